"""Laws that read reactions which are not unique: friction in joints, forces on reactions.

Redundant rows can share a load in many ways. Without such laws all of them give the same motion;
with them each gives another (docs/decisions/0074).
"""

from collections.abc import Iterator, Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.common.friction import forces_by
from dap3d_core.formulations.constraint_rows import scaled_rows
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.interface.codegen.kernel_arguments import parameters
from dap3d_core.interface.codegen.reactions import reaction_names
from dap3d_core.kernels.array_types import Floats, Integers
from dap3d_core.kernels.runtime.function_lists import LoopArrays, call_loop
from dap3d_core.kernels.runtime.loop_support import V
from dap3d_core.model import Group
from dap3d_core.model.state_layout import velocities_of
from dap3d_core.registry.suggestions import some
from dap3d_core.result.arrays import Arrays
from dap3d_core.scene import ValidatedScene
from dap3d_core.simulation.errors import AssemblyError, RedundantError
from dap3d_core.simulation.initial.least_change import finite_rows
from dap3d_core.simulation.redundancy.other_poses import redundancy_elsewhere
from dap3d_core.simulation.redundancy.redundancy import Redundancy, by_joint, rank_of

#: Field by which a force takes a share, and its value for the least multipliers.
SHARED, LEAST = "shared", "least"
#: Magnitudes of random multipliers with which a law is tried, N or N m.
LOADS = (1.0, 1e3, 1e6)
#: A law changes where its forces do by more than this part of the largest.
FORCE_CHANGE = 1e-9
#: Instants of a run, at most, at which other shares are tried.
MOST_INSTANTS = 100
#: So many other shares are tried, of rows up to this many times stiffer or softer than all alike.
SHARES, STIFFER = 64, 1e3
MOST_NAMES = 8


@attrs.frozen
class SharedLaw:
    """A force that reads reactions which are not unique.

    Attributes:
        force: its name.
        joints: names of the joints that it reads and whose reactions are not unique.
        takes_least: its field ``shared`` says "least".
    """

    force: str
    joints: tuple[str, ...]
    takes_least: bool


def shared_laws(
    checked: ValidatedScene, evaluator: Evaluator, u: Floats, redundancy: Redundancy, t: float = 0.0
) -> tuple[SharedLaw, ...]:
    """Forces of a scene whose law depends on how redundant rows share their load.

    Args:
        u, t: (13 n,) an assembled state, and its time.
        redundancy: that of this state.
    """
    model = evaluator.model
    if not redundancy.rank.redundant or not model.iterated_forces:
        return ()
    if not any(joints & set(redundancy.joints) for _, _, joints in _readers(evaluator)):
        return ()
    if redundancy_elsewhere(evaluator, u, redundancy).redundant == 0:
        return ()  # at one pose alone
    changes = _changes(evaluator, redundancy.rank.dependencies, t, u)
    evaluator.place(t, _in_motion(u))
    found: dict[str, set[str]] = {}
    for joint, change in changes.items():
        name = model.joint_names[joint]
        for q, force, joints in _readers(evaluator):
            if name in joints and _depends(evaluator, q, t, change):
                found.setdefault(force, set()).add(name)
    return tuple(
        SharedLaw(
            one.name,
            tuple(sorted(found[one.name], key=model.joint_names.index)),
            one.values.get(SHARED) == LEAST,
        )
        for one in (*checked.forces, *checked.contacts)
        if one.name in found and one.name not in model.brought_forces.values()  # joints carry it
    )


def why_refused(laws: Sequence[SharedLaw]) -> str:
    """Reason why a scene with such laws has no unique motion, and the remedy; "" if it has."""
    refused = [law for law in laws if not law.takes_least]
    if not refused:
        return ""
    joints = dict.fromkeys(name for law in refused for name in law.joints)
    own = f'say {SHARED} = "{LEAST}" of the force to go on with the least multipliers'
    return (
        f"force{'s' if len(refused) > 1 else ''} {some([x.force for x in refused], MOST_NAMES)}: "
        "the law reads reactions that are not unique, of "
        f"joint{'s' if len(joints) > 1 else ''} {some(list(joints), MOST_NAMES)}: redundant rows "
        "can share their load in many ways, and each gives another motion. Make the rows "
        "independent, by joints of fewer rows; or give each joint its share, by a bushing in "
        "its place (or sph_sd and rot_sda), which carries what its stiffness says; or "
        f"{own}: a note then says how much the outcome depends on it"
    )


def refuse_shared(laws: Sequence[SharedLaw], evaluator: Evaluator, implicit: str = "") -> None:
    """Refuse laws on reactions that are not unique, but where the least are wanted and found.

    implicit: name of the integrator, where it is an implicit one.

    Raises:
        RedundantError: gives reason and remedy.
    """
    if words := why_refused(laws):
        raise RedundantError(words)
    formulation = evaluator.formulation
    if laws and (formulation.has_own_coordinates or not formulation.is_exact):
        raise RedundantError(
            f'{SHARED} = "{LEAST}" of force {laws[0].force} needs method lsq: method '
            f"{formulation.name} shares the load of redundant rows in another way"
        )
    if laws and implicit:
        raise RedundantError(
            f'{SHARED} = "{LEAST}" of force {laws[0].force} needs an explicit integrator, such as '
            f"dop853: {implicit} shares the load of redundant rows in another way"
        )


class ShareSpread:
    """Measures how much the work of laws depends on the share of what redundant rows carry."""

    def __init__(self, evaluator: Evaluator, laws: Sequence[SharedLaw]) -> None:
        self._evaluator, self._laws = evaluator, laws
        self._kept: list[tuple[float, Floats, Floats, Floats]] = []
        self._stride, self._seen = 1, 0

    def update(self, arrays: Arrays) -> None:
        """Take notice of what was reported next."""
        for k in range(len(arrays)):
            if self._seen % self._stride == 0:
                row = arrays.u[k].copy(), arrays.Lam[k].copy(), arrays.states[k].copy()
                self._kept.append((float(arrays.t[k]), *row))
            self._seen += 1
            if len(self._kept) > MOST_INSTANTS:
                self._kept, self._stride = self._kept[::2], 2 * self._stride

    def note(self) -> str:
        """The work of the laws by the least share, and by others along the same motion."""
        forces = some([law.force for law in self._laws], MOST_NAMES)
        head = (
            f'{SHARED} = "{LEAST}" of {forces}: reactions of redundant joints are not unique, and '
            "these forces read the least"
        )
        works = self._works()
        if works is None:
            return head
        return (
            f"{head}. Along this motion forces on reactions took {works[0]:.6g} J; they would have "
            f"taken between {min(works):.6g} and {max(works):.6g} J in joints whose rows differ in "
            f"stiffness, by factors up to {STIFFER**2:.0g}: the outcome is uncertain by as much"
        )

    @IGNORE_FLOAT_ERRORS
    def _works(self) -> Floats | None:
        """(1 + SHARES,) work taken, J, by the share of the run and by others."""
        evaluator, own = self._evaluator, self._evaluator.states
        powers = []
        try:
            for t, u, Lam, states in self._kept:
                evaluator.states = states
                shares = _other_shares(evaluator, t, u, Lam)
                evaluator.place(t, u)
                powers.append([_power(evaluator, t, share) for share in (Lam, *shares)])
        except AssemblyError:
            return None
        finally:
            evaluator.states = own
        times = np.array([t for t, *_ in self._kept])
        return -np.trapezoid(powers, times, axis=0)


def _other_shares(evaluator: Evaluator, t: float, u: Floats, Lam: Floats) -> Floats:
    """(SHARES, rows) multipliers that act as Lam (rows,) does, in joints of random stiffness.

    Of elastic joints lambda . c lambda is least, with the compliance c of each row.
    """
    rng = np.random.default_rng(0)
    rows, gradient = scaled_rows(finite_rows(evaluator, t, u), evaluator.model.length)
    compliance = STIFFER ** rng.uniform(-1.0, 1.0, (SHARES, len(Lam)))
    shares = np.tile(Lam * gradient, (SHARES, 1))
    for dependency in rank_of(evaluator, rows).dependencies:
        N, own = dependency.combinations, shares[:, dependency.rows]
        c = compliance[:, dependency.rows]
        z = np.linalg.solve(
            np.einsum("ir,sr,jr->sij", N, c, N), -np.einsum("ir,sr,sr->si", N, c, own)[..., None]
        )
        shares[:, dependency.rows] += z[..., 0] @ N
    return shares / gradient


def _power(evaluator: Evaluator, t: float, Lam: Floats) -> float:
    s = evaluator.system
    force = forces_by(t, s, evaluator.loops, Lam)
    return float(np.sum(force.reshape(-1, 6) * s.body[:, V : V + 6]))


def _readers(evaluator: Evaluator) -> Iterator[tuple[int, str, set[str]]]:
    """Loop and name of each force on reactions, and names of the joints that it reads."""
    names, forces = evaluator.model.joint_names, evaluator.model.force_names
    for q, (kind, group) in enumerate(evaluator.loop_groups):
        if kind != "friction":
            continue
        joints: list[Integers] = [read.members for read in group.read]
        joints += [some for some in (group.joints, group.loaded) if some is not None]
        own = names if group.type_info.type.is_contact else forces
        for k, member in enumerate(group.members.tolist()):
            yield q, own[member], {names[int(of_force[k])] for of_force in joints}


def _changes(
    evaluator: Evaluator, dependencies: Sequence[Any], t: float, u: Floats
) -> dict[int, Floats]:
    """Joint -> its part (rows,) of a change of the multipliers that D^T does not see."""
    rng, model = np.random.default_rng(0), evaluator.model
    _, gradient = scaled_rows(finite_rows(evaluator, t, u), model.length)
    changes: dict[int, Floats] = {}
    for dependency in dependencies:
        change = rng.standard_normal(len(dependency.combinations)) @ dependency.combinations
        change /= gradient[dependency.rows]
        for joint, mine in by_joint(model, dependency.rows):
            own = changes.setdefault(joint, np.zeros(model.row_count))
            own[dependency.rows[mine]] += change[mine]
    return changes


def _in_motion(u: Floats) -> Floats:
    """The state with random velocities: a law of friction has none at rest."""
    moving = u.copy()
    velocities_of(moving)[:] = np.random.default_rng(1).standard_normal(velocities_of(u).size)
    return moving


@IGNORE_FLOAT_ERRORS
def _depends(evaluator: Evaluator, q: int, t: float, change: Floats) -> bool:
    """True if what a loop of forces on reactions gives changes with the multipliers."""
    group: Group = evaluator.loop_groups[q][1]
    if group.loaded is not None:
        load: Any = group.type_info.type
        first = evaluator.model.joint_start[group.loaded][:, None] + load.load
        return bool(np.abs(change[first]).max() > FORCE_CHANGE * np.abs(change).max())
    kernel = group.type_info.kernels.get("rate")
    if kernel and set(parameters(kernel)) & set(reaction_names(group.type_info.type)):
        return True
    s, rng = evaluator.system, np.random.default_rng(2)
    arrays = LoopArrays(body=s.body, F=s.F, idx=s.idx, par=s.par, states=s.states)
    for load in LOADS:
        first = rng.standard_normal(len(change))
        forces = []
        for Lam in (first, first + change):
            force, minus = np.zeros_like(s.force), np.zeros_like(s.multipliers)
            minus[s.row] = -load * Lam
            call_loop(evaluator.loops, q, t, arrays, s.groups[q], force, minus, minus)
            forces.append(force)
        size = np.max(np.abs(forces))
        if not np.max(np.abs(forces[1] - forces[0])) <= FORCE_CHANGE * size:
            return True
    return False
