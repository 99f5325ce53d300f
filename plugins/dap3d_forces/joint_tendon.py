"""Tendon whose length is a sum of coordinates of joints."""

from typing import ClassVar

from dap3d_core.interface import bodies, hookimpl, number, numbers, vectors
from dap3d_core.kernels import by_body, cross, dot, scale, sub
from dap3d_forces.actuator import kept
from dap3d_forces.bounds import within
from dap3d_forces.tendon_law import TendonLaw, activated, contracted, numbers_of, passive, stored

interface_version = 1

ZERO = (0.0, 0.0, 0.0)


class JointTendon(TendonLaw):
    """Spring and damper, an actuator or a muscle, on a sum of coordinates of joints.

    Each of the ``movers`` turns against its body of ``holders`` about its vector of ``axes``, which
    lies there, or, with a 1 in ``slides``, slides along it. With their coordinates q_k and
    ``coefs`` c_k the length is x = x_0 + sum c_k q_k, a state that counts turns; x_0 is that in the
    poses of the scene, and also ``length`` where that is left out. The laws of the tension T are
    those of the force ``tendon``, with x for L. It acts on the coordinates alone, with -T c_k.
    """

    keyword = "joint_tendon"
    synonyms = ("fixed_tendon", "coupling")
    states: ClassVar = ("x",)
    example: ClassVar[dict[str, str]] = {"k": "1e3"}
    samples: ClassVar = (
        {"movers": (0, 1), "holders": (1, 2), "axes": (1, 2), "slides": (0.0, 1.0)},
    )
    movers: tuple = bodies("n", doc="bodies that move, one of each joint")
    holders: tuple = bodies("n", doc="bodies that they move against")
    axes: tuple = vectors("n", doc="axes of the joints, on the holders")
    coefs: tuple = numbers("n", 1.0, doc="m/rad, or 1 of sliders, by which the length grows")
    slides: tuple = numbers("n", 0.0, constant=True, doc="1 for a mover that slides along the axis")
    x_0: float = number(0.0, unit="m", doc="initial length")

    def prepare(self, bodies):
        if any(one is not other for one, other in zip(bodies["axes"], bodies["holders"],
                                                      strict=True)):  # fmt: skip
            raise ValueError("axes should lie on their holders")
        return numbers_of(self, self.x_0)

    def rate(r_movers, v_movers, w_movers, r_holders, v_holders, w_holders, axes, coefs, slides):
        i, j = (r_movers, v_movers, w_movers), (r_holders, v_holders, w_holders)
        return rate_of(i, j, axes, coefs, slides)

    def wrench(r_movers, v_movers, w_movers, on_movers, r_holders, v_holders, w_holders, on_holders,
               body_count, axes, coefs, slides, x, spring):  # fmt: skip
        i, j = (r_movers, v_movers, w_movers), (r_holders, v_holders, w_holders)
        T = passive(x, rate_of(i, j, axes, coefs, slides), spring)
        return acting(T, i, j, axes, coefs, slides, on_movers + on_holders, body_count)

    def tension(r_movers, v_movers, w_movers, r_holders, v_holders, w_holders, axes, coefs, slides,
                x, spring):  # fmt: skip
        i, j = (r_movers, v_movers, w_movers), (r_holders, v_holders, w_holders)
        return passive(x, rate_of(i, j, axes, coefs, slides), spring)

    def energy(x, spring):
        return stored(x, spring)

    def switch(x, spring):
        return x - spring[0], x - spring[1]


class Driven(JointTendon, activation="none", control=True):
    """A control acts at once."""

    energy = None

    def wrench(r_movers, v_movers, w_movers, on_movers, r_holders, v_holders, w_holders, on_holders,
               body_count, axes, coefs, slides, x, spring, control, control_min, control_max, gain,
               bias, tension_min, tension_max):  # fmt: skip
        i, j = (r_movers, v_movers, w_movers), (r_holders, v_holders, w_holders)
        T = passive(x, rate_of(i, j, axes, coefs, slides), spring)
        T = T + bias + gain * within(control, control_min, control_max)
        T = within(T, tension_min, tension_max)
        return acting(T, i, j, axes, coefs, slides, on_movers + on_holders, body_count)

    tension = None


class Lagging(JointTendon, activation="lag"):
    """A control acts with a lag."""

    energy = tension = None
    states = ("x", "z")

    def rate(r_movers, v_movers, w_movers, r_holders, v_holders, w_holders, axes, coefs, slides,
             control, control_min, control_max, activation_min, activation_max,
             time, z):  # fmt: skip
        i, j = (r_movers, v_movers, w_movers), (r_holders, v_holders, w_holders)
        z_dot = kept((within(control, control_min, control_max) - z) / time, z, activation_min,
                     activation_max)  # fmt: skip
        return rate_of(i, j, axes, coefs, slides), z_dot

    def wrench(r_movers, v_movers, w_movers, on_movers, r_holders, v_holders, w_holders, on_holders,
               body_count, axes, coefs, slides, x, z, spring, gain, bias, tension_min,
               tension_max):  # fmt: skip
        i, j = (r_movers, v_movers, w_movers), (r_holders, v_holders, w_holders)
        T = passive(x, rate_of(i, j, axes, coefs, slides), spring) + bias + gain * z
        T = within(T, tension_min, tension_max)
        return acting(T, i, j, axes, coefs, slides, on_movers + on_holders, body_count)


class Summing(Lagging, activation="integral"):
    """The integral of a control acts."""

    def rate(r_movers, v_movers, w_movers, r_holders, v_holders, w_holders, axes, coefs, slides,
             control, control_min, control_max, activation_min, activation_max,
             time, z):  # fmt: skip
        i, j = (r_movers, v_movers, w_movers), (r_holders, v_holders, w_holders)
        z_dot = kept(within(control, control_min, control_max) / time, z, activation_min,
                     activation_max)  # fmt: skip
        return rate_of(i, j, axes, coefs, slides), z_dot


class Muscle(Lagging, activation="muscle"):
    """A control activates a muscle."""

    def rate(r_movers, v_movers, w_movers, r_holders, v_holders, w_holders, axes, coefs, slides,
             control, control_min, control_max, activation_min, activation_max,
             muscle, z):  # fmt: skip
        i, j = (r_movers, v_movers, w_movers), (r_holders, v_holders, w_holders)
        z_dot = kept(activated(within(control, control_min, control_max), z, muscle), z,
                     activation_min, activation_max)  # fmt: skip
        return rate_of(i, j, axes, coefs, slides), z_dot

    def wrench(r_movers, v_movers, w_movers, on_movers, r_holders, v_holders, w_holders, on_holders,
               body_count, axes, coefs, slides, x, z, spring, muscle, tension_min,
               tension_max):  # fmt: skip
        i, j = (r_movers, v_movers, w_movers), (r_holders, v_holders, w_holders)
        x_dot = rate_of(i, j, axes, coefs, slides)
        T = within(passive(x, x_dot, spring) + contracted(x, x_dot, z, muscle), tension_min,
                   tension_max)  # fmt: skip
        return acting(T, i, j, axes, coefs, slides, on_movers + on_holders, body_count)


def rate_of(i, j, axes, coefs, slides):
    """The rate of the length, m/s; i, j: positions, velocities, angular velocities of both ends."""
    total = 0.0
    for r_i, v_i, w_i, r_j, v_j, w_j, a, c, slide in zip(*i, *j, axes, coefs, slides, strict=True):
        along = sub(sub(v_i, v_j), cross(w_j, sub(r_i, r_j))) if slide else sub(w_i, w_j)
        total = total + c * dot(a, along)
    return total


def acting(T, i, j, axes, coefs, slides, on, body_count):
    """The wrench of a tension on each body; a slider is pulled at its own mass centre."""
    ours, theirs = [], []
    for r_i, r_j, a, c, slide in zip(i[0], j[0], axes, coefs, slides, strict=True):
        F = scale(-T * c, a)
        G = scale(-1.0, F)
        ours.append((F, ZERO) if slide else (ZERO, F))
        theirs.append((G, cross(sub(r_i, r_j), G)) if slide else (ZERO, G))
    return by_body(on, ours + theirs, body_count)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [JointTendon]
