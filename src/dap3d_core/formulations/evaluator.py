"""A model made ready to be evaluated: plan, arrays, group loops, a formulation; for Python."""

from collections.abc import Callable, Iterator
from functools import cached_property
from typing import Any

import attrs
import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.assembly.arrays import (
    ACCELERATION,
    ALPHA,
    ANGLE,
    BEGINS,
    DOUBTFUL,
    ENDS,
    EVEN,
    MU,
    OMEGA,
    POSITION,
    SINGULAR,
    UNSEEN,
    UNSETTLED,
    VALUE,
    WRENCH,
    Floats,
    Integers,
    System,
)
from dap3d_core.assembly.evaluate import call_kinds, place_bodies
from dap3d_core.formulations import FORMULATIONS, REPORT, RHS
from dap3d_core.formulations.arrays import build_loops, build_system, load_numbers
from dap3d_core.formulations.constraint_rows import Rows, scaled_rows
from dap3d_core.interface.codegen.instance_layout import ANGLE_WIDTH
from dap3d_core.interface.codegen.specialise import is_knots
from dap3d_core.linear.ldlt.factor import LESS, POOR
from dap3d_core.linear.ldlt.plan import Plan, make_plan
from dap3d_core.model import Group, Model
from dap3d_core.model.knots import narrowest
from dap3d_core.model.rotations import to_body, to_global
from dap3d_core.model.state_layout import split, to_integrated, velocities_of


@attrs.frozen(eq=False)
class Switch:
    """One number whose sign is watched.

    Attributes:
        group, place: whose it is: an instance of a group.
        kind: "switch": the element's own; "knot": the distance of an argument from where the
            function that the element is given takes another form.
        is_one_of_several, part: where the kernel gives a tuple, which of its numbers.
    """

    group: Group
    place: int
    kind: str
    is_one_of_several: bool
    part: int

    @property
    def words(self) -> str:
        """Why the run ends where it becomes negative; "" where it starts anew there."""
        type_: Any = self.group.examined.type
        return str(type_.switch_words) if self.kind == "switch" else ""

    @property
    def band(self) -> float:
        """How far beyond a knot an argument may be until it is said to have passed it."""
        if self.kind == "switch":
            return 0.0
        row, numbers = self.group.numbers[self.place], self.group.examined.layout.numbers
        own = [place for name, place in numbers.items() if is_knots(name)]
        knots = [row[at : at + count] for at, (count,) in own]
        return NEAR_KNOT * min(map(narrowest, knots))

    def name(self, model: Model) -> str:
        """The element's name; with the number's place, from 1, where there are several."""
        is_joint = self.group.examined.type.kind == "joint"
        names = model.joint_names if is_joint else model.force_names
        name = names[int(self.group.members[self.place])]
        return f"{name} [{self.part + 1}]" if self.is_one_of_several else name


#: The part of the narrowest range between two knots that counts as at the knot.
NEAR_KNOT = 1e-6
#: Plain Python divides by zero without a warning, as compiled code does: NaN is looked for after.
AS_COMPILED = np.errstate(all="ignore")
#: A row whose pivot is below this many times what regularises it depends on other rows.
REDUNDANT = 100.0


class Machine:
    """Evaluates one model by one formulation. Not for two threads at once: its arrays are its own.

    Attributes:
        model, plan, system, loops: what it evaluates.
        formulation: its properties.
        report_size: numbers that ``report`` writes (formulations/standard.py).
        length_count: lengths that ``project`` gives (formulations/common/constraints.py).
    """

    def __init__(
        self, model: Model, method: str, announce: Callable[[str], None] | None = None
    ) -> None:
        """Args:
        model: what to evaluate.
        method: name of the formulation, a key of ``FORMULATIONS``.
        announce: called with the name of each group loop that has to be compiled.
        """
        self.model = model
        self.formulation = FORMULATIONS[method]
        self.plan: Plan = make_plan(model.body_count, model.joint_slots, model.joint_rows.tolist())
        self.loops, self.what = build_loops(model, self.formulation.loops, announce)
        self.system: System = build_system(model, self.plan, self.what)
        self.start_functions()
        self._weigh_rows()
        self.report_size = model.report_layout.size
        self.length_count = len(self.plan.nodes) - 1

    @property
    def method(self) -> str:
        """Name of the formulation."""
        return self.formulation.name

    @property
    def counts_turns(self) -> bool:
        """Whether there are angles, whose turns are counted at accepted steps."""
        kinds = self.system.kinds
        return bool(kinds[ANGLE + 1] > kinds[ANGLE])

    @cached_property
    def switches(self) -> tuple[Switch, ...]:
        """The switches of the model's elements, in the order in which ``watch`` gives them."""
        return tuple(
            Switch(group, k, kind, len(group.examined.outputs[kind]) > 1, part)
            for kind, group in self.what
            if kind in ("switch", "knot")
            for k in range(group.count)
            for part in range(len(group.examined.outputs[kind]))
        )

    @property
    def ending(self) -> Floats:
        """(2, switches) what each does, and its band, as an integration takes it."""
        does = [ENDS if s.words else UNSEEN if s.kind == "knot" else BEGINS for s in self.switches]
        return np.array([does, [s.band for s in self.switches]], dtype=float).reshape(2, -1)

    @property
    def unsettled(self) -> int:
        """How often since the start the multipliers did not settle with friction."""
        return int(self.system.settings[UNSETTLED])

    @property
    def singular_reports(self) -> int:
        """How often since the start a pose was singular where something was reported."""
        return int(self.system.settings[SINGULAR])

    @property
    def doubtful_turns(self) -> int:
        """How often since the start a step was too long to count the turns of an angle safely."""
        return int(self.system.settings[DOUBTFUL])

    def load(self, model: Model) -> None:
        """Evaluate another model of the same structure from here on; nothing is compiled.

        Raises:
            ValueError: the structure is another.
        """
        self.what = load_numbers(self.system, self.model, model, self.what)
        self.model = model
        self.__dict__.pop("switches", None)  # they name groups
        self.start_functions()
        self._weigh_rows()

    @AS_COMPILED
    def start(self, t: float, u: ArrayLike) -> None:
        """Make ready for a run from a state u (13 n,): whole turns are counted from here."""
        for places in self.turn_places():
            self.system.par[places] = 0.0
        self._place(t, u)
        s = self.system
        s.settings[[UNSETTLED, SINGULAR, DOUBTFUL]] = 0.0
        self._call(ANGLE, t, s.force, s.force, s.force)

    def turn_places(self) -> Iterator[slice]:
        """Where in ``par`` the turns of angles are counted."""
        for q, (kind, group) in enumerate(self.what):
            if kind == "angle":
                p0, width = int(self.system.groups[q, 1]), group.examined.layout.par_width
                for offset in group.examined.layout.angles.values():
                    for k in range(offset, offset + ANGLE_WIDTH):
                        yield slice(p0 + k, p0 + width * group.count, width)

    @AS_COMPILED
    def start_functions(self, t: float = 0.0) -> None:
        """Keep each function's value at the start, for drivers that count from it."""
        s = self.system
        self._call(VALUE, t, s.force, s.force, s.force)
        s.F[:, 4] = s.F[:, 0]

    @AS_COMPILED
    def function_values(self, t: float) -> Floats:
        """(functions, 4) values of the functions of time and their first three derivatives at t."""
        s = self.system
        self._call(VALUE, t, s.force, s.force, s.force)
        values: Floats = s.F[1:, :4].copy()
        return values

    def set_penalty(self, alpha: float, Omega: float, mu: float) -> None:
        """Numbers of the penalty formulation; Omega in 1/s."""
        self.system.settings[[ALPHA, OMEGA, MU]] = alpha, Omega, mu

    @cached_property
    def functions(self) -> Any:
        """The compiled functions (rhs, project, report, ...) that an integrator takes."""
        turns, switches = self.counts_turns, bool(self.switches)
        return self.formulation.functions(turns=turns, switches=switches)

    def integrated(self, u: ArrayLike) -> Floats:
        """The integrated state y (13 n + 1,) of a state u (13 n,)."""
        return to_integrated(np.asarray(u, dtype=float))

    @AS_COMPILED
    def rhs(self, t: float, u: ArrayLike) -> Floats:
        """du/dt (13 n,) at time t in s and state u (13 n,).

        In the order of u: r_dot, p_dot of each body, then r_ddot, omega_dot of each.
        """
        y = self.integrated(u)
        out = np.zeros_like(y)
        self.functions[RHS](float(t), y, out, self.system, self.loops)
        w_dot = split(out)[3]
        w_dot[:] = to_global(split(y)[1], w_dot)  # omega_dot = A omega'_dot, no extra term
        return out[:-1]

    @AS_COMPILED
    def rates(self, t: float, u: ArrayLike, v_dot: Floats) -> Floats:
        """dy/dt (13 n + 1,) with given accelerations (6 n,): r_ddot, omega_dot of each body."""
        y = self.integrated(u)
        out = np.zeros_like(y)
        self.functions[RHS](float(t), y, out, self.system, self.loops)
        velocities_of(out)[:] = v_dot
        w_dot = split(out)[3]
        w_dot[:] = to_body(split(y)[1], w_dot)
        return out

    @AS_COMPILED
    def report(self, t: float, u: ArrayLike) -> Floats:
        """What a run reports at a state, (report_size,).

        v_dot, lambda, angles whose turns are counted, potential energy and the largest residuals of
        the three levels.
        """
        out = np.zeros(self.report_size)
        self.functions[REPORT](float(t), self.integrated(u), out, self.system, self.loops)
        return out

    @AS_COMPILED
    def applied_forces(self, t: float, u: ArrayLike) -> Floats:
        """Force and moment about the mass centre on each body, (n, 6), those of joints left out."""
        s = self.system
        self._place(t, u)
        s.force[:] = 0.0
        call_kinds(VALUE, WRENCH, float(t), s, self.loops, s.force, s.force, s.force)
        return s.force[6:].reshape(-1, 6).copy()

    @AS_COMPILED
    def watch_pivots(self, t: float, u: ArrayLike) -> None:
        """Remember the pivots at a state u (13 n,): below POOR of it a pose is near a singular one.

        Relative to the start, because masses of very different size make small pivots, too. Rows
        that depend on others from the start are left alone.
        """
        if not self.formulation.needs_joints or not self.model.row_count:
            return
        s = self.system
        self._place(t, u)
        s.smallest[:] = 0.0
        pivots = self.pivots(t)
        if self.formulation.accepts_redundant:
            pivots[pivots < REDUNDANT * s.compliance[s.row]] = 0.0
        s.smallest[s.row] = POOR * pivots

    def poor_rows(self, t: float) -> Integers:
        """Rows (model's order) that are nearly singular at the bodies as placed (pivot_lengths)."""
        s = self.system
        smallest, pivots = s.smallest[s.row], self.pivots(t)
        watched = smallest > 0.0
        ratio = np.ones(self.plan.row_size)
        ratio[s.row[watched]] = POOR * pivots[watched] / smallest[watched]
        poor = ~(ratio > POOR)
        for size, first, *_ in self.plan.nodes[:-1]:
            poor[first : first + size] &= not np.prod(ratio[first : first + size]) > LESS
        return np.flatnonzero(poor[s.row])

    @AS_COMPILED
    def pivots(self, t: float) -> Floats:
        """(rows,) pivots of the formulation's factors at the bodies as placed; model's order."""
        from dap3d_core.formulations.common.constraints import (
            PART,
            factorise,
            linearise,
            linearise_evenly,
        )

        s = self.system
        place = linearise_evenly if s.settings[EVEN] else linearise
        place(float(t), s, self.loops)
        factorise(s, PART if self.formulation.accepts_redundant else None)
        inverse = np.ones(self.plan.row_size)
        for size, first, diagonal, *_ in self.plan.nodes[:-1]:
            inverse[first : first + size] = s.K[diagonal : diagonal + size * size : size + 1]
        result: Floats = np.abs(1.0 / inverse[s.row])
        return result

    @AS_COMPILED
    def rows(self, t: float, u: ArrayLike) -> Rows:
        """All constraint rows at time t and state u (13 n,)."""
        s = self.system
        self._place(t, u)
        s.residual[:] = 0.0
        self._call(POSITION, t, s.residual, s.residual, s.residual)
        self._call(ACCELERATION, t, s.D, s.gamma, s.nu)
        row, column, place = self.pattern
        shape = (self.model.row_count, 6 * self.model.body_count)
        return Rows(s.residual[s.row], s.nu[s.row], s.gamma[s.row], row, column, s.D[place], shape)

    def _weigh_rows(self) -> None:
        """Weights of the rows, of residuals in m; in scenes of ordinary size they stay as they are.

        A row's residual is its length in m times that of its gradient there, of displacements in
        units of the scene's length and rotations in rad, be it an equation of lengths, of their
        squares or of directions.
        """
        model = self.model
        self.system.weight[:] = 1.0
        if model.length != 1.0 and model.row_count:
            gradients = scaled_rows(self.rows(0.0, model.u0), model.length)[1]
            good = np.where(np.isfinite(gradients), gradients, 1.0)
            self.system.weight[self.system.row] = model.length / good

    def _place(self, t: float, u: ArrayLike) -> None:
        s = self.system
        place_bodies(self.integrated(u), s.body, s.metric)
        self._call(VALUE, t, s.force, s.force, s.force)

    def _call(self, kind: int, t: float, out1: Floats, out2: Floats, out3: Floats) -> None:
        s = self.system
        call_kinds(kind, kind, float(t), s, self.loops, out1, out2, out3)

    @cached_property
    def pattern(self) -> tuple[Integers, Integers, Integers]:
        """Row, column and place in D of the Jacobian's entries, in the order of ``rows``."""
        s = self.system
        blocks = self.plan.blocks
        heights = blocks[:, 2]
        count = int(heights.sum())
        block = np.repeat(np.arange(len(blocks)), heights)
        within = np.arange(count) - np.repeat(np.cumsum(heights) - heights, heights)
        model_row = np.zeros(self.plan.row_size, dtype=np.int64)
        model_row[s.row] = np.arange(self.model.row_count)
        six = np.arange(6)
        row = np.repeat(model_row[blocks[block, 3] + within], 6)
        column = (6 * (blocks[block, 1] - 1)[:, None] + six).ravel()
        place = ((blocks[block, 0] + 6 * within)[:, None] + six).ravel()
        return row, column, place


__all__ = ["Machine"]
