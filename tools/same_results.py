"""Compare the results of two commits, bit for bit, on this machine.

    python tools/same_results.py BASE [--models NAME ...] [--quick]

Every shipped model is run with every method and integrator that take it, at this working tree and
at BASE (checked out into a temporary folder), each in a process of its own. Besides runs, of each
model: a sweep, and a run that is resumed from a checkpoint; of one, the errors of a report. Prints
one line for each result that differs, with the largest difference relative to the size of the
quantity; exits with 1 if there is any. What both refuse is equal if both refuse it.

Runs are short: a tenth of each model's time, or one second.
"""

import argparse
import math
import os
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from contextlib import suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
METHODS = ("unconstrained", "standard", "penalty", "lsq")
INTEGRATORS = ("dopri5", "dop853", "adams", "rk4", "radau", "auto")
#: What is compared of a run; Lam and v_dot stand for what is computed from them.
ARRAYS = ("t", "u", "v_dot", "Lam")


def main() -> None:
    """Run both sides, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("base", help="commit to compare with")
    parser.add_argument("--models", nargs="*", default=None, help="only these")
    parser.add_argument("--quick", action="store_true", help="method auto alone")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as folder:
        base = Path(folder) / "base"
        git = ["git", "-C", str(ROOT), "worktree"]
        subprocess.run([*git, "add", "--detach", "--quiet", str(base), options.base], check=True)
        try:
            names = options.models or sorted(
                p.parent.name for p in base.glob("models/*/scene.toml")
            )
            methods = ("auto",) if options.quick else ("auto", *METHODS)
            before, after = (
                _run_side(root, Path(folder) / side, names, methods)
                for side, root in (("base.npz", base), ("tree.npz", ROOT))
            )
        finally:
            subprocess.run([*git, "remove", "--force", str(base)], check=True)
    differences = list(compare(before, after))
    print("\n".join(differences))
    print(f"{len(before)} arrays compared, {len(differences)} differ")
    sys.exit(bool(differences))


def compare(before: dict[str, np.ndarray], after: dict[str, np.ndarray]) -> Iterator[str]:
    """One line for each array that is not the same in all bits."""
    for name in sorted(before | after):
        if name not in before or name not in after:
            yield f"{name}: only in the {'base' if name in before else 'working tree'}"
            continue
        one, other = before[name], after[name]
        if one.shape != other.shape or one.dtype != other.dtype:
            yield f"{name}: {one.dtype}{one.shape} became {other.dtype}{other.shape}"
        elif one.tobytes() != other.tobytes():
            if one.dtype.kind != "f":
                yield f"{name}: {one!r} became {other!r}"
                continue
            size = np.max(np.abs(one), initial=np.finfo(float).tiny)
            yield f"{name}: differs by {np.max(np.abs(one - other)) / size:.1e} of its size"


def _run_side(
    root: Path, file: Path, names: list[str], methods: tuple[str, ...]
) -> dict[str, np.ndarray]:
    """Results of one side, computed in a process that imports its sources alone."""
    paths = os.pathsep.join(str(root / folder) for folder in ("src", "plugins"))
    environment = os.environ | {"PYTHONPATH": paths}
    words = [str(file), ",".join(names), ",".join(methods)]
    command = [sys.executable, str(Path(__file__)), "--side", *words]
    subprocess.run(command, env=environment, cwd=file.parent, check=True)
    with np.load(file) as arrays:
        return dict(arrays)


def side(file: str, names: list[str], methods: list[str]) -> None:
    """Compute all results with the sources on the path, and save them."""
    import dap3d_core as dap

    found: dict[str, np.ndarray] = {}
    for name in names:
        scene = dap.load(name)
        t_end = min(1.0, 0.1 * float(scene.simulation.t_end or 1.0))
        settings = {"t_end": t_end, "dt": t_end / 20, "allow_code": True}
        for method in methods:
            for integrator in INTEGRATORS:
                step = {"step": t_end / 200} if integrator == "rk4" else {}
                chosen = {**settings, "method": method, "integrator": integrator, **step}
                run = partial(dap.simulate, scene, **chosen)
                found |= _attempt(f"{name} {method} {integrator}", run)
        found |= _swept(f"{name} sweep", scene, settings)
        found |= _attempt(f"{name} resumed", partial(_resumed, scene, settings))
        print(f"{name} done", file=sys.stderr, flush=True)
    found |= _reported(dap.load(names[0]))
    np.savez(file, **found)


def _attempt(label: str, compute: Callable[[], Any]) -> dict[str, np.ndarray]:
    """Arrays of the result that a function computes, by name; the refusal where there is none."""
    import dap3d_core as dap

    try:
        result = compute()
    except (dap.SimulationError, dap.SceneError, dap.RedundantError, dap.AssemblyError) as error:
        result = getattr(error, "result", None)
        if result is None:
            return {f"{label} refused": np.array(type(error).__name__)}
    stats = result.stats
    counts = [stats.steps, stats.rejected, stats.rhs, stats.projections]
    arrays = {f"{label} {key}": np.asarray(getattr(result, key)) for key in ARRAYS}
    return arrays | {f"{label} counts": np.array(counts)}


def _swept(label: str, scene: Any, settings: dict[str, Any]) -> dict[str, np.ndarray]:
    """Outputs of a sweep of two points over the mass of the first body."""
    import dap3d_core as dap

    body = next(iter(scene.bodies))
    outputs = [f"{body}.r.z:max", f"{body}.w.x:end", "energy.total:end"]
    data = dap.sweep(scene, {f"bodies.{body}.mass": [1.0, 2.0]}, outputs=outputs, **settings)
    return {f"{label} {name}": np.asarray(data[name]) for name in outputs if name in data}


def _resumed(scene: Any, settings: dict[str, Any]) -> Any:
    """The result of a run that is interrupted after its first chunk and resumed."""
    import dap3d_core as dap

    def interrupt(_t: float, _t_end: float) -> None:
        raise KeyboardInterrupt

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.nc"
        with suppress(KeyboardInterrupt):
            return dap.simulate(
                scene, **settings, output=file, checkpoint=math.inf, progress=interrupt
            )
        return dap.resume(f"{file}.checkpoint", model=scene.path, allow_code=True)


def _reported(scene: Any) -> dict[str, np.ndarray]:
    """Errors of the runs of a short report."""
    import dap3d_core as dap

    chosen = {"quick": True, "t_end": 0.1, "allow_code": True}
    report = dap.report(scene, integrators=["dop853", "dopri5", "rk4"], **chosen)
    return {f"report {k}": np.array(run.error, float) for k, run in enumerate(report.runs)}


if __name__ == "__main__":
    if sys.argv[1:2] == ["--side"]:
        side(sys.argv[2], sys.argv[3].split(","), sys.argv[4].split(","))
    else:
        main()
