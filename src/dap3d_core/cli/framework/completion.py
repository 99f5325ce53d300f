"""Words offered to a shell for completion: models, parameters of a scene, quantities of a result.

Nothing is printed, and nothing raises: a file that cannot be read has no words to offer.
"""

import re
from contextlib import suppress
from typing import Any

import click
from click.shell_completion import CompletionItem

#: Words without a meaning for a shell. Names in a result, which may come from anyone, are offered
#: only if they are such words.
_PLAIN = re.compile(r"\w[\w.+:@%/-]*")
#: Variables of a sweep that are no outputs.
_STATUS = ("status", "note")


def _path(incomplete: str) -> list[CompletionItem]:
    """A path, which the shell completes itself."""
    return [CompletionItem(incomplete, type="file")]


def models(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """Shipped models; a path if none begins so."""
    from dap3d_core.scene import shipped_models

    return [name for name in shipped_models() if name.startswith(incomplete)] or _path(incomplete)


def parameters(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """Parameters of the model on the command line, part by part."""
    with suppress(Exception):
        from dap3d_core.registry import load_registry
        from dap3d_core.scene import check, load
        from dap3d_core.study.parameters import names_under

        # After an option without its value click leaves all words in ctx.args.
        scene = load(ctx.params["model"] or ctx.args[0])
        checked = check(scene, load_registry(), allow_code=False)
        return list(filter(_PLAIN.fullmatch, names_under(checked, incomplete)))
    return []


def quantities(ctx: click.Context, param: click.Parameter, incomplete: str) -> list[Any]:
    """Quantities of the result on the command line, part by part; outputs of a sweep; a path."""
    words: list[str] = []
    with suppress(Exception):
        from dap3d_core.result import names_of
        from dap3d_core.simulation.open_result import open_result
        from dap3d_core.study.sweep.dataset import is_sweep, open_sweep

        # After an option without its value click leaves all words in ctx.args.
        result = ctx.params["result"] or ctx.args[0]
        if is_sweep(result):
            variables = map(str, open_sweep(result).data_vars)
            names = [v for v in variables if v.startswith(incomplete) and v not in _STATUS]
        else:
            names = list(names_of(open_result(result), incomplete))
        words = list(filter(_PLAIN.fullmatch, names))
    return words or _path(incomplete)
