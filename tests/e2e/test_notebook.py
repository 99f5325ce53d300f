"""The notebook of the first tutorial is that of its page, and its cells run in their order."""

import ast
import importlib.util
import json
from contextlib import chdir

import pytest
from support.process import REPOSITORY

PAGE = REPOSITORY / "docs" / "tutorials" / "slider-crank.md"
NOTEBOOK = PAGE.with_suffix(".ipynb")


def tool():
    """The script that makes notebooks."""
    spec = importlib.util.spec_from_file_location("notebook", REPOSITORY / "tools/notebook.py")
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def shown(source, names):
    """Run a cell; returns the value of its last line where this is an expression, else None."""
    tree = ast.parse(source)
    last = tree.body.pop() if isinstance(tree.body[-1], ast.Expr) else None
    exec(compile(tree, "cell", "exec"), names)
    return last and eval(compile(ast.Expression(last.value), "cell", "eval"), names)


def test_it_is_made_of_the_page():
    made = tool().notebook(PAGE.read_text(encoding="utf-8"))
    assert NOTEBOOK.read_text(encoding="utf-8") == made, "python tools/notebook.py writes it anew"
    texts = ["".join(c["source"]) for c in json.loads(made)["cells"] if c["cell_type"] != "code"]
    assert texts[0].startswith("# A slider-crank in Python\n")
    assert not any("```" in text or "](" in text for text in texts)


@pytest.mark.slow
def test_its_cells_run_and_show_the_result(tmp_path, monkeypatch):
    monkeypatch.setenv("MPLBACKEND", "agg")
    cells = json.loads(NOTEBOOK.read_text(encoding="utf-8"))["cells"]
    code = ["".join(cell["source"]) for cell in cells if cell["cell_type"] == "code"]
    names = {}
    with chdir(tmp_path):
        results = [shown(source, names) for source in code]
    (html,) = [x._repr_html_() for x in results if type(x).__name__ == "Result"]
    assert "<img" in html
    assert "initial velocities corrected" in html
    assert results[-1].get_figure() is not None  # the axes of the last line
