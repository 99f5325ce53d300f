"""Compare the results of two commits, bit for bit, on this machine.

    python tools/same_results.py BASE [--quick] [--scenes NAME ...]

The working tree and BASE (unpacked into a temporary folder) compute the same things from the scenes
of BASE, each in a process of its own that imports its own sources alone:

- a short run of every shipped model, of an example of every installed type, and of some scenes made
  here, with every method and integrator that take it;
- of each model a sweep and a run that is resumed from a checkpoint;
- of each model what the commands check, run, post and export write;
- an error estimate, events, a report, a fit.

Prints one line for each array that differs, with the largest difference relative to the size of the
array, and exits with 1 if there is any. What both refuse alike is equal. Both sides are driven by
public names and commands alone, so that modules may be moved between the two commits; both open
the files that BASE wrote, too.

--quick takes method auto alone, and the commands on two models: some two minutes of one core.
"""

import argparse
import io
import json
import math
import os
import re
import subprocess
import sys
import tarfile
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from contextlib import redirect_stdout, suppress
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

ROOT = Path(__file__).resolve().parents[1]
METHODS = ("auto", "unconstrained", "standard", "penalty", "lsq", "joint")
INTEGRATORS = ("dopri5", "dop853", "adams", "rk4", "radau", "auto")
#: Arrays of a run, and those that the post-processor computes from them.
STORED = ("t", "u", "v_dot", "Lam")
COMPUTED = ("r", "p", "rd", "w", "wp", "rdd", "wd", "wpd", "rP", "rPd", "rPdd")
#: Scenes that a side loads, as files of BASE; the models among them get sweeps and commands, too.
MODELS, EXAMPLES = "models", "examples"
#: Models whose commands run in a quick comparison: joints and a driver; types of its own.
QUICK_COMMANDS = ("fourbar3", "ball1")
Arrays = dict[str, np.ndarray]


def main() -> None:
    """Run both sides, compare, print."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("base", help="commit to compare with")
    parser.add_argument("--scenes", nargs="*", default=[], help="only these scenes")
    parser.add_argument("--quick", action="store_true", help="method auto; commands on two models")
    options = parser.parse_args()
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        archive = ["git", "-C", str(ROOT), "archive", options.base]
        with tarfile.open(
            fileobj=io.BytesIO(subprocess.run(archive, check=True, stdout=subprocess.PIPE).stdout)
        ) as tar:
            tar.extractall(folder / "base", filter="data")
        base, tree = Side(folder / "base", folder / "of-base"), Side(ROOT, folder / "of-tree")
        _write_scenes(base, folder / "scenes")
        work = [str(folder / "scenes"), str(int(options.quick)), ",".join(options.scenes)]
        processes = [side.start("--side", *work) for side in (base, tree)]
        codes = [process.wait() for process in processes]
        if any(codes):
            sys.exit("a side ended with an error: see above")
        for side in (base, tree):
            side.start("--open", str(base.folder)).wait()
        before, after = base.arrays(), tree.arrays()
    differences = list(compare(before, after))
    print("\n".join(differences))
    refused = sum(name.endswith("refused") for name in before.keys() & after.keys())
    print(f"{len(before)} arrays compared ({refused} refusals), {len(differences)} differ")
    sys.exit(bool(differences))


def compare(before: Arrays, after: Arrays) -> Iterator[str]:
    """One line for each array that is not the same in all bits."""
    for name in sorted(before | after):
        if name not in before or name not in after:
            yield f"{name}: only in {'BASE' if name in before else 'the working tree'}"
            continue
        one, other = before[name], after[name]
        if one.shape != other.shape or one.dtype.kind != other.dtype.kind:
            yield f"{name}: {one.dtype}{one.shape} became {other.dtype}{other.shape}"
        elif one.tobytes() != other.tobytes():
            if one.dtype.kind != "f":
                yield f"{name}: {one!r} became {other!r}"
                continue
            size = np.max(np.abs(one), initial=np.finfo(float).tiny)
            yield f"{name}: differs by {np.max(np.abs(one - other)) / size:.1e} of its size"


class Side:
    """Sources of one commit: processes that import them, and the arrays these computed."""

    def __init__(self, root: Path, folder: Path) -> None:
        self.folder = folder
        folder.mkdir()
        paths = [folder / "installed"]
        for file in (root / "pyproject.toml", *root.glob("plugins/*/pyproject.toml")):
            paths += _installed(file, paths[0])
        surroundings = {"PYTHONPATH": os.pathsep.join(map(str, paths)), "SOURCES": str(root)}
        self.environment = os.environ | surroundings

    def start(self, *words: str) -> subprocess.Popen[bytes]:
        """Start this file with some words, as a process of this side."""
        command = [sys.executable, "-P", str(Path(__file__).resolve()), *words]
        return subprocess.Popen(command, env=self.environment, cwd=self.folder)

    def arrays(self) -> Arrays:
        """All arrays that were computed, by name."""
        found: Arrays = {}
        for file in sorted(self.folder.glob("*.npz")):
            with np.load(file) as arrays:
                found |= dict(arrays)
        return found


def _installed(file: Path, folder: Path) -> list[Path]:
    """Name a distribution and its entry points to importlib.metadata; the folders of its modules.

    Only metadata of the side's own commit lead to where its modules lie.
    """
    about = tomllib.loads(file.read_text())
    project = about["project"]
    name = f"{project['name'].replace('-', '_')}-{project['version']}.dist-info"
    (folder / name).mkdir(parents=True)
    metadata = f"Metadata-Version: 2.1\nName: {project['name']}\nVersion: {project['version']}\n"
    (folder / name / "METADATA").write_text(metadata)
    groups = {"console_scripts": project.get("scripts", {}), **project.get("entry-points", {})}
    lines = []
    for group, points in groups.items():
        lines += [f"[{group}]", *(f"{key} = {value}" for key, value in points.items())]
    (folder / name / "entry_points.txt").write_text("\n".join(lines) + "\n")
    build = about.get("tool", {}).get("hatch", {}).get("build", {})
    return [file.parent / directory for directory in build.get("dev-mode-dirs", ["src"])]


def _write_scenes(base: Side, folder: Path) -> None:
    """Collect the scenes: the models of BASE, and examples of its types, made to move."""
    root = Path(base.environment["SOURCES"])
    for file in sorted(root.glob("models/**/scene.toml")):
        (folder / MODELS).mkdir(parents=True, exist_ok=True)
        (folder / MODELS / file.parent.name).symlink_to(file.parent, target_is_directory=True)
    if base.start("--examples", str(folder / EXAMPLES)).wait():
        sys.exit("the examples of the types cannot be had from BASE: see above")


def write_examples(folder: str) -> None:
    """Write the example of every type that works, with bodies that turn and fall."""
    Path(folder).mkdir()
    types = _command("plugins", "--no-compile")["types"]
    kinds = ("joint", "force", "function")
    types = [one for one in types if one["state"] == "ok" and one["kind"] in kinds]
    for keyword in sorted({about["keyword"] for about in types}):
        for about in _command("describe", keyword)["types"]:
            text = re.sub(
                r"^(\[bodies\..*\])$", r"\1\nw = [0.3, 0.2, 0.1]", about["example"], flags=re.M
            )
            if 'type = "weight"' not in text:
                text += '\n[forces.falls]\ntype = "weight"\n'
            file = Path(folder) / f"{about['kind']}-{keyword}"
            file.mkdir()
            (file / "scene.toml").write_text(text)


# ------------------------------------------------------------- in the process of a side


def _public() -> Any:
    """The public names, of this side's own sources."""
    import dap3d_core as dap

    if not Path(dap.__file__ or "").resolve().is_relative_to(os.environ["SOURCES"]):
        sys.exit(f"{dap.__file__} is not of {os.environ['SOURCES']}")
    return dap


def _command(*words: str) -> Any:
    """The JSON object that a dap3d command prints, and its exit code.

    The command runs in this process, through its entry point: starting many takes long.
    """
    from importlib.metadata import entry_points

    (script,) = entry_points(group="console_scripts", name="dap3d")
    printed, before = io.StringIO(), sys.argv
    sys.argv = ["dap3d", *words, "--json"]
    try:
        with redirect_stdout(printed):
            code = script.load()()
    except SystemExit as ended:
        code = ended.code
    finally:
        sys.argv = before
    return {"exit": int(code or 0), **json.loads(printed.getvalue() or "{}")}


def side(folder: str, quick: str, chosen: str) -> None:
    """Compute everything with the sources on the path, and save it by scene."""
    dap = _public()
    scenes: dict[str, Callable[[], Any]] = {}
    for file in sorted(Path(folder).glob("*/*")):
        scenes[file.name] = partial(dap.load, file)
    scenes |= {"chain-600": partial(_chain, 600), "net-9": partial(_net, 9)}
    names = chosen.split(",") if chosen else list(scenes)
    for name in names:
        scene, found = scenes[name](), {}
        is_model = (Path(folder) / MODELS / name).exists()
        settings = _settings(scene)
        methods = METHODS if is_model and quick == "0" else METHODS[:1]
        for label, chosen_settings in _combinations(settings, methods, len(scene.bodies)):
            run = partial(dap.simulate, scene, **settings | chosen_settings)
            found |= _attempt(f"{name} {label}", run)
        if is_model:
            found |= _swept(f"{name} sweep", scene, settings)
            found |= _attempt(f"{name} resumed", partial(_resumed, scene, settings))
            if quick == "0" or name in QUICK_COMMANDS:
                found |= _commanded(name, Path(folder) / MODELS / name, settings["t_end"])
        np.savez(f"{name}.npz", **found)
        print(f"{Path.cwd().name}: {name}", file=sys.stderr, flush=True)
    if not chosen:
        np.savez("others.npz", **_others(dap.load(Path(folder) / MODELS / "pen1")))


def _settings(scene: Any) -> dict[str, Any]:
    """A tenth of the time of a scene, at most a second; all that needs little work."""
    t_end = min(1.0, 0.1 * float(scene.simulation.t_end or 1.0))
    t_end = 0.02 if len(scene.bodies) > 100 else t_end
    return {"t_end": t_end, "dt": t_end / 20, "allow_code": True}


def _combinations(
    settings: dict[str, Any], methods: tuple[str, ...], bodies: int
) -> Iterator[tuple[str, dict[str, Any]]]:
    """Methods and integrators; the largest scenes with two integrators alone."""
    for method in methods:
        for integrator in INTEGRATORS if bodies < 100 else ("dop853", "rk4"):
            step = {"step": settings["t_end"] / 50} if integrator == "rk4" else {}
            yield f"{method} {integrator}", {"method": method, "integrator": integrator, **step}


def _attempt(label: str, compute: Callable[[], Any]) -> Arrays:
    """Arrays of the result that a function computes, by name; the refusal where there is none."""
    try:
        result = compute()
    except Exception as error:
        result = getattr(error, "result", None)
        if result is None:
            return {f"{label} refused": np.array(type(error).__name__)}
    stats = result.stats
    counts = [stats.steps, stats.rejected, stats.rhs, stats.projections]
    found = {f"{label} {key}": np.asarray(getattr(result, key)) for key in STORED}
    found[f"{label} counts"] = np.array(counts)
    if label.endswith((" auto auto", " resumed", " events", " estimated")):
        found |= {f"{label} {name}": value for name, value in _computed(result)}
    return found


def _computed(result: Any) -> Iterator[tuple[str, np.ndarray]]:
    """Arrays of the post-processor, and what is known of a run as a whole."""
    for key in COMPUTED:
        yield key, np.asarray(getattr(result, key))
    for key in ("kinetic", "potential", "total"):
        yield f"energy {key}", np.asarray(getattr(result.energy, key))
    for key, entry in result.ledger.items():
        yield f"ledger {key}", np.array([entry.value, entry.limit], float)
    for joint, sides in result.reactions().items():
        for slot, reaction in sides.items():
            yield f"reaction {joint} {slot}", np.hstack([reaction.force, reaction.moment])
    for force in result.force_names:
        with suppress(LookupError, ValueError):  # weight and friction have no bodies of their own
            for slot, acting in result.force(force).on.items():
                yield f"force {force} {slot}", np.hstack([acting.force, acting.moment])
    yield "events", np.array([event.t for event in result.events])
    if result.error is not None:
        yield "error", np.asarray(result.error.u)


def _swept(label: str, scene: Any, settings: dict[str, Any]) -> Arrays:
    """Outputs of a sweep of two points over the mass of the first body."""
    body = next(iter(scene.bodies))
    outputs = [f"{body}.r.z:max", f"{body}.w.x:end", "energy.total:end"]
    varied = {f"bodies.{body}.mass": [1.0, 2.0]}
    data = _public().sweep(scene, varied, outputs=outputs, **settings)
    return {f"{label} {name}": np.asarray(data[name]) for name in outputs if name in data}


def _resumed(scene: Any, settings: dict[str, Any]) -> Any:
    """The result of a run that is interrupted after its first chunk and resumed."""
    dap = _public()

    def interrupt(_t: float, _t_end: float) -> None:
        raise KeyboardInterrupt

    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "run.nc"
        with suppress(KeyboardInterrupt):
            return dap.simulate(
                scene, **settings, output=file, checkpoint=math.inf, progress=interrupt
            )
        return dap.resume(f"{file}.checkpoint", model=scene.path, allow_code=True)


def _commanded(name: str, model: Path, t_end: float) -> Arrays:
    """Numbers that commands print and write: check, run, post, export."""
    found: Arrays = {}
    own, file = ("--model", str(model), "--allow-code"), f"{name}.nc"
    short = ("--t-end", str(t_end), "--dt", str(t_end / 20))
    for words in (
        ("check", str(model), "--allow-code"),
        ("run", str(model), "--allow-code", *short, "-o", file),
        ("post", file, "-o", f"{name}-post.nc", "--jacobian", *own),
        ("export", file, "--format", "csv", "-o", f"{name}.csv"),
    ):
        numbers = _numbers(_command(*words), (name, words[0]))
        found |= {key: np.array(value) for key, value in numbers}
    for written in (file, f"{name}-post.nc"):
        found |= {f"{written} {key}": value for key, value in _variables(Path(written))}
    if Path(f"{name}.csv").exists():
        found[f"{name} csv"] = np.array(Path(f"{name}.csv").read_text())
    return found


def _numbers(value: Any, path: tuple[str, ...]) -> Iterator[tuple[str, float]]:
    """Numbers of a JSON object that are no times of the clock or sizes of files, by their keys."""
    if path and re.search("time_s$|size_bytes|^versions$", path[-1]):
        return
    if isinstance(value, dict | list):
        for key, part in value.items() if isinstance(value, dict) else enumerate(value):
            yield from _numbers(part, (*path, str(key)))
    elif isinstance(value, int | float):
        yield " ".join(path), value


def _variables(file: Path) -> Iterator[tuple[str, np.ndarray]]:
    """The arrays of numbers in a file."""
    import netCDF4

    if file.exists():
        with netCDF4.Dataset(file) as data:
            data.set_auto_mask(False)
            for key, variable in data.variables.items():
                if variable.dtype is not str:
                    yield key, np.asarray(variable[...])


def _others(scene: Any) -> Arrays:
    """An estimate of the error, events, a report and a fit, of a pendulum."""
    dap = _public()
    settings = _settings(scene)
    body = next(iter(scene.bodies))
    events = [dap.Event(f"{body}.w.x", below=0.0), dap.Event(f"{body}.r.y", below=0.0)]
    found = _attempt("estimated", partial(dap.simulate, scene, estimate_error=True, **settings))
    found |= _attempt("with events", partial(dap.simulate, scene, events=events, **settings))
    report = dap.report(scene, quick=True, t_end=0.1, integrators=["dop853", "dopri5", "rk4"])
    found |= {f"report {k}": np.array(run.error, float) for k, run in enumerate(report.runs)}
    run = dap.simulate(scene, **settings)
    measured = {"t": run.t, f"{body}.r.z": run.r[:, 0, 2]}
    mass = float(scene.bodies[body].mass)
    numbers = {f"bodies.{body}.mass": dap.Parameter(1.1 * mass, 0.5 * mass, 2.0 * mass)}
    with suppress(dap.SimulationError, dap.SceneError):
        fitted = dap.fit(scene, numbers, measured, **settings)
        found["fit"] = np.array([float(value) for value in fitted.values.values()])
    return found


def _chain(n: int) -> Any:
    """Rods of 1 m and 1 kg, end to end from ground; many enough for two threads."""
    scene = _public().Scene(name=f"chain of {n}")
    outer = "ground.O"
    for k in range(n):
        scene.add_body(f"b{k}", mass=1.0, Jp=(0.001, 1 / 12, 1 / 12), r=(k + 0.5, 0.0, 0.0))
        inner = scene.add_point(f"in{k}", f"b{k}", (-0.5, 0.0, 0.0))
        scene.add_joint("sph", f"J{k}", P_i=inner, P_j=outer)
        outer = scene.add_point(f"out{k}", f"b{k}", (0.5, 0.0, 0.0))
    scene.add_force("weight", "gravity")
    return scene


def _net(n: int) -> Any:
    """A square net of n x n balls, one metre apart, hung up at a corner; rods hold neighbours."""
    scene = _public().Scene(name=f"net of {n}")
    for i in range(n):
        for j in range(n):
            scene.add_body(f"b{i}_{j}", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(i, j, 0.0))
    scene.add_joint("sph", "hook", P_i="b0_0.O", P_j="ground.O")
    for i in range(n):
        for j in range(n):
            for k, m in ((i + 1, j), (i, j + 1)):
                if k < n and m < n:
                    ends = {"P_i": f"b{i}_{j}.O", "P_j": f"b{k}_{m}.O"}
                    scene.add_joint("sph-sph", f"rod{i}_{j}_{k}_{m}", length=1.0, **ends)
    scene.add_force("weight", "gravity")
    return scene


def open_results(folder: str) -> None:
    """Read the results that commands of BASE wrote, and save their arrays."""
    for file in sorted(Path(folder).glob("*.nc")):
        if not file.stem.endswith("-post"):
            result = _public().open(file)
            found = {
                f"{file.stem} opened {key}": np.asarray(getattr(result, key)) for key in STORED
            }
            np.savez(f"{file.stem}-opened.npz", **found)


if __name__ == "__main__":
    inner = {"--side": side, "--examples": write_examples, "--open": open_results}
    if sys.argv[1:2] and sys.argv[1] in inner:
        inner[sys.argv[1]](*sys.argv[2:])
    else:
        main()
