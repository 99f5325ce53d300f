"""Mechanisms with one freedom by closed forms of their poses, differentiated in high precision.
A mechanism is a function of the crank's angle that returns for each body the place of its mass
centre (3) and its axes (3 x 3, columns) in mpmath's numbers. With T = I(q) q_dot^2 / 2 and the
potential V(q), Lagrange's equation gives the driving moment I q_ddot + I' q_dot^2 / 2 + V'."""

import mpmath as mp
import numpy as np

import dap3d_core as dap

mp.mp.dps = 40
GRAVITY = mp.mpf("9.81")


def vector(*numbers):
    return mp.matrix([mp.mpf(x) for x in numbers])


def dot(a, b):
    return sum(x * y for x, y in zip(a, b, strict=True))


def cross(a, b):
    return mp.matrix([a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2],
                      a[0] * b[1] - a[1] * b[0]])  # fmt: skip


def unit(a):
    return a / mp.sqrt(dot(a, a))


def columns(*vectors):
    return mp.matrix([[v[k] for v in vectors] for k in range(3)])


def turned(axis, angle):
    """The rotation matrix about a unit vector (Rodrigues)."""
    K = mp.matrix([[0, -axis[2], axis[1]], [axis[2], 0, -axis[0]], [-axis[1], axis[0], 0]])
    return mp.eye(3) + mp.sin(angle) * K + (1 - mp.cos(angle)) * K * K


def derivative(function, q, order):
    """Derivatives of matrices of mpmath, by central differences of the eighth order."""
    h = mp.mpf(10) ** -4
    weights = {
        1: {1: mp.mpf(4) / 5, 2: -mp.mpf(1) / 5, 3: mp.mpf(4) / 105, 4: -mp.mpf(1) / 280},
        2: {0: -mp.mpf(205) / 72, 1: mp.mpf(8) / 5, 2: -mp.mpf(1) / 5, 3: mp.mpf(8) / 315,
            4: -mp.mpf(1) / 560},
    }[order]  # fmt: skip
    sign = -1 if order == 1 else 1
    total = weights.get(0, 0) * function(q)
    for k, weight in weights.items():
        if k:
            total += weight * (function(q + k * h) + sign * function(q - k * h))
    return total / h**order


class OneFreedom:
    """Motion and driving moment of a mechanism at an angle q, with rate and second rate."""

    def __init__(self, poses, masses, inertias):
        self.poses, self.masses = poses, masses
        self.inertias = [mp.diag([mp.mpf(x) for x in J]) for J in inertias]

    def motion(self, body, q, rate, rise):
        """r, R, v, w, a, alpha of a body, as arrays."""
        place = lambda x: self.poses(x)[body][0]  # noqa: E731
        axes = lambda x: self.poses(x)[body][1]  # noqa: E731
        r, R = place(q), axes(q)
        r1, r2 = derivative(place, q, 1), derivative(place, q, 2)
        R1, R2 = derivative(axes, q, 1), derivative(axes, q, 2)
        w1, W = self._spin(R, R1), R1 * R.T
        w2 = self._spin(R, R2, W * W)
        return [np.array(x.tolist(), dtype=float).squeeze() for x in
                (r, R, rate * r1, rate * w1, rise * r1 + rate**2 * r2,
                 rise * w1 + rate**2 * w2)]  # fmt: skip

    @staticmethod
    def _spin(R, change, square=None):
        """The vector of the skew part of change R^T - square."""
        K = change * R.T - (square if square is not None else mp.zeros(3))
        return mp.matrix([K[2, 1] - K[1, 2], K[0, 2] - K[2, 0], K[1, 0] - K[0, 1]]) / 2

    def inertia(self, q):
        """I(q) = 2 T for a rate of one."""
        total = mp.mpf(0)
        for k, (m, J) in enumerate(zip(self.masses, self.inertias, strict=True)):
            r1 = derivative(lambda x, k=k: self.poses(x)[k][0], q, 1)
            R = self.poses(q)[k][1]
            w = R.T * self._spin(R, derivative(lambda x, k=k: self.poses(x)[k][1], q, 1))
            total += m * dot(r1, r1) + dot(w, J * w)
        return total

    def potential(self, q):
        """Of weights along -z."""
        poses = self.poses(q)
        return GRAVITY * sum(m * r[2] for m, (r, _) in zip(self.masses, poses, strict=True))

    def moment(self, q, rate, rise):
        """What drives the angle, N m."""
        I1, V1 = derivative(self.inertia, q, 1), derivative(self.potential, q, 1)
        return float(rise * self.inertia(q) + rate**2 * I1 / 2 + V1)


def quaternion(R):
    """Euler parameters of a rotation matrix with a positive trace + 1."""
    R = np.array(R.tolist(), dtype=float) if isinstance(R, mp.matrix) else R
    e0 = np.sqrt(max(1.0 + np.trace(R), 1e-30)) / 2.0
    e = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]]) / (4.0 * e0)
    return np.array([e0, *e])


def add_bodies(scene, names, mechanism, q):
    """Bodies of a mechanism, as placed at an angle."""
    poses = zip(names, mechanism.poses(mp.mpf(q)), strict=True)
    for k, (name, (r, R)) in enumerate(poses):
        J = [float(mechanism.inertias[k][c, c]) for c in range(3)]
        scene.add_body(name, mass=float(mechanism.masses[k]), Jp=J,
                       r=[float(x) for x in r], p=quaternion(R))  # fmt: skip


def y_axes(x):
    """Axes of a body in the plane of x and z whose first is a unit vector there."""
    y = vector(0, 1, 0)
    return columns(x, y, cross(x, y))


# ---------------------------------------------------------------------------- slider-crank

SLIDER = ("crank", "rod", "slider")


def slider_crank(a=0.1, b=0.35, offset=0.02):
    """In the plane of x and z: the crank at the angle q above x, the slider at a height."""
    a, b, offset = mp.mpf(str(a)), mp.mpf(str(b)), mp.mpf(str(offset))

    def poses(q):
        crank = vector(mp.cos(q), 0, mp.sin(q))
        rise = (offset - a * mp.sin(q)) / b
        rod = vector(mp.sqrt(1 - rise**2), 0, rise)
        pin = a * crank
        return [(pin / 2, y_axes(crank)), (pin + b / 2 * rod, y_axes(rod)),
                (pin + b * rod, mp.eye(3))]  # fmt: skip

    masses = [mp.mpf(x) for x in ("0.8", "1.3", "0.6")]
    inertias = [("0.001", "0.002", "0.0025"), ("0.002", "0.013", "0.014"), ("0.01", "0.01", "0.02")]
    return OneFreedom(poses, masses, inertias)


def driven(scene, coefficients):
    """A scene whose crank turns by a polynomial of time, under its weight."""
    scene.add_function("a", "turning", coeff=coefficients)
    scene.add_vector("back", body="ground", sp=[0.0, -1.0, 0.0])  # q grows about it
    scene.add_joint("drive-rot", "motor", body_i="crank", a_j="back", function="turning")
    scene.add_force("weight", "gravity")
    return scene


def slider_crank_scene(q, coefficients, a=0.1, b=0.35, offset=0.02):
    """The same as a scene, its crank driven by f = c1 + c2 t + c3 t^2 more than q."""
    scene = dap.Scene(name="slider-crank")
    add_bodies(scene, SLIDER, slider_crank(a, b, offset), q)
    for name, body, x in (("A", "crank", -a / 2), ("B", "crank", a / 2), ("B_rod", "rod", -b / 2),
                          ("C_rod", "rod", b / 2)):  # fmt: skip
        scene.add_point(name, body=body, sPp=[x, 0.0, 0.0])
    scene.add_point("guide", body="ground", sPp=[0.0, 0.0, offset])
    scene.add_joint("rev", "bearing", P_i="A", P_j="ground.O", a_i="crank.y", a_j="ground.y")
    scene.add_joint("cyl", "crank_pin", P_i="B_rod", P_j="B", a_i="rod.y", a_j="crank.y")
    scene.add_joint("sph", "wrist", P_i="C_rod", P_j="slider.O")
    scene.add_joint("tran", "way", P_i="slider.O", P_j="guide", a_j="ground.x")
    return driven(scene, coefficients)


# ---------------------------------------------------------------------------- double wishbone

WISHBONE = ("lower", "upper", "upright")
#: Hard points, m: inner middles and axes of the arms, ball joints of the upright at q = 0, tie rod.
LOWER, UPPER = ("0.0", "0.35", "0.2"), ("0.02", "0.42", "0.5")
LOWER_AXIS, UPPER_AXIS = ("1.0", "0.05", "0.02"), ("1.0", "-0.04", "0.06")
LOWER_BALL, UPPER_BALL = ("0.0", "0.75", "0.18"), ("-0.02", "0.7", "0.52")
RACK, TIE_BALL = ("-0.12", "0.38", "0.27"), ("-0.14", "0.72", "0.25")


def double_wishbone():
    """Lower arm turned by q; the upper arm and the upright follow, by circles and spheres."""
    inner = [vector(*x) for x in (LOWER, UPPER)]
    outer = [vector(*x) for x in (LOWER_BALL, UPPER_BALL)]
    axes = [unit(vector(*x)) for x in (LOWER_AXIS, UPPER_AXIS)]
    rack, tie = vector(*RACK), vector(*TIE_BALL)
    arms = [o - i for o, i in zip(outer, inner, strict=True)]

    def length(x):
        return mp.sqrt(dot(x, x))

    def frame(low, high, side):
        z = unit(high - low)
        x = side - low - dot(side - low, z) * z
        x = unit(x)
        return columns(x, cross(z, x), z)

    start = frame(*outer, tie)
    kingpin, tie_length = length(outer[1] - outer[0]), length(tie - rack)
    spokes = [length(tie - ball) for ball in outer]
    middle = start.T * ((outer[0] + outer[1]) / 2 + vector("0.01", "0.06", "0") - outer[0])

    def upper_angle(low):
        """The turn of the upper arm at which its ball is a kingpin's length from the lower one."""
        n, arm = axes[1], arms[1]
        along = dot(arm, n) * n
        flat = arm - along
        side = cross(n, flat)
        gap = inner[1] + along - low
        A, B = 2 * dot(gap, flat), 2 * dot(gap, side)
        C = kingpin**2 - dot(gap, gap) - dot(flat, flat)
        one, two = (mp.atan2(B, A) + s * mp.acos(C / mp.sqrt(A * A + B * B)) for s in (1, -1))
        return min((mp.atan2(mp.sin(x), mp.cos(x)) for x in (one, two)), key=abs)

    def tie_ball(low, high):
        """Where three spheres meet, on the side where the tie rod is."""
        ex = unit(high - low)
        i = dot(ex, rack - low)
        ey = unit(rack - low - i * ex)
        ez, j = cross(ex, ey), dot(ey, rack - low)
        x = (spokes[0] ** 2 - spokes[1] ** 2 + kingpin**2) / (2 * kingpin)
        y = (spokes[0] ** 2 - tie_length**2 + i**2 + j**2 - 2 * i * x) / (2 * j)
        z = mp.sqrt(spokes[0] ** 2 - x**2 - y**2)
        points = [low + x * ex + y * ey + s * z * ez for s in (1, -1)]
        return max(points, key=lambda P: P[1])

    def poses(q):
        R_low = turned(axes[0], q)
        low = inner[0] + R_low * arms[0]
        R_high = turned(axes[1], upper_angle(low))
        high = inner[1] + R_high * arms[1]
        R = frame(low, high, tie_ball(low, high))
        return [(inner[0] + R_low * arms[0] / 2, R_low), (inner[1] + R_high * arms[1] / 2, R_high),
                (low + R * middle, R * start.T)]  # fmt: skip

    masses = [mp.mpf(x) for x in ("3.1", "2.2", "25")]
    inertias = [("0.05", "0.06", "0.08"), ("0.03", "0.03", "0.05"), ("0.6", "1.1", "0.7")]
    return OneFreedom(poses, masses, inertias)


def double_wishbone_scene(coefficients):
    """The same as a scene at q = 0, where all axes are those of the ground."""
    mechanism = double_wishbone()
    scene = dap.Scene(name="double wishbone")
    add_bodies(scene, WISHBONE, mechanism, 0.0)
    hard = {name: np.array(values, dtype=float) for name, values in (
        ("lower_in", LOWER), ("upper_in", UPPER), ("lower_out", LOWER_BALL),
        ("upper_out", UPPER_BALL), ("rack", RACK), ("tie", TIE_BALL))}  # fmt: skip
    on = {"lower": ("lower_in", "lower_out"), "upper": ("upper_in", "upper_out"),
          "upright": ("lower_out", "upper_out", "tie"),
          "ground": ("lower_in", "upper_in", "rack")}  # fmt: skip
    for body, names in on.items():
        centre = np.array(scene.bodies[body].r) if body != "ground" else np.zeros(3)
        for name in names:
            scene.add_point(f"{body}_{name}", body=body, sPp=hard[name] - centre)
    for arm, axis in (("lower", LOWER_AXIS), ("upper", UPPER_AXIS)):
        n = np.array(axis, dtype=float)
        for body in (arm, "ground"):
            scene.add_vector(f"{arm}_axis_{body}", body=body, sp=n / np.linalg.norm(n))
        scene.add_joint("rev", f"{arm}_hinge", P_i=f"{arm}_{arm}_in", P_j=f"ground_{arm}_in",
                        a_i=f"{arm}_axis_{arm}", a_j=f"{arm}_axis_ground")  # fmt: skip
        scene.add_joint("sph", f"{arm}_ball", P_i=f"{arm}_{arm}_out", P_j=f"upright_{arm}_out")
    length = float(np.linalg.norm(hard["tie"] - hard["rack"]))
    scene.add_joint("sph-sph", "tie_rod", P_i="upright_tie", P_j="ground_rack", length=length)
    scene.add_function("a", "lift", coeff=coefficients)
    scene.add_joint("drive-rot", "jack", body_i="lower", a_j="lower_axis_ground", function="lift")
    scene.add_force("weight", "gravity")
    return scene
