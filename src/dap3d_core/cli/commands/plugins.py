"""``dap3d plugins``: all installed types, and why some cannot be used."""

import click

from dap3d_core.cli.framework import options
from dap3d_core.cli.framework.command import command
from dap3d_core.cli.process.exit_codes import DONE, FAILED, Refused
from dap3d_core.cli.process.streams import prints_json


@command(
    "List the installed types.",
    click.option("--no-compile", is_flag=True, help="Do not check that kernels compile."),
    click.option("--limit", type=options.FiniteFloat(positive=True), metavar="SECONDS",
                 help="Time in which a plugin must load (60 by default)."),
    click.option("--test", is_flag=True, help="Check formulas, and run the tests of packages."),
    options.JSON,
)  # fmt: skip
def plugins(*, no_compile: bool, limit: float | None, test: bool) -> int:
    """List the types of joints, forces and functions that are installed, and what else packages
    bring: importers, exporters, integrators and shapes.

    A type that cannot be loaded, or whose kernels cannot be compiled, is listed with the reason.
    For that the kernels of other packages are compiled: the first time about a second a type.

    With --test the formulas of all types are checked, as by dap3d check-plugin --all, and the tests
    that the packages bring are run by pytest; the exit code is 1 if anything is wrong.

    DAP3D_BLOCK=NAME leaves out the types of a distribution, DAP3D_BLOCK=NAME:KEYWORD one of them.
    """
    import attrs

    import dap3d_core as dap
    from dap3d_core.cli.console.console import print_json, stdout
    from dap3d_core.registry import LOAD_LIMIT
    from dap3d_core.registry.extensions import extension_listing

    if test:
        if no_compile or limit is not None:
            raise Refused("--no-compile and --limit are of the list; leave them out with --test")
        return _test()
    registry = dap.load_registry()
    limit_s = limit or LOAD_LIMIT
    types = registry.listing(compiling=not no_compile, limit_s=limit_s)
    types += extension_listing(limit_s)
    if prints_json():
        print_json({"types": [attrs.asdict(t) for t in types], "notes": registry.notes})
        return DONE
    console = stdout()
    rows = [
        (t.kind or "?", t.keyword or "?", f"{t.distribution} {t.version}".strip() or "-", t.state)
        for t in types
    ]
    console.table(("kind", "keyword", "distribution", "state"), rows, fixed=(0, 1, 3))
    faults = [f"{t.keyword or t.distribution}, {t.module}: {t.reason}" for t in types if t.reason]
    console.section("not usable", faults, "red")
    console.section("notes", registry.notes)
    return DONE


def _test() -> int:
    """Check and test all that is installed; prints each package as it is done."""
    import attrs

    import dap3d_core as dap
    from dap3d_core.cli.console.console import count, print_json, seconds, stderr, stdout
    from dap3d_core.testing.packages import check_packages

    console, reports = stdout(), []
    for report in check_packages(dap.load_registry(), stderr().say):
        reports.append(report)
        if prints_json():
            continue
        console.title(f"{report.name} {report.version}".strip())
        wrong = [t for t in report.types if not t.ok]
        right = len(report.types) - len(wrong)
        console.say(f"formulas: {right} of {count(len(report.types), 'type')} right", indent=2)
        for one in wrong:
            console.items((f"{one.keyword}: {f}" for f in one.findings), "red")
        tests = report.tests
        took = f" ({seconds(tests.seconds)})" if tests.seconds else ""
        state = {"none": "no tests"}.get(tests.state, tests.state)
        style = "red" if tests.state in ("failed", "not run") else ""
        console.say(f"tests: {state}: {tests.words}{took}", style, indent=2)
        for line in tests.output.splitlines():
            console.say(line, indent=4, whole=True)
    good = all(report.ok for report in reports)
    if prints_json():
        data = [
            {**attrs.asdict(report), "ok": report.ok,
             "types": [{**attrs.asdict(one), "ok": one.ok} for one in report.types]}
            for report in reports
        ]  # fmt: skip
        print_json({"ok": good, "packages": data})
    elif good:
        console.say(f"{count(len(reports), 'package')} tested: nothing is wrong", "green")
    else:
        bad = ", ".join(report.name for report in reports if not report.ok)
        console.say(f"something is wrong in {bad}", "bold red")
    return DONE if good else FAILED
