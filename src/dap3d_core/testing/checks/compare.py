"""Comparison of the values of a kernel with reference values, row by row, at many poses."""

from collections.abc import Iterable, Mapping
from typing import Any

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.testing.checks.findings import FAILED, OK, CheckOutcome, Finding
from dap3d_core.testing.samples.random_state import Direction
from dap3d_core.testing.samples.sampled_type import Sample, SampledType

#: Tolerances relative to the largest number compared: a derivative by complex step has the rounding
#: of the formula alone, some 1e-16 times its condition; differences with h = 2e-3 leave about 1e-12
#: of truncation and rounding, far more where functions are steep (see the spread of three steps).
STEP_TOLERANCE, DIFFERENCE_TOLERANCE, EXACT_TOLERANCE = 1e-9, 1e-7, 1e-9


@attrs.frozen
class Wrong:
    """A wrong number: row (from 0), index within the row, actual and expected value."""

    row: int
    index: tuple[int, ...]
    is_: float
    should: float

    @property
    def error(self) -> float:
        """Absolute error."""
        return abs(self.is_ - self.should)

    @property
    def n(self) -> int:
        """The row, counted from 1."""
        return self.row + 1

    @property
    def axis(self) -> str:
        """The axis of a component of a vector."""
        return "xyz"[self.index[-1]]

    @property
    def part(self) -> str:
        """The part of a wrench."""
        return "moment" if self.index[0] else "force"


@attrs.define
class Comparison:
    """One check of a type, compared pose by pose.

    Attributes:
        check: its name.
        subject: the type or variant.
        kernel: the function to blame for a wrong number.
        words: the quantities compared, for users.
    """

    check: str
    subject: SampledType
    kernel: str
    words: str
    notes: dict[str, None] = attrs.field(factory=dict)
    largest: float | None = None
    differences: float | None = None
    _worst: dict[Any, tuple[float, Finding]] = attrs.field(factory=dict)

    def compare(
        self,
        sample: Sample,
        got: Floats,
        want: Any,
        says: str,
        *,
        tolerance: float = EXACT_TOLERANCE,
        words: Mapping[str, Any] | None = None,
        bound: Any = None,
        scale: float = 0.0,
        rows: Iterable[int] | None = None,
    ) -> None:
        """Compare two arrays, the rows first.

        Args:
            sample: the element and its state.
            got, want: (rows, ...) actual and expected values.
            says: the text of a finding: a format of ``x``, the ``Wrong`` number, and of ``words``.
            tolerance: relative to 1 + the largest number of both.
            bound: (rows, ...) error bound of ``want``, where it is found by differences.
            scale: size of the terms, where the compared numbers are differences of larger ones.
            rows: the rows of the kernel.
        """
        got, want = np.asarray(got, dtype=float), np.broadcast_to(want, got.shape)
        if not got.size:
            return
        numbers = list(range(len(got))) if rows is None else list(rows)
        size = 1.0 + max(scale, np.max(np.abs(want), initial=0.0), np.max(np.abs(got), initial=0.0))
        excess = np.abs(got - want) / size
        if bound is None:
            self.largest = max(self.largest or 0.0, float(np.max(excess)))
        else:
            spread = np.broadcast_to(bound, got.shape) / size
            smooth = excess[spread < tolerance]
            self.differences = max(self.differences or 0.0, float(np.max(smooth, initial=0.0)))
            excess = excess - spread
        for k, row in enumerate(numbers):
            index = np.unravel_index(np.argmax(excess[k]), excess[k].shape)
            error = float(excess[k][index])
            if not np.isfinite(error):
                continue
            actual, expected = float(got[k][index]), float(want[k][index])
            wrong = Wrong(row, tuple(map(int, index)), actual, expected)
            if error > tolerance and error > self._worst.get((self.kernel, row), (0.0, None))[0]:
                text = says.format(x=wrong, **words or {})
                finding = self._finding(row + 1, text, sample, wrong.error, tolerance * size)
                self._worst[self.kernel, row] = error, finding

    def fail(self, words: str, sample: Sample | None = None, row: int = 0) -> None:
        """Add a finding without a size."""
        self._worst.setdefault(words, (0.0, self._finding(row, words, sample, 0.0, 0.0)))

    def note(self, words: str) -> None:
        """Add a note, once."""
        self.notes[words] = None

    def outcome(self, *, sized: bool = True) -> CheckOutcome:
        """The outcome of the check."""
        findings = tuple(finding for _, finding in self._worst.values())
        error, state = self.largest if sized else None, FAILED if findings else OK
        variant, notes = self.subject.variant, tuple(self.notes)
        return CheckOutcome(
            self.check, variant, state, self.words, error, self.differences, notes, findings
        )

    def _finding(
        self, row: int, words: str, sample: Sample | None, error: float, tolerance: float
    ) -> Finding:
        pose = {} if sample is None else sample.pose()
        return Finding(
            self.check, self.subject.variant, self.kernel, row, words, error, tolerance, pose
        )


@attrs.frozen(eq=False)
class Rate:
    """A derivative: values, error bound (None by complex step), tolerance and method."""

    value: Floats
    bound: Floats | None
    tolerance: float
    way: str


def rates(sample: Sample, name: str, along: Direction, comparison: Comparison) -> list[Rate]:
    """The derivative of a kernel along a direction: by complex step and by differences.

    Of a kernel that does not take complex numbers, by differences alone, with a note.
    """
    derivatives = []
    try:
        slope = sample.slope(name, along)
        derivatives.append(Rate(slope, None, STEP_TOLERANCE, "complex step"))
    except Exception as error:
        comparison.note(
            f"{name} does not run on complex numbers ({type(error).__name__}: {error}), so its "
            "derivatives are differences alone; take the functions of dap3d_core.kernels"
        )
    value, bound = sample.difference(name, along)
    derivatives.append(Rate(value, bound, DIFFERENCE_TOLERANCE, "differences"))
    return derivatives


def body_words(sample: Sample, slot: int, component: int) -> str:
    """A direction of motion of a body: "the position of body i along x"."""
    letter = sample.kernels.type_info.layout.slots[slot]
    axis = "xyz"[component % 3]
    if component < 3:
        return f"the position of body {letter} along {axis}"
    return f"a turn of body {letter} about {axis}"
