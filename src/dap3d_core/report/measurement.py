"""One measured setting of a report: its times and errors, or the reason of its failure."""

import time
from collections.abc import Callable
from typing import Any

import attrs

from dap3d_core.formulations import FORMULATIONS
from dap3d_core.report.settings_ladder import Setting
from dap3d_core.result import Result
from dap3d_core.scene import Scene
from dap3d_core.simulation import (
    AssemblyError,
    CompiledModel,
    RedundantError,
    SimulationError,
    simulate,
)

#: ``progress(done, total, words)``: seconds of work done and in all; the present activity.
Progress = Callable[[float, float, str], None]
Announce = Callable[[str], None]


@attrs.frozen(kw_only=True)
class MeasuredRun:
    """A setting whose run was completed.

    Attributes:
        setting: method, integrator, tolerances or step.
        time_s, time_min_s, time_max_s: median, least and largest wall time, s, compile time apart.
        repeats: number of timings.
        error: the error e against the reference (reference.py), over all its instants.
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


class _TimeLimitError(Exception):
    """A run took longer than its limit."""


@attrs.frozen
class RejectedSetting:
    """A method that does not fit the scene.

    Attributes:
        method: its name.
        reason: the reason, for users.
    """

    method: str
    reason: str


class Bench:
    """Runs settings of one scene.

    Attributes:
        scene: the scene, without its own step.
        models: compiled model by method, of the methods that fit.
        refused: methods that do not fit, with reasons.
        limit_s: seconds after which a run is ended.
    """

    def __init__(
        self, scene: Scene, *, limit_s: float, allow_code: bool, announce: Announce | None
    ) -> None:
        """Compile the scene for each method that fits it.

        Raises:
            SceneError, PluginError: as ``compile``.
        """
        self.scene, self.limit_s, self.announce = scene, limit_s, announce
        self.models: dict[str, CompiledModel] = {}
        self.refused: list[RejectedSetting] = []
        for method in FORMULATIONS:
            try:
                compiled = CompiledModel(
                    scene, method=method, allow_code=allow_code, announce=announce
                )
            except SimulationError as error:
                self.refuse(method, str(error))
                continue
            if compiled.method != method:
                self.refuse(method, f"the scene is then run as {compiled.method}")
            else:
                self.models[method] = compiled

    def refuse(self, method: str, reason: str) -> None:
        """Remove a method."""
        self.models.pop(method, None)
        self.refused.append(RejectedSetting(method, reason))

    def run(
        self, setting: Setting, tick: Callable[[], None], *, limit_s: float | None = None
    ) -> Result | str:
        """The result of a setting, or the reason why there is none.

        Args:
            setting: the setting; its method is in ``models``.
            tick: called between chunks of the run; its exceptions are passed on.
            limit_s: time limit, s, in place of the bench's own.

        Raises:
            AssemblyError: the scene cannot be assembled, whatever the setting.
        """
        limit = self.limit_s if limit_s is None else limit_s
        begun = time.perf_counter()
        outside: list[BaseException] = []

        def between(t: float, t_end: float) -> None:
            try:
                tick()
            except BaseException as error:
                outside.append(error)
                raise
            if t < t_end and time.perf_counter() - begun > limit:
                raise _TimeLimitError(f"ended after {limit:g} s, at t = {t:.4g} of {t_end:.4g} s")

        compiled, options = self.models[setting.method], setting.options
        try:
            return simulate(compiled, progress=between, announce=self.announce, **options)
        except AssemblyError:  # no method could
            raise
        except RedundantError as error:
            self.refuse(setting.method, str(error))
            return str(error)
        except (SimulationError, _TimeLimitError) as error:
            return str(error)
        except Exception as error:
            if error in outside:
                raise
            return f"{type(error).__name__}: {error}"
