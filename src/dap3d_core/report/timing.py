"""Runs the settings of a report, with one compiled model per method."""

import time
from collections.abc import Callable

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
