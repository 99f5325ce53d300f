"""A page for a model, in one call: what a gallery of models is made with."""

import os
from pathlib import Path

from dap3d_core.view.page import view


def model_page(
    model: str | os.PathLike[str],
    path: str | os.PathLike[str],
    *quantities: str,
    fps: float | None = None,
    allow_code: bool = False,
    force: bool = False,
) -> Path:
    """Simulate a model as its scene says and write the page of the result.

    Args:
        model: the name of a shipped model, a folder, or a scene file.
        path: the page.
        quantities: curves that are drawn at once.
        fps: frames a second; every reported instant when left out.
        allow_code: whether the model's own types (plugin.py) may be loaded.
        force: whether an existing file is overwritten.

    Returns:
        The path.

    Raises:
        SceneError, SimulationError: the model cannot be run.
        UnknownNameError, ValueError: as ``view``.
        ResultError: the page cannot be written.
    """
    from dap3d_core.simulation import simulate

    result = simulate(model, allow_code=allow_code)
    return view(result, *quantities, fps=fps, model=model).save(path, force=force)
