"""One measured setting of a report: its times and errors, or the reason of its failure."""

from typing import Any

import attrs

from dap3d_core.report.settings_ladder import Setting
from dap3d_core.result import Result


@attrs.frozen(kw_only=True)
class MeasuredRun:
    """A setting whose run was completed.

    Attributes:
        setting: method, integrator, tolerances or step.
        time_s, time_min_s, time_max_s: median, least and largest wall time, s, compile time apart.
        repeats: number of timings.
        error: the error e against the reference (error_norms.py), over all its instants.
        final_position_error: largest distance of a mass centre from the reference at the last
            instant, m.
        energy_error: imbalance of energy and work, relative, as in the ledger.
        constraint_error, constraint_velocity_error, constraint_acceleration_error: largest ``|C|``,
            ``|D v - nu|``, ``|D v_dot - gamma|``.
        quaternion_error: largest deviation of Euler parameters from unit length.
        counts: steps, rejected, rhs, projections and the other counters of a run.
        below_uncertainty: the error is below the reference's own uncertainty, which then is all
            that is known of it.
        on_front: no faster run has a smaller error.
    """

    setting: Setting
    time_s: float
    time_min_s: float
    time_max_s: float
    repeats: int
    error: float
    final_position_error: float
    energy_error: float
    constraint_error: float
    constraint_velocity_error: float
    constraint_acceleration_error: float
    quaternion_error: float
    counts: dict[str, int]
    below_uncertainty: bool = False
    on_front: bool = False

    @property
    def method(self) -> str:
        """The formulation."""
        return self.setting.method

    @property
    def integrator(self) -> str:
        """The method of integration."""
        return self.setting.integrator

    @property
    def rtol(self) -> float | None:
        """Relative tolerance; None for fixed steps."""
        return self.setting.rtol

    @property
    def step(self) -> float | None:
        """Fixed step, s; None where the integrator chooses it."""
        return self.setting.step

    def to_dict(self) -> dict[str, Any]:
        """The run in JSON: ``rtol`` and ``atol`` or ``step``, and the counts among the others."""
        values = attrs.asdict(self, recurse=False)
        del values["setting"], values["counts"]
        return {**self.setting.to_dict(), **values, **self.counts}


@attrs.frozen
class Failed:
    """A setting without a result, and the reason."""

    setting: Setting
    reason: str

    def to_dict(self) -> dict[str, Any]:
        """The setting and the reason in JSON."""
        return {**self.setting.to_dict(), "failed": self.reason}


def measures_of(result: Result) -> dict[str, Any]:
    """The fields of ``MeasuredRun`` that a result gives without a reference."""
    ledger = {name: entry.value for name, entry in result.ledger.items()}
    counts = attrs.asdict(result.stats)
    return dict(
        energy_error=ledger["energy"],
        constraint_error=ledger["position"],
        constraint_velocity_error=ledger["velocity"],
        constraint_acceleration_error=ledger["acceleration"],
        quaternion_error=ledger["quaternion"],
        counts={k: v for k, v in counts.items() if not k.endswith("_s")},
    )
