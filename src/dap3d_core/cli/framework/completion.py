"""What a shell offers when the tab key is pressed: models, results, quantities of a
result, numbers of a scene.

Nothing is printed here, and nothing fails: where there is nothing to offer, nothing is.
"""

import re
from contextlib import suppress
from typing import Any

import click
from click.shell_completion import CompletionItem

#: What a shell takes as it stands: other names of a result, which may come from anywhere, are not
#: put on somebody's command line.
_PLAIN = re.compile(r"\w[\w.+:@%/-]*")


def _path(incomplete: str) -> list[CompletionItem]:
    """A path, which the shell completes by itself."""
    return [CompletionItem(incomplete, type="file")]


def results(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """Result files."""
    return _path(incomplete)


def models(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """The shipped models, or a path where none begins so."""
    from dap3d_core.scene import shipped_models

    return [name for name in shipped_models() if name.startswith(incomplete)] or _path(incomplete)


def numbers(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """Numbers of the model that was named before, part by part."""
    found: list[str] = []
    with suppress(Exception):
        from dap3d_core.registry import load_registry
        from dap3d_core.scene import check, load
        from dap3d_core.study.parameters import names_under

        # Behind an option without its value click leaves all words in ctx.args.
        scene = load(ctx.params["model"] or ctx.args[0])
        checked = check(scene, load_registry(), allow_code=False)
        found += filter(_PLAIN.fullmatch, names_under(checked, incomplete))
    return list(found)


def quantities(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """Quantities of the result that was named before, part by part; outputs of a sweep; a path."""
    found: list[str] = []
    with suppress(Exception):
        from dap3d_core.result import names_of, open_result
        from dap3d_core.study.sweep.dataset import is_sweep, open_sweep

        # Behind an option without its value click leaves all words in ctx.args.
        result = ctx.params["result"] or ctx.args[0]
        if is_sweep(result):
            kept = map(str, open_sweep(result).data_vars)
            names = [n for n in kept if n.startswith(incomplete) and n not in ("status", "note")]
        else:
            names = list(names_of(open_result(result), incomplete))
        found += filter(_PLAIN.fullmatch, names)
    return list(found) or _path(incomplete)
