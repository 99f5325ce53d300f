"""The scenes that all programs simulate, described once: bodies, joints, a final time.

Right-handed axes, z up, gravity along -z. A rod lies along the x axis of its body, whose origin is
the mass centre. Axes of revolute joints are along y. Joints stand in the order of a tree; those
that close a loop are marked. Units are SI.
"""

import math
from dataclasses import dataclass, field

import numpy as np

GRAVITY = 9.81
GROUND = -1
#: Inertia of a rod about its own axis, kg m^2: small, and nothing depends on it in planar motion.
THIN = 1e-3

#: Numbers of bodies of the chains, of loops of the rows of four-bars.
CHAINS = (1, 2, 4, 8, 16, 64, 256, 1024)
ROWS = (1, 2, 10, 40)


@dataclass(frozen=True)
class Body:
    """One body at the start: mass centre x, rotation matrix R, velocity v, w in body axes."""

    mass: float
    J: np.ndarray  # (3,) principal moments
    x: np.ndarray
    R: np.ndarray = field(default_factory=lambda: np.eye(3))
    v: np.ndarray = field(default_factory=lambda: np.zeros(3))
    w: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Joint:
    """A joint of two bodies at a point (3,) in ground axes; ``free`` joins nothing."""

    kind: str  # "free", "spherical", "revolute"
    parent: int
    child: int
    point: np.ndarray
    closes: bool = False


@dataclass(frozen=True)
class Mechanism:
    """A scene: ``name`` and ``size`` say which; ``axes`` are good axes for Euler angles."""

    name: str
    size: int
    t_end: float
    bodies: list[Body]
    joints: list[Joint]
    gravity: float = GRAVITY
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))

    @property
    def key(self):
        """Name and size in one word."""
        return f"{self.name}-{self.size}"


def rod_inertia(mass, length):
    """Principal moments of a thin rod along x."""
    return np.array([THIN, mass * length**2 / 12, mass * length**2 / 12])


def about_y(angle):
    """Rotation matrix about y."""
    c, s = math.cos(angle), math.sin(angle)
    return np.array([[c, 0.0, s], [0.0, 1.0, 0.0], [-s, 0.0, c]])


def rotation_of(q):
    """Rotation matrix of a quaternion, scalar first, of any length."""
    w, x, y, z = np.asarray(q) / np.linalg.norm(q)
    return np.array(
        [
            [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
            [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
            [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
        ]
    )


def free_body():
    """A body with three different moments that turns over, again and again, for 20 s."""
    w = np.array([0.01, 5.0, 0.01])
    body = Body(1.0, np.array([1.0, 2.0, 3.0]), np.zeros(3), w=w)
    return Mechanism("free-body", 1, 20.0, [body], [Joint("free", GROUND, 0, np.zeros(3))], 0.0)


def heavy_top():
    """The fast heavy top of the literature on integration with rotations, for 2 s."""
    r, w = np.array([0.0, 1.0, 0.0]), np.array([0.0, 150.0, -4.61538])
    body = Body(15.0, np.array([0.234375, 0.46875, 0.234375]), r, v=np.cross(w, r), w=w)
    # Roll along the spin axis. The top nutates through the vertical; the third axis stands where
    # the figure axis never comes.
    z, x = np.array([-math.cos(math.pi / 6), 0.0, 0.5]), np.array([0.0, 1.0, 0.0])
    axes = np.column_stack([x, np.cross(z, x), z])
    joint = Joint("spherical", GROUND, 0, np.zeros(3))
    return Mechanism("heavy-top", 1, 2.0, [body], [joint], axes=axes)


def chain(kind, n):
    """n rods of 1 m and 1 kg, end to end, horizontal; 1 s, or 0.1 s beyond 64."""
    spin = np.array([0.1 if kind == "spherical" else 0.0, 0.0, 0.0])
    J = rod_inertia(1.0, 1.0)
    bodies = [Body(1.0, J, np.array([k + 0.5, 0.0, 0.0]), w=spin) for k in range(n)]
    joints = [Joint(kind, k - 1, k, np.array([float(k), 0.0, 0.0])) for k in range(n)]
    # roll about the rod, pitch about the vertical: Euler angles stay far from their singular pose
    axes = np.array([[1.0, 0.0, 0.0], [0.0, 0.0, 1.0], [0.0, -1.0, 0.0]])
    return Mechanism(f"{kind}-chain", n, 1.0 if n <= 64 else 0.1, bodies, joints, axes=axes)


class _Planar:
    """Collects rods and revolute joints of a mechanism in the plane x-z."""

    def __init__(self):
        self.bodies, self.joints = [], []

    def rod(self, start, end, v_start, v_end):
        """Add a rod by its ends and their velocities; returns its number."""
        d = end - start
        length = float(np.linalg.norm(d))
        turning = float((v_end - v_start) @ np.array([d[2], 0.0, -d[0]])) / length**2
        self.bodies.append(
            Body(1.0, rod_inertia(1.0, length), (start + end) / 2,
                 about_y(-math.atan2(d[2], d[0])), (v_start + v_end) / 2,
                 np.array([0.0, turning, 0.0]))
        )  # fmt: skip
        return len(self.bodies) - 1

    def joint(self, parent, child, point, closes=False):
        """Add a joint."""
        self.joints.append(Joint("revolute", parent, child, point, closes))


#: Lengths of the single four-bar: crank, coupler, follower, ground.
CRANK, COUPLER, FOLLOWER, BASE = 2.0, 6.4, 7.0, 4.0


def four_bar_points(angle):
    """Tip of the crank and joint of coupler and follower at a crank angle."""
    tip = CRANK * np.array([math.cos(angle), 0.0, math.sin(angle)])
    pivot = np.array([BASE, 0.0, 0.0])
    across = pivot - tip
    distance = np.linalg.norm(across)
    along = (COUPLER**2 - FOLLOWER**2 + distance**2) / (2 * distance)
    height = math.sqrt(COUPLER**2 - along**2)
    across /= distance
    return tip, tip + along * across + height * np.array([-across[2], 0.0, across[0]])


def four_bar():
    """A crank, coupler and follower of 1 kg each under gravity; the crank turns over; 10 s."""
    origin, pivot = np.zeros(3), np.array([BASE, 0.0, 0.0])
    tip, top = four_bar_points(math.pi / 2)
    v_tip = np.array([1.0, 0.0, 0.0])
    swing = np.array([(top - pivot)[2], 0.0, -(top - pivot)[0]])
    v_top = swing * (v_tip @ (top - tip)) / (swing @ (top - tip))
    made = _Planar()
    crank = made.rod(origin, tip, origin, v_tip)
    coupler = made.rod(tip, top, v_tip, v_top)
    follower = made.rod(pivot, top, origin, v_top)
    made.joint(GROUND, crank, origin)
    made.joint(crank, coupler, tip)
    made.joint(GROUND, follower, pivot)
    made.joint(follower, coupler, top, closes=True)
    return Mechanism("four-bar", 1, 10.0, made.bodies, made.joints)


def row_of_four_bars(count):
    """A row of parallelograms of rods of 1 m; singular whenever they lie flat; 10 s."""
    up, along, v = np.array([0.0, 0.0, 1.0]), np.array([1.0, 0.0, 0.0]), np.array([1.0, 0.0, 0.0])
    still, made = np.zeros(3), _Planar()
    last = made.rod(still, up, still, v)
    made.joint(GROUND, last, still)
    for k in range(count):
        coupler = made.rod(k * along + up, (k + 1) * along + up, v, v)
        crank = made.rod((k + 1) * along, (k + 1) * along + up, still, v)
        made.joint(last, coupler, k * along + up)
        made.joint(GROUND, crank, (k + 1) * along)
        made.joint(coupler, crank, (k + 1) * along + up, closes=True)
        last = crank
    return Mechanism("four-bars", count, 10.0, made.bodies, made.joints)


#: The bouncing ball: radius, stiffness, damping of its contact; the force never pulls.
RADIUS, STIFFNESS, DAMPING = 0.1, 2000.0, 5.0


def contact_force(z, v):
    """Force of the ground on the ball along z, at height z of its centre and velocity v."""
    depth = RADIUS - z
    return max(0.0, STIFFNESS * depth - DAMPING * v) if depth > 0.0 else 0.0


def ball():
    """A ball of 1 kg dropped from 1 m on a springy ground, for 5 s."""
    body = Body(1.0, np.ones(3), np.array([0.0, 0.0, 1.0]))
    return Mechanism("ball", 1, 5.0, [body], [Joint("free", GROUND, 0, np.zeros(3))])


def all_mechanisms(quick=False):
    """All scenes; ``quick`` leaves out sizes that no mark belongs to."""
    sizes = (1, 8, 64, 1024) if quick else CHAINS
    yield free_body()
    yield heavy_top()
    for kind in ("spherical", "revolute"):
        yield from (chain(kind, n) for n in sizes)
    yield four_bar()
    yield from (row_of_four_bars(n) for n in ((10, 40) if quick else ROWS))
    yield ball()


def mechanism_of(key):
    """The scene of a key."""
    return next(m for m in all_mechanisms() if m.key == key)


def error_of(mechanism, reference, x, R):
    """Largest error of a position at the end, m; of a free body, which stays, that of its axes.

    reference: what references.json holds for the scene. Infinite where a number is not finite.
    """
    found, true = (R, reference["R"]) if mechanism.name == "free-body" else (x, reference["x"])
    error = float(np.max(np.abs(np.asarray(found) - np.reshape(true, np.shape(found)))))
    return error if math.isfinite(error) else math.inf
