"""What it costs that a type comes from outside: nothing.

``sph`` is copied, as it stands, into another package under another keyword, and ``ptp`` into the
``plugin.py`` of a model. The same scene is run with the standard type and with the copy, in turns.
The mark is a ratio of 1.1.
"""

import contextlib
import inspect
import sys
import tempfile
from pathlib import Path

import numpy as np
import scenes
from right_hand_side import WORK, repeat
from timing import median_seconds

import dap3d_core as dap
from dap3d_core.registry import load_registry
from dap3d_core.simulation import CompiledModel

MARK = 1.1
BODIES, RUNS = 64, 15
PACKAGE = "dap3d_bench_copy"


def copied(kind, keyword):
    """The source of a standard type, under the keyword ``copied-KEYWORD``."""
    text = inspect.getsource(inspect.getmodule(load_registry().get(kind, keyword).type))
    assert text.count(f'"{keyword}"') == 1
    return text.replace(f'"{keyword}"', f'"copied-{keyword}"')


@contextlib.contextmanager
def installed(folder):
    """A distribution on the path that brings the copy of ``sph``."""
    Path(folder, f"{PACKAGE}.py").write_text(copied("joint", "sph"))
    info = Path(folder, f"{PACKAGE}-1.0.dist-info")
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {PACKAGE}\nVersion: 1.0\n")
    (info / "entry_points.txt").write_text(f"[dap3d.joints]\ncopied-sph = {PACKAGE}\n")
    sys.path.insert(0, str(folder))
    try:
        yield
    finally:
        sys.path.remove(str(folder))


def springs():
    """A row of bodies on springs, the first of them on ground, each a little turned."""
    scene = dap.Scene(name=f"{BODIES} on springs")
    before = "ground.O"
    for k in range(BODIES):
        name = f"b{k}"
        scene.add_body(name, mass=1.0, Jp=(0.1, 0.2, 0.3), r=(k + 1.0, 0.0, 0.0), w=(0.1, 0.2, 0.3))
        here = scene.add_point(f"P{k}", name, (-0.2, 0.1, 0.0))
        scene.add_force("ptp", f"F{k}", P_i=here, P_j=before, k=50.0, c=0.1, l0=0.5)
        before = f"{name}.O"
    return scene


def with_type(scene, table, keyword):
    """The scene, with another type for the elements of the type that ``copied-`` stands before."""
    for element in getattr(scene, table).values():
        if f"copied-{element.type}" == keyword:
            element.type = keyword
    return scene


def right_hand_sides(compiled):
    """A function that evaluates right-hand sides for some 10 ms."""
    evaluator = compiled.evaluator
    y = evaluator.integrated(evaluator.model.u0)
    out = np.zeros_like(y)
    count = WORK // (4 * BODIES)
    return lambda: repeat(evaluator.functions, count, y, out, evaluator.system, evaluator.loops)


def whole_run(compiled):
    """A function that simulates 0.2 s."""
    return lambda: dap.simulate(compiled, t_end=0.2, dt=0.2, rtol=1e-8, atol=1e-8)


def compared(title, pair):
    """Rows for a pair of compiled models, standard and from outside, which do the same."""
    first, second = (whole_run(c)() for c in pair)
    assert np.array_equal(first.u, second.u)
    rows = []
    for what, function in (("right-hand side", right_hand_sides), ("run", whole_run)):
        standard, outside = median_seconds([function(c) for c in pair], RUNS)
        ratio = outside / standard
        rows.append({"case": title, "run": what, "standard_ms": 1e3 * standard,
                     "from_outside_ms": 1e3 * outside, "ratio": ratio,
                     "in_mark": "yes" if ratio <= MARK else "no"})  # fmt: skip
    return rows


def measure():
    """Rows of the table: case, what is timed, milliseconds, ratio."""
    with tempfile.TemporaryDirectory() as folder, installed(folder):
        other = with_type(scenes.chain(BODIES), "joints", "copied-sph")
        pair = CompiledModel(scenes.chain(BODIES), joint=False), CompiledModel(other, joint=False)
        rows = compared("joint of another package", pair)
    with tempfile.TemporaryDirectory() as folder:
        Path(folder, "plugin.py").write_text(copied("force", "ptp"))
        with_type(springs(), "forces", "copied-ptp").save(Path(folder, "scene.toml"))
        pair = CompiledModel(springs()), CompiledModel(folder, allow_code=True)
        rows += compared("force of a model's own file", pair)
    return rows
