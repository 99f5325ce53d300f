"""What the ledger compares, at each instant of a run: found block by block, in little memory."""

from typing import TYPE_CHECKING

import attrs
import numpy as np

from dap3d_core.model.groups import Floats
from dap3d_core.model.state_layout import split, velocities_of
from dap3d_core.result.arrays import Arrays
from dap3d_core.result.model_summary import Subject
from dap3d_core.result.post.point_motion import kinetic_energy, momentum

if TYPE_CHECKING:
    from dap3d_core.result.file.lazy_arrays import FileArrays


@attrs.frozen(eq=False, kw_only=True)
class Course:
    """Numbers of a run at nt instants.

    Attributes:
        t, work, potential_energy, position_residual, velocity_residual, acceleration_residual:
            (nt,) as ``Arrays`` has them.
        kinetic: (nt,) kinetic energy, J.
        speed, spin: (nt,) sums over the bodies of m |r_dot|, kg m/s, and of |J| |omega|, kg m^2/s.
        off_unit: (nt,) largest deviation of Euler parameters from unit length.
        reaction: (nt,) sum of the magnitudes of all multipliers, SI.
        far, orbit: (nt,) sums of m |r|, kg m, and of m |r| |r_dot|, kg m^2/s.
        linear, angular: (nt, 3) momenta, kg m/s, kg m^2/s about the origin.
        sizes: largest magnitude of a coordinate, a velocity and an acceleration, those of angles
            times the length that tolerances speak of (m, m/s, m/s^2).

    ``far``, ``orbit``, ``linear`` and ``angular`` only of an isolated system, else (0,).
    """

    t: Floats
    work: Floats
    potential_energy: Floats
    position_residual: Floats
    velocity_residual: Floats
    acceleration_residual: Floats
    kinetic: Floats
    speed: Floats
    spin: Floats
    off_unit: Floats
    reaction: Floats
    far: Floats
    orbit: Floats
    linear: Floats
    angular: Floats
    sizes: tuple[float, float, float]


def course_of(subject: Subject, arrays: "Arrays | FileArrays", length: float = 1.0) -> Course:
    """The course of a run."""
    found: dict[str, list[Floats]] = {}
    sizes = np.zeros(3)
    for block in arrays.blocks():
        for name, values in _numbers(subject, block).items():
            found.setdefault(name, []).append(values)
        arms = np.tile(np.repeat([1.0, length], 3), subject.body_count)
        speeds = arms * velocities_of(block.u)
        r = split(block.u)[0]
        sizes = np.maximum(sizes, [_largest(a) for a in (r, speeds, arms * block.v_dot)])
    whole = {name: np.concatenate(values) for name, values in found.items()}
    nothing = {name: np.zeros(0) for name in ("far", "orbit", "linear", "angular")}
    return Course(**(nothing | whole), sizes=(float(sizes[0]), float(sizes[1]), float(sizes[2])))


def _numbers(subject: Subject, block: Arrays) -> dict[str, Floats]:
    r, p, rd, w = split(block.u)
    fast = np.linalg.norm(rd, axis=2)
    inertia = np.linalg.norm(subject.Jp, ord=2, axis=(1, 2))
    off = np.abs(np.linalg.norm(p, axis=2) - 1.0)
    found = {
        "t": block.t,
        "work": block.work,
        "potential_energy": block.potential_energy,
        "position_residual": block.position_residual,
        "velocity_residual": block.velocity_residual,
        "acceleration_residual": block.acceleration_residual,
        "kinetic": kinetic_energy(subject, block.u),
        "speed": fast @ subject.mass,
        "spin": np.linalg.norm(w, axis=2) @ inertia,
        "off_unit": off.max(axis=1, initial=0.0),
        "reaction": np.abs(block.Lam).sum(axis=1),
    }
    if subject.is_isolated:
        far = np.linalg.norm(r, axis=2)
        found |= {"far": far @ subject.mass, "orbit": (far * fast) @ subject.mass}
        found |= dict(zip(("linear", "angular"), momentum(subject, block.u), strict=True))
    return found


def _largest(values: Floats) -> float:
    return float(np.max(np.abs(values), initial=0.0))
