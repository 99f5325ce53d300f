"""Findings, outcomes of checks and the report of a type."""

from collections.abc import Mapping
from typing import Any

import attrs

from dap3d_core.assembly.motion.joint_motion import Part

OK, FAILED, LEFT_OUT = "ok", "failed", "not applicable"


@attrs.frozen
class Finding:
    """A wrong formula.

    Attributes:
        check: the check.
        variant: values of fields for which the type has this formula; "" where it has no variants.
        kernel: the function.
        row: its row, counted from 1; 0 where there are no rows.
        words: the error and the expected value, for users.
        error: the largest error.
        tolerance: the tolerance there.
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
        return f"{self.words}{_pose_text(self.pose)}"


@attrs.frozen
class CheckOutcome:
    """The outcome of one check of a type, or of one of its variants.

    Attributes:
        check: its name.
        variant: values of fields of the variant; "" where there are none.
        state: ok, failed, or not applicable.
        words: the quantities compared, or the reason why the check does not apply.
        error: the largest relative error; None for yes or no. Of derivatives it is the one by
            complex step.
        differences: the same by differences, away from corners; None where there are none.
        notes: limitations of the check.
        findings: wrong formulas, one for each row.
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
        """True if there are no findings."""
        return self.state != FAILED

    @property
    def title(self) -> str:
        """The check, with the variant if any."""
        return f"{self.check} [{self.variant}]" if self.variant else self.check

    def __str__(self) -> str:
        error = "" if self.error is None else f", largest error {self.error:.1e}"
        error += "" if self.differences is None else f" ({self.differences:.1e} by differences)"
        lines = [f"{self.state}: {self.title}: {self.words}{error}"]
        lines += [f"  {note}" for note in self.notes]
        return "\n".join([*lines, *(f"  {finding}" for finding in self.findings)])


@attrs.frozen
class TypeMotion:
    """The motion that a joint type, or a variant of it, leaves free.

    Attributes:
        variant: values of fields of the variant; "" where there are none.
        words: the motion; or "refused", with the reason why it is not about constant axes.
        parts: its elementary motions; None where it is refused.
    """

    variant: str
    words: str
    parts: tuple[Part, ...] | None

    def __str__(self) -> str:
        title = f"motion [{self.variant}]" if self.variant else "motion"
        return f"{title}: {self.words}"


@attrs.frozen
class Report:
    """The outcomes of all checks of a type.

    Attributes:
        kind: joint, force or function.
        keyword: of the type.
        title: file and class.
        seed: of the random poses.
        poses: number of random poses for each check.
        outcomes: one for each check of each variant.
        motions: of a joint, the motion that each variant leaves free.
    """

    kind: str
    keyword: str
    title: str
    seed: int
    poses: int
    outcomes: tuple[CheckOutcome, ...]
    motions: tuple[TypeMotion, ...] = ()

    @property
    def ok(self) -> bool:
        """True if there are no findings."""
        return all(outcome.ok for outcome in self.outcomes)

    @property
    def findings(self) -> tuple[Finding, ...]:
        """The findings of all checks."""
        return tuple(finding for outcome in self.outcomes for finding in outcome.findings)

    def __str__(self) -> str:
        head = f"{self.kind} {self.keyword} ({self.title}), seed {self.seed}"
        return "\n".join([head, *map(str, self.outcomes), *map(str, self.motions)])


def _pose_text(pose: Mapping[str, Any]) -> str:
    """The pose, to follow a finding."""
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
