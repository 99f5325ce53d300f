"""What one right-hand side costs: chains of spherical and revolute joints, a star, free bodies.

The mark is a chain written by hand.
"""

import importlib.util
import sys
from functools import cache

import numpy as np
import plain_chain
import scenes
from timing import median_seconds

from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.simulation import CompiledModel

SIZES = (1, 8, 64, 1000, 100_000)
#: Right-hand sides of one timing: some 50 ms.
WORK = 100_000


@compiled
def repeat(functions, count, y, out, system, loops):
    """Call the right-hand side of a formulation count times."""
    rhs = functions[0]
    for _ in range(count):
        rhs(0.0, y, out, system, loops)


def our(scene):
    """Count right-hand sides, and a function that evaluates them, for a scene."""
    evaluator = CompiledModel(scene, joint=False).evaluator
    y = evaluator.integrated(evaluator.model.u0)
    out = np.zeros_like(y)
    count = max(2, WORK // evaluator.model.body_count)
    functions = evaluator.functions
    return count, lambda: repeat(functions, count, y, out, evaluator.system, evaluator.loops)


def plain(n):
    """The same for the chain written by hand."""
    u, arguments = plain_chain.chain(n)
    du = np.zeros_like(u)
    count = max(2, WORK // n)
    return count, lambda: plain_chain.repeat(count, u, du, *arguments)


@cache
def loaded(path):
    """The module at a path."""
    spec = importlib.util.spec_from_file_location("prototype", path)
    module = sys.modules["prototype"] = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def prototype(path, n):
    """The same for another program with ``build(n)`` and ``rk4(u, h, steps, args)``.

    It takes four right-hand sides a step.
    """
    module = loaded(path)
    u, arguments = module.build(n)
    steps = max(2, WORK // n // 4)
    return 4 * steps, lambda: module.rk4(u.copy(), 1e-9, steps, arguments)


def measure(against=None):
    """Rows of the table: mechanism, bodies, microseconds, and per body, ratios to the marks."""
    rows = []
    for n in SIZES:
        runs = {"ours": our(scenes.chain(n)), "by hand": plain(n)}
        if against:
            runs["mark"] = prototype(against, n)
        times = dict(zip(runs, median_seconds([f for _, f in runs.values()]), strict=True))
        per = {name: times[name] / runs[name][0] * 1e6 for name in runs}
        row = {
            "mechanism": "chain, spherical",
            "bodies": n,
            "us": per["ours"],
            "us_per_body": per["ours"] / n,
            "ratio_by_hand": per["ours"] / per["by hand"],
        }
        if against:
            row["ratio_mark"] = per["ours"] / per["mark"]
        rows.append(row)
    others = {
        "chain, revolute": [(n, scenes.chain(n, "rev")) for n in SIZES[:-1]],
        "star": [(1001, scenes.star(1000))],
        "free bodies": [(n, scenes.free(n)) for n in SIZES[:-1]],
    }
    for title, made in others.items():
        for n, scene in made:
            count, function = our(scene)
            us = median_seconds([function])[0] / count * 1e6
            rows.append({"mechanism": title, "bodies": n, "us": us, "us_per_body": us / n})
    return rows
