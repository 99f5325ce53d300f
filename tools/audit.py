"""What dap3d depends on: are the licences ones that may be passed on, are holes known?

    python tools/audit.py

Licences are read from the installed packages, offline: each package that dap3d needs, itself or
through others, for a run or for one of its extras EXTRAS, must have a licence of ALLOWED. Known
holes are asked from the Python packaging advisory database by pip-audit, within LIMIT seconds;
without it or without a network that part is skipped, and a line says so. Exits with 1 where
something was found.
"""

import json
import re
import subprocess
import sys
from collections.abc import Iterator
from importlib.metadata import Distribution, PackageNotFoundError, distribution

from packaging.requirements import Requirement

ROOT = "dap3d"
#: What users install; tools of development are not passed on.
EXTRAS = ("derive", "mesh", "matlab")
#: Seconds that the advisory database may take.
LIMIT = 12
#: Licences that ask for no more than a notice; files of MPL stay as they are in their package.
ALLOWED = frozenset(
    {"0BSD", "Apache-2.0", "Apache-2.0 WITH LLVM-exception", "BSD-2-Clause", "BSD-3-Clause", "BSD",
     "CC0-1.0", "HPND", "ISC", "MIT", "MIT-CMU", "MPL-2.0", "PSF-2.0", "Python-2.0", "Unlicense",
     "Zlib"}
)  # fmt: skip
#: Older words for them: of classifiers, and of free text that is one of these and nothing else.
WORDS = {
    "Apache 2.0": "Apache-2.0",
    "Apache License 2.0": "Apache-2.0",
    "Apache Software License": "Apache-2.0",
    "BSD License": "BSD",
    "BSD 3-Clause": "BSD-3-Clause",
    "BSD-3-Clause License": "BSD-3-Clause",
    "Historical Permission Notice and Disclaimer (HPND)": "HPND",
    "ISC License (ISCL)": "ISC",
    "MIT License": "MIT",
    "Mozilla Public License 2.0 (MPL 2.0)": "MPL-2.0",
    "Python Software Foundation License": "PSF-2.0",
    "The Unlicense (Unlicense)": "Unlicense",
}


def needed(root: str, extras: tuple[str, ...]) -> dict[str, Distribution | None]:
    """The packages that one needs, by name, itself left out; None for what is not installed."""
    found: dict[str, Distribution | None] = {}
    waiting = [(root, extras)]
    seen = set()
    while waiting:
        name, wanted = waiting.pop()
        if (name, wanted) in seen:
            continue
        seen.add((name, wanted))
        try:
            package = distribution(name)
        except PackageNotFoundError:
            found[name] = None
            continue
        found[name] = package
        for line in package.requires or ():
            requirement = Requirement(line)
            environments = [{"extra": extra} for extra in ("", *wanted)]
            if requirement.marker is None or any(map(requirement.marker.evaluate, environments)):
                waiting.append((_normal(requirement.name), tuple(sorted(requirement.extras))))
    found.pop(root, None)
    return dict(sorted(found.items()))


def _normal(name: str) -> str:
    return re.sub(r"[-_.]+", "-", name).lower()


def licence_of(package: Distribution) -> str:
    """The licence that a package says it has, "" where it says none that is understood."""
    about = package.metadata
    if expression := about.get("License-Expression"):
        return str(expression)
    classifiers = [c.rpartition(" :: ")[2] for c in about.get_all("Classifier") or []
                   if c.startswith("License :: ")]  # fmt: skip
    classifiers = [c for c in classifiers if c != "OSI Approved"]
    if classifiers:
        return " AND ".join(WORDS.get(c, c) for c in classifiers)
    text = (about.get("License") or "").strip()
    return WORDS.get(text, text) if "\n" not in text else ""


def is_allowed(expression: str) -> bool:
    """Whether an SPDX expression, without brackets, can be met with the licences of ALLOWED."""
    return bool(expression) and any(
        all(part.strip() in ALLOWED for part in choice.split(" AND "))
        for choice in expression.split(" OR ")
    )


def licence_faults(packages: dict[str, Distribution | None]) -> Iterator[str]:
    """What is wrong with the licences of packages, a line each."""
    for name, package in packages.items():
        if package is not None and not is_allowed(licence := licence_of(package)):
            yield f"{name}: the licence {licence[:80] or 'is not told'!r} is not among the allowed"


def known_holes(packages: dict[str, Distribution | None]) -> tuple[list[str], str]:
    """Known holes, a line each; and why they could not be asked for, "" where they were."""
    pinned = "".join(f"{n}=={p.version}\n" for n, p in packages.items() if p is not None)
    words = [sys.executable, "-m", "pip_audit", "--progress-spinner", "off", "--format", "json",
             "--no-deps", "--disable-pip", "--timeout", "5", "-r", "/dev/stdin"]  # fmt: skip
    try:
        done = subprocess.run(words, input=pinned, capture_output=True, text=True, timeout=LIMIT)
    except subprocess.TimeoutExpired:
        return [], f"no answer within {LIMIT} s"
    try:
        told = json.loads(done.stdout)["dependencies"]
    except (ValueError, KeyError, TypeError):
        lines = done.stderr.strip().splitlines()
        return [], lines[-1] if lines else "pip-audit says nothing"
    asked = [d for d in told if "skip_reason" not in d]
    if not asked:
        return [], "the database knows none of the packages; is there a network?"
    return [f"{d['name']} {d['version']}: {v['id']}, repaired in {v['fix_versions'] or 'nothing'}"
            for d in asked for v in d["vulns"]], ""  # fmt: skip


def main() -> int:
    """Print what was found and return the exit status."""
    packages = needed(ROOT, EXTRAS)
    faults = list(licence_faults(packages))
    if not packages:
        faults.append(f"{ROOT} is not installed here")
    installed = sum(p is not None for p in packages.values())
    for name in (n for n, p in packages.items() if p is None):
        print(f"skipped: {name} is not installed here")
    print("\n".join(faults) or f"licences: all {installed} packages may be passed on")
    holes, why = known_holes(packages)
    if why:
        print(f"skipped: known holes were not asked for: {why}")
    else:
        print("\n".join(holes) or f"holes: none known in {installed} packages")
    print(f"audit: {'FAILED' if faults or holes else 'clean'}")
    return 1 if faults or holes else 0


if __name__ == "__main__":
    sys.exit(main())
