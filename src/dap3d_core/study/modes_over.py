"""Public function ``modes_over``: modes of a scene followed over the values of a parameter."""

import os
from collections.abc import Iterator
from typing import Any

import attrs
import numpy as np
from numpy.typing import NDArray

from dap3d_core.kernels.array_types import Floats
from dap3d_core.registry import load_registry
from dap3d_core.registry.arguments import checked
from dap3d_core.scene import Scene, check, load
from dap3d_core.simulation import SimulationError
from dap3d_core.simulation.linearization.linearization import (
    MANY_BODIES,
    REAL_PART_ROUNDING,
    Linearization,
    linearize,
)
from dap3d_core.simulation.linearization.state_matrices import Complex
from dap3d_core.study.parameters import SceneParameter, read_values, with_values

#: Weight of the distance of eigenvalues beside the likeness of shapes: it only breaks ties.
TIE = 1e-3
#: Eigenvalues within this part of each other share a space of shapes, of which any is a mode's.
REPEATED = 1e-6


@attrs.frozen(eq=False)
class ModesOver:
    """Modes of a scene at n values of a parameter, each followed by its shape.

    Modes are ordered by their frequency at the first value; modes that begin at later values come
    behind them. NaN where there is no such mode: an oscillation that is damped more and more ends
    as two motions that decay.

    Attributes:
        parameter: its dotted name.
        unit: its SI unit.
        values: (n,) values of the parameter.
        eigenvalues: (n, modes) eigenvalue of each mode, 1/s; of a conjugate pair that with Im > 0.
        stable: (n,) whether no motion grows, as ``Linearization.stable``.
        steady: (n,) whether the start is an equilibrium or a steady motion; stability means
            nothing elsewhere.
        notes: of the linearisations, each once.
    """

    parameter: str
    unit: str
    values: Floats
    eigenvalues: Complex
    stable: NDArray[np.bool_]
    steady: NDArray[np.bool_]
    notes: tuple[str, ...]

    @property
    def frequencies(self) -> Floats:
        """(n, modes) natural frequency of each mode, Hz: ``|lambda|`` / (2 pi)."""
        return np.asarray(np.abs(self.eigenvalues) / (2.0 * np.pi))

    @property
    def damping(self) -> Floats:
        """(n, modes) damping ratio of each mode: ``-Re lambda / |lambda|``; 0 for lambda = 0."""
        magnitude = np.abs(self.eigenvalues)
        return np.asarray(-self.eigenvalues.real / np.where(magnitude == 0.0, 1.0, magnitude) + 0.0)

    @property
    def grows(self) -> NDArray[np.bool_]:
        """(n, modes) whether the motion of the mode grows, beyond rounding."""
        beyond = self.eigenvalues.real > REAL_PART_ROUNDING[0] * np.abs(self.eigenvalues)
        return np.asarray(beyond & ~self.stable[:, None])

    def __repr__(self) -> str:
        n, modes = self.eigenvalues.shape
        return f"<ModesOver {self.parameter}: {modes} modes at {n} values>"


@checked
def modes_over(
    scene: Scene | str | os.PathLike[str],
    parameter: str,
    values: Any,
    *,
    t: float = 0.0,
    modes: int | None = None,
    allow_code: bool = False,
) -> ModesOver:
    """Follow the modes of a scene over the values of a parameter (Campbell diagram, root loci).

    The scene is linearised about its start at each value, in steady motion as ``linearize`` does.
    From value to value modes are paired by the likeness of their shapes of displacement and
    velocity, in the metric of the masses (modal assurance criterion: Allemang and Brown, 1982), so
    that modes whose frequencies cross stay themselves. Steps must be so small that shapes change
    little in one.

    Args:
        scene: a Scene, or what ``load`` takes.
        parameter: what ``sweep`` may vary: ``forces.spring.k``, ``parameters.speed``.
        values: (n,) in the order in which modes are followed, or text: "1:5:9" (from:to:count),
            "1:100:5:log".
        t: time, s: of the functions of time and the drivers.
        modes: number of modes to return, the lowest at the first value; by default all, or 10 of a
            scene of more than 150 bodies.
        allow_code: whether the model's own types may be loaded.

    Raises:
        SceneError, PluginError: an unknown parameter, with the nearest; invalid values; others as
            ``load``.
        SimulationError: the scene cannot be linearised at a value, which the message names.
    """
    if modes is not None and modes < 1:
        raise ValueError(f"modes must be a whole number above zero, not {modes!r}")
    scene = scene if isinstance(scene, Scene) else load(scene)
    own = check(scene, load_registry(), allow_code=allow_code)
    varied, numbers = read_values(own, parameter, values)
    follower = _Follower()
    stable: list[bool] = []
    steady: list[bool] = []
    notes: dict[str, None] = {}
    for point in _linearised(scene, varied, numbers, t, modes, allow_code):
        follower.add(point)
        stable.append(point.stable)
        steady.append(point.is_steady)
        notes |= dict.fromkeys(point.notes)
    return ModesOver(varied.name, varied.unit, numbers, follower.eigenvalues()[:, :modes],
                     np.array(stable), np.array(steady), tuple(notes))  # fmt: skip


def _linearised(
    scene: Scene, parameter: SceneParameter, values: Floats, t: float, modes: int | None,
    allow_code: bool,
) -> Iterator[Linearization]:  # fmt: skip
    """The linearisation at each value; of large scenes with twice the modes, which may cross."""
    many = len(scene.bodies) > MANY_BODIES and modes is not None
    count = 2 * modes if many and modes else None
    for value in values:
        changed = with_values(scene, [parameter], [value])
        try:
            point = linearize(changed, t=t, modes=count, allow_code=allow_code)
            _ = point.eigenvalues
        except SimulationError as error:
            raise SimulationError(f"at {parameter.name} = {value:g}: {error}") from error
        yield point


class _Follower:
    """Pairs the modes at each value with those before.

    A mode that is missing keeps its last shape, by which it is found again.
    """

    def __init__(self) -> None:
        self.rows: list[Complex] = []
        self.shapes = np.zeros((0, 0), dtype=complex)  # (6 n, modes so far)
        self.last = np.zeros(0, dtype=complex)

    def add(self, point: Linearization) -> None:
        """Add the modes at the next value."""
        values, shapes, M = point.mode_eigenvalues, point.modes, point.M
        if not self.rows:
            self.rows, self.last, self.shapes = [values], values.copy(), shapes
            return
        from scipy.optimize import linear_sum_assignment

        near = _closeness(self.last, values)
        likeness = _likeness(self.last, self.shapes, values, shapes, M)
        own, new = linear_sum_assignment(likeness + TIE * near, maximize=True)
        begun = np.setdiff1d(np.arange(len(values)), new)
        row = np.full(len(self.last), np.nan, dtype=complex)
        row[own] = values[new]
        kept = self.shapes.copy()
        for j, k in zip(own, new, strict=True):
            kept[:, j] = _followed(self.shapes[:, j], k, values, shapes)
        self.last[own] = values[new]
        self.rows.append(np.append(row, values[begun]))
        self.last = np.append(self.last, values[begun])
        self.shapes = np.hstack([kept, shapes[:, begun]])

    def eigenvalues(self) -> Complex:
        """(n, modes), NaN where a mode is missing."""
        found = np.full((len(self.rows), len(self.last)), np.nan, dtype=complex)
        for row, values in zip(found, self.rows, strict=True):
            row[: len(values)] = values
        return found


def _closeness(a: Complex, b: Complex) -> Floats:
    """(a, b) 1 where eigenvalues are equal, down to 0."""
    size = np.abs(a)[:, None] + np.abs(b)
    return np.asarray(1.0 - np.abs(a[:, None] - b) / np.where(size > 0.0, size, 1.0))


def _likeness(a: Complex, X: Complex, b: Complex, Y: Complex, M: Any) -> Floats:
    """(a, b) modal assurance criterion of shapes (x, lambda x / s), s the larger ``|lambda|``.

    Velocities tell the two motions apart that an overdamped oscillation has, of one shape.
    """
    size = np.maximum(np.abs(a)[:, None], np.abs(b))
    s = np.where(size > 0.0, size, 1.0)
    a, b = a[:, None] / s, b / s
    product = np.abs((X.conj().T @ (M @ Y)) * (1.0 + a.conj() * b)) ** 2
    x, y = (np.real(np.sum(Z.conj() * (M @ Z), axis=0)) for Z in (X, Y))
    norms = x[:, None] * y * (1.0 + np.abs(a) ** 2) * (1.0 + np.abs(b) ** 2)
    return np.asarray(product / np.where(norms > 0.0, norms, 1.0))


def _followed(shape: Complex, k: int, values: Complex, shapes: Complex) -> Complex:
    """Shape of the new mode k; of a repeated eigenvalue, the one nearest to the shape before.

    Where frequencies are equal any combination of both shapes is a mode, and which ones are
    computed is chance.
    """
    group = np.flatnonzero(np.abs(values - values[k]) <= REPEATED * np.abs(values[k]))
    if len(group) < 2:
        return np.asarray(shapes[:, k])
    weights = np.linalg.lstsq(shapes[:, group], shape, rcond=None)[0]
    nearest = shapes[:, group] @ weights
    return np.asarray(nearest if np.any(nearest) else shapes[:, k])
