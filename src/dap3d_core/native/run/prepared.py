"""A scene made ready to be exported: its run as it begins, in one block of memory."""

import os
from functools import cached_property
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.arrays import step_functions
from dap3d_core.formulations.contacts.decide import decide
from dap3d_core.formulations.contacts.rows import follow_drivers
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.jumps.law import JumpLaw
from dap3d_core.formulations.jumps.rounds import jump
from dap3d_core.integrators import IMPLICIT, Integration
from dap3d_core.integrators.moreau.impulses import put_means
from dap3d_core.integrators.moreau.integration import MoreauIntegration
from dap3d_core.integrators.plugin_integrators import integrator_named
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.compiler.types import FLOAT, INT, Array
from dap3d_core.kernels.compiler.units import Entry, type_of
from dap3d_core.kernels.runtime.array_struct import Arrays
from dap3d_core.kernels.runtime.cache import jit_is_on
from dap3d_core.native.run.image import Image
from dap3d_core.registry import Registry
from dap3d_core.scene import MISSING, Mistake, Scene, SceneError
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.control.held_inputs import HeldInputs
from dap3d_core.simulation.events.contact_jumps import ContactJumps
from dap3d_core.simulation.events.uncarried_contact import UncarriedContact
from dap3d_core.simulation.initial.breakpoints import stops_of
from dap3d_core.simulation.run import Run
from dap3d_core.simulation.run_state import Callbacks, jumps_of
from dap3d_core.simulation.settings import compiled_for, settings_of
from dap3d_core.simulation.stepwise.stepped_run import HORIZON
from dap3d_core.study.batch.compiled_batch import begin_functions, start_constants
from dap3d_core.study.batch.initial_state import begin_free

#: Final time of an exported run where the scene has none, s.
USUAL_END = 1.0


def refusal(what: str, remedy: str = "") -> SceneError:
    """The error that something cannot be exported."""
    return SceneError([Mistake("export", MISSING, what, remedy=remedy)])


def _require_bodies(evaluator: Evaluator, what: str) -> None:
    """Refuse coordinates of joints, in which Python finds what is behind an event."""
    if not evaluator.coordinates.are_of_bodies:
        raise refusal(
            f"{what}, and Python alone brings that into joint coordinates (method joint, which "
            "auto takes for large trees)",
            'set method = "lsq" in [simulation], or export with it (--method lsq)',
        )


@attrs.frozen
class Stop:
    """An instant that no step goes over (simulation/initial/breakpoints.py).

    Attributes:
        t: s.
        jumps: whether a function takes another form there.
        needs: it is one of runs that end later than this, s.
    """

    t: float
    jumps: bool
    needs: float


@attrs.frozen(eq=False)
class Advance:
    """An integration of the run, and the compiled loop that advances it.

    Attributes:
        integration: as it begins.
        entry: the loop.
        arguments: structs and tables that it takes before the budget.
        completes: puts into a row what a report does not know; of the first two arguments.
    """

    integration: Integration
    entry: Entry
    arguments: tuple[Any, ...]
    completes: Entry | None = None

    @classmethod
    def of(cls, integration: Integration) -> "Advance":
        """The loop of an integration."""
        completes = None
        if isinstance(integration, MoreauIntegration):
            integration.make_room()
            means: Any = put_means
            changed = integration.loop_arguments[:2]
            completes = means.compile([*map(type_of, changed), Array(FLOAT, 1)])
        loop: Any = integration.loop
        given = integration.loop_arguments
        return cls(integration, loop.compile([*map(type_of, given), INT]), given, completes)


@attrs.frozen(eq=False)
class JumpCode:
    """The law of jumps (formulations/jumps/rounds.py).

    Attributes:
        entry, arguments: as of ``Advance``, behind the time; the first are its arrays.
    """

    entry: Entry
    arguments: tuple[Any, ...]

    @classmethod
    def of(cls, evaluator: Evaluator) -> "JumpCode":
        """The law of a model.

        Raises:
            SceneError: it cannot be exported.
        """
        _require_bodies(evaluator, "velocities jump")
        law = JumpLaw(evaluator)
        contact = UncarriedContact(evaluator, law)
        if contact.is_bare.any():  # Python sees contact that stays, and ends the run
            switch = evaluator.switches[int(np.argmax(contact.is_bare))]
            raise refusal(
                f"velocities jump at {switch.name(evaluator.model)}, whose type carries nothing "
                "where contact stays: runs of Python alone notice that",
                "give the type a wrench, as ptp_stop and its like have",
            )
        given = law.arguments(law.arrays)
        function: Any = jump
        return cls(function.compile([FLOAT, *map(type_of, given)]), given)


@attrs.frozen(eq=False)
class ContactCode:
    """What contacts do where a mode ends (formulations/contacts/decide.py).

    Attributes:
        entry, arguments: as of ``JumpCode``.
        follows: brings velocities onto drivers, where these read inputs; of the first arguments.
        names: of the contacts.
    """

    entry: Entry
    arguments: tuple[Any, ...]
    follows: Entry | None
    names: tuple[str, ...]

    @classmethod
    def of(cls, evaluator: Evaluator, *, drives: bool) -> "ContactCode":
        """That of a model.

        Raises:
            SceneError: it cannot be exported.
        """
        _require_bodies(evaluator, "contacts change at events")
        jumps = ContactJumps(evaluator)
        table, arrays = jumps.table, jumps.table.arrays(rounds=1)  # decisions ask if there was one
        arrays.jammed = -1
        given = arrays, evaluator.system, evaluator.loops, evaluator.functions, table.tensions
        types = [FLOAT, *map(type_of, given)]
        decides: Any = decide
        follows: Any = follow_drivers
        follow = follows.compile(types[:4]) if drives else None
        return cls(decides.compile(types), given, follow, tuple(table.names))


@attrs.define(eq=False, kw_only=True, slots=False)
class StartArrays(Arrays):
    """What compiled code makes a start of."""

    given: Floats  # (13 n + states,) of the scene: u, and states of elements
    unit: Floats  # (7,) constants of the metric of displacements
    starting: Floats  # arguments of study/batch/initial_state.py


@attrs.frozen(eq=False)
class StartCode:
    """The start of a run as compiled code finds it, for parameters that it depends on.

    Attributes:
        arrays: what it works on.
        functions: those that store references of a start, and that assemble it.
        assembles: it is brought onto the constraints.
        moves: another start may be given; False where Python alone brings it onto the constraints.
    """

    arrays: StartArrays
    functions: Any
    assembles: bool
    moves: bool

    @classmethod
    def of(cls, evaluator: Evaluator, settings: Any) -> "StartCode | None":
        """That of a model; None where Python alone finds its start."""
        model, formulation = evaluator.model, evaluator.formulation
        if formulation.has_own_coordinates or evaluator.has_unknowns:
            return None
        has_contacts = bool(model.contact_count)
        if settings.start == "equilibrium" or settings.hold:
            return None
        if model.iterated_forces and not has_contacts:  # those are found at each start anew
            return None
        if str(settings.correct_metric) != "unit":
            return None
        given = np.concatenate([model.u0, model.initial_states])
        arrays = StartArrays(given=given, **start_constants(evaluator))
        is_corrected = bool(model.joint_row_count and settings.correct)
        assembles = is_corrected and not (formulation.accepts_redundant or has_contacts)
        # pivots beside contacts are not watched (formulations/pivots.py)
        found = step_functions(begin_free) if has_contacts else begin_functions(formulation)
        return cls(arrays, found, assembles, assembles or not is_corrected)


class PreparedRun:
    """A run as it begins: corrected, with its integrations and their memory.

    Attributes:
        compiled, evaluator: the model.
        t_end: s, by default.
        advances: the integration that it begins with; for "auto" the implicit one as well.
        jumps: the law of jumps, or what contacts do at events; None where velocities do not jump.
    """

    def __init__(
        self,
        scene: Scene | str | os.PathLike[str] | CompiledModel,
        *,
        allow_code: bool = False,
        registry: Registry | None = None,
        **settings: Any,
    ) -> None:
        """Prepare the run; settings as of ``simulate``.

        Raises:
            SceneError: as ``compile``; something cannot be exported: its name.
            SimulationError: the run cannot begin.
        """
        if not jit_is_on():
            raise refusal("nothing is compiled where DAP3D_PLAIN is 1", "unset it")
        method, integrator = settings.get("method"), settings.get("integrator")
        if registry is not None and not isinstance(scene, CompiledModel):
            scene = CompiledModel(scene, method=method, allow_code=allow_code, registry=registry)
        compiled = compiled_for(scene, allow_code, method=method, integrator=integrator)
        given = settings.pop("t_end", None)
        if given is not None and not given > 0.0:
            raise refusal(f"t_end = {given:g} leaves no time to run", "give a later end")
        self.t_end = float(given or compiled.scene.simulation.t_end or USUAL_END)
        # three reporting times: the start, where the run is to be reported next, and the end
        chosen = settings_of(compiled, t_end=self.t_end, dt=0.5 * self.t_end, **settings)
        with compiled.borrow_evaluator():
            self.compiled, self.run = compiled, (run := Run(compiled, chosen, Callbacks()))
            run.reports = False
            self.evaluator: Evaluator = compiled.new_evaluator()
            run.evaluator = self.evaluator
            self._take_jumps()
            run.stops = [(stop.t, stop.jumps) for stop in self.stops]
            run.initialise()
            integrations = [run.present]
            run.present.work.stops_when_slow = 0
            if run.present.work.stops_when_stiff:
                options = run.options | {"first_step": None}
                second = IMPLICIT.make(self.evaluator, run.present.y, run.times, **options)
                second.compile()
                integrations.append(second)
        self.advances = [Advance.of(one) for one in integrations]
        #: False where no parameter asks for another start: its code is left out.
        self.may_start_anew = run.singular is None
        #: Arrays and tables besides: of outputs.
        self.more: list[Any] = []

    @cached_property
    def image(self) -> Image:
        """The memory of the run, once all that it needs is known."""
        parts = [part for one in self.advances for part in one.arguments]
        parts += [self.functions, self.evaluator.system, self.evaluator.loops]
        parts += [] if self.jumps is None else [*self.jumps.arguments]
        parts += [] if self.start is None else [self.start.arrays, self.start.functions]
        return Image(self.evaluator.loops, *parts, *self.more)

    @cached_property
    def start(self) -> StartCode | None:
        """How it starts; None where Python alone finds that, or nothing asks for it."""
        settings = self.run.settings
        return StartCode.of(self.evaluator, settings) if self.may_start_anew else None

    @property
    def steps_contacts(self) -> bool:
        """True if steps follow contacts: rates of states are no functions of them then."""
        return self.advances[0].completes is not None

    def _take_jumps(self) -> None:
        self.jumps: JumpCode | ContactCode | None = None
        if integrator_named(self.run.settings.integrator).steps_contacts:
            jumps_of(self.evaluator, self.run.settings)
            return
        if self.evaluator.model.contact_count:
            self.jumps = ContactCode.of(self.evaluator, drives=self.drives)
        elif any(s.jumps for s in self.evaluator.switches):
            self.jumps = JumpCode.of(self.evaluator)

    @property
    def functions(self) -> Any:
        """The table of the formulation's functions."""
        return self.evaluator.functions

    @cached_property
    def stops(self) -> list[Stop]:
        """Break points of functions of time in runs of any length, and instants between them."""
        found: list[Stop] = []
        needs = HORIZON
        for t, jumps in reversed(stops_of(self.compiled.checked, self.evaluator.model, HORIZON)):
            needs = t if jumps else needs
            found.append(Stop(t, jumps, needs))
        return found[::-1]

    @cached_property
    def drives(self) -> bool:
        """True if a joint reads an input."""
        return HeldInputs(self.evaluator).drives

    @property
    def state_names(self) -> list[str]:
        """Names of the components of the integrated state, the work last."""
        return [f"state.{name}" for name in (*self.evaluator.coordinates.names, "work")]
