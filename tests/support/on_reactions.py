"""Forces on the reactions of joints: a brake, a tyre, the friction of a pin, a slider."""

from dap3d_core.interface import Body, Force, Point, Vector, body, joint, number, point, vector
from dap3d_core.kernels import add, cross, dot, neg, scale, sqrt, sub, tanh, where

ZERO = (0.0, 0.0, 0.0)


class Brake(Force):
    """A shoe, pressed by a joint, brakes body i against body j about a_i."""

    keyword = "brake"
    a_i: Vector = vector(doc="axis")
    a_j: Vector = vector(doc="axis")
    shoe: str = joint(doc="the joint that presses")
    mu: float = number(default=0.3, minimum=0.0)
    radius: float = number(default=0.1, unit="m", positive=True)
    w_tol: float = number(default=1e-3, unit="rad/s", positive=True)

    def wrench(a_i, w_i, w_j, force_shoe, mu, radius, w_tol):
        load = sqrt(dot(force_shoe, force_shoe))
        sliding = tanh(dot(a_i, sub(w_i, w_j)) / w_tol)
        moment = scale(-mu * radius * load * sliding, a_i)
        return (ZERO, moment), (ZERO, neg(moment))


class Tyre(Force):
    """Drive of a wheel by slip under the load of its row of contact with the ground z = 0."""

    keyword = "loaded-tyre"
    P_i: Point = point(doc="centre of the wheel, on body i")
    contact: str = joint(rows=1, doc="keeps the wheel on the ground")
    radius: float = number(default=0.3, unit="m", positive=True)
    stiffness: float = number(default=0.05, unit="s/m", doc="force per load and sliding velocity")

    def wrench(v_P_i, s_P_i, w_i, lam_contact, radius, stiffness):
        arm = (0.0, 0.0, -radius)
        sliding = add(v_P_i, cross(w_i, arm))
        force = scale(-stiffness * lam_contact[0], (sliding[0], sliding[1], 0.0))
        return ((force, cross(add(s_P_i, arm), force)),)


class PinFriction(Force):
    """The friction of a revolute joint, as the joint type has it."""

    keyword = "pin-friction"
    body_i: Body = body()
    a_j: Vector = vector()
    pin: str = joint(rows=5)
    mu: float = number(default=0.3)
    radius: float = number(default=0.02, unit="m")
    v_tol: float = number(default=1e-3, unit="m/s")

    def wrench(a_j, w_i, w_j, lam_pin, mu, radius, v_tol):
        load = sqrt(lam_pin[0] ** 2 + lam_pin[1] ** 2 + lam_pin[2] ** 2)
        moment = scale(-radius * mu * load * tanh(radius * dot(a_j, sub(w_i, w_j)) / v_tol), a_j)
        return (ZERO, moment), (ZERO, neg(moment))


class Servo(Force):
    """Friction on a plane that presses its body onto the plane by a part k of the load."""

    keyword = "pressed-servo"
    body_i: Body = body()
    a_j: Vector = vector(ground=True)
    n_j: Vector = vector(ground=True)
    plane: str = joint(rows=1)
    mu: float = number(default=0.3)
    k: float = number(default=0.3)

    def wrench(a_j, n_j, v_i, lam_plane, mu, k):
        load = abs(lam_plane[0])
        sliding = tanh(dot(a_j, v_i) / 1e-3)
        return ((add(scale(-mu * load * sliding, a_j), scale(-k * load, n_j)), ZERO),)


class SeizingServo(Servo):
    """The servo, whose gain below a speed of 4.9 m/s is so large that it jams."""

    keyword = "seizing-servo"

    def wrench(a_j, n_j, v_i, lam_plane, mu, k):
        load, sliding = abs(lam_plane[0]), dot(a_j, v_i)
        gain = where(sliding < 4.9, 1.5, k)
        return ((add(scale(-mu * load, a_j), scale(-gain * load, n_j)), ZERO),)


ON_REACTIONS = (Brake, Tyre, PinFriction, Servo)


class WornBrake(Brake):
    """The brake with a state: the work of friction that its shoe has taken, J."""

    keyword, states = "worn-brake", ("worn",)

    def rate(a_i, w_i, w_j, force_shoe, mu, radius, w_tol):
        speed = dot(a_i, sub(w_i, w_j))
        load = sqrt(dot(force_shoe, force_shoe))
        return mu * radius * load * speed * tanh(speed / w_tol)
