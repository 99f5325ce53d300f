"""[requires] of a scene: distributions that bring its types, with ranges of versions."""

import shlex
from importlib.metadata import PackageNotFoundError, version
from typing import Any

from packaging.specifiers import InvalidSpecifier, SpecifierSet
from packaging.utils import InvalidName, canonicalize_name
from packaging.version import InvalidVersion

from dap3d_core.registry import load_registry
from dap3d_core.scene.errors import Key
from dap3d_core.scene.validate.coerce_values import Fault, text_of
from dap3d_core.scene.validate.mistake_collector import Collector


def read_requirements(report: Collector) -> str:
    """Check that each distribution is installed, in a version of its range.

    A distribution that lacks, or has another version, is a mistake with the command that installs
    it. Ranges are those of packaging (PEP 440), such as ``">=0.2, <1"``.

    Returns:
        The command that installs all that lack; "" if none does.
    """
    missing = []
    for name, given in report.scene.requires.items():
        key = ("requires", str(name))
        if not _is_name(name):
            what = "not the name of a distribution; it has letters, digits, and - _ . between them"
            report.add(key, given, what)
            continue
        versions = report.read(key, given, _range_of)
        if not isinstance(versions, Fault) and not _is_installed(report, key, name, versions):
            missing.append(_pip(f"{name}{versions}"))
    return f"pip install {' '.join(missing)}" if missing else ""


def _is_installed(report: Collector, key: Key, name: str, versions: SpecifierSet) -> bool:
    """True for a distribution of a version in a range; otherwise a mistake is reported."""
    given, remedy = report.scene.requires[name], f"pip install {_pip(f'{name}{versions}')}"
    try:
        installed = version(name)
    except PackageNotFoundError:
        brought = {s.distribution for each in load_registry().sources.values() for s in each}
        what = f"the distribution {name}, which the scene requires, is not installed"
        report.add(key, given, what, report.nearest(name, brought), remedy)
        return False
    try:
        is_suitable = versions.contains(installed, prereleases=True)
    except InvalidVersion:
        is_suitable = not versions
    if not is_suitable:
        what = f"{name} {installed} is installed, which is not of this range"
        report.add(key, given, what, remedy=remedy)
    return is_suitable


def _range_of(value: Any) -> Any:
    """The range of versions, or the fault."""
    text = text_of(value)
    if isinstance(text, Fault):
        return text
    try:
        return SpecifierSet("" if text.strip() == "*" else text)
    except InvalidSpecifier:
        return Fault('should be a range of versions, such as ">=0.2, <1", or "*" for any')


def _is_name(name: Any) -> bool:
    try:
        canonicalize_name(name, validate=True)
    except (InvalidName, TypeError):
        return False
    return True


def _pip(words: str) -> str:
    """A requirement in a command of a shell."""
    quoted = shlex.quote(words)
    return f'"{words}"' if quoted != words else words
