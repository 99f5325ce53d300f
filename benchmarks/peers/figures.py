"""Pictures made from the cells: work against precision, growth with the number of bodies."""

import math

import levels
import matplotlib

matplotlib.use("Agg")
from matplotlib import pyplot

#: Okabe and Ito's colours, which colour-blind readers can tell apart; each with a marker.
LOOK = {
    "dap3d": ("#000000", "o"),
    "exudyn": ("#E69F00", "s"),
    "mujoco": ("#0072B2", "^"),
    "drake": ("#009E73", "D"),
    "pinocchio": ("#CC79A7", "v"),
    "dart": ("#D55E00", "v"),
}
PANELS = ("free-body-1", "heavy-top-1", "spherical-chain-8", "spherical-chain-64",
          "revolute-chain-8", "four-bar-1")  # fmt: skip
#: Those of the README, in one row: a top, a long chain, a closed loop.
GLANCE = ("heavy-top-1", "revolute-chain-64", "four-bar-1")
SETTINGS = {
    "svg.hashsalt": "dap3d",  # equal data give equal files
    "svg.fonttype": "none",
    "font.size": 9,
    "axes.grid": True,
    "grid.alpha": 0.3,
    "axes.spines.top": False,
    "axes.spines.right": False,
}
LEAST_ERROR = 1e-12


def front(cells, scene, program):
    """(seconds, error) of the settings that no other setting of the program beats."""
    pairs = sorted(
        (levels.seconds_of(c), max(c["error"], LEAST_ERROR))
        for ladder in levels.ladders_of(cells, scene, program).values()
        for c in ladder
    )
    found, least = [], math.inf
    for seconds, error in pairs:
        if error < least:
            found, least = [*found, (seconds, error)], error
    return found


def _line(axes, program, x, y):
    colour, marker = LOOK[program]
    axes.plot(x, y, color=colour, marker=marker, markersize=4, linewidth=1.2, label=program)


def work_precision(cells, path, panels=PANELS):
    """One panel a scene: error of the best settings of each program against time."""
    there = {cell["scene"] for cell in cells}
    scenes = [scene for scene in panels if scene in there]
    with pyplot.rc_context(SETTINGS):
        count = len(panels) // 3
        figure, rows = pyplot.subplots(
            count, 3, figsize=(10, 3 * count), layout="constrained", squeeze=False
        )
        for axes, scene in zip(rows.flat, scenes, strict=False):
            unit = levels.best(cells, scene, levels.OURS, 1e-6)[0]
            for program in levels.PROGRAMS:
                points = [(s / unit, e) for s, e in front(cells, scene, program) if e < 1.0]
                if points:
                    _line(axes, program, *zip(*points, strict=True))
            axes.set(xscale="log", yscale="log", title=scene, ylim=(LEAST_ERROR / 2, 1.0))
        for axes in rows.flat[len(scenes) :]:
            axes.set_visible(False)
        figure.supxlabel("time / dap3d's time to 1e-6")
        figure.supylabel("largest error of a position at the end, m" if count > 1 else "error, m")
        handles, labels = rows.flat[0].get_legend_handles_labels()
        figure.legend(handles, labels, loc="outside upper center", ncols=5, frameon=False)
        figure.savefig(path, metadata={"Date": None})
        pyplot.close(figure)


def growth(cells, path):
    """Time to 1e-6 against the number of bodies of the chains; up to 64 of 1 s, beyond of 0.1 s."""
    with pyplot.rc_context(SETTINGS):
        figure, row = pyplot.subplots(1, 2, figsize=(10, 4), layout="constrained", sharey=True)
        for axes, kind in zip(row, ("spherical", "revolute"), strict=True):
            sizes = sorted({int(c["scene"].rsplit("-", 1)[1]) for c in cells
                            if c["scene"].startswith(kind)})  # fmt: skip
            base = levels.best(cells, f"{kind}-chain-{sizes[0]}", levels.OURS, 1e-6)[0]
            for program in levels.PROGRAMS:
                for part in ([n for n in sizes if n <= 64], [n for n in sizes if n > 64]):
                    times = [levels.best(cells, f"{kind}-chain-{n}", program, 1e-6)[0]
                             for n in part]  # fmt: skip
                    good = [(n, t / base) for n, t in zip(part, times, strict=True)
                            if math.isfinite(t)]  # fmt: skip
                    if good:
                        _line(axes, program, *zip(*good, strict=True))
            axes.set(xscale="log", yscale="log", title=f"{kind} joints", xlabel="bodies")
        row[0].set_ylabel("time to 1e-6 / dap3d's with one body")
        handles, labels = row[0].get_legend_handles_labels()
        named = dict(zip(labels, handles, strict=True))
        figure.legend(named.values(), named.keys(), loc="outside upper center", ncols=5,
                      frameon=False)  # fmt: skip
        figure.savefig(path, metadata={"Date": None})
        pyplot.close(figure)


def contacts(ladders, path):
    """One panel a scene with a closed form: error against CPU time, a line for each method."""
    scenes = ("ball", "bounce", "slope", "tower")
    with pyplot.rc_context(SETTINGS):
        figure, rows = pyplot.subplots(2, 2, figsize=(10, 7), layout="constrained")
        for axes, scene in zip(rows.flat, scenes, strict=True):
            for (where, program, _), found in ladders.items():
                points = [(r["seconds"], max(r["error"], 1e-17)) for r in found if r["error"]]
                if where == scene and points:
                    _line(axes, program, *zip(*points, strict=True))
            axes.set(xscale="log", yscale="log", title=scene)
        figure.supxlabel("CPU time, s")
        figure.supylabel("largest error of a position, m")
        labels = dict(zip(*reversed(rows[0, 0].get_legend_handles_labels()), strict=True))
        figure.legend(labels.values(), labels.keys(), loc="outside upper center", ncols=4,
                      frameon=False)  # fmt: skip
        figure.savefig(path, metadata={"Date": None})
        pyplot.close(figure)
