"""Reference of the settings of a run, the formulations and the integrators."""

from collections.abc import Iterator
from importlib import import_module
from typing import Any

from dap3d_core.settings import INTEGRATORS, METHODS, SETTINGS
from dap3d_site.markdown import code, doc_of, page, table

#: What no module of its own says.
AUTO_INTEGRATOR = (
    "`dop853` where the scene says nothing; goes over to `radau` where the scene turns out to be "
    "stiff, and says so."
)
AUTO_METHOD = (
    "`unconstrained`, `standard` or `lsq`, by the rows of the scene; it says which and why."
)
#: Environment variables, and what each does.
VARIABLES = {
    "DAP3D_CACHE_DIR": "folder that keeps compiled code; by default `dap3d` in the user's cache",
    "DAP3D_THREADS": "most threads of a study, by default one for each core",
    "DAP3D_BLOCK": "distributions whose types are left out, or `NAME:KEYWORD` of single types, "
    "separated by commas",
    "DAP3D_CPU": "processor that code is compiled for, as LLVM names it; by default this one",
    "DAP3D_PLAIN": "1: kernels run as plain Python, to look into them; slowly",
    "NO_COLOR": "any value: no colours in the terminal",
    "MPLBACKEND": "how `dap.plot` draws: `Agg` without a screen",
}


#: Modules whose docstrings describe the integrators.
INTEGRATOR_MODULES = {
    "dop853": "dap3d_core.integrators.runge_kutta.dop853",
    "dopri5": "dap3d_core.integrators.runge_kutta.dopri5",
    "rk4": "dap3d_core.integrators.runge_kutta.rk4",
    "adams": "dap3d_core.integrators.adams",
    "radau": "dap3d_core.integrators.radau.step",
    "moreau": "dap3d_core.integrators.moreau.integration",
}


def pages() -> Iterator[tuple[str, str]]:
    """The page of the settings: (path, text)."""
    yield "reference/settings.md", page("Settings of a run", *_parts())


def _parts() -> Iterator[str]:
    yield (
        "Written in `[simulation]` of a scene; options of `dap3d run` and arguments of "
        "`dap.simulate` take their place."
    )
    yield table(("setting", "default", "option", "is"), _settings())
    yield "## Formulations"
    yield "Values of `method`."
    for name in METHODS:
        yield f"### `{name}`"
        yield AUTO_METHOD if name == "auto" else _module(f"dap3d_core.formulations.{name}")
    yield "## Integrators"
    yield "Values of `integrator`."
    for name in INTEGRATORS:
        yield f"### `{name}`"
        yield AUTO_INTEGRATOR if name == "auto" else _module(INTEGRATOR_MODULES[name])
    yield "## Environment variables"
    yield table(("variable", "is"), [(code(name), text) for name, text in VARIABLES.items()])


def _settings() -> Iterator[tuple[str, ...]]:
    for name, setting in SETTINGS.items():
        option = code(setting.option) if setting.on_command_line else ""
        yield code(name), code(_written(setting.default)), option, setting.text


def _written(default: Any) -> str:
    """A default as a scene file has it."""
    if default is None:
        return ""
    if isinstance(default, float):
        return f"{default:g}"
    return "[]" if default == () else str(default).lower()


def _module(name: str) -> str:
    return doc_of(import_module(name))
