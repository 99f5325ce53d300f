"""The page: one HTML file with its data, its program and three.js, which loads nothing."""

import base64
import hashlib
import html
import json
import os
from collections.abc import Callable
from importlib.resources import files
from pathlib import Path
from typing import Any

import attrs

from dap3d_core.registry.arguments import checked, require
from dap3d_core.result import Result, ResultError
from dap3d_core.result.file.atomic_write import whole_file
from dap3d_core.view.page_data import page_data
from dap3d_core.view.scene3d.scene_data import scene_of

#: The program of the page, in the order in which its parts build on one another.
PROGRAM = (
    "data", "motion", "stage", "marks", "arrows", "traces", "labels", "quantities", "plots",
    "transport", "panel", "keyboard", "sweep", "main",
)  # fmt: skip
#: Height of the frame in a notebook, pixels.
NOTEBOOK_HEIGHT = 620


@attrs.frozen(eq=False)
class View:
    """A result as a page, with its plain data; a notebook shows the last one of a cell."""

    data: dict[str, Any] = attrs.field(repr=False)

    @property
    def title(self) -> str:
        """Name of the scene."""
        return str(self.data["about"]["title"])

    @property
    def instants(self) -> int:
        """Number of instants that the page holds."""
        return int(self.data["instants"])

    @property
    def html(self) -> str:
        """The page: the template with everything put in."""
        data = self.data
        program = "\n".join(_text_of(f"assets/js/{part}.js") for part in PROGRAM)
        style, three = _text_of("assets/view.css"), _text_of("vendor/three.min.js")
        try:
            text = json.dumps(data, separators=(",", ":"), allow_nan=False)
        except ValueError:  # no run of ours leaves such a result
            raise ResultError(
                "the result holds numbers that are not finite: no page shows it"
            ) from None
        parts = {
            "title": html.escape(self.title),
            "scripts": f"{_hash(three)} {_hash(program)}",
            "styles": _hash(style),
            "style": style,
            "licence": html.escape(_text_of("vendor/LICENSE").strip()),
            "three": three,
            "data": text.replace("<", "\\u003c"),
            "program": program,
        }
        pieces: list[str] = []  # each part is put in once, none within inserted text
        for piece in _text_of("assets/page.html").split("{{"):
            name, closed, rest = piece.partition("}}")
            pieces.append(parts[name] + rest if closed else piece)
        return "".join(pieces)

    def save(self, path: str | os.PathLike[str], force: bool = False) -> Path:
        """Write the page to a file, whole or not at all; returns the path.

        Raises:
            ResultError: the file cannot be written, or exists and ``force`` is off.
        """
        target = Path(path)
        with whole_file(target, force) as part:
            part.write_text(self.html, encoding="utf-8")
        return target

    def _repr_html_(self) -> str:
        """The page in a frame for notebooks, from which it reaches nothing of theirs."""
        return (
            f'<iframe srcdoc="{html.escape(self.html)}" title="{html.escape(self.title)}" '
            'sandbox="allow-scripts allow-forms" allowfullscreen '
            f'style="width: 100%; height: {NOTEBOOK_HEIGHT}px; border: 0"></iframe>'
        )


@checked
def view(
    result: Any,
    *quantities: str,
    fps: float | None = None,
    play: bool = False,
    model: str | os.PathLike[str] | None = None,
    allow_code: bool = False,
    progress: Callable[[int, int], None] | None = None,
    announce: Callable[[str], None] | None = None,
) -> View:
    """A result or a sweep as a page: the moving scene, plots, the ledger, settings.

    The points of a sweep, some 50 of many, are run again; in the page they are chosen by sliders.

    Args:
        result: a ``Result``, or the data set of a sweep.
        quantities: curves that are shown at first, such as ``crank.r.z``; more can be chosen in
            the page. By default energies, and motion of the first body; of a sweep its outputs.
        fps: frames a second of the page, nearest reported instants; by default every instant.
        play: the scene moves as the page opens, unless its reader's system asks for less motion.
        model: the model (a name, a folder, a file) in whose folder meshes of shapes lie; of a
            sweep also that of its own types.
        allow_code: of a sweep: permits types of that model's ``plugin.py``.
        progress: of a sweep: called as progress(done, total). announce: as ``compile``.

    Returns:
        A view: shown by notebooks, written by ``.save("page.html")``.

    Raises:
        UnknownNameError: there is no such quantity; names the nearest.
        ValueError: the result has no instants, fps is not positive, or no point of a sweep runs.
        SceneError: there is no such model, or the scene of a sweep cannot be used.
    """
    if hasattr(result, "data_vars"):  # a data set of xarray
        from dap3d_core.view.sweep_page import sweep_data

        data = sweep_data(result, quantities, fps, model=model, allow_code=allow_code,
                          progress=progress, announce=announce)  # fmt: skip
    else:
        require("result", Result, result)
        data = page_data(result, scene_of(result, model), quantities, fps)
    return View(data | {"play": play})


def _text_of(name: str) -> str:
    return (files("dap3d_core.view") / name).read_text(encoding="utf-8")


def _hash(text: str) -> str:
    """The name of a script or a style in a content security policy: no other one is run."""
    digest = hashlib.sha256(text.encode("utf-8")).digest()
    return f"'sha256-{base64.b64encode(digest).decode('ascii')}'"
