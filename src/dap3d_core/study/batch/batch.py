"""The points of a study run many at once, as far as they can be; what is left is run by itself."""

import contextlib
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from dap3d_core.result import INFORMATION
from dap3d_core.scene import SceneError
from dap3d_core.simulation import AssemblyError
from dap3d_core.simulation.failure.negative_reactions import Pulling
from dap3d_core.simulation.initial.assemble import ROUNDING, Initial, correction_notes, distance
from dap3d_core.simulation.initial_state import Start
from dap3d_core.study.batch import driver, initial_state
from dap3d_core.study.batch.compiled_batch import Found, Runs
from dap3d_core.study.batch.packs import Packs, packs_for
from dap3d_core.study.batch.parameter_map import NotCopiedError, Places
from dap3d_core.study.batch.rebuild import Modelling

if TYPE_CHECKING:
    from dap3d_core.study.study import Batch, Ensemble

#: The status of a point whose run went to its end (``PointStatus``).
DONE = 1
Floats = NDArray[np.float64]
Integers = NDArray[np.int64]


def together(ensemble: "Ensemble") -> "Together | None":
    """What runs points of an ensemble for this thread; None where the scene as given cannot start.

    Each point is then run by itself, which says what is wrong there.
    """
    settings = ensemble.study.scene.simulation
    compiled = ensemble.compiled
    asked = bool(settings.correct), settings.hold, str(settings.correct_metric)
    try:
        start = compiled.start(*asked)
    except (AssemblyError, SceneError):
        return None
    found = start.redundancy
    if not found.is_plain:
        return None
    if found.rank.redundant and not compiled.machine.formulation.accepts_redundant:
        return None
    return Together(ensemble, start)


class Together:
    """Runs points in one compiled call. For one thread."""

    def __init__(self, ensemble: "Ensemble", start: Start) -> None:
        """Args: whose points; the start of the scene as given."""
        compiled, self._ensemble, self._start = ensemble.compiled, ensemble, start
        machine = compiled.another_machine()
        settings = compiled.scene.simulation
        end = float(ensemble.times[-1])
        self._modelling = Modelling(compiled, machine, ensemble.numbers, end)
        self._runs = Runs(machine, settings, ensemble.times, compiled.pace(end).stops)
        self._size = self._runs.size
        self._pulling = Pulling(compiled.model)
        self._places: Places | None = None
        self._packs: Packs | None = None
        with contextlib.suppress(NotCopiedError):
            places = Places(compiled.checked, machine, ensemble.numbers)
            if not places.moves_start or self._assembles_simply():
                self._places = places
                self._packs = packs_for(ensemble, machine)

    def run(self, values: Floats, batch: "Batch", part: slice, notes: list[str]) -> None:
        """Run points (k, d): the outputs of those that go to their end into a part of a batch."""
        places = np.arange(part.start, part.stop)
        if self._places is not None:
            which, found = self._run_copied(values)
        else:
            which, found = self._run_modelled(values, notes, part.start)
        first = 2 + 19 * self._ensemble.compiled.model.body_count
        good = found.done & (found.numbers[:, driver.LOOSE] == 0.0)
        good &= ~self._pulling.among(found.rows[..., first:])  # these are run alone, and noted
        which, rows = which[good], found.rows[good]
        self._note(found, good, which, notes, part.start)
        batch.status[places[which]] = DONE
        self._keep(values, which, rows, batch, notes, part.start)

    def _run_copied(self, values: Floats) -> tuple[Integers, Found]:
        """Points whose numbers have their places: which were run, and what came of them."""
        assert self._places is not None
        table, fine = self._places.table(values)
        which = np.flatnonzero(fine)
        model, moves = self._ensemble.compiled.model, self._places.moves_start
        if moves:
            y0 = self._places.states(values[which], model.u0)
        else:
            y0 = np.repeat(self._runs.machine.integrated(self._start.u)[None], len(which), axis=0)
        table, places = table[which], self._places.places
        start = driver.CORRECTED if moves and model.row_count else driver.AS_IT_STANDS
        found = self._run_in_packs(table, places, y0, start)
        if self._places.moves:
            found.done[self._places.are_undefined(table, found.y0)] = False
        return which, found

    def _run_in_packs(self, table: Floats, places: Integers, y0: Floats, start: int) -> Found:
        """Runs of points whose numbers have their places; in packs, where that was asked for."""
        if self._packs is None:
            return self._runs.run(table, places, y0, start)
        first = None
        if start == driver.CORRECTED:
            first = self._runs.run(table, places, y0, driver.ALONE)
            y0 = np.where(first.done[:, None], first.y0, y0)
        found = self._packs.run(table, places, y0)
        if first is not None:
            found = found._replace(given=first.given, numbers=first.numbers)
            found.done[:] &= first.done
        rest = np.flatnonzero(~found.done)
        singly = self._runs.run(table[rest], places, found.given[rest], start)
        for all_of_them, of_rest in zip(found, singly, strict=True):
            all_of_them[rest] = of_rest
        return found

    def _run_modelled(self, values: Floats, notes: list[str], first: int) -> tuple[Integers, Found]:
        """Points each of which has a model of its own."""
        which, table, y0 = [], [], []
        for k, point in enumerate(values):
            ready = self._modelling.prepare(point)
            if ready is not None:
                which.append(k)
                table.append(ready.numbers)
                y0.append(ready.y0)
                notes[first + k] = "; ".join(ready.notes)
        places, size = self._modelling.places, self._ensemble.compiled.model.u0.size + 1
        numbers = np.array(table).reshape(-1, len(places))
        states = np.array(y0).reshape(-1, size)
        return np.array(which, dtype=np.int64), self._runs.run(numbers, places, states)

    def _keep(
        self,
        values: Floats,
        which: Integers,
        rows: Floats,
        batch: "Batch",
        notes: list[str],
        first: int,
    ) -> None:
        """The outputs of runs, by their rows (k, nt, width)."""
        reduction, times = self._ensemble.reduction, self._ensemble.times
        for name, of_rows in reduction.reduce(rows, times).items():
            batch.values[name][first + which] = of_rows
        others = [o for o in reduction.outputs if not reduction.of_rows[o.name]]
        if not others:
            return
        machine = self._runs.machine
        for k, of_run in zip(which, rows, strict=True):
            _, model = self._modelling.load(values[k])
            result = reduction.result(model, of_run, lambda: machine)
            why = self._ensemble.keep(first + int(k), result, others, batch)
            notes[first + k] = why or notes[first + k]

    def _note(
        self, found: Found, good: NDArray[np.bool_], which: Integers, notes: list[str], first: int
    ) -> None:
        """Warn of starts that had to be corrected by more than rounding."""
        scene, machine = self._ensemble.compiled.scene, self._runs.machine
        n = machine.model.body_count
        corrected = found.numbers[good, initial_state.C_BEFORE] > ROUNDING * self._size
        those = np.flatnonzero(good)[corrected]
        moved, turned = distance(found.given[those], found.y0[those], n)
        for j, (k, place) in enumerate(zip(those, which[corrected], strict=True)):
            numbers = found.numbers[k].tolist()
            initial = Initial(
                u=machine.model.u0,
                violation=(numbers[initial_state.C_BEFORE], numbers[initial_state.V_BEFORE]),
                residual=(numbers[initial_state.C_AFTER], numbers[initial_state.V_AFTER]),
                passes=int(numbers[initial_state.NEWTON]),
                moved=float(moved[j]),
                turned=float(turned[j]),
            )
            words = correction_notes(initial, machine, scene)
            notes[first + place] = "; ".join(w for w in words if not w.startswith(INFORMATION))

    def _assembles_simply(self) -> bool:
        """Whether compiled code can correct a start: independent rows, the usual metric."""
        compiled = self._ensemble.compiled
        settings, model = compiled.scene.simulation, compiled.model
        if not model.row_count or not settings.correct:
            return not model.row_count
        usual = str(settings.correct_metric) == "unit" and not settings.hold
        return usual and not compiled.machine.formulation.accepts_redundant
