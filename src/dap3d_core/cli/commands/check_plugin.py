"""``dap3d check-plugin``: the formulas of types against derivatives, balances and each other."""

from collections import Counter
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any

import click

from dap3d_core.cli.app import Command
from dap3d_core.cli.process.exit_codes import DONE, FAILED, Refused

if TYPE_CHECKING:
    from dap3d_core.registry import Registry
    from dap3d_core.testing import Report

#: What a check came to, as the table has it, with its colour.
STATES = {"ok": ("ok", "green"), "failed": ("WRONG", "bold red"), "not applicable": ("-", "")}
#: Checks of what kernels are made of, not of what they compute.
NO_FORMULAS = {"purity", "plain", "compiled"}


@click.command(cls=Command, name="check-plugin", short_help="Check the formulas of types.")
@click.argument("names", metavar="[NAME]...", nargs=-1)
@click.option("--all", "every", is_flag=True, help="Check all installed types.")
@click.option("--poses", type=click.IntRange(1, 1000), default=4, show_default=True, metavar="N",
              help="Random poses off the manifold, and as many on it.")  # fmt: skip
@click.option("--seed", type=int, default=1, show_default=True, help="Seed of the random poses.")
@click.option("--allow-code", is_flag=True, help="Allow a Python file that is named to run.")
@click.option("--json", "as_json", is_flag=True, help="Print one JSON object, nothing else.")
@click.option("-q", "--quiet", is_flag=True, help="Print what went wrong alone.")
def check_plugin(
    names: tuple[str, ...],
    *,
    every: bool,
    poses: int,
    seed: int,
    allow_code: bool,
    as_json: bool,
    quiet: bool,
) -> int:
    """Check the formulas of types of joints, forces and functions.

    NAME is the keyword of a type, a distribution or a module that brings types, or a Python file
    with types of its own (with --allow-code).

    J, nu and gamma are compared with time derivatives, by complex step and by differences, at
    random poses on and off the constraints; energies with wrenches; and much else
    (docs/check-plugin.md). What is wrong is told row by row; the exit code is then 1.
    """
    import dap3d_core as dap
    from dap3d_core.cli.console.console import output, print_json, say

    if every == bool(names):
        raise Refused("name what is to be checked, or give --all for all installed types")
    registry, types = _found(dap.load_registry(), names, allow_code=allow_code)
    console, reports = output(), []
    for kind, keyword in types:
        report = _checked(registry, kind, keyword, poses, seed)
        reports.append(report)
        if not as_json and not (quiet and report.ok):
            _show(console, report, quiet=quiet)
    wrong = any(not report.ok for report in reports)
    if as_json:
        print_json({"ok": not wrong, "seed": seed, "poses": poses,
                    "types": [_facts(report) for report in reports]})  # fmt: skip
    elif wrong:
        for words, number in Counter(map(_verdict, reports)).items():
            if words:
                say(console, words.format(f"{number} of {_count(reports)}"), "bold red")
    elif not quiet:
        say(console, f"{_count(reports)} checked: nothing is wrong", "green")
    return FAILED if wrong else DONE


def _verdict(report: "Report") -> str:
    """What is wrong with a type, in words around a count; "" for nothing."""
    checks = {finding.check for finding in report.findings}
    if checks <= {"loading"}:
        return "{} cannot be loaded" if checks else ""
    return "unfit kernels in {}" if checks <= NO_FORMULAS else "wrong formulas in {}"


def _count(reports: list["Report"]) -> str:
    from dap3d_core.cli.console.console import count

    return count(len(reports), "type")


def _found(
    registry: "Registry", names: tuple[str, ...], *, allow_code: bool
) -> tuple["Registry", list[tuple[str, str]]]:
    """The (kind, keyword) of all types that are named, once each; with files, their registry."""
    files = [name for name in names if name.endswith(".py")]
    for name in files:
        if not Path(name).is_file():
            raise Refused(f"there is no file {name}")
        if not allow_code:
            raise Refused(
                f"{name} is not run unless it is allowed; if you trust it, give --allow-code"
            )
        registry = registry.with_file(name)
    found: dict[tuple[str, str], None] = {}
    for name in names or ("",):
        found |= dict.fromkeys(_of_name(registry, name))
    return registry, list(found)


def _of_name(registry: "Registry", name: str) -> Iterator[tuple[str, str]]:
    """The types of one name: a keyword, a distribution, a module, a file; all for no name."""
    from dap3d_core.registry.declared_types import not_yet_installed
    from dap3d_core.registry.discovery import normal_name
    from dap3d_core.registry.suggestions import nearest

    words: dict[str, None] = {}
    is_there = False
    for key, sources in registry.sources.items():
        for source in (s for s in sources if s.kind and not s.blocked):
            names = (source.keyword, source.module, normal_name(source.distribution))
            words |= dict.fromkeys(n for n in (*names[:2], source.distribution) if n)
            if not name or name in names or normal_name(name) == names[2]:
                is_there = True
                yield key
    if not is_there:
        near = nearest(name, list(words))
        hint = not_yet_installed(name) or (f"did you mean {near!r}?" if near else "")
        hint = f"; {hint}" if hint else ""
        raise Refused(
            f"there is no type, distribution or module {name!r}{hint} (dap3d plugins lists them)"
        )


def _checked(registry: "Registry", kind: str, keyword: str, poses: int, seed: int) -> "Report":
    """The report on one type; a type that cannot be loaded has one finding."""
    from dap3d_core.interface import PluginError
    from dap3d_core.registry import LOAD_LIMIT
    from dap3d_core.testing import Finding, Outcome, Report, check_type

    try:
        examined = registry.get(kind, keyword, limit_s=LOAD_LIMIT)
        return check_type(examined, poses=poses, seed=seed)
    except PluginError as error:
        words = "it can be loaded"
        outcome = Outcome("loading", "", "failed", words, None, None, (),
                          (Finding("loading", "", "", 0, str(error)),))  # fmt: skip
        title = registry.sources[kind, keyword][0].module
        return Report(kind, keyword, title, seed, poses, (outcome,))


def _facts(report: "Report") -> dict[str, Any]:
    import attrs

    return {**attrs.asdict(report), "ok": report.ok}


def _show(console: Any, report: "Report", *, quiet: bool) -> None:
    from rich.text import Text

    from dap3d_core.cli.console.console import items, say, show, table, title

    title(console, f"{report.keyword}, a {report.kind}")
    if not quiet:
        say(console, report.title, indent=2, whole=True)
        rows = [
            (Text(*STATES[o.state]), o.title, _size(o.error), _size(o.differences), o.words)
            for o in report.outcomes
        ]
        columns = ("", "check", "error", "by diff.", "what was compared; why it does not apply")
        show(console, table(columns, rows, fixed=(0, 2, 3)))
    notes = dict.fromkeys(f"{o.title}: {note}" for o in report.outcomes for note in o.notes)
    if notes and not quiet:
        items(console, notes)
    items(console, dict.fromkeys(f"{_variant(f.variant)}{f}" for f in report.findings), "red")
    if not quiet:
        console.print()


def _size(error: float | None) -> str:
    return "" if error is None else f"{error:.0e}"


def _variant(values: str) -> str:
    return f"with {values}: " if values else ""
