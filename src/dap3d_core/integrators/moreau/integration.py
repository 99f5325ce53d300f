"""An integration by time stepping of contacts.

Moreau, Unilateral contact and dry friction in finite freedom dynamics (1988), with the gap term of
Anitescu and Potra (Nonlinear Dynamics 14, 1997): a step of length h is

    M (v+ - v_free) = J^T x,   u = J v+ + bias,   0 <= x_N _|_ u_N >= 0,   x_T by Coulomb's law

where v_free comes of the explicit midpoint rule without contacts, in parts of the step where forces
are stiff, and bias of the normal is e u_N
of before where a gap closes at speed, else max(gap, 0) / h. Positions follow by the trapezoidal
rule, second order; those of bodies that collide by velocities that jump when the first gap of their
group closes. Then what overlaps is moved apart.
"""

from collections.abc import Iterator
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.contacts.contact_table import words_of_drive
from dap3d_core.formulations.contacts.equations import OF_CONTACT, STATE
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.integrators.moreau.arrays import all_room, grown, step_arrays
from dap3d_core.integrators.moreau.contact_set import POINTS
from dap3d_core.integrators.moreau.free_motion import MOST_PARTS, PART
from dap3d_core.integrators.moreau.impulses import log_contacts, put_means
from dap3d_core.integrators.moreau.step import FOLLOWED, MOST_STEPS, START_ALONE, advance
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.integrators.stepping.integration import Integration
from dap3d_core.integrators.stepping.integration_state import IntegrationState
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.array_struct import Matrix, Scalar

#: Contacts of a shape whose impulses are kept for the next step.
KEPT = 12
#: Overlap at the start that is told, a part of the length of the scene.
LEAST_OVERLAP = 1e-8


def _measure() -> Scalar[float]:
    return Scalar("measures")


@attrs.define(eq=False, kw_only=True, slots=False)
class MoreauState(IntegrationState):
    """State of an integration by time stepping."""

    rate = _measure()  # largest one of the forces without contacts, 1/s; by the last power alone
    last_rate = _measure()
    largest_residual = _measure()  # of all steps, a part of the largest impulse of each
    contact_work = _measure()  # of all steps so far, J
    friction_work = _measure()  # the part of friction
    work_given = _measure()  # that of steps in which it is positive, J
    deepest = _measure()  # largest overlap at the end of a step, m
    overlap_at_start = _measure()  # that of before the first step, m, which moves bodies apart
    overlap_key = _measure()  # of that contact

    memory: Matrix  # (room, 5) key of a contact, or -1, its impulse, N s, and its mode
    pulls: Floats  # impulses of joints, N s, besides those of motion without contacts
    pushed: Matrix  # (n + 1, 6) accelerations by contacts, global axes; 1 in the first item if any
    direction: Floats  # a change of the state that forces change at their largest rate
    measures: Floats  # scalars


class MoreauIntegration(Integration):
    """An initial value problem with contacts, in steps of equal length."""

    name, adaptive, has_means = "moreau", False, True
    state_class = MoreauState
    loop = staticmethod(advance)

    def __init__(self, evaluator: Evaluator, y0: Any, times: Any, **options: Any) -> None:
        """Args: the evaluator of the model; the others as of ``Integration``."""
        self._evaluator = evaluator
        y0 = without_modes(evaluator, y0) if evaluator.model.contact_count else y0
        options |= {"watched": min(evaluator.watched, 1), "ends": (),
                    "length_count": evaluator.length_count}  # fmt: skip
        options.pop("stop_when_stiff", None)
        functions = evaluator.functions, evaluator.system, evaluator.loops
        super().__init__(*functions, y0, times, **options)
        self._arrays = step_arrays(evaluator, self.work.state.shape[1], len(self.work.memory))
        self._contact_rows: list[Floats] = [Integration.contact_rows]

    def own_arrays(self, size: int, length_count: int) -> dict[str, Any]:
        """As ``Integration.own_arrays``."""
        model = self._evaluator.model
        shapes = 0 if model.collisions is None else np.count_nonzero(model.collisions.body)
        if model.collisions is not None and model.collisions.resists_turning:
            shapes *= 3  # friction, rolling, spinning
        memory = np.full((KEPT * shapes + model.contact_count, 5), -1.0)
        pushed = np.zeros((model.body_count + 1, 6))
        return {
            "memory": memory,
            "pulls": np.zeros(model.joint_row_count),
            "pushed": pushed,
            "direction": np.zeros(size),
            "measures": np.zeros(len(MoreauState.indices("measures"))),
        }

    @property
    def loop_arguments(self) -> tuple[Any, ...]:
        """As ``Integration.loop_arguments``."""
        return self.work, self._arrays, *self._arguments

    def make_room(self) -> None:
        """Make all room that a run without Python has."""
        self._arrays = all_room(self._arrays)

    @IGNORE_FLOAT_ERRORS
    def _advance(self, budget: int) -> None:
        limit = int(self.work.rhs_count) + budget
        while True:
            self.call(self.loop, *self.loop_arguments, limit - int(self.work.rhs_count))
            arrays = self._arrays
            waits = arrays.log_count + 2 * arrays.met_count > len(arrays.log)
            if arrays.log_count:
                self._contact_rows.append(arrays.log[: arrays.log_count].copy())
                arrays.log_count = 0
            if arrays.stage or 2 * arrays.met_count > len(arrays.log):
                self._arrays = grown(arrays)
            elif not waits:
                return

    def state_within(self, t: float) -> Floats | None:
        """As ``Integration.state_within``, linear."""
        work = self.work
        if work.status != at.RUNNING or not work.t_dense < t <= work.t_dense + work.h_dense:
            return None
        part = (t - work.t_dense) / work.h_dense
        found: Floats = (1.0 - part) * work.state[at.OTHER] + part * work.state[at.Y]
        return found

    def complete(self, row: Floats) -> None:
        """As ``Integration.complete``: accelerations and forces are means of the last step."""
        if self.work.step_count == 0:
            self._arrays.stage = START_ALONE
            self._advance(0)
        self.call(put_means, self.work, self._arrays, row)

    def contacts_at(self, t: float) -> Floats:
        """As ``Integration.contacts_at``."""
        arrays = self._arrays
        self.call(log_contacts, self.work, arrays, t)
        found: Floats = arrays.log[: arrays.log_count].copy()
        arrays.log_count = 0
        return found

    @property
    def contact_rows(self) -> Floats:  # type: ignore[override]
        """As of ``Integration``."""
        found: Floats = np.concatenate(self._contact_rows)
        found.flags.writeable = False
        return found

    def all_arrays(self) -> Iterator[tuple[str, Any]]:
        """As ``Restorable.all_arrays``."""
        yield from super().all_arrays()
        yield "contacts", self.contact_rows

    def restored(self, name: str, array: Any, found: Any) -> Any:
        """As ``Restorable.restored``."""
        if name != "contacts":
            return super().restored(name, array, found)
        shapes = len(self._arrays.shapes.kind)
        if found is None or found.shape[1:] != array.shape[1:] or found.dtype != array.dtype:
            raise ValueError("contacts: no such table can be")
        if not np.isfinite(found).all() or not np.isin(found[:, 1:3], np.arange(shapes)).all():
            raise ValueError("contacts: they are of other shapes")
        self._contact_rows = [found]
        return found

    @property
    def too_fast(self) -> str:
        """As of ``Integration``."""
        rate, h = float(self.work.rate), float(self.work.fixed_step)
        if not h * rate > PART * MOST_PARTS:
            return ""
        return (
            f"forces change motion at {rate:.2g} 1/s there, and a step of {h:g} s follows "
            f"{PART * MOST_PARTS / h:.2g} 1/s; let a joint do what so stiff a spring or damper "
            "does, give a shorter contact_step, or make it less stiff"
        )

    @property
    def driving(self) -> str:
        """As of ``Integration``."""
        s, names = self._arrays, self._evaluator.model.contact_names
        return f"contact {words_of_drive(names[s.driving], s.grip[s.driving])}"

    @property
    def shortened(self) -> str:
        """As of ``Integration``."""
        rate, h = float(self.work.rate), float(self.work.fixed_step)
        if not h * rate > FOLLOWED:
            return ""
        return (
            f"steps are {max(FOLLOWED / rate, h / MOST_STEPS):.2g} s long where {h:g} s were asked "
            f"for: forces change motion at {rate:.2g} 1/s at the end"
        )

    @property
    def overlapping(self) -> str:
        """As of ``Integration``."""
        model, overlap = self._evaluator.model, float(self.work.overlap_at_start)
        shapes = model.collisions
        if shapes is None or not overlap > LEAST_OVERLAP * model.length:
            return ""
        pair = divmod(int(self.work.overlap_key) // POINTS, len(shapes.names))
        one, other = (shapes.names[k] for k in pair)
        return (
            f"bodies overlapped by {overlap:.2g} m at the start, most of all shapes {one} and "
            f"{other}: move them, or keep them apart by exclude in [collisions], or group and meets"
        )

    @property
    def dy_dt(self) -> Floats | None:
        """None: rates jump with impulses."""
        return None


def without_modes(evaluator: Evaluator, y: Any) -> Floats:
    """The state y as if contacts were open: impulses do what they do, and none besides.

    A start from a result has the modes reported there, and forces that contacts shared.
    """
    opened: Floats = np.array(y, dtype=float)
    first = evaluator.model.integrated_layout["states"].start
    of_contacts = np.add.outer(evaluator.system.contacts[:, STATE], np.arange(OF_CONTACT))
    opened[first + of_contacts] = 0.0
    return opened
