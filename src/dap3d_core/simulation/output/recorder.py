"""Records the reports of a run: in memory while they are few, else in a file next to the output."""

import math
import os
import time
from collections.abc import Callable
from pathlib import Path
from typing import TYPE_CHECKING

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Model
from dap3d_core.result import Result, ResultError, ResultWriter, RunMetadata, check_target
from dap3d_core.result.arrays import LARGE, Arrays, arrays_of, joined
from dap3d_core.result.file.atomic_write import check_utf8
from dap3d_core.result.model_summary import summary_of
from dap3d_core.result.open import arrays_in
from dap3d_core.simulation.failure.monitors import CreepMonitor, UnilateralMonitor

if TYPE_CHECKING:
    from dap3d_core.simulation.redundancy.shared_reactions import ShareSpread

#: A run that lasts longer writes its rows to disk as they come, so that it may be killed.
SHORT_SECONDS = 1.0


class ResultRecorder:
    """Keeps the rows of one run.

    Attributes:
        run: the identity that its files carry.
        output: the file that is wanted in the end, or None.
        count: instants reported so far.
        pulling: multipliers that must not be negative, and were.
        spread: what depends on the share of loads that are not unique; None where nothing does.
        creep: friction that should stick and creeps.
    """

    def __init__(
        self,
        model: Model,
        evaluator: Callable[[], Evaluator],
        output: str | os.PathLike[str] | None,
        most: int,
        *,
        force: bool,
        run: str = "",
    ) -> None:
        """Args:
            model: the model of the rows.
            evaluator: returns its evaluator, for quantities that a result computes later.
            output, force: as ``simulate`` has them.
            most: how many rows come at most.
            run: identity of the run that this one continues.

        Raises:
            ResultError: the output cannot be written.
        """
        if output is not None:
            check_utf8("write", output)
        self.run = run or os.urandom(16).hex()
        self.output: Path | None = None if output is None else check_target(output, force)
        self.count = 0
        self._model, self._evaluator, self._most, self._force = model, evaluator, most, force
        self._subject = summary_of(model)
        self._parts: list[Arrays] = []
        self.pulling = UnilateralMonitor(model)
        self.spread: ShareSpread | None = None
        self.creep = CreepMonitor(model, most)
        self._bytes = 0
        self._writer: ResultWriter | None = None
        #: (13 n,) the least and the largest value of each component so far.
        self.low, self.high = (np.full(model.u0.size, x) for x in (np.inf, -np.inf))
        self._began = math.inf  # when the first rows came

    def take(self, rows: Floats, record: Callable[[], RunMetadata]) -> None:
        """Keep what was reported since the last time; record: what is known of the run."""
        self.add(arrays_of(rows, self._subject), record)

    def add(self, arrays: Arrays, record: Callable[[], RunMetadata]) -> None:
        """Array version of ``take``."""
        self._began = min(self._began, time.perf_counter())
        self.count += len(arrays)
        if len(arrays):
            self.low = np.minimum(self.low, np.min(arrays.u, axis=0))
            self.high = np.maximum(self.high, np.max(arrays.u, axis=0))
        self.pulling.update(arrays)
        if self.spread is not None:
            self.spread.update(arrays)
        self.creep.update(arrays)
        self._bytes += 8 * len(arrays) * arrays.width
        large = self._bytes > LARGE
        if self._writer is None:
            self._parts.append(arrays)
            if self.output and (large or time.perf_counter() - self._began > SHORT_SECONDS):
                self.write(record)
        else:
            self._writer.append(arrays)
            if not large:
                self._parts.append(arrays)
        if large and self._writer is not None:
            self._parts.clear()

    def write(self, record: Callable[[], RunMetadata]) -> None:
        """Have all rows in a file from now on."""
        if self._writer is None:
            assert self.output is not None
            about = attrs.evolve(record(), run=self.run)
            self._writer = ResultWriter(
                self.output, self._subject, about, self._most, force=self._force
            )
            for part in self._parts:
                self._writer.append(part)

    @property
    def part(self) -> Path | None:
        """The unfinished file that holds the rows written so far; None where there is none."""
        return None if self._writer is None or not self._writer.count else self._writer.part

    def to_disk(self, record: Callable[[], RunMetadata]) -> None:
        """Wait until all rows are on the disk."""
        self.write(record)
        assert self._writer is not None
        self._writer.to_disk()

    def result(self, record: RunMetadata) -> Result | None:
        """The result of what was kept, whole in the output if there is one; None of nothing."""
        if not self.count:
            if self._writer is not None:
                self._writer.discard()
            return None
        if self._writer is not None:
            self._writer.close()
        result = Result(
            self._subject,
            self._arrays(),
            attrs.evolve(record, run=self.run),
            lambda: (self._model, self._evaluator),
        )
        if self.output is not None:
            try:
                result.save(self.output, force=self._force)
            except ResultError as error:
                if self._writer is None:
                    raise
                words = f"{error}; what was computed is in {self._writer.part}"
                raise ResultError(words) from error
            self._force = True  # it is ours now
        if self._writer is not None:
            self._writer.discard()
        return result

    def _arrays(self) -> Arrays:
        if self._parts:
            return joined(self._parts)
        assert self._writer is not None
        return arrays_in(self._writer.part, self._subject, self.count)
