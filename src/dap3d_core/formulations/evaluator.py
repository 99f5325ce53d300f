"""The evaluator of a model: plan, arrays, group loops and formulation, called from Python."""

from collections.abc import Callable, Iterator
from contextlib import contextmanager
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from dap3d_core.assembly.arrays import (
    ACCELERATION,
    ALPHA,
    ANGLE,
    MU,
    OMEGA,
    POSITION,
    SINGULAR,
    TURNED,
    UNSETTLED,
    VALUE,
    WRENCH,
    Floats,
    Integers,
    System,
    step_functions,
)
from dap3d_core.assembly.evaluate import call_kinds, place_state
from dap3d_core.assembly.motion.coordinates import with_motions
from dap3d_core.assembly.turns import ANGLE as AT_STEP
from dap3d_core.assembly.turns import (
    COORDINATE,
    STATE,
    STATE_WIDTH,
    begin_turns,
    follow_poses,
    report_turns,
)
from dap3d_core.formulations import ACCEPTED, FORMULATIONS, REPORT, RHS, WATCH, arrays
from dap3d_core.formulations.constraint_rows import ConstraintRows, jacobian_pattern, scaled_rows
from dap3d_core.formulations.coordinates import Coordinates
from dap3d_core.formulations.switches import Switch, switches_of, turns
from dap3d_core.interface.codegen.instance_layout import ANGLE_WIDTH
from dap3d_core.interface.element_states import START
from dap3d_core.linear.ldlt.plan import Plan, make_plan
from dap3d_core.model import Model
from dap3d_core.model.rotations import to_body
from dap3d_core.model.state_layout import bodies_of, split, u_from_y, velocities_of, y_from_u

#: Plain Python divides by zero without a warning, as compiled code does: NaN is looked for after.
IGNORE_FLOAT_ERRORS = np.errstate(all="ignore")
#: How often the unknowns of joints are solved for at the start, by a few Newton passes each time.
UNKNOWN_PASSES = 12


class Evaluator:
    """Evaluates one model by one formulation. Not for two threads at once: its arrays are its own.

    Attributes:
        model, plan, system, loops: what it evaluates.
        formulation: its properties.
        report_size: numbers that ``report`` writes (formulations/standard.py).
        states: (states,) of elements, in evaluations at a state u of the bodies alone.
        time: s, that tolerances speak of (``Model.time``).
    """

    model: Model

    def __init__(
        self,
        model: Model,
        method: str,
        announce: Callable[[str], None] | None = None,
        like: "Evaluator | None" = None,
    ) -> None:
        """Args:
            model: what to evaluate.
            method: name of the formulation, a key of ``FORMULATIONS``.
            announce: called with the name of each group loop that has to be compiled.
            like: another one of this method, of a model of the same structure.

        Raises:
            ValueError: that has another structure.
        """
        self.states: Floats = model.initial_states
        self.formulation = FORMULATIONS[method]
        if like is None:
            rows = model.joint_rows.tolist()
            self.plan: Plan = make_plan(
                model.body_count, model.joint_slots, rows, model.contact_count
            )
            self.loops, self.loop_groups = arrays.build_loops(
                model, self.formulation.loops, announce
            )
        else:
            self.plan, self.loops = like.plan, like.loops
            self.loop_groups = arrays.regrouped(like.model, model, like.loop_groups)
        self.model = model = with_motions(model, None if like is None else like.model)
        self.system: System = arrays.build_system(model, self.plan, self.loop_groups)
        self.store_initial_function_values()
        self._seek_unknowns()
        self._weigh_rows()
        self.report_size = model.report_layout["inputs"].start
        self.coordinates: Coordinates = self.formulation.coordinates(self)

    @property
    def length_count(self) -> int:
        """Lengths that ``project`` gives (formulations/common/constraints.py)."""
        return int(self.coordinates.length_count)

    @property
    def method(self) -> str:
        """Name of the formulation."""
        return self.formulation.name

    @property
    def counts_turns(self) -> bool:
        """True if the model has angles; their turns are counted at accepted steps."""
        return self.has_own_angles or self.model.joint_angle_count > 0

    @property
    def has_own_angles(self) -> bool:
        """True if elements of the model have angles of their own."""
        kinds = self.system.kinds
        return bool(kinds[ANGLE + 1] > kinds[ANGLE])

    @property
    def watched(self) -> int:
        """0 without angles; 1 where all are coordinates; 2 where they limit the steps."""
        limits = self.has_own_angles or bool(np.any(self.system.turns[:, COORDINATE] < 0))
        return int(self.counts_turns) + int(limits)

    @cached_property
    def has_unknowns(self) -> bool:
        """True if joints have unknowns of their own."""
        return any(group.type_info.layout.unknowns for group in self.model.joints)

    @cached_property
    def switches(self) -> tuple[Switch, ...]:
        """The switches of the model's elements, in the order in which ``watch`` gives them."""
        return switches_of(self.loop_groups, self.model.length, self.time, self.model.reach)

    @property
    def friction_failure_count(self) -> int:
        """Number of friction iterations since the start that did not converge."""
        return int(self.system.settings[UNSETTLED])

    @property
    def singular_reports(self) -> int:
        """Number of reports since the start at singular poses."""
        return int(self.system.settings[SINGULAR])

    def load(self, model: Model) -> None:
        """Evaluate another model of the same structure from here on; nothing is compiled.

        Raises:
            ValueError: the structure is another.
        """
        model = with_motions(model, self.model)
        self.loop_groups = arrays.load_numbers(self.system, self.model, model, self.loop_groups)
        self.model, self.states = model, model.initial_states
        self.__dict__.pop("switches", None)  # they name groups
        self.store_initial_function_values()
        self._seek_unknowns()
        self._weigh_rows()
        before, self.coordinates = self.coordinates, self.formulation.coordinates(self)
        if self.coordinates.function(RHS) is not before.function(RHS):
            self.__dict__.pop("functions", None)

    @IGNORE_FLOAT_ERRORS
    def start(
        self, t: float, u: ArrayLike, angles: Floats | None = None, states: Floats | None = None
    ) -> None:
        """Make ready for a run from a state u (13 n,): whole turns are counted from here.

        angles: (angles,) those that the state's are within half a turn of, rad, in the order of
            reports; zeros by default.
        states: (states,) of elements; their initial values by default.
        """
        self.states = self.model.initial_states if states is None else states
        self._seek_unknowns()
        self.begin_turns(t, u, angles)
        self.system.settings[[UNSETTLED, SINGULAR]] = 0.0

    @IGNORE_FLOAT_ERRORS
    def begin_turns(self, t: float, u: ArrayLike, angles: Floats | None = None) -> None:
        """Count whole turns from a state u (13 n,); angles as of ``start``."""
        s = self.system
        for places in self.turn_places(of_unknowns=False):
            s.par[places] = 0.0
        if angles is not None:
            self._set_angles(angles)
        self._count_own(t, u)
        if len(s.turns):
            y = self.coordinates.start(np.asarray(u, dtype=float))
            self.place(t, u)
            begin_turns(float(t), y, s)

    def _set_angles(self, angles: Floats) -> None:
        s = self.system
        for q, (kind, group) in enumerate(self.loop_groups):
            if kind == "angle":
                p0, layout = int(s.groups[q, 1]), group.type_info.layout
                columns = self.model.angles_of(group, np.arange(group.count)).T
                for offset, column in zip(layout.angles.values(), columns, strict=True):
                    end = p0 + layout.par_width * group.count
                    s.par[p0 + offset : end : layout.par_width] = angles[column]
        s.par[s.turns[:, STATE] + AT_STEP] = angles[self.model.own_angle_count :]

    @IGNORE_FLOAT_ERRORS
    def count_turns(self, t: float, u: ArrayLike) -> None:
        """Count whole turns of angles up to a state u (13 n,), less than half a turn further."""
        self._count_own(t, u)
        if len(self.system.turns):
            self.place(t, u)
            follow_poses(float(t), self.system)

    def _count_own(self, t: float, u: ArrayLike) -> None:
        """Count the angles of elements, and find the unknowns of joints, at a state u (13 n,)."""
        if self.has_own_angles:
            self.place(t, u)
            self._call(ANGLE, t, np.zeros(1), np.ones(1), np.zeros(1))

    def _seek_unknowns(self) -> None:
        """Find the unknowns of joints at the poses as given, from where their fields begin."""
        signs: list[slice] = []
        for q, (kind, group) in enumerate(self.loop_groups):
            layout, p0 = group.type_info.layout, int(self.system.groups[q, 1])
            for name in layout.unknowns if kind == "angle" else ():
                first, end = p0 + layout.angles[name], p0 + layout.par_width * group.count
                places = [slice(first + k, end, layout.par_width) for k in range(ANGLE_WIDTH + 1)]
                for place in places:
                    self.system.par[place] = 0.0
                self.system.par[places[0]] = group.numbers[:, layout.numbers[f"{name}{START}"][0]]
                signs.append(places[-1])
        for _ in range(UNKNOWN_PASSES if signs else 0):
            self._count_own(0.0, self.model.u0)
        for place in signs:  # of what was found
            self.system.par[place] = 0.0
        if signs:
            self._count_own(0.0, self.model.u0)

    @IGNORE_FLOAT_ERRORS
    def counted_angles(self, t: float, u: ArrayLike) -> Floats:
        """(angles,) angles whose turns are counted, rad, at a state u (13 n,)."""
        angles, scratch = np.zeros(self.model.angle_count), np.zeros(1)
        self.place(t, u)
        self._call(TURNED, t, angles, scratch, scratch)
        report_turns(float(t), angles[:0], angles[self.model.own_angle_count :], self.system)
        return angles

    def turn_places(self, *, of_unknowns: bool = True) -> Iterator[slice]:
        """Slices of ``par`` that count the turns of angles, or keep the unknowns of joints."""
        for q, (kind, group) in enumerate(self.loop_groups):
            if kind == "angle":
                layout = group.type_info.layout
                p0, width = int(self.system.groups[q, 1]), layout.par_width
                for name, offset in layout.angles.items():
                    if name in layout.unknowns and not of_unknowns:
                        continue
                    for k in range(offset, offset + ANGLE_WIDTH):
                        yield slice(p0 + k, p0 + width * group.count, width)
        if len(turns := self.system.turns):
            yield slice(int(turns[0, STATE]), int(turns[-1, STATE]) + STATE_WIDTH)

    @property
    def inputs(self) -> Floats:
        """(inputs,) the values that elements read, a copy."""
        return self.system.F[self.model.input_rows, 0]

    def set_inputs(self, values: ArrayLike) -> None:
        """Set the values that elements read, (inputs,); they hold until they are set again."""
        self.system.F[self.model.input_rows, 0] = values

    @contextmanager
    def held_inputs(self) -> Iterator[None]:
        """Put the values of inputs back at the end."""
        values = self.inputs
        try:
            yield
        finally:
            self.set_inputs(values)

    @IGNORE_FLOAT_ERRORS
    def store_initial_function_values(self) -> None:
        """Keep each function's value at the start, for drivers that count from it."""
        self.set_inputs(self.model.input_values)
        self.function_values(0.0)
        self.system.F[:, 4] = self.system.F[:, 0]

    @IGNORE_FLOAT_ERRORS
    def function_values(self, t: float) -> Floats:
        """(functions, 4) values of the functions of time and their first three derivatives at t."""
        s = self.system
        self._call(VALUE, t, s.force, s.force, s.force)
        return s.F[1:, :4].copy()

    def set_penalty(self, alpha: float, Omega: float, mu: float) -> None:
        """Numbers of the penalty formulation; Omega in 1/s."""
        self.system.settings[[ALPHA, OMEGA, MU]] = alpha, Omega, mu

    @cached_property
    def functions(self) -> Any:
        """The compiled functions (rhs, project, report, ...) that an integrator takes."""
        last = WATCH if self.switches else ACCEPTED if self.counts_turns else REPORT
        return step_functions(*map(self.coordinates.function, range(last + 1)))

    def integrated(self, u: ArrayLike) -> Floats:
        """The integrated state y of a state u (13 n,) and ``states``, in coordinates of bodies."""
        return y_from_u(np.asarray(u, dtype=float), states=self.states)

    def body_state(self, y: Floats) -> Floats:
        """The state y in coordinates of bodies of one that is integrated."""
        return self.coordinates.body_states(y[None])[0]

    def bodies_of(self, y: Floats) -> Floats:
        """View of the bodies' part (13 n,) of a state y in coordinates of bodies."""
        return bodies_of(y, len(self.states))

    def hold(self, y: Floats) -> Floats:
        """Keep the states of elements of a state y for evaluations; its state u (13 n,).

        y: in coordinates of bodies.
        """
        self.states = y[self.model.integrated_layout["states"]].copy()
        return u_from_y(y[None], len(self.states))[0]

    def body_rows(self, rows: Floats) -> Floats:
        """Reported rows (k, 1 + y + report_size) with y in coordinates of bodies."""
        if self.coordinates.are_of_bodies:
            return rows
        end = rows.shape[1] - self.report_size
        states = self.coordinates.body_states(np.ascontiguousarray(rows[:, 1:end]))
        return np.hstack([rows[:, :1], states, rows[:, end:]])

    def with_inputs(self, rows: Floats, values: Floats | None = None) -> Floats:
        """Reported rows with inputs, (inputs,) or (k, inputs), behind them; by default the present.

        The last numbers of a row of results, which compiled code does not write.
        """
        if not self.model.input_names:
            return rows
        values = self.inputs if values is None else values
        return np.hstack([rows, np.broadcast_to(values, (len(rows), values.shape[-1]))])

    @IGNORE_FLOAT_ERRORS
    def rhs(self, t: float, u: ArrayLike) -> Floats:
        """du/dt (13 n,) at time t in s and state u (13 n,).

        In the order of u: r_dot, p_dot of each body, then r_ddot, omega_dot of each.
        """
        return self.coordinates.u_dot(float(t), np.asarray(u, dtype=float))

    @IGNORE_FLOAT_ERRORS
    def slope(self, t: float, y: Floats) -> Floats:
        """dy/dt at time t and the integrated state y."""
        out = np.zeros_like(y)
        self.functions[RHS](float(t), y, out, self.system, self.loops)
        return out

    @IGNORE_FLOAT_ERRORS
    def switch_values(self, t: float, y: Floats) -> Floats:
        """(switches,) values of the switches at time t and the integrated state y."""
        out = np.zeros(len(self.switches))
        self.functions[WATCH](float(t), y, out, self.system, self.loops)
        return out

    @IGNORE_FLOAT_ERRORS
    def reported(self, t: float, y: Floats) -> Floats:
        """What is reported at time t and the integrated state y, without inputs."""
        out = np.zeros(self.report_size)
        self.functions[REPORT](float(t), y, out, self.system, self.loops)
        return out

    def state_rates(self, t: float, u: ArrayLike) -> Floats:
        """(states,) derivatives of the states of elements at time t, a state u and ``states``."""
        with self.coordinates.at(np.asarray(u, dtype=float)) as y:
            out = self.slope(t, y)
        return out[len(out) - 1 - len(self.states) : -1].copy()

    @IGNORE_FLOAT_ERRORS
    def rates(self, t: float, u: ArrayLike, v_dot: Floats) -> Floats:
        """dy/dt with given accelerations (6 n,): r_ddot, omega_dot of each body."""
        y = self.integrated(u)
        out = self.slope(t, y)
        u_dot = self.bodies_of(out)
        velocities_of(u_dot)[:] = v_dot
        w_dot = split(u_dot)[3]
        w_dot[:] = to_body(split(self.bodies_of(y))[1], w_dot)
        return out

    @IGNORE_FLOAT_ERRORS
    def report(self, t: float, u: ArrayLike) -> Floats:
        """Report of a run at a state, of the size of the model's report layout.

        v_dot, lambda, angles whose turns are counted, potential energy, the largest residuals of
        the three levels, and inputs.
        """
        out = self.coordinates.report(float(t), np.asarray(u, dtype=float))
        return self.with_inputs(out[None])[0]

    @IGNORE_FLOAT_ERRORS
    def applied_forces(self, t: float, u: ArrayLike) -> Floats:
        """Force and moment about the mass centre on each body, (n, 6), those of joints left out."""
        s = self.system
        self.place(t, u)
        s.force[:] = 0.0
        call_kinds(VALUE, WRENCH, float(t), s, self.loops, s.force, s.force, s.force)
        return s.force[6:].reshape(-1, 6).copy()

    @IGNORE_FLOAT_ERRORS
    def rows(self, t: float, u: ArrayLike) -> ConstraintRows:
        """All constraint rows at time t and state u (13 n,)."""
        s = self.system
        self.place(t, u)
        s.residual[:] = 0.0
        self._call(POSITION, t, s.residual, s.residual, s.residual)
        self._call(ACCELERATION, t, s.D, s.gamma, s.nu)
        row, column, place = self.pattern
        shape = (self.model.row_count, 6 * self.model.body_count)
        return ConstraintRows(
            s.residual[s.row], s.nu[s.row], s.gamma[s.row], row, column, s.D[place], shape
        )

    def _weigh_rows(self) -> None:
        """Weights of the rows, of residuals in m; in scenes of ordinary size they stay as they are.

        A row's residual is its length in m times that of its gradient there, of displacements in
        units of the scene's length and rotations in rad, be it an equation of lengths, of their
        squares or of directions.
        """
        model = self.model
        self.system.weight[:] = 1.0
        self.time = model.time(lambda t: self.applied_forces(t, model.u0))
        self._weigh_forces()
        if model.length != 1.0 and model.row_count:
            gradients = scaled_rows(self.rows(0.0, model.u0), model.length)[1]
            good = np.where(np.isfinite(gradients), gradients, 1.0)
            self.system.weight[self.system.row] = model.length / good
        if model.iterated_forces and model.row_count:
            self._weigh_multipliers()

    def _weigh_forces(self) -> None:
        """Put the time of the scene into what contacts measure forces by: their rest is a speed."""
        for q, (kind, group) in enumerate(self.loop_groups):
            if kind == "switch" and group.type_info.type.is_contact:
                layout, p0 = group.type_info.layout, int(self.system.groups[q, 1])
                first = p0 + layout.numbers["unit_mass"][0]
                arm = self.model.length if turns(group) else 1.0  # of a moment
                places = slice(first, p0 + layout.par_width * group.count, layout.par_width)
                self.system.par[places] *= arm * arm / self.time

    def _weigh_multipliers(self) -> None:
        """Weights of multipliers, by which those of least lambda . w lambda are a choice.

        They make forces of them: of rows that turn alone, moments over the size of the parts. So
        neither units, nor axes, nor how a row is scaled matter (formulations/regularised.py).
        """
        model, s = self.model, self.system
        rows = self.rows(0.0, model.u0)
        moves = rows.column % 6 < 3
        moving, turning = (
            np.bincount(rows.row[of], rows.value[of] ** 2, minlength=model.row_count)
            for of in (moves, ~moves)
        )
        turns_alone = moving <= 1e-12 * turning / model.part_size**2
        w = np.where(turns_alone, turning / model.part_size**2, moving)
        last, size = s.friction.size - s.K.size, s.total.size
        s.friction[last - size : last][s.row] = np.where(np.isfinite(w) & (w > 0.0), w, 1.0)
        s.friction[last - 2 * size : last - size][s.row] = arrays.rows_read(model, self.loop_groups)

    @IGNORE_FLOAT_ERRORS
    def place(self, t: float, u: ArrayLike) -> None:
        """Place the bodies of a state u (13 n,) and evaluate the functions of time."""
        s = self.system
        place_state(self.integrated(u), s)
        self._call(VALUE, t, s.force, s.force, s.force)

    def _call(self, kind: int, t: float, out1: Floats, out2: Floats, out3: Floats) -> None:
        s = self.system
        call_kinds(kind, kind, float(t), s, self.loops, out1, out2, out3)

    def blocks(self, rows: ConstraintRows) -> Floats:
        """(block_size,) blocks of D for the elimination program, from rows of ``rows``."""
        D = self.system.D.copy()
        D[self.pattern[2]] = rows.value
        return D

    @cached_property
    def pattern(self) -> tuple[Integers, Integers, Integers]:
        """Row, column and place in D of the Jacobian's entries, in the order of ``rows``."""
        return jacobian_pattern(self.plan, self.system.row)
