"""Cable over spheres and cylinders, with pulleys; a tendon with an actuator or a muscle."""

from typing import ClassVar

from dap3d_core.interface import hookimpl
from dap3d_core.kernels import by_body, cable_length, cable_rate, cable_spans, cross, scale
from dap3d_forces.actuator import kept
from dap3d_forces.bounds import within
from dap3d_forces.tendon_law import TendonLaw, activated, contracted, numbers_of, passive, stored
from dap3d_joints.tendon import Route, pulls_of

interface_version = 1


class Tendon(Route, TendonLaw):
    """Spring and damper, or an actuator, along a massless cable that wraps over drums.

    The cable runs from point to point, and without friction over the ``drums`` between them: the
    shortest way, straight where it does not touch. Drum k, of the radius ``radii`` about a point of
    any body, lies after point ``after``, counted from 1. Drums are spheres, but the first are
    cylinders about ``axes``, without ends. ``ways`` says how it passes each: 0, on the shorter
    way; 1, not opposite to its point of ``sides``; 2, through the drum, as through a ring.

    ``divisors``, one for each point, are those of the span that begins there: a part of the cable
    behind a pulley whose length counts divided by it, as a tackle's does; 0 where the cable ends
    and goes on at the next point, as one of several branches. With the lengths l_k of the spans,
    L = sum l_k / divisor_k, and x = max(0, L - length) - max(0, length - play - L):

        T = k x + c L_dot,  energy = k x^2 / 2
        with a control: T = k x + c L_dot + bias + gain u, kept within tension_min and tension_max
        with a muscle:  T = k x + c L_dot + peak (f_l(l) f_v(v) z + f_p(l)), in the same bounds

    and a force T / divisor along both ends of each span. ``length`` is that of the start if left
    out. With ``slack`` spring and damper do not push. u acts at once, or by a state z within its
    bounds: lag, z_dot = (u - z) / time; integral, z_dot = u / time; muscle, faster up than down.
    Of a muscle l = (L - sinew) / optimum and v = l_dot / v_max; its curves are those of MuJoCo: f_l
    is 1 at l = 1 and 0 beyond l_min and l_max, f_v falls to 0 at v = -1, f_p rises from l = 1.

    T is continuous where the cable comes to touch a drum, and its slope is not: a ``switch``.
    """

    keyword = "tendon"
    synonyms = ("muscle", "wrap", "drum", "capstan", "tackle")
    example: ClassVar[dict[str, str]] = {"k": "1e3"}

    def prepare(self, bodies):
        return numbers_of(self, self.length_at_start(bodies))

    def wrench(r_points, s_points, v_points, on_points, body_count, r_drums, s_drums, v_drums,
               w_drums, on_drums, axes, r_sides, radii, after, ways, divisors, spring):  # fmt: skip
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        T = passive(cable_length(path), cable_rate(path, v_points, v_drums, w_drums), spring)
        return acting(T, path, s_points, on_points, s_drums, on_drums, body_count)

    def tension(r_points, v_points, r_drums, v_drums, w_drums, axes, r_sides, radii, after, ways,
                divisors, spring):  # fmt: skip
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        return passive(cable_length(path), cable_rate(path, v_points, v_drums, w_drums), spring)

    def energy(r_points, r_drums, axes, r_sides, radii, after, ways, divisors, spring):
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        return stored(cable_length(path), spring)

    def switch(r_points, r_drums, axes, r_sides, radii, after, ways, divisors, spring):
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        changes = [x for _, _, drum, way in path if drum is not None for x in way[5:]]
        return cable_length(path) - spring[0], *(x for x in changes if x is not None)


class Driven(Tendon, activation="none", control=True):
    """A control acts at once."""

    energy = None

    def wrench(r_points, s_points, v_points, on_points, body_count, r_drums, s_drums, v_drums,
               w_drums, on_drums, axes, r_sides, radii, after, ways, divisors, spring, control,
               control_min, control_max, gain, bias, tension_min, tension_max):  # fmt: skip
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        T = passive(cable_length(path), cable_rate(path, v_points, v_drums, w_drums), spring)
        T = T + bias + gain * within(control, control_min, control_max)
        T = within(T, tension_min, tension_max)
        return acting(T, path, s_points, on_points, s_drums, on_drums, body_count)

    def tension(r_points, v_points, r_drums, v_drums, w_drums, axes, r_sides, radii, after, ways,
                divisors, spring, control, control_min, control_max, gain, bias, tension_min,
                tension_max):  # fmt: skip
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        T = passive(cable_length(path), cable_rate(path, v_points, v_drums, w_drums), spring)
        T = T + bias + gain * within(control, control_min, control_max)
        return within(T, tension_min, tension_max)


class Lagging(Tendon, activation="lag"):
    """A control acts with a lag."""

    energy = None
    states = ("z",)

    def rate(control, control_min, control_max, activation_min, activation_max, time, z):
        z_dot = (within(control, control_min, control_max) - z) / time
        return kept(z_dot, z, activation_min, activation_max)

    def wrench(r_points, s_points, v_points, on_points, body_count, r_drums, s_drums, v_drums,
               w_drums, on_drums, axes, r_sides, radii, after, ways, divisors, spring, z, gain,
               bias, tension_min, tension_max):  # fmt: skip
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        T = passive(cable_length(path), cable_rate(path, v_points, v_drums, w_drums), spring)
        T = within(T + bias + gain * z, tension_min, tension_max)
        return acting(T, path, s_points, on_points, s_drums, on_drums, body_count)

    def tension(r_points, v_points, r_drums, v_drums, w_drums, axes, r_sides, radii, after, ways,
                divisors, spring, z, gain, bias, tension_min, tension_max):  # fmt: skip
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        T = passive(cable_length(path), cable_rate(path, v_points, v_drums, w_drums), spring)
        return within(T + bias + gain * z, tension_min, tension_max)


class Summing(Lagging, activation="integral"):
    """The integral of a control acts."""

    def rate(control, control_min, control_max, activation_min, activation_max, time, z):
        z_dot = within(control, control_min, control_max) / time
        return kept(z_dot, z, activation_min, activation_max)


class Muscle(Lagging, activation="muscle"):
    """A control activates a muscle."""

    def rate(control, control_min, control_max, activation_min, activation_max, muscle, z):
        z_dot = activated(within(control, control_min, control_max), z, muscle)
        return kept(z_dot, z, activation_min, activation_max)

    def wrench(r_points, s_points, v_points, on_points, body_count, r_drums, s_drums, v_drums,
               w_drums, on_drums, axes, r_sides, radii, after, ways, divisors, spring, z, muscle,
               tension_min, tension_max):  # fmt: skip
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        L, L_dot = cable_length(path), cable_rate(path, v_points, v_drums, w_drums)
        T = passive(L, L_dot, spring) + contracted(L, L_dot, z, muscle)
        T = within(T, tension_min, tension_max)
        return acting(T, path, s_points, on_points, s_drums, on_drums, body_count)

    def tension(r_points, v_points, r_drums, v_drums, w_drums, axes, r_sides, radii, after, ways,
                divisors, spring, z, muscle, tension_min, tension_max):  # fmt: skip
        path = cable_spans(r_points, r_drums, radii, axes, r_sides, after, ways, divisors)
        L, L_dot = cable_length(path), cable_rate(path, v_points, v_drums, w_drums)
        T = passive(L, L_dot, spring) + contracted(L, L_dot, z, muscle)
        return within(T, tension_min, tension_max)


def acting(T, path, s, on_points, s_drums, on_drums, body_count):
    """The wrench of a tension on each body."""
    parts = pulls_of(path, on_points, s, on_drums, s_drums)
    forces = [(on, s, scale(T, F)) for on, s, F in parts]
    return by_body(
        [on for on, _, _ in forces], [(F, cross(s, F)) for _, s, F in forces], body_count
    )


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Tendon]
