"""What the checks of a type found: findings in words, outcomes of checks, and the whole report."""

from collections.abc import Mapping
from typing import Any

import attrs

OK, FAILED, LEFT_OUT = "ok", "failed", "not applicable"


@attrs.frozen
class Finding:
    """One formula that is wrong.

    Attributes:
        check: the check that found it.
        variant: values of fields for which the type has this formula; "" where it has no variants.
        kernel: the function it stands in.
        row: its row, counted from 1; 0 where there are no rows.
        words: what is wrong, and what it should be.
        error: by how much, where it is worst.
        tolerance: what was allowed there.
        pose: seed and number of the random pose, time, state of the bodies and fields, by name.
    """

    check: str
    variant: str
    kernel: str
    row: int
    words: str
    error: float = 0.0
    tolerance: float = 0.0
    pose: Mapping[str, Any] = attrs.field(factory=dict)

    def __str__(self) -> str:
        return f"{self.words}{_told(self.pose)}"


@attrs.frozen
class Outcome:
    """What one check of a type, or of one of its variants, came to.

    Attributes:
        check: its name.
        variant: values of fields that make the variant; "" where there are none.
        state: ok, failed, or not applicable.
        words: what was compared; why it is not applicable.
        error: the largest error relative to the size of what is compared; None for yes or no. Of
            derivatives it is the one by complex step.
        differences: the same by differences, away from corners; None where there are none.
        notes: what could not be done, and what was done instead.
        findings: what is wrong, one for each row.
    """

    check: str
    variant: str
    state: str
    words: str
    error: float | None = None
    differences: float | None = None
    notes: tuple[str, ...] = ()
    findings: tuple[Finding, ...] = ()

    @property
    def ok(self) -> bool:
        """Whether nothing is wrong."""
        return self.state != FAILED

    @property
    def title(self) -> str:
        """The check, and the variant where there is one."""
        return f"{self.check} [{self.variant}]" if self.variant else self.check

    def __str__(self) -> str:
        error = "" if self.error is None else f", largest error {self.error:.1e}"
        error += "" if self.differences is None else f" ({self.differences:.1e} by differences)"
        lines = [f"{self.state}: {self.title}: {self.words}{error}"]
        lines += [f"  {note}" for note in self.notes]
        return "\n".join([*lines, *(f"  {finding}" for finding in self.findings)])


@attrs.frozen
class Report:
    """What all checks of a type came to.

    Attributes:
        kind: joint, force or function.
        keyword: of the type.
        title: file and class.
        seed: of the random poses.
        poses: how many of them for each check.
        outcomes: one for each check of each variant.
    """

    kind: str
    keyword: str
    title: str
    seed: int
    poses: int
    outcomes: tuple[Outcome, ...]

    @property
    def ok(self) -> bool:
        """Whether nothing is wrong."""
        return all(outcome.ok for outcome in self.outcomes)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """All that is wrong."""
        return tuple(finding for outcome in self.outcomes for finding in outcome.findings)

    def __str__(self) -> str:
        head = f"{self.kind} {self.keyword} ({self.title}), seed {self.seed}"
        return "\n".join([head, *map(str, self.outcomes)])


def _told(pose: Mapping[str, Any]) -> str:
    """The pose in words, to be put behind a finding."""
    if not pose:
        return ""
    rest = "; ".join(
        f"{name} = {_number(value)}" for name, value in pose.items() if name not in ("seed", "pose")
    )
    return f" (seed {pose['seed']}, {pose['pose']}: {rest})"


def _number(value: Any) -> str:
    if isinstance(value, (tuple, list)):
        return f"({', '.join(map(_number, value))})"
    return f"{value:.6g}" if isinstance(value, float) else str(value)
