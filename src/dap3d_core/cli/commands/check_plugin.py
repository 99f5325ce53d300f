"""``dap3d check-plugin``: compares the formulas of types with derivatives and with each other."""

import importlib.util
from collections import Counter
from collections.abc import Iterator
from contextlib import suppress
from pathlib import Path
from typing import TYPE_CHECKING

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, FAILED, Refused
from dap3d_core.cli.process.streams import is_quiet, prints_json

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.registry import Registry
    from dap3d_core.testing import Report

#: State of a check -> its text in the table, and the colour.
STATES = {"ok": ("ok", "green"), "failed": ("WRONG", "bold red"), "not applicable": ("-", "")}
#: Checks of the code of kernels, not of what they compute.
NO_FORMULAS = {"purity", "plain", "compiled"}


@command(
    "Check the formulas of types.",
    click.argument("names", metavar="[NAME]...", nargs=-1),
    click.option("--all", "every", is_flag=True, help="Check all installed types."),
    click.option("--poses", type=click.IntRange(1, 1000), default=4, show_default=True,
                 metavar="N", help="Random poses off the manifold, and as many on it."),
    click.option("--seed", type=int, default=1, show_default=True,
                 help="Seed of the random poses."),
    click.option("--allow-code", is_flag=True, help="Allow the named Python files to run."),
    options.JSON, options.QUIET,
)  # fmt: skip
def check_plugin(
    names: tuple[str, ...], *, every: bool, poses: int, seed: int, allow_code: bool
) -> int:
    """Check the formulas of types of joints, forces and functions.

    Of importers, exporters, integrators and shapes: that they can be loaded.

    NAME is the keyword of a type (PACKAGE:KEYWORD where two packages share one), a distribution or
    a module that brings types; or a Python file, of an installed package as it is, any other with
    --allow-code.

    J, nu and gamma are compared with time derivatives, by complex step and by differences, at
    random poses on and off the constraints; energies with wrenches; and much else
    (docs/how-to/check-plugin.md). Errors are reported row by row; the exit code is then 1.
    """
    import attrs

    import dap3d_core as dap
    from dap3d_core.cli.console.console import count, print_json, stdout
    from dap3d_core.testing.packages import check_named

    if every == bool(names):
        raise Refused("name what is to be checked, or give --all for all installed types")
    registry, types = _named_types(dap.load_registry(), names, allow_code=allow_code)
    console, reports = stdout(), []
    for kind, keyword in types:
        report = check_named(registry, kind, keyword, poses=poses, seed=seed)
        reports.append(report)
        if not prints_json() and not (is_quiet() and report.ok):
            _show(console, report)
    wrong = any(not report.ok for report in reports)
    total = count(len(reports), "type")
    if prints_json():
        data = [{**attrs.asdict(report), "ok": report.ok} for report in reports]
        print_json({"ok": not wrong, "seed": seed, "poses": poses, "types": data})
    elif wrong:
        for verdict, number in Counter(map(_verdict, reports)).items():
            if verdict:
                console.say(verdict.format(f"{number} of {total}"), "bold red")
    elif not is_quiet():
        console.say(f"{total} checked: nothing is wrong", "green")
    return FAILED if wrong else DONE


def _verdict(report: "Report") -> str:
    """The fault of a type, with a place for a count; "" for none."""
    checks = {finding.check for finding in report.findings}
    if checks <= {"loading"}:
        return "{} cannot be loaded" if checks else ""
    return "unfit kernels in {}" if checks <= NO_FORMULAS else "wrong formulas in {}"


def _named_types(
    registry: "Registry", names: tuple[str, ...], *, allow_code: bool
) -> tuple["Registry", list[tuple[str, str]]]:
    """The (kind, keyword) of all named types, without duplicates, and their registry."""
    names = tuple(_module_of(registry, name) if name.endswith(".py") else name for name in names)
    for name in (n for n in names if n.endswith(".py")):
        if not allow_code:
            raise Refused(
                f"{name} is not run unless it is allowed; if you trust it, give --allow-code"
            )
        registry = registry.with_file(name)
    types: dict[tuple[str, str], None] = {}
    for name in names or ("",):
        types |= dict.fromkeys(_types_of(registry, name))
    return registry, list(types)


def _module_of(registry: "Registry", name: str) -> str:
    """The module of an installed package that a file is, such as one of an editable install.

    The name of the file where it is none: it then stands alone.
    """
    from dap3d_core.testing.packages import active_sources

    path = Path(name)
    if not path.is_file():
        raise Refused(f"there is no file {name}")
    path = path.resolve()
    stem = path.parent.name if path.stem == "__init__" else path.stem
    for module in dict.fromkeys(source.module for source in active_sources(registry)):
        if module.rpartition(".")[2] == stem:
            with suppress(Exception):  # of a broken package; loading it reports the fault
                found = importlib.util.find_spec(module)
                if found and found.origin and Path(found.origin).resolve() == path:
                    return module
    return name


def _types_of(registry: "Registry", name: str) -> Iterator[tuple[str, str]]:
    """The types of a keyword, a distribution, a module or a file; all for an empty name.

    A keyword that several packages share is named with the package.
    """
    from dap3d_core.registry.discovery import normal_name
    from dap3d_core.testing.packages import active_sources

    known: dict[str, None] = {}
    matched = False
    for source in active_sources(registry):
        if not source.kind:
            continue
        names = (source.keyword, source.module, normal_name(source.distribution))
        known |= dict.fromkeys(n for n in (*names[:2], source.distribution) if n)
        package, _, word = name.rpartition(":")
        is_one = word == source.keyword and normal_name(package) == names[2]
        if not name or name in names or normal_name(name) == names[2] or is_one:
            matched = True
            yield source.kind, registry.word_of(source)
    if not matched:
        from dap3d_core.cli.framework.error_messages import type_hint

        if Path(name).is_dir():
            hint = f"pip install -e {name}, and name the package, or name a file"
        else:
            hint = "dap3d plugins lists them"
        raise Refused(
            f"there is no type, distribution or module {name!r}{type_hint(name, list(known))} "
            f"({hint})"
        )


def _show(console: "Terminal", report: "Report") -> None:
    from rich.text import Text

    article = "an" if report.kind[:1] in "aeiou" else "a"
    console.title(f"{report.keyword}, {article} {report.kind}")
    if not is_quiet():
        console.say(report.title, indent=2, whole=True)
        rows: list[tuple[str | Text, ...]] = []
        for o in report.outcomes:
            errors = ("" if x is None else f"{x:.0e}" for x in (o.error, o.differences))
            rows.append((Text(*STATES[o.state]), o.title, *errors, o.words))
        columns = ("", "check", "error", "by diff.", "compared; or why not")
        console.table(columns, rows, fixed=(0, 2, 3))
        console.items(dict.fromkeys(f"{o.title}: {n}" for o in report.outcomes for n in o.notes))
        console.items(map(str, report.motions))
    findings = (f"{f'with {f.variant}: ' if f.variant else ''}{f}" for f in report.findings)
    console.items(dict.fromkeys(findings), "red")
    if not is_quiet():
        console.print()
