"""Prints the newest Python here for dap3d, if it is newer than the one that runs this.

The exit status is 1 where there is none.
"""

import shutil
import subprocess
import sys
from pathlib import Path

#: Minor versions of Python 3, the newest first.
MINORS = (14, 13, 12)


def candidates(minor: int) -> list[str]:
    """Programs that may be a version: on the search path, and those that pyenv has installed."""
    found = shutil.which(f"python3.{minor}")
    installed = sorted((Path.home() / ".pyenv" / "versions").glob(f"3.{minor}.*/bin/python3"))
    return [*([found] if found else []), *map(str, reversed(installed))]


def works(program: str, minor: int) -> bool:
    """True if a program is that version of Python, with its venv module."""
    code = f"import sys, venv, ensurepip; sys.exit(sys.version_info[:2] != (3, {minor}))"
    try:
        done = subprocess.run([program, "-c", code], capture_output=True, check=False, timeout=30)
    except (OSError, subprocess.TimeoutExpired):
        return False
    return done.returncode == 0


if __name__ == "__main__":
    newer = (minor for minor in MINORS if minor > sys.version_info.minor)
    programs = (p for minor in newer for p in candidates(minor) if works(p, minor))
    program = next(programs, None)
    if program is None:
        sys.exit(1)
    print(program)
