"""Coulomb friction in a joint."""

from dap3d_core.interface import Force, choice, hookimpl, joint, number

interface_version = 1


class Friction(Force):
    """Coulomb friction in a joint whose type says how it rubs.

    Where it slides it is mu |N|, against the sliding velocity v; at rest it sticks, exactly, by up
    to mu_s |N|, as contacts do (docs/concepts/contact.md). N is the load that the joint's
    multipliers lambda carry; the equations stand with the joint types: ``sph``, ``rev``, ``cyl``,
    ``tran``, ``disk`` (but for slip ``xyz``). lambda depends on friction and friction on lambda:
    both are solved for together.

    With v_tol it is regularised, mu |N| S(v / v_tol), S = tanh, for runs that take no contacts:
    below v_tol friction fades, and a body that should stick creeps at a part of v_tol.

    Redundant joints can share their load in many ways, each with another friction and motion: a run
    is refused, but with shared = "least", which goes on with the least lambda (method lsq) and
    notes how much the work of friction depends on it.
    """

    keyword = "friction"
    joint: str = joint(doc="the joint that rubs")
    mu: float = number(default=0.5, minimum=0.0, usual=(None, 10.0), doc="coefficient of friction")
    mu_s: float = number(None, minimum=0.0, doc="the same where it sticks; mu by default")
    v_tol: float = number(
        None, unit="m/s", positive=True, doc="velocity below which it fades; sticks without it"
    )
    radius: float = number(
        default=None,
        unit="m",
        positive=True,
        doc="of the ball, pin or rod that turns; required for sph, rev, cyl",
    )
    shared: str = choice(
        ("refuse", "least"),
        default="refuse",
        doc="where the joint's load is not unique: whether to take the least, with a note",
    )


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Friction]
