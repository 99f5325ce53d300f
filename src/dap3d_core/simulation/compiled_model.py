"""A scene made ready to run: checked, modelled, with its method chosen and its kernels compiled."""

import logging
import os
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager, contextmanager, nullcontext, suppress
from functools import cache, cached_property
from pathlib import Path
from typing import TYPE_CHECKING, Any, NoReturn, Self

import attrs
import numpy as np
from numpy.typing import ArrayLike, NDArray

from dap3d_core.formulations import FORMULATIONS
from dap3d_core.formulations.coordinates import UnsuitableError
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.cache import cache_notes
from dap3d_core.model import Model, ModelError, build_model
from dap3d_core.registry import Registry, load_registry
from dap3d_core.registry.arguments import checked
from dap3d_core.result import information
from dap3d_core.scene import (
    Scene,
    SceneError,
    ValidatedScene,
    check,
    check_simulation,
    load,
    mistake_at,
)
from dap3d_core.simulation.errors import AssemblyError, SimulationError
from dap3d_core.simulation.explain import (
    MANY_BODIES,
    choose_method,
    explain,
    takes_joint_coordinates,
)
from dap3d_core.simulation.failure.diagnosis import find_offender
from dap3d_core.simulation.failure.narrow_forces import notes_on_drivers, notes_on_laws
from dap3d_core.simulation.initial.breakpoints import Breakpoints
from dap3d_core.simulation.initial.conservative import is_conservative
from dap3d_core.simulation.initial.given_state import state_of, time_of
from dap3d_core.simulation.initial.undefined_directions import undefined_directions
from dap3d_core.simulation.initial_state import InitialState, find_start
from dap3d_core.simulation.output.type_sources import types_of
from dap3d_core.simulation.redundancy.redundancy import Redundancy, redundancy_of

if TYPE_CHECKING:
    from dap3d_core.simulation.initial.start_state import StartState

Announce = Callable[[str], None]
#: Options of a start: whether it is corrected, what is held, the metric.
StartOptions = tuple[bool, tuple[str, ...], str]

#: Joints whose lines in the file a message gives.
MOST_PLACES = 10


@cache
def log_first_compilation() -> None:
    """Tell a script, once in a process, that kernels are compiled, which takes a while.

    It is a warning of the logger "dap3d", which Python shows on stderr unless configured otherwise:
    ``logging.getLogger("dap3d").setLevel("ERROR")``. With ``announce`` it is reported there alone.
    """
    logging.getLogger("dap3d").warning("compiling for the first time; this happens once")


class _Evaluators(threading.local):
    """The evaluators of one thread.

    Attributes:
        stack: the last one is what the thread works with.
        running: whether it is in the middle of a run.
    """

    def __init__(self) -> None:
        self.stack: list[Evaluator] = []
        self.running = False


class CompiledModel:
    """A frozen model that can be evaluated and explained, as ``compile`` returns it.

    Threads may use one at once: each has arrays of its own to work on. So may a callback of a run,
    which may run the model again.

    Attributes:
        scene: a copy of the scene, as it was when it was compiled.
        checked: the scene after its check.
        model: arrays, groups, row and column pointers (irc, iru, irv).
        method: name of the formulation, a key of ``FORMULATIONS``.
        reason: why this formulation.
        notes: what was changed or assumed.
        compile_time: seconds that checking, modelling and compiling took.
    """

    _of_bodies: "CompiledModel | None" = None

    def __init__(
        self,
        scene: Scene | str | os.PathLike[str],
        *,
        method: str | None = None,
        allow_code: bool = False,
        registry: Registry | None = None,
        announce: Announce | None = None,
        joint: bool | None = None,
        like: "CompiledModel | None" = None,
    ) -> None:
        """Check a scene, build its model, compile what it needs; arguments as for ``compile``.

        joint: whether ``auto`` may choose it; by default where the scene's integrator takes it.
        like: one of the same structure and method, whose loops are taken; else a ValueError.
        """
        started = time.perf_counter()
        if isinstance(scene, Scene):
            scene = scene.copy()  # whoever has it may change it
        else:
            scene = load(Path(scene) if isinstance(scene, os.PathLike) else scene)
        announce = announce or (lambda kernel: log_first_compilation())
        registry = registry or load_registry()
        self.scene: Scene = scene
        self.checked: ValidatedScene = check(scene, registry, allow_code=allow_code)
        self.model: Model = _modelled(self.checked)
        if method is not None:
            settings = attrs.evolve(scene.simulation, method=method)
            check_simulation(settings, self.model.body_names)
        #: The requested method, perhaps "auto".
        self.requested_method = requested = method or str(scene.simulation.method)
        self._like = like
        usual = takes_joint_coordinates(str(scene.simulation.integrator))
        usual = usual and self.model.collisions is None
        self._may_choose_joint = usual if joint is None else joint
        self._breakpoints: dict[float, Breakpoints] = {}
        self._starts: dict[StartOptions, InitialState] = {}
        #: Equilibria that runs start at, by the options of ``start``; each is found once.
        self.rest_states: dict[StartOptions, StartState] = {}
        self._own = _Evaluators()
        self._take_method(requested, announce)
        self.evaluator.formulation = FORMULATIONS[self.method]
        _ = self.evaluator.functions  # compiled here, and not on the clock of the first run
        self.notes: list[str] = [
            *self.checked.notes,
            *self.model.notes,
            *notes_on_drivers(self.checked),
            *notes_on_laws(self.checked),
            *(information(f"{note}") for note in self.evaluator.coordinates.notes),
            *(information(f"{note}") for note in cache_notes()),
        ]
        self._redundancy: Redundancy | None = None
        self._check_expressions()
        self.compile_time = time.perf_counter() - started

    def _check_expressions(self) -> None:
        """SceneError for expressions that no result of the scene would have."""
        if self.scene.outputs or self.model.active:
            from dap3d_core.simulation.output.check_outputs import check_active, check_outputs

            check_outputs(self.scene, self.scene_text, self.evaluator)
            check_active(self.scene, self.scene_text, self.evaluator)

    def _take_method(self, requested: str, announce: Announce) -> None:
        """Set the method and its reason, with the evaluator and the start that led to them."""
        self._first_method = self.method = choose_method(self.model, requested)[0]
        if (tree := self._tree_of_many_bodies(announce)) is not None:
            evaluator, self._starts[self._usual_start] = tree
            self._first_method = self.method = "joint"
            self.reason = f"the joints of its {self.model.body_count} bodies are a tree"
            self._own.stack.append(evaluator)
        else:
            self._own.stack.append(self.new_evaluator(announce, self.method))
            self.method, self.reason = self.select_method(requested)

    @property
    def evaluator(self) -> Evaluator:
        """Evaluator of the model for the calling thread, made at its first use."""
        stack = self._own.stack
        if not stack:
            stack.append(self.new_evaluator())
        return stack[-1]

    @contextmanager
    def borrow_evaluator(self) -> Iterator[Evaluator]:
        """An evaluator for a run: this thread's or, in a callback of a run that has it, another."""
        own = self._own
        if own.running:
            own.stack.append(self.new_evaluator())
            try:
                yield own.stack[-1]
            finally:
                own.stack.pop()
            return
        own.running = True
        try:
            yield self.evaluator
        finally:
            own.running = False

    def new_evaluator(
        self, announce: Announce | None = None, method: str | None = None
    ) -> Evaluator:
        """An evaluator of the model with arrays of its own, for whoever changes its numbers."""
        first = method or self._first_method
        try:
            like = None if self._like is None else self._like.evaluator
            evaluator = Evaluator(self.model, first, announce, like)
        except UnsuitableError as error:
            raise SimulationError(f"method {first} does not fit the scene: {error}") from error
        self.model = evaluator.model  # with the motions of its joints
        evaluator.formulation = FORMULATIONS[method or self.method]
        settings = self.scene.simulation
        evaluator.set_penalty(settings.alpha, settings.Omega, settings.mu)
        return evaluator

    def __copy__(self) -> Self:
        """Itself: nothing of it changes."""
        return self

    def __deepcopy__(self, memo: Any) -> Self:
        """Itself: nothing of it changes."""
        return self

    def __reduce__(self) -> NoReturn:
        raise TypeError(
            "a compiled model stays in its process, because compiled code does: send the scene to "
            "the other process, and compile it there"
        )

    @property
    def irc(self) -> NDArray[np.int64]:
        """(n,) index in u of the first coordinate of each body; iru and irv as in ``Model``."""
        return self.model.irc

    @property
    def iru(self) -> NDArray[np.int64]:
        """(n,) index in u of the first velocity of each body."""
        return self.model.iru

    @property
    def irv(self) -> NDArray[np.int64]:
        """(n,) index in v_dot, column in the Jacobian, of the first acceleration of each body."""
        return self.model.irv

    @cached_property
    def is_conservative(self) -> bool:
        """True if potentials account for all work that can be done in the scene."""
        return is_conservative(self.evaluator, self.model.u0)

    @cached_property
    def types(self) -> dict[str, dict[str, str]]:
        """Sources of the scene's types (type_sources.py), for the metadata of its results."""
        return types_of(self.checked)

    @cached_property
    def scene_text(self) -> str:
        """The scene as the text of a scene file, for the record of its results."""
        return self.scene.to_toml()

    def rhs(self, t: float, u: ArrayLike) -> Floats:
        """du/dt (13 n,) at time t in s and state u (13 n,).

        In the order of u: r_dot, p_dot of each body, then r_ddot, omega_dot of each. Where forces
        or joints have s states of their own, u and its rates have them as well, last: (13 n + s,).

        Raises:
            ValueError: u is not 13 n (+ s) finite numbers, t is not one, or Euler parameters are
                zero.
            SimulationError: the rates are not finite; names the body, force or joint.
        """
        evaluator, model = self.evaluator, self.model
        t, state = time_of(t), state_of(u, model.body_names, model.state_count)
        state, own = np.split(state, [len(state) - model.state_count])
        evaluator.states = own
        rates = evaluator.rhs(t, state)
        if model.state_count:
            rates = np.concatenate([rates, evaluator.state_rates(t, state)])
        if not np.all(np.isfinite(rates)):
            found = find_offender(evaluator, t, evaluator.integrated(state), t)
            raise SimulationError(f"the rates are not finite: {found or f't = {t:.9g} s'}")
        return rates

    def redundancy(self, u: ArrayLike | None = None) -> Redundancy:
        """Rank of the constraints at a state u (13 n,), or as given; see ``Redundancy``.

        Raises:
            ValueError: as ``rhs``.
        """
        state = self.model.u0 if u is None else state_of(u, self.model.body_names)
        for start in self._starts.values():
            if np.array_equal(start.u, state):
                return start.redundancy
        if u is not None:
            return redundancy_of(self.evaluator, state)
        if self._redundancy is None:
            self._redundancy = redundancy_of(self.evaluator, state)
        return self._redundancy

    def breakpoints(self, t_end: float) -> Breakpoints:
        """Break points of functions of time in a run from 0 to t_end, computed once."""
        if t_end not in self._breakpoints:
            self._breakpoints[t_end] = Breakpoints(self.checked, self.evaluator, t_end)
        return self._breakpoints[t_end]

    def start(
        self,
        correct: bool,
        hold: tuple[str, ...],
        metric: str = "unit",
        state: "StartState | None" = None,
    ) -> InitialState:
        """Initial state of a run; that of the scene is computed once. As ``find_start``.

        Raises:
            SceneError: a direction that an element needs is undefined there.
            AssemblyError: as ``find_start``.
        """
        key = correct, tuple(hold), metric
        self.evaluator.set_inputs(self.model.input_values)
        if state is not None:
            return self._find_start(self.evaluator, key, state)
        if key not in self._starts:
            self._starts[key] = self._find_start(self.evaluator, key)
        return self._starts[key]

    def _find_start(
        self, evaluator: Evaluator, key: StartOptions, state: "StartState | None" = None
    ) -> InitialState:
        """As ``start``, with an evaluator."""
        active: AbstractContextManager[object] = nullcontext()
        if self.model.active:
            from dap3d_core.simulation.output.check_outputs import only_active

            u = self.model.u0 if state is None else state.u
            active = only_active(self.scene_text, evaluator, u)
        try:
            with active:
                start = find_start(evaluator, *key, state)
        except AssemblyError as error:
            raise self._located(error) from error
        mistakes = undefined_directions(self.scene, self.model, start.u, self.model.size)
        if mistakes:
            raise SceneError(mistakes)
        return start

    def _located(self, error: AssemblyError) -> AssemblyError:
        """The same error with the file and the lines of the joints that are open."""
        found = [
            mistake_at(self.scene, ("joints", name), "") for name in error.joints[:MOST_PLACES]
        ]
        places = [f"{m.file}:{m.line}: {m.key}" for m in found if m.line is not None]
        return AssemblyError("\n".join([str(error), *places]), error.joints)

    def select_method(self, requested: str) -> tuple[str, str]:
        """The formulation that a run takes for a requested method, and the reason in words.

        Raises:
            SimulationError: the requested method does not fit the scene.
        """
        method, reason = choose_method(self.model, requested)
        model = self.model
        if requested != "auto" or not model.row_count or model.contact_count or model.breaks:
            return method, reason
        start = self._start_of_scene()
        if start is None:
            return method, reason
        rank = start.redundancy.rank
        if rank.redundant:
            fits = (f.name for f in FORMULATIONS.values() if f.accepts_redundant and f.is_exact)
            verb = "is" if rank.redundant == 1 else "are"
            return next(fits), f"{rank.redundant} of {rank.rows} rows {verb} redundant"
        return method, f"{reason}, and their rows are independent"

    @property
    def _usual_start(self) -> StartOptions:
        """The options of ``start`` for a run with the scene's own settings."""
        settings = self.scene.simulation
        return settings.correct, tuple(settings.hold), str(settings.correct_metric)

    def _start_of_scene(self) -> InitialState | None:
        """The initial state of a run; None where it cannot be assembled, which the run reports."""
        try:
            return self.start(*self._usual_start)
        except AssemblyError:
            return None

    def _tree_of_many_bodies(self, announce: Announce) -> tuple[Evaluator, InitialState] | None:
        """Evaluator and start in joint coordinates, where ``auto`` takes these: in large trees.

        In them a tree has no singular poses. Forces that depend on multipliers cost more there.
        """
        count, joints = self.model.body_count, len(self.model.joint_names)
        is_open = self.requested_method == "auto" and self._may_choose_joint
        is_open = is_open and not (self.model.iterated_forces or self.model.breaks)
        if not is_open or not MANY_BODIES <= count >= joints > 0:
            return None
        with suppress(SimulationError):  # too many rows to keep, or no start
            evaluator = self.new_evaluator(announce, "joint")
            if not evaluator.length_count:  # no rows are kept
                evaluator.set_inputs(self.model.input_values)
                start = self._find_start(evaluator, self._usual_start)
                if start.redundancy.singular is None:
                    return evaluator, start
        return None

    @cached_property
    def joint_cost(self) -> float | None:
        """Estimate of the time of a right-hand side by method joint, over that of the usual one.

        None where forces depend on multipliers: method joint takes longer then.
        """
        from dap3d_core.formulations.joint.coordinates import cost_over_standard

        if self.model.iterated_forces:
            return None
        return cost_over_standard(self.model, self.evaluator.plan)

    def for_integrator(self, integrator: str) -> "CompiledModel":
        """This model, or one of body coordinates where ``auto`` chose others it does not take."""
        is_chosen = self.requested_method == "auto" and self.method == "joint"
        if not is_chosen or takes_joint_coordinates(integrator):
            return self
        if self._of_bodies is None:
            registry = self.checked.registry
            self._of_bodies = CompiledModel(
                self.scene, method="auto", registry=registry, joint=False
            )
        return self._of_bodies

    def explain(self) -> str:
        """Text on what is modelled, what is left out and why, and why the method was chosen.

        The rank is that where a run would start, or as given where that cannot be assembled.
        """
        u, start = self.model.u0, self._start_of_scene()
        if start is None:
            redundancy = self.redundancy()
        else:
            u, redundancy = start.u, start.redundancy
        is_left_out = self.requested_method == "auto" and self.method != "joint"
        cost = self.joint_cost if is_left_out and self.model.row_count else None
        method = f"{self.method}, because {self.reason}"
        return explain(self.checked, self.evaluator, method, cost, u, redundancy)


def _modelled(checked: ValidatedScene) -> Model:
    try:
        return build_model(checked)
    except ModelError as error:
        scene = checked.scene
        # contacts are elements of the kind of joints, rigid stops and friction among the forces
        tables = {name: table for table in ("forces", "contacts", "joints")
                  for name in getattr(scene, table)}  # fmt: skip
        found = [
            mistake_at(
                scene, (f"{k}s" if k != "joint" else tables.get(name, "joints"), name), words
            )
            for k, name, words in error.faults
        ]
        raise SceneError(sorted(found, key=lambda m: m.line or 0)) from error


@checked
def compile_scene(
    scene: Scene | str | os.PathLike[str],
    *,
    method: str | None = None,
    allow_code: bool = False,
    registry: Registry | None = None,
    announce: Announce | None = None,
) -> CompiledModel:
    """Check a scene, build its model and compile the kernels it needs.

    Args:
        scene: a Scene, or what ``load`` takes: the name of a shipped model, a folder, a TOML file.
        method: formulation; the scene's own choice when left out.
        allow_code: whether the model's own types (plugin.py in its folder) may be loaded.
        registry: where types come from; by default the installed plugins.
        announce: called with the name of each kernel that has to be compiled anew; by default the
            first one is a warning of the logger "dap3d".

    Raises:
        SceneError: the scene has mistakes; all of them are in the message.
        PluginError: a type that the scene uses cannot be loaded.
        SimulationError: the method does not fit the scene.
    """
    return CompiledModel(
        scene, method=method, allow_code=allow_code, registry=registry, announce=announce
    )
