"""Tests of all that is installed: formulas of the types, and the tests that packages bring."""

import subprocess
import sys
import time
from collections.abc import Callable, Iterator
from importlib.metadata import PackageNotFoundError, distribution
from importlib.util import find_spec
from pathlib import Path

import attrs

from dap3d_core.interface import PluginError
from dap3d_core.interface.hooks import EXTENSIONS
from dap3d_core.registry import LOAD_LIMIT, Registry
from dap3d_core.registry.discovery import Source, discover, editable_folder
from dap3d_core.registry.extensions import extensions
from dap3d_core.registry.registry import OWN
from dap3d_core.testing.checks.findings import OK, CheckOutcome, Finding, Report
from dap3d_core.testing.kit import POSES, SEED, check_type

#: States of the tests of a package.
PASSED, FAILED, NONE, NOT_RUN = "passed", "failed", "none", "not run"
#: Exit code of pytest where it finds no test.
NO_TESTS = 5
#: Lines of pytest that are kept of tests that fail.
KEPT_LINES = 40


@attrs.frozen
class PackageTests:
    """The outcome of the tests that a package brings.

    Attributes:
        state: passed, failed, none (it brings no tests) or not run.
        words: the last line of pytest, or the reason why the tests were not run.
        files: the files or folders with tests.
        output: the last lines of pytest where tests fail.
        seconds: time taken.
    """

    state: str
    words: str = ""
    files: tuple[str, ...] = ()
    output: str = ""
    seconds: float = 0.0


@attrs.frozen
class PackageReport:
    """The outcome of all checks of a package.

    Attributes:
        name, version: of the distribution.
        types: a report for each type, as check-plugin makes them.
        tests: the outcome of its own tests.
    """

    name: str
    version: str
    types: tuple[Report, ...]
    tests: PackageTests

    @property
    def ok(self) -> bool:
        """True if no type has a finding and no test fails."""
        return all(t.ok for t in self.types) and self.tests.state in (PASSED, NONE)


def active_sources(registry: Registry) -> list[Source]:
    """The origins of all installed types and extensions that are not blocked."""
    types = (source for same in registry.sources.values() for source in same)
    others = discover([group for group, _ in EXTENSIONS.values()])
    extensions_ = (source for source in others if source.kind)
    return [source for source in (*types, *extensions_) if not source.blocked]


def check_named(
    registry: Registry, kind: str, keyword: str, *, poses: int = POSES, seed: int = SEED
) -> Report:
    """The report on a type or an extension; a single finding if it cannot be loaded."""
    try:
        if kind in EXTENSIONS:
            extensions(kind).load(keyword, limit_s=LOAD_LIMIT)
            words = "it can be loaded, and is what its kind declares"
            return _loading_report(registry, kind, keyword, CheckOutcome("loading", "", OK, words))
        type_info = registry.get(kind, keyword, limit_s=LOAD_LIMIT)
        return check_type(type_info, poses=poses, seed=seed)
    except PluginError as error:
        outcome = _not_loaded(str(error), "it can be loaded")
        return _loading_report(registry, kind, keyword, outcome)


def _not_loaded(fault: str, words: str) -> CheckOutcome:
    finding = Finding("loading", "", "", 0, fault)
    return CheckOutcome("loading", "", "failed", words, findings=(finding,))


def _loading_report(registry: Registry, kind: str, keyword: str, outcome: CheckOutcome) -> Report:
    """The report of one outcome, with the module that brings the type."""
    sources = (
        extensions(kind).sources.get(keyword, ())
        if kind in EXTENSIONS
        else registry.sources_of(kind, keyword)
    )
    module = next((source.module for source in sources), keyword)
    return Report(kind, keyword, module, SEED, POSES, (outcome,))


def check_packages(
    registry: Registry, progress: Callable[[str], None] | None = None
) -> Iterator[PackageReport]:
    """Check the types of every installed package and run its own tests, package by package.

    The tests of dap3d itself are not run: they belong to its sources (``make test-all``).

    Args:
        registry: the installed types.
        progress: called with what is done next.
    """
    say = progress or (lambda words: None)
    sources = active_sources(registry)
    packages = {s.distribution: s.version for s in sources if s.distribution}
    for name in sorted(packages, key=lambda n: (n != OWN, n)):
        reports = []
        for source in (s for s in sources if s.distribution == name):
            if not source.kind:
                wrong = _not_loaded(source.fault, "")
                reports.append(Report("", "", name, SEED, POSES, (wrong,)))
                continue
            say(f"{name}: checking {source.keyword}")
            reports.append(check_named(registry, source.kind, registry.word_of(source)))
        tests = PackageTests(NONE, "those of dap3d are in its sources, for make test-all")
        if name != OWN:
            say(f"{name}: running its tests")
            tests = run_tests(name)
        yield PackageReport(name, packages[name], tuple(reports), tests)


def run_tests(name: str) -> PackageTests:
    """Run the tests that an installed distribution brings, by pytest in a process of its own."""
    try:
        folder, files = tests_of(name)
    except PackageNotFoundError:
        return PackageTests(NONE, "it has no metadata")
    if not files:
        return PackageTests(NONE, "it brings no tests")
    words = tuple(map(str, files))
    if find_spec("pytest") is None:
        return PackageTests(NOT_RUN, "pytest is not installed: pip install pytest", words)
    began = time.monotonic()
    done = subprocess.run(
        [sys.executable, "-m", "pytest", "-q", "-p", "no:cacheprovider", *words],
        cwd=folder, stdin=subprocess.DEVNULL, stdout=subprocess.PIPE, stderr=subprocess.STDOUT,
        text=True, errors="replace", check=False,
    )  # fmt: skip
    seconds, lines = time.monotonic() - began, done.stdout.rstrip().splitlines()
    if done.returncode == NO_TESTS:
        return PackageTests(NONE, "pytest finds no tests in its files", words, seconds=seconds)
    last = lines[-1].strip("= ") if lines else f"exit code {done.returncode}"
    if done.returncode == 0:
        return PackageTests(PASSED, last, words, seconds=seconds)
    output = "\n".join(lines[-KEPT_LINES:])
    return PackageTests(FAILED, last, words, output, seconds)


def tests_of(name: str) -> tuple[Path, list[Path]]:
    """The folder in which to run the tests of an installed distribution, and where they are.

    Those of an editable install are in the folder ``tests`` of its sources; those of any other are
    installed with it, in files ``test_*.py`` or ``*_test.py``.

    Raises:
        PackageNotFoundError: there is no such distribution.
    """
    package = distribution(name)
    if (sources := editable_folder(package)) is not None:
        tests = sources / "tests"
        return sources, [tests] if tests.is_dir() else []
    listed = [f for f in package.files or () if f.suffix == ".py"]
    files = [f for f in listed if f.stem.startswith("test_") or f.stem.endswith("_test")]
    root = Path(str(package.locate_file("")))
    return root, [Path(str(package.locate_file(f))) for f in files]
