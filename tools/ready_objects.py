"""Ready-made objects of a wheel: units that most scenes need, compiled for every target.

``python tools/ready_objects.py FOLDER [TARGET ...]`` writes a file for each target. It compiles the
source tree that contains it, installed or not; it needs attrs, llvmlite, numpy, pluggy and scipy.
The loops are those of all standard types; the core's units are those that runs of the shipped
models make, with each method and integrator, and that their exports link. Where DAP3D_READY_LEVEL
is 0, for tests, code is unoptimised, of runs of three models and exports of one alone: some minutes
less.
"""

import concurrent.futures
import contextlib
import json
import os
import subprocess
import sys
import tempfile
import tomllib
from pathlib import Path
from typing import Any

ROOT = Path(__file__).parents[1]
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: External symbols that objects may have besides the C library's: those that LLVM calls.
SYSTEM = {"memcpy", "memmove", "memset", "bzero", "__bzero", "memset_pattern16", "__chkstk"}
SYSTEM.add("_fltused")  # a marker of Windows, no function
MODELS = sorted(path.parent for path in (ROOT / "models").glob("*/scene.toml"))
#: The name of the level of optimisation, and the models that tests run.
LEVEL, TRIED = "DAP3D_READY_LEVEL", ("bodies2", "fourbar3", "pen2")


def main(arguments: list[str]) -> None:
    """Write the files."""
    folder, *names = arguments
    if folder == "--gather":
        sys.path[:0] = names
        _add_sources()
        print(json.dumps(gathered()))
        return
    with tempfile.TemporaryDirectory() as scratch:
        _declare_entry_points(Path(scratch))
        units, linked = _gathered_alone(Path(scratch))
    _add_sources()
    from dap3d_core.kernels.runtime.ready import TARGETS
    from dap3d_core.native.build import PLATFORMS

    Path(folder).mkdir(parents=True, exist_ok=True)
    with concurrent.futures.ProcessPoolExecutor(initializer=_add_sources) as pool:
        given = {name: linked if name in PLATFORMS else {} for name in names or TARGETS}
        done = {name: pool.submit(pack_of, name, units, more) for name, more in given.items()}
        for name, found in done.items():
            content, count = found.result()
            (Path(folder) / f"{name}.pack").write_bytes(content)
            total = len(units) + len(given[name])
            print(f"{name}: {count} of {total} units, {len(content) / 1e3:.0f} kB")


def pack_of(
    target_name: str, units: dict[str, Any], linked: dict[str, Any] | None = None
) -> tuple[bytes, int]:
    """The content of a target's file and how many units are in it.

    Args:
        target_name: a key of ``ready.TARGETS``.
        units: text and results of each unit, by its name.
        linked: text and level of units for the linker of a platform of that name.

    A unit with an external symbol that not every such system has is left out, unless a linker that
    has it follows.
    """
    import llvmlite.binding as llvm
    from object_symbols import symbols_of

    from dap3d_core.kernels.compiler.objects import OPTIMISED, compile_ir
    from dap3d_core.kernels.compiler.writer import EXACT, LIBRARY
    from dap3d_core.kernels.runtime.ready import TARGETS, packed
    from dap3d_core.native.build import PLATFORMS

    llvm.initialize_all_targets()
    llvm.initialize_all_asmprinters()
    level = int(os.environ.get(LEVEL, OPTIMISED))
    kept = {}
    for name, (text, results) in units.items():
        code = compile_ir(text, level, TARGETS[target_name])
        if symbols_of(code).undefined <= SYSTEM | {*EXACT, *LIBRARY}:
            kept[name] = results, code
    for name, (text, own) in (linked or {}).items():
        processor = PLATFORMS[target_name].processor
        kept[name] = [], compile_ir(text, min(own, level), processor, is_linked=True)
    return packed(kept), len(kept)


def gathered() -> tuple[dict[str, Any], dict[str, Any]]:
    """Text in LLVM IR and results of each unit, text and level of each for linkers, by their names.

    In a process with an empty cache.
    """
    import dap3d_core as dap
    from dap3d_core.interface.codegen.compile_loops import compile_all
    from dap3d_core.kernels.compiler import units
    from dap3d_core.registry.registry import GROUPS
    from dap3d_core.settings import FIXED_STEP, INTEGRATORS, METHODS

    if hasattr(os, "sched_setaffinity"):
        os.sched_setaffinity(0, set(list(os.sched_getaffinity(0))[:1]))  # nothing is made beside
    units.collected = {}
    registry = dap.load_registry()
    is_tried = os.environ.get(LEVEL) == "0"
    kinds = [] if is_tried else list(GROUPS)
    for kind in kinds:
        for keyword in PROJECT["entry-points"][f"dap3d.{kind}s"]:
            compile_all(registry.get(kind, keyword))
    for folder in (path for path in MODELS if path.name in TRIED or not is_tried):
        scene = dap.load(folder)
        for integrator in INTEGRATORS:
            for method in METHODS:
                step = 1e-3 if integrator in FIXED_STEP else None
                options = {"method": method, "integrator": integrator, "step": step}
                # some do not suit a scene
                with contextlib.suppress(dap.SceneError, dap.SimulationError):
                    dap.simulate(scene, t_end=2e-3, dt=1e-3, **options)
    ball = dap.Scene(name="ball")  # what impacts need
    ball.add_body("ball", mass=1.0, Jp=[0.1] * 3, r=[0.0, 0.0, 0.1], r_dot=[0.0, 0.0, -1.0])
    ball.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1, e=0.5)
    dap.simulate(ball, t_end=2e-3, dt=1e-3)
    linked: dict[str, Any] = {}
    for file in (ROOT / "models").rglob("scene.toml"):
        if file.parent.name == TRIED[-1] or not is_tried:
            _add_linked(linked, dap.load(file.parent))
    found = units.collected, linked
    return tuple({k: v for k, v in part.items() if "@llvm.x86" not in v[0]} for part in found)


def _add_linked(linked: dict[str, Any], scene: Any) -> None:
    """Add units that exports of a scene link, with each integrator; without a parameter and with.

    What has no derivative, or cannot be exported, is left out.
    """
    import dap3d_core as dap
    from dap3d_core.kernels.compiler.types import CompileError
    from dap3d_core.native.build import module_of, ready_name
    from dap3d_core.native.export import model_of
    from dap3d_core.settings import FIXED_STEP, INTEGRATORS

    masses = [f"bodies.{name}.mass" for name in scene.bodies][:1]
    for integrator, parameters in [*((one, []) for one in INTEGRATORS), (None, masses)]:
        step = 1e-3 if integrator in FIXED_STEP else None
        with contextlib.suppress(dap.SceneError, dap.SimulationError):
            model = model_of(scene, parameters=parameters, integrator=integrator, step=step)
            for unit in model.units:
                if (name := ready_name(unit)) and name not in linked:
                    with contextlib.suppress(CompileError):
                        module = module_of(unit, Path())
                        linked[name] = module.text, module.level


def _gathered_alone(scratch: Path) -> tuple[dict[str, Any], dict[str, Any]]:
    """The units that a fresh process gathers, with an empty cache and nothing compiled beside it.

    The process extends its path itself: where pip builds in isolation, it removes the folders of
    packages that are installed editable from the path, even if PYTHONPATH names them.
    """
    env = {k: v for k, v in os.environ.items() if not k.startswith("DAP3D_") or k == LEVEL}
    env["DAP3D_CACHE_DIR"] = str(scratch / "cache")
    command = [sys.executable, __file__, "--gather", str(scratch)]
    done = subprocess.run(command, env=env, check=False, stdout=subprocess.PIPE)
    if done.returncode:
        sys.exit(done.returncode)  # it has said why
    return json.loads(done.stdout)


def _declare_entry_points(folder: Path) -> None:
    """Let the standard types be found where dap3d is not installed."""
    version = PROJECT["version"]
    info = folder / f"dap3d-{version}.dist-info"
    info.mkdir()
    (info / "METADATA").write_text(f"Metadata-Version: 2.1\nName: dap3d\nVersion: {version}\n")
    lines = []
    for group, entries in PROJECT["entry-points"].items():
        lines += [f"[{group}]", *(f"{name} = {module}" for name, module in entries.items())]
    (info / "entry_points.txt").write_text("\n".join(lines) + "\n")


def _add_sources() -> None:
    sys.path[:0] = [str(ROOT / "src"), str(ROOT / "plugins"), str(ROOT / "tools")]


if __name__ == "__main__":
    main(sys.argv[1:])
