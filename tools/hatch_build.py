"""Ready-made objects for a wheel, if ``DAP3D_READY_OBJECTS`` names targets (``make wheel``).

Its value is ``all``, or names of targets separated by commas
(src/dap3d_core/kernels/runtime/ready.py). Without it a wheel holds none, its build has no further
dependencies, and code is compiled at the first run.
"""

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from typing import Any

from hatchling.builders.hooks.plugin.interface import BuildHookInterface


class ReadyObjects(BuildHookInterface[Any]):
    """The build hook that hatchling loads from this file."""

    def dependencies(self) -> list[str]:
        """Dependencies of the build: those of the project that simulations need."""
        if not os.environ.get("DAP3D_READY_OBJECTS"):
            return []
        names = ("attrs", "llvmlite", "numpy", "pluggy", "scipy")
        wanted = self.build_config.builder.metadata.core.dependencies
        return [one for one in wanted if one.startswith(names)]

    def initialize(self, version: str, build_data: dict[str, Any]) -> None:
        """Make the objects; without them the wheel is built with a warning."""
        wanted = os.environ.get("DAP3D_READY_OBJECTS", "")
        if version == "editable" or not wanted:
            return
        self._folder = tempfile.TemporaryDirectory()
        targets = [] if wanted == "all" else wanted.split(",")
        script = Path(self.root, "tools", "ready_objects.py")
        done = subprocess.run(
            [sys.executable, str(script), self._folder.name, *targets],
            capture_output=True, text=True, check=False,
        )  # fmt: skip
        if done.returncode:
            reason = (done.stderr.strip().splitlines() or ["no reason given"])[-1]
            self.app.display_warning(f"the wheel has no ready-made objects: {reason}")
            return
        self.app.display_info(done.stdout)
        for file in sorted(Path(self._folder.name).glob("*.pack")):
            build_data["force_include"][str(file)] = f"dap3d_core/ready_objects/{file.name}"

    def finalize(self, version: str, build_data: dict[str, Any], artifact_path: str) -> None:
        """Remove the temporary folder."""
        if hasattr(self, "_folder"):
            self._folder.cleanup()
