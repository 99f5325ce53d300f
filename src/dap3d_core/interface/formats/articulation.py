"""An articulated model: links, joints and what acts in them, between a file and a scene.

Every importer makes one and every exporter is given one, so that a format is translated once in
each direction. Lengths in m, angles in rad, masses in kg.
"""

from collections.abc import Callable, Mapping
from math import inf, isfinite
from typing import Any

import attrs
import numpy as np

from dap3d_core.interface.formats.frames import IDENTITY, Frame
from dap3d_core.interface.formats.remarks import NOWHERE, FormatError, Place
from dap3d_core.kernels.array_types import Floats

#: The name of what does not move, as parent or child of a joint.
WORLD = "world"
#: Kinds of joints -> number of their coordinates. The axes of universal and planar joints are two:
#: of a universal joint the first is fixed in the parent and the second in the child; of a planar
#: one they are the directions of sliding, and the child turns about their cross product.
KINDS = {
    "fixed": 0, "revolute": 1, "prismatic": 1, "screw": 1, "cylindrical": 2, "universal": 2,
    "ball": 3, "planar": 3, "free": 6,
}  # fmt: skip
#: Limits of this size and beyond are none, rad or m: files have 1e16, and the largest numbers.
UNLIMITED = 1e6
#: Bounds that are none.
UNBOUNDED = (-inf, inf)


def _floats(value: Any) -> Floats:
    return np.array(value, dtype=np.float64)


@attrs.frozen(eq=False)
class Inertial:
    """Mass and inertia of a link.

    Attributes:
        mass: kg.
        com: (3,) mass centre in the axes of the link.
        inertia: (3, 3) about the mass centre, in the axes of the link, kg m^2.
    """

    mass: float
    com: Floats = attrs.field(default=(0.0, 0.0, 0.0), converter=_floats)
    inertia: Floats = attrs.field(factory=lambda: np.zeros((3, 3)), converter=_floats)


@attrs.frozen(eq=False)
class Geometry:
    """A shape of a link, which is drawn.

    Attributes:
        kind: box, sphere, cylinder, capsule, ellipsoid, cone, mesh, height_field, or plane, whose
            normal is z.
        size: edges of a box; radius of a sphere; radius and length of a cylinder, a cone and
            (without its caps) a capsule, along z; semi-axes of an ellipsoid.
        pose: its frame in the link.
        mesh: path of the file of a mesh, as ``Source.locate`` returns it.
        scale: (3,) factors of a mesh.
        color: "#rrggbb", or "".
        collision: True for the shape of contacts, which is drawn where a link has no other.
        contact: how it meets others, where contacts are imported; None if it does not.
        place: its place in the file.
        name: its name in the file, or "".
        heights: rows along x of heights along y, m, of a height_field, whose size is its edges.
    """

    kind: str
    size: tuple[float, ...] = ()
    pose: Frame = IDENTITY
    mesh: Any = None
    scale: tuple[float, ...] = (1.0, 1.0, 1.0)
    color: str = ""
    collision: bool = False
    contact: "Contact | None" = None
    place: Place = NOWHERE
    name: str = ""
    heights: tuple[tuple[float, ...], ...] = ()


#: Coefficients of friction, and the ``directions`` of a contact from which on they count.
FRICTION_DIRECTIONS = {"mu": 3, "mu_spin": 4, "mu_roll": 6}


@attrs.frozen
class Contact:
    """How a shape meets others.

    Attributes:
        mu, mu_spin, mu_roll: coefficients of friction, and moments against spinning and rolling
            over the force that presses, m; of a pair see ``Articulation.coefficient_of_pair``.
        directions: that it acts along: 1 is smooth, 3 has friction, 4 resists spinning and 6 also
            rolling; of a pair the larger one counts.
        group, meets: bits; a pair meets where ``group`` of one and ``meets`` of the other have one
            in common.
        priority: of a pair the one with the larger decides alone.
        e: coefficient of restitution.
        surface: a name where ``Articulation.friction`` has its friction with some others, or "".
    """

    mu: float = 1.0
    mu_spin: float = 0.0
    mu_roll: float = 0.0
    directions: int = 3
    group: int = 1
    meets: int = 1
    priority: int = 0
    e: float = 0.0
    surface: str = ""


@attrs.define(eq=False)
class Link:
    """A rigid link.

    Attributes:
        name: its name in the file.
        inertial: its mass and inertia, or None for none.
        geometries: its shapes.
        place: its place in the file.
        gravcomp: the part of its weight that is carried.
    """

    name: str
    inertial: Inertial | None = None
    geometries: list[Geometry] = attrs.Factory(list)
    place: Place = NOWHERE
    gravcomp: float = 0.0


def _lower(value: float) -> float:
    return value if value > -UNLIMITED else -inf


def _upper(value: float) -> float:
    return value if value < UNLIMITED else inf


@attrs.frozen
class Limits:
    """Limits of a coordinate.

    Attributes:
        lower, upper: rad or m; infinite for none, also for those of files beyond UNLIMITED.
        stiffness: of the stops, N m/rad or N/m; None where the format says none.
    """

    lower: float = attrs.field(default=-inf, converter=_lower)
    upper: float = attrs.field(default=inf, converter=_upper)
    stiffness: float | None = None

    @property
    def finite(self) -> bool:
        """True if there is a limit on one side at least."""
        return isfinite(self.lower) or isfinite(self.upper)

    def contain(self, q: float, slack: float = 0.0) -> bool:
        """True for a coordinate between them, or beyond one by no more than a slack."""
        return self.lower - slack <= q <= self.upper + slack

    @classmethod
    def between(
        cls, lower: float, upper: float, joint: str, place: Place, stiffness: float | None = None
    ) -> "Limits":
        """The limits of a joint that a file gives.

        Raises:
            FormatError: no coordinate lies between them.
        """
        if not lower <= upper or lower == inf or upper == -inf:
            what = f"joint {joint}: lower = {lower:g} lies above upper = {upper:g}"
            if lower == upper:
                what = f"joint {joint}: no coordinate is as large as its limits, {lower:g}"
            raise FormatError(what, place)
        return cls(lower, upper, stiffness)


@attrs.define(eq=False)
class Joint:
    """A joint between two links.

    Attributes:
        name: its name in the file.
        kind: one of KINDS.
        parent, child: names of links, or WORLD.
        in_parent, in_child: the joint's frame in the parent, and in the child; they coincide where
            the coordinates are zero.
        axes: (3,) unit vectors in the joint's frame: one; two for universal and planar.
        pitch: of a screw, m a turn.
        limits, damping, friction, stiffness, rest, armature: of each coordinate: a number, or a
            tuple for kinds with several axes. Forces are N m or N; ``rest`` is the coordinate
            without force of the spring.
        reference: the coordinate in the file where the joint's is zero, as ``ref`` of MJCF.
        position, rate: coordinate or coordinates where the model starts, and their rates.
        closes: True for a joint that closes a loop: it does not place its child.
        place: its place in the file.
    """

    name: str
    kind: str
    parent: str
    child: str
    in_parent: Frame = IDENTITY
    in_child: Frame = IDENTITY
    axes: tuple[Any, ...] = ((0.0, 0.0, 1.0),)
    pitch: float = 0.0
    limits: tuple[Limits, ...] = (Limits(),)
    damping: tuple[float, ...] = (0.0,)
    friction: tuple[float, ...] = (0.0,)
    stiffness: tuple[float, ...] = (0.0,)
    rest: tuple[float, ...] = (0.0,)
    armature: tuple[float, ...] = (0.0,)
    reference: float = 0.0
    position: tuple[float, ...] = ()
    rate: tuple[float, ...] = ()
    closes: bool = False
    place: Place = NOWHERE


@attrs.frozen(eq=False)
class Coupling:
    """A coordinate that follows another: q = offset + ratio q_of_other, or a polynomial of it.

    Attributes:
        name: its name in the file, or "".
        joint, other: names of joints with one coordinate.
        ratio, offset: see above.
        place: its place in the file.
        curve: coefficients of a polynomial; ratio and offset are then of its tangent at 0, and of
            a model with a start at that.
    """

    name: str
    joint: str
    other: str
    ratio: float = 1.0
    offset: float = 0.0
    place: Place = NOWHERE
    curve: tuple[float, ...] = ()

    def at(self, q: float) -> float:
        """The coordinate that follows, for one of the other joint."""
        if self.curve:
            return float(np.polynomial.polynomial.polyval(q, self.curve))
        return self.offset + self.ratio * q

    def tangent(self, q: float) -> "Coupling":
        """The coupling with the ratio and offset of its tangent at a coordinate of the other."""
        if not self.curve:
            return self
        slope = self.slopes(q)[0]
        return attrs.evolve(self, ratio=slope, offset=self.at(q) - slope * q)

    def slopes(self, q: float) -> tuple[float, ...]:
        """Coefficients of the ratio as a polynomial of what the other moves on from q."""
        powers = np.polynomial.Polynomial(self.curve or (self.offset, self.ratio))
        return tuple(powers(np.polynomial.Polynomial([q, 1.0])).deriv().coef.tolist())


@attrs.frozen(eq=False)
class Drum:
    """A sphere, or a cylinder about z, that a tendon wraps over.

    Attributes:
        link, at: its link, and its frame there.
        radius: m.
        after: number of the point of the tendon that it lies behind, from 1.
        cylinder: False for a sphere.
        side: a link and a point of it on whose side the tendon passes; None for the shorter way.
        inside: the tendon passes through it.
    """

    link: str
    at: Frame
    radius: float
    after: int
    cylinder: bool = False
    side: "tuple[str, Floats] | None" = None
    inside: bool = False


@attrs.frozen(eq=False)
class Tendon:
    """A line from point to point of links, or a sum of coordinates of joints, with its length.

    Attributes:
        name: its name in the file.
        points: links, and the points in their axes, (3,) each.
        stiffness, damping: N/m, N s/m.
        rest: the length above which its spring pulls, m; None for that where the model starts.
        limits: of its length, m.
        place: its place in the file.
        play: by how much it is shorter where the spring pushes, m.
        drums: between points.
        divisors: by which the line behind each point counts less, 0 where there is none; () for 1.
        terms: joints of one coordinate, and their factors in the sum.
        armature: mass that its lengthening moves, kg; inertia, kg m^2, of a sum of angles.
    """

    name: str
    points: tuple[tuple[str, Floats], ...] = ()
    stiffness: float = 0.0
    damping: float = 0.0
    rest: float | None = 0.0
    limits: Limits = Limits()
    place: Place = NOWHERE
    play: float = 0.0
    drums: tuple[Drum, ...] = ()
    divisors: tuple[float, ...] = ()
    terms: tuple[tuple[str, float], ...] = ()
    armature: float = 0.0

    @property
    def ordered_drums(self) -> list[Drum]:
        """The drums in the order in which elements have them: cylinders first."""
        return sorted(self.drums, key=lambda drum: not drum.cylinder)


@attrs.frozen(eq=False)
class Actuator:
    """A force on the coordinate q of a joint, or a force and moment on a link, by an input u.

        F = gear u + bias - stiffness q - damping q_dot

    Attributes:
        name: its name in the file, which becomes that of an input; several may share one.
        joint: the joint; "" for one of a link.
        gear: N m or N for an input of 1.
        place: its place in the file.
        bias, stiffness, damping: see above; q as the joint counts it.
        control, force, active: least and greatest u, F and activation, infinite for none.
        activation: "lag" or "integral" where u acts by a state, with the time constant ``time``.
        start: that state, and the input, where the model starts.
        link, at, wrench: of a link, the frame and the (6,) force and moment for u = 1 in its axes.
        tendon: whose length is q; F lengthens it.
        muscle: with the activation "muscle": its numbers, of a force that shortens the tendon.
    """

    name: str
    joint: str
    gear: float = 1.0
    place: Place = NOWHERE
    bias: float = 0.0
    stiffness: float = 0.0
    damping: float = 0.0
    control: tuple[float, float] = UNBOUNDED
    force: tuple[float, float] = UNBOUNDED
    active: tuple[float, float] = UNBOUNDED
    activation: str = ""
    time: float = 1.0
    start: tuple[float, float] = (0.0, 0.0)
    link: str = ""
    at: Frame = IDENTITY
    wrench: tuple[float, ...] = ()
    tendon: Tendon | None = None
    muscle: Mapping[str, float] = attrs.Factory(dict)


@attrs.define(eq=False)
class Articulation:
    """A model of links and joints.

    Attributes:
        name: of the model.
        links, joints: by name, in the order of the file.
        couplings, actuators, tendons: in the order of the file.
        held: tendons whose length stays ``rest``: of two points, or sums of coordinates, which are
            zero where the file draws them.
        excluded: pairs of links whose shapes do not meet.
        base_meets: whether links meet those that do not move and that a joint holds them at.
        coefficient_of_pair: friction and restitution of two shapes that meet, of those of both: max
            or min.
        friction: coefficients by name of two surfaces, for pairs that do not take them of both.
        gravity: (3,) m/s^2.
        fixed_base: whether links without a joint to a parent are fixed to the world, rather than
            free; None where the format leaves it open.
        base_poses: of links without a joint to a parent.
        place: the place of the model in its file.
    """

    name: str
    links: dict[str, Link] = attrs.Factory(dict)
    joints: dict[str, Joint] = attrs.Factory(dict)
    couplings: list[Coupling] = attrs.Factory(list)
    actuators: list[Actuator] = attrs.Factory(list)
    tendons: list[Tendon] = attrs.Factory(list)
    held: list[Tendon] = attrs.Factory(list)
    excluded: list[tuple[str, str]] = attrs.Factory(list)
    base_meets: bool = False
    coefficient_of_pair: Callable[[float, float], float] = max
    friction: dict[frozenset[str], dict[str, float]] = attrs.Factory(dict)
    gravity: tuple[float, float, float] = (0.0, 0.0, -9.81)
    fixed_base: bool | None = None
    place: Place = NOWHERE
    base_poses: dict[str, Frame] = attrs.Factory(dict)
