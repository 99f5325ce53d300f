"""Random states of the bodies and functions of an element, and their variations."""

import math
import random
from collections.abc import Sequence

import attrs
import numpy as np

from dap3d_core.interface.examine.random_values import numbers, random_pose
from dap3d_core.interface.fields import SLOTS
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, JP, MASS, A, P, R, V, W
from dap3d_core.model.rigid_motion import quaternion_product
from dap3d_core.model.rotations import euler_rates, rotation, skew

#: In place of a function of time: an input, whose value stays.
HELD = "held"
#: Ground, and a body for each slot that a type may have.
BODIES = 1 + len(SLOTS)
#: Ground and the bodies of slots i, j, k, which are drawn first.
DRAWN = 4


@attrs.frozen
class TimeFunction:
    """A smooth function of time with its exact derivatives: c0 + c1 t + c2 t^2 + c3 sin(c4 t)."""

    c: tuple[float, ...]

    def at(self, t: float) -> tuple[float, ...]:
        """(f, f', f'', f''') at a time."""
        c0, c1, c2, c3, c4 = self.c
        s, c = c3 * math.sin(c4 * t), c3 * math.cos(c4 * t)
        return (
            c0 + c1 * t + c2 * t * t + s,
            c1 + 2 * c2 * t + c4 * c,
            2 * c2 - c4**2 * s,
            -(c4**3) * c,
        )


@attrs.frozen(eq=False)
class Direction:
    """A direction: rates of position (m/s), rotation (rad/s, global) and time; row 0 is ground.

    In time the states of an element move at their rates; ``own`` (s,) are further rates of them.
    """

    move: Floats
    turn: Floats
    time: float = 0.0
    own: Floats = attrs.field(factory=lambda: np.zeros(0))
    unknowns: tuple[float, ...] = ()  # rates of those of a joint

    @classmethod
    def of(cls, slot: int, component: int) -> "Direction":
        """Body ``slot`` (from 0) along x, y, z or about x, y, z (components 0 to 5)."""
        both = np.zeros((2, BODIES, 3))
        both[component // 3, slot + 1, component % 3] = 1.0
        return cls(both[0], both[1])

    @classmethod
    def of_state(cls, k: int, count: int) -> "Direction":
        """State k of so many."""
        return cls(np.zeros((BODIES, 3)), np.zeros((BODIES, 3)), 0.0, np.eye(count)[k])

    @classmethod
    def of_unknown(cls, k: int, count: int) -> "Direction":
        """One of the unknowns of a joint."""
        still = np.zeros((BODIES, 3))
        return cls(still, still, unknowns=tuple(float(n == k) for n in range(count)))

    @classmethod
    def in_time(cls) -> "Direction":
        """Time alone, at a fixed pose."""
        return cls(np.zeros((BODIES, 3)), np.zeros((BODIES, 3)), 1.0)


@attrs.frozen(eq=False)
class State:
    """Time, and for ground and each slot r (9, 3), p (9, 4), velocity, angular velocity (9, 3).

    ``mass`` (9,) and ``Jp`` (9, 9) are the bodies' inertia, ``functions`` those of time; None
    for an absent one. ``own`` (s,) are the states of the element, ``unknowns`` (k, 2) those of a
    joint, with their rates.
    """

    t: float
    r: Floats
    p: Floats
    v: Floats
    w: Floats
    mass: Floats
    Jp: Floats
    functions: tuple[TimeFunction | None, ...]
    own: Floats = attrs.field(factory=lambda: np.zeros(0))
    unknowns: Floats = attrs.field(factory=lambda: np.zeros((0, 2)))

    def body(self) -> Floats:
        """(9, BODY_WIDTH) columns of the bodies, as a group loop reads them."""
        body = np.zeros((BODIES, BODY_WIDTH))
        body[:, R : R + 3], body[:, A : A + 9] = self.r, rotation(self.p).reshape(BODIES, 9)
        body[:, V : V + 3], body[:, W : W + 3], body[:, P : P + 4] = self.v, self.w, self.p
        body[:, MASS], body[:, JP : JP + 9] = self.mass, self.Jp
        return body

    def body_rate(self, along: Direction) -> Floats:
        """The rate of ``body`` along a direction; velocities stay."""
        rate = np.zeros((BODIES, BODY_WIDTH))
        rate[:, R : R + 3] = along.move
        turned = skew(along.turn) @ rotation(self.p)
        rate[:, A : A + 9] = turned.reshape(BODIES, 9)
        rate[:, P : P + 4] = euler_rates(self.p, along.turn)
        return rate

    def table(self) -> Floats:
        """(functions + 1, 5) f, f', f'', f''' at t, and f at 0; row 0 is the absent function."""
        rows = [(*f.at(self.t), f.at(0.0)[0]) if f else (0.0,) * 5 for f in self.functions]
        own = [(*x, 0.0, 0.0, 0.0) for x in self.unknowns.tolist()]  # with their rates
        return np.array([(0.0,) * 5, *rows, *own])

    def table_rate(self, along: Direction) -> Floats:
        """The rate of ``table`` along a direction."""
        known = len(self.functions) + 1
        rate = np.zeros((known + len(self.unknowns), 5))
        rate[:known, :3] = along.time * self.table()[:known, 1:4]
        rate[known:, 0] = along.unknowns or 0.0
        return rate

    def moved(self, along: Direction, h: float) -> "State":
        """The state after a finite step h along a direction, with finite rotations."""
        angle = np.sqrt(np.sum(along.turn**2, axis=1, keepdims=True)) * h
        half = np.where(angle == 0.0, 0.5 * h, np.sin(angle / 2) * h / np.where(angle, angle, 1.0))
        q = np.hstack([np.cos(angle / 2), half * along.turn])
        return attrs.evolve(
            self,
            t=self.t + along.time * h,
            r=self.r + h * along.move,
            p=quaternion_product(q, self.p),
            unknowns=self.unknowns + [[h * rate, 0.0] for rate in along.unknowns]
            if along.unknowns
            else self.unknowns,
        )

    def together(self, q: Floats, shift: Floats, speed: Floats, spin: Floats) -> "State":
        """The state after a common rotation (quaternion) and shift, plus a common velocity."""
        R = rotation(q)
        r = self.r @ R.T + shift
        return attrs.evolve(
            self,
            r=r,
            p=quaternion_product(q, self.p),
            v=self.v @ R.T + speed + np.cross(spin, r),
            w=self.w @ R.T + spin,
        )

    def at_rest(self) -> "State":
        """The same pose without velocities."""
        return attrs.evolve(self, v=np.zeros((BODIES, 3)), w=np.zeros((BODIES, 3)))

    def velocities(self, slots: int) -> Floats:
        """(slots, 6) velocities and angular velocities of the bodies, without ground."""
        return np.hstack([self.v, self.w])[1 : slots + 1]

    def at_speed(self, factor: float) -> "State":
        """The same pose with so many times the velocities."""
        return attrs.evolve(self, v=factor * self.v, w=factor * self.w)

    def with_velocity(self, x: Floats) -> "State":
        """The same pose with velocities (slots, 6) of the bodies."""
        v, w = self.v.copy(), self.w.copy()
        v[1 : len(x) + 1], w[1 : len(x) + 1] = x[:, :3], x[:, 3:]
        return attrs.evolve(self, v=v, w=w)

    def motion(self) -> Direction:
        """The direction in which the state moves: its velocities, and time."""
        rates = tuple(self.unknowns[:, 1].tolist())
        return Direction(self.v, self.w, 1.0, unknowns=rates)


def random_state(rng: random.Random, functions: Sequence[bool | str], *, grounded: bool) -> State:
    """A random state.

    Args:
        rng: random numbers.
        functions: True for each function of time that is present, HELD for an input.
        grounded: slot j is on ground.
    """
    first = _random_bodies(rng, DRAWN)
    # drawn apart, so that the others do not depend on how many slots there are
    rest = _random_bodies(random.Random(first[0][0, 0]), BODIES - DRAWN)
    r, p, v, w, Jp, mass = (np.concatenate(pair) for pair in zip(first, rest, strict=True))
    for b in (0, 2) if grounded else (0,):
        r[b], p[b], v[b], w[b], mass[b], Jp[b] = 0.0, (1.0, 0.0, 0.0, 0.0), 0.0, 0.0, 0.0, 0.0
    present = (_row_of_time(rng, one) if one else None for one in functions)
    return State(rng.uniform(0.1, 1.0), r, p, v, w, mass, Jp, tuple(present))


def _random_bodies(rng: random.Random, count: int) -> tuple[Floats, ...]:
    """r, p, v, w, Jp (count, 9) and mass of random bodies."""
    poses = [random_pose(rng) for _ in range(count)]
    r, p = np.array([x.r for x in poses]), np.array([x.p for x in poses])
    v, w = (np.array([numbers(rng, 3) for _ in range(count)]) for _ in range(2))
    L = [np.reshape([rng.uniform(-0.3, 0.3) for _ in range(9)], (3, 3)) for _ in range(count)]
    Jp = np.array([(x @ x.T + 0.5 * np.eye(3)).ravel() for x in L])
    return r, p, v, w, Jp, np.array([rng.uniform(0.5, 2.0) for _ in range(count)])


def _row_of_time(rng: random.Random, which: bool | str) -> TimeFunction:
    if which == HELD:
        return TimeFunction((*numbers(rng, 1), 0.0, 0.0, 0.0, 0.0))
    return TimeFunction(numbers(rng, 5))
