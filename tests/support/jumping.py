"""Force types whose elements let velocities jump."""

from dap3d_core.interface import Body, Force, Joint, Point, Vector, body, number, point, vector
from dap3d_core.kernels import cross, dot, neg, scale, sub, where
from support.own_types import registry_of

ZERO = (0.0, 0.0, 0.0)


class Bounce(Force):
    """A point that bounces on the plane z = 0; nothing carries it there."""

    keyword = "test-bounce"
    unilateral = (0,)
    restitution = "e"
    P_i: Point = point()
    e: float = number(minimum=0.0, maximum=1.0)

    def switch(r_P_i):
        return r_P_i[2]

    def impulse(Jv, e):
        return where(Jv < 0.0, -(1.0 + e) * Jv, 0.0)


class Clutch(Force):
    """From t_on on the two bodies turn together about an axis, by a damper from then on."""

    keyword = "test-clutch"
    a_j: Vector = vector()
    body_i: Body = body()
    t_on: float = number()
    c: float = number(default=0.0)

    def switch(t, t_on):
        return t - t_on

    def J(a_j):
        return ((*ZERO, *neg(a_j)),), ((*ZERO, *a_j),)

    def impulse(Jv, crossing):
        return where(crossing > 0.0, -Jv, 0.0)

    def wrench(t, t_on, a_j, w_i, w_j, c):
        M = scale(where(t < t_on, 0.0, -c * dot(a_j, sub(w_j, w_i))), a_j)
        return (ZERO, neg(M)), (ZERO, M)


class Stage(Force):
    """At t_fire an impulse acts at a point along a vector of the body."""

    keyword = "test-stage"
    P_i: Point = point()
    d_i: Vector = vector()
    t_fire: float = number()
    impulse_size: float = number()

    def switch(t, t_fire):
        return t - t_fire

    def impulse(s_P_i, d_i, impulse_size):
        P = scale(impulse_size, d_i)
        return ((P, cross(s_P_i, P)),)


class Counter(Force):
    """Counts how often a point passes z = 0 downwards; z_sum gathers its speeds then."""

    keyword = "test-counter"
    states = ("count", "z_sum")
    P_i: Point = point()

    def switch(r_P_i):
        return r_P_i[2]

    def rate():
        return 0.0, 0.0

    def reset(count, z_sum, v_P_i, crossing):
        down = crossing < 0.0
        return where(down, count + 1.0, count), where(down, z_sum + v_P_i[2], z_sum)

    def wrench():
        return ((ZERO, ZERO),)


class SpeedDrive(Joint):
    """Drives the angular velocity of a body about a_j to the state w, which becomes w_1 at t_1."""

    keyword, rows, holonomic, drives = "test-speed-drive", 1, False, True
    states = ("w",)
    body_i: Body = body()
    a_j: Vector = vector(ground=True)
    t_1: float = number()
    w_1: float = number()

    def J(a_j):
        return ((*ZERO, *a_j),)

    def nu(w):
        return w

    def gamma():
        return 0.0

    def rate():
        return 0.0

    def switch(t, t_1):
        return t - t_1

    def reset(w_1):
        return w_1


JUMPING = registry_of(Bounce, Clutch, Stage, Counter, SpeedDrive)
