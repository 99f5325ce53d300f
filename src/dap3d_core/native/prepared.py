"""A scene made ready to be exported: its run as it begins, in one block of memory."""

import os
from collections.abc import Iterable, Sequence
from functools import cached_property
from itertools import pairwise
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.integrators import IMPLICIT, Integration
from dap3d_core.integrators.adams.integration import AdamsIntegration
from dap3d_core.integrators.adams.step import advance_adams
from dap3d_core.integrators.radau.integration import RadauIntegration
from dap3d_core.integrators.radau.step import advance as advance_radau
from dap3d_core.integrators.runge_kutta.integration import RungeKutta
from dap3d_core.integrators.runge_kutta.step import advance
from dap3d_core.integrators.stepping import integration_state as at
from dap3d_core.kernels.compiler.types import INT
from dap3d_core.kernels.compiler.units import Entry, type_of
from dap3d_core.kernels.runtime.cache import jit_is_on
from dap3d_core.model.knots import breaks_of
from dap3d_core.native.image import Image
from dap3d_core.registry import Registry
from dap3d_core.scene import MISSING, Mistake, Scene, SceneError
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.control.held_inputs import HeldInputs
from dap3d_core.simulation.errors import refuse_contacts
from dap3d_core.simulation.initial.breakpoints import SEEN
from dap3d_core.simulation.run_state import Callbacks
from dap3d_core.simulation.settings import compiled_for, settings_of
from dap3d_core.simulation.stepwise.stepped_run import HORIZON, OpenRun

#: Final time of an exported run where the scene has none, s.
USUAL_END = 1.0


def refusal(what: str, remedy: str = "") -> SceneError:
    """The error that something cannot be exported."""
    return SceneError([Mistake("export", MISSING, what, remedy=remedy)])


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
    """

    integration: Integration
    entry: Entry
    arguments: tuple[Any, ...]

    @classmethod
    def of(cls, integration: Integration) -> "Advance":
        """The loop of an integration.

        Raises:
            SceneError: its integrator cannot be exported.
        """
        function: Any = {RungeKutta: advance, AdamsIntegration: advance_adams}.get(
            type(integration)
        )
        given: tuple[Any, ...] = (integration.work, *integration._arguments)
        if isinstance(integration, RadauIntegration):
            function, given = advance_radau, integration.loop_arguments
        elif function is None:
            raise refusal(f"integrator {integration.name} cannot be exported")
        return cls(integration, function.compile([*map(type_of, given), INT]), given)


class PreparedRun:
    """A run as it begins: corrected, with its integrations and their memory.

    Attributes:
        compiled, evaluator: the model.
        t_end: s, by default.
        advances: the integration that it begins with; for "auto" the implicit one as well.
        image: their memory.
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
        compiled = compiled_for(scene, method, allow_code, None, integrator)
        given = settings.pop("t_end", None)
        if given is not None and not given > 0.0:
            raise refusal(f"t_end = {given:g} leaves no time to run", "give a later end")
        self.t_end = float(given or compiled.scene.simulation.t_end or USUAL_END)
        # three reporting times: the start, where the run is to be reported next, and the end
        chosen = settings_of(compiled, t_end=self.t_end, dt=0.5 * self.t_end, **settings)
        with compiled.borrow_evaluator():
            run = OpenRun(compiled, chosen, Callbacks())
            self.compiled, self.run = compiled, run
            self.evaluator: Evaluator = compiled.new_evaluator()
            run.evaluator = self.evaluator
            self._refuse_jumps()
            run.initialise()
            integrations = [run.present]
            if run.present.work.stops_when_stiff:
                options = run.options | {"first_step": None}
                second = IMPLICIT.make(self.evaluator, run.present.y, run.times, **options)
                second.compile()
                integrations.append(second)
        self.advances = [Advance.of(one) for one in integrations]
        parts = (part for one in self.advances for part in one.arguments)
        self.image = Image(self.evaluator.loops, *parts)

    def _refuse_jumps(self) -> None:
        refuse_contacts(self.evaluator.model, "export")
        switches = [s for s in self.evaluator.switches if s.jumps]
        if switches:
            types = sorted({str(s.group.type_info.type.keyword) for s in switches})
            raise refusal(
                f"velocities jump at elements of type {', '.join(types)}: that is not exported yet",
                "model the contact by a force, such as a stiff spring with a damper",
            )

    @property
    def functions(self) -> Any:
        """The table of the formulation's functions."""
        return self.evaluator.functions

    @cached_property
    def stops(self) -> list[Stop]:
        """Break points of functions of time in runs of any length, and instants between them."""
        checked, model = self.compiled.checked, self.evaluator.model
        used = {int(k) for group in model.functions for k in group.members}
        breaks = sorted({
            float(t) for k in used for t in breaks_of(checked.functions[k]) if 0.0 < t < HORIZON
        })  # fmt: skip
        between = [Stop(a + part * (b - a), False, b) for a, b in pairwise(breaks) for part in SEEN]
        found = [*(Stop(t, True, t) for t in breaks), *between]
        return sorted(found, key=lambda stop: (stop.t, stop.jumps))

    @cached_property
    def drives(self) -> bool:
        """True if a joint reads an input."""
        return HeldInputs(self.evaluator).drives

    @property
    def state_names(self) -> list[str]:
        """Names of the components of the integrated state, the work last."""
        evaluator, model = self.evaluator, self.evaluator.model
        size = len(self.run.present.work.state[at.Y]) - 1
        if evaluator.formulation.has_own_coordinates:
            return [*(f"state.{k + 1}" for k in range(size)), "state.work"]
        axes = ("x", "y", "z")
        poses = [*(f"r.{a}" for a in axes), *(f"p.e{k}" for k in range(4))]
        rates = [*(f"rd.{a}" for a in axes), *(f"wp.{a}" for a in axes)]
        names = [
            f"state.{b}.{q}" for part in (poses, rates) for b in model.body_names for q in part
        ]
        own = [f"state.{label}" for s in model.element_states for label in s.labels]
        return [*names, *own, "state.work"]

    def constants(self) -> "Iterable[tuple[str, Any, Any]]":
        """Names, arrays and flat indices of what nothing changes in the course of a run."""
        from dap3d_core.formulations.programs.symbolic_arrays import constants

        arrays = dict(self.evaluator.system.walk())
        for name, places in constants(self.evaluator):
            yield name, arrays[name], places
        for k, one in enumerate(self.advances):
            work = one.integration.work
            for name in ("real", "integer", "state", "switches", "tolerance"):
                array = getattr(work, name)
                yield f"{k}.{name}", array, np.arange(array.size)


def tunable_words(
    prepared: PreparedRun, others: Sequence[tuple[float, PreparedRun]], value: float
) -> dict[int, float] | None:
    """Words of the memory that are a parameter, each with its sign; None where more depends on it.

    Args:
        prepared: of the scene as it is.
        others: the same with other values of the parameter.
        value: of the parameter in the scene.
    """
    found: dict[int, float] = {}
    rows = zip(prepared.constants(), *(other.constants() for _, other in others), strict=True)
    for (_, array, places), *changed in rows:
        mine = array.reshape(-1)[places]
        theirs = [a.reshape(-1)[p] for _, a, p in changed]
        if any(len(one) != len(mine) for one in theirs):
            return None
        moved = np.zeros(len(mine), dtype=bool)
        for one in theirs:
            moved |= (one != mine) & ~((one != one) & (mine != mine))
        for k in np.flatnonzero(moved).tolist():
            sign = next((s for s in (1.0, -1.0) if mine[k] == s * value), 0.0)
            if not sign or array.dtype != np.float64:
                return None
            if any(a[k] != sign * x for a, (x, _) in zip(theirs, others, strict=True)):
                return None
            found[prepared.image.at(array) + int(places[k])] = sign
    return found or None
