"""Compare every number of models/**/expected.toml with the reference simulators of this folder.

    python tests/models/reference/check_expected.py [MODEL...] [--all]

Prints the checks that differ (with --all, every check); exits with 1 if there is any. A number from
the specification or the reference problems must lie within its tolerance of the reference, one that
was taken from a reference within a tenth of it.
"""

import argparse
import importlib
import sys
import tomllib
from collections.abc import Iterator
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from rigid import Array

MODELS = Path(__file__).parents[3] / "models"
NAMES = ("bodies2", "ball1", "pen1", "pen2", "fourbar3", "fourbar2", "fourbar4", "tri", "bicycle")
#: The reference problems, and the script of each: one for all sizes of A02.
BENCHMARKS = {
    "A02-1": "fourbar_row",
    "A02-2": "fourbar_row",
    "A02-40": "fourbar_row",
    "A03": "andrews",
    "A04": "bricard",
    "A05": "governor",
    "N1": "rolling_disk",
}
#: Mechanisms of engineers.
ENGINEERING = (
    "crane",
    "engine",
    "excavator",
    "motion_platform",
    "planetary",
    "quarter_car",
    "rotor",
    "two_link_arm",
    "wiper",
)
#: Scenes of contacts.
CONTACT = (
    "cradle",
    "domino_row",
    "gripper",
    "hand",
    "humanoid",
    "marble_run",
    "quadruped",
    "sphere_box",
    "walker",
)
#: The folder of each model that is in one.
GROUPS = {
    **dict.fromkeys(BENCHMARKS, "benchmarks"),
    **dict.fromkeys(ENGINEERING, "engineering"),
    **dict.fromkeys(CONTACT, "contact"),
}
ALL = (*NAMES, *GROUPS)
PRINTED = ("specification", "benchmarks")  # sources that are no script of this folder


def folder_of(model: str) -> Path:
    """Return the folder of a model."""
    return MODELS / GROUPS.get(model, "") / model


def reference(model: str) -> Any:
    """Return the reference simulator of a model: a script, or of a family of models its member."""
    family, _, size = model.partition("-")
    script = importlib.import_module(BENCHMARKS.get(model, family))
    return script.member(int(size)) if size else script


class Comparison(NamedTuple):
    """One check beside what the reference says."""

    model: str
    check: dict[str, Any]
    reference: Array
    difference: float
    limit: float

    @property
    def ok(self) -> bool:
        """Return whether the two agree."""
        return self.difference <= self.limit

    def __str__(self) -> str:
        """Return one line, and on disagreement the reference value."""
        when = f"t = {self.check['t']:g}" if "t" in self.check else "crossing"
        line = (
            f"{'ok      ' if self.ok else 'DIFFERS '} {self.model:9} {when:14} "
            f"{self.check['quantity']:24} {self.difference:8.1e} of {self.limit:8.1e}"
        )
        return line if self.ok else f"{line}\n         reference: {self.reference.tolist()}"


@cache
def quantities(model: str, t: float, source: str) -> dict[str, Array]:
    """Return the reference quantities of a model; the pendulums have a closed form apart."""
    module = reference(model)
    if source == "closed-form" and hasattr(module, "closed_form"):
        return module.closed_form(t)
    return module.quantities(t)


def difference(quantity: str, value: Array, reference: Array) -> float:
    """Return the largest difference of a component; of p and -p, the same pose, the nearer."""
    if value.shape != reference.shape:
        return np.inf
    apart = np.abs(value - reference).max()
    if quantity.startswith("p."):
        apart = min(apart, np.abs(value + reference).max())
    return float(apart)


def comparisons(model: str) -> Iterator[Comparison]:
    """Yield each check of a model, compared."""
    with (folder_of(model) / "expected.toml").open("rb") as file:
        expected = tomllib.load(file)
    for check in expected["check"]:
        if "crossing" in check:
            found = np.array([reference(model).crossing(**check["crossing"])])
        else:
            found = quantities(model, check["t"], check["source"])[check["quantity"]]
        apart = difference(check["quantity"], np.array(check["value"], float), found)
        share = 1.0 if check["source"] in PRINTED else 0.1
        yield Comparison(model, check, found, apart, share * check["tolerance"])


def main() -> int:
    """Print the comparisons and return the exit code."""
    parser = argparse.ArgumentParser(description="Compare expected.toml with the references.")
    parser.add_argument("models", nargs="*", metavar="MODEL", help=", ".join(ALL))
    parser.add_argument("--all", action="store_true", help="print the checks that agree as well")
    options = parser.parse_args()
    found = [c for model in options.models or ALL for c in comparisons(model)]
    for comparison in found:
        if options.all or not comparison.ok:
            print(comparison)
    wrong = sum(not c.ok for c in found)
    print(f"{len(found)} checks, {wrong} differ")
    return 1 if wrong else 0


if __name__ == "__main__":
    sys.exit(main())
