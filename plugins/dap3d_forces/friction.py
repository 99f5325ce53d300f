"""Coulomb friction in a joint."""

from dap3d_core.interface import Force, choice, hookimpl, joint, number

interface_version = 1


class Friction(Force):
    """Friction mu |N| S(v / v_tol), S = tanh, in a joint whose type says how it rubs (spec 6.1).

    N is the load that the joint's multipliers lambda carry and v the sliding velocity; the
    equations stand with the joint types: ``sph``, ``rev``, ``cyl``, ``tran``, ``disk`` (but for
    slip ``xyz``). lambda depends on friction and friction on lambda, which are made to agree by
    iteration. There is no sticking: below v_tol friction fades, and a body that should stick creeps
    at a part of v_tol.

    Redundant joints can share their load in many ways, each with another friction and motion: a run
    is refused, but with shared = "least", which goes on with the least lambda (method lsq) and
    notes how much the work of friction depends on it.
    """

    keyword = "friction"
    joint: str = joint(doc="the joint that rubs")
    mu: float = number(default=0.5, minimum=0.0, usual=(None, 10.0), doc="coefficient of friction")
    v_tol: float = number(
        default=1e-3, unit="m/s", positive=True, doc="sliding velocity below which friction fades"
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
