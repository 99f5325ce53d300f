"""Prints the lowest versions of dependencies that pyproject.toml allows, as constraints for pip."""

import re
import sys
import tomllib
from pathlib import Path

#: Extras of users; those of developers (tests, documentation, rivals) take the newest versions.
EXTRAS = ("cluster", "control", "derive", "matlab", "mesh", "xacro")


def lowest(project: dict) -> list[str]:
    """``name==version`` of each dependency, of the extras as well.

    Raises:
        ValueError: a dependency has no lowest version.
    """
    extras = project["optional-dependencies"]
    found = []
    for requirement in [*project["dependencies"], *(r for name in EXTRAS for r in extras[name])]:
        bound = re.fullmatch(r"([\w.-]+)>=([\w.]+)", requirement)
        if bound is None:
            raise ValueError(
                f"pyproject.toml: {requirement!r} has no lowest version, NAME>=VERSION"
            )
        found.append(f"{bound[1]}=={bound[2]}")
    return found


if __name__ == "__main__":
    text = (Path(__file__).parents[1] / "pyproject.toml").read_text(encoding="utf-8")
    sys.stdout.write("\n".join(lowest(tomllib.loads(text)["project"])) + "\n")
