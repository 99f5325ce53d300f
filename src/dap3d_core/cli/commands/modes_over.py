"""``dap3d modes --over``: modes followed over the values of a parameter."""

from typing import TYPE_CHECKING, Any

from dap3d_core.cli.framework import options
from dap3d_core.cli.process.exit_codes import refusing

if TYPE_CHECKING:
    from dap3d_core.cli.console.console import Terminal
    from dap3d_core.scene import Scene
    from dap3d_core.study.modes_over import ModesOver


def find_modes_over(
    scene: "Scene", over: str, time: float | None, number: int, *, allow_code: bool
) -> "ModesOver":
    """The modes over what --over names.

    Raises:
        Refused: it is not PARAMETER=FROM:TO:N, or the scene cannot be linearised at a value.
        SceneError: there is no such parameter, or the values are none.
    """
    import dap3d_core as dap

    with options.over_values(over) as (name, values), refusing(dap.SimulationError):
        return dap.modes_over(scene, name, values, t=time or 0.0, modes=number,
                              allow_code=allow_code)  # fmt: skip


def data_of(name: str, found: "ModesOver") -> dict[str, Any]:
    """The modes as data; null where there is no such mode."""
    return {
        "scene": name,
        "parameter": found.parameter,
        "unit": found.unit,
        "values": found.values,
        "frequencies": found.frequencies,
        "damping": found.damping,
        "real": found.eigenvalues.real,
        "imag": found.eigenvalues.imag,
        "grows": found.grows,
        "stable": found.stable,
        "steady": found.steady,
        "notes": found.notes,
    }


def show(console: "Terminal", name: str, found: "ModesOver") -> None:
    """Print the frequency and damping of each mode at the first and the last value."""
    import numpy as np

    from dap3d_core.cli.console.console import scene_name

    console.title(scene_name(name))
    x, stable = found.values, found.stable
    where = "stable at all values"
    if not found.steady.all():
        where = f"no equilibrium, no steady motion at {np.sum(~found.steady)} of {len(x)} values"
    elif not stable.all():
        unstable = x[~stable]
        where = f"unstable at {len(unstable)} of {len(x)} values, "
        where += f"{unstable.min():g} to {unstable.max():g}"
    unit = "" if found.unit in ("1", "SI") else f" {found.unit}"
    ends = f"{found.parameter} from {x[0]:g} to {x[-1]:g}{unit}, {len(x)} values"
    console.facts([("over", ends), ("stability", where)])
    f, damping, grows = found.frequencies, found.damping, found.grows
    rows = [
        (
            str(k + 1),
            *(_number(f[row, k], "", 0.0) for row in (0, -1)),
            *(_number(damping[row, k], "0", 5e-10) for row in (0, -1)),
            f"{x[grows[:, k]].min():g} to {x[grows[:, k]].max():g}" if grows[:, k].any() else "",
        )
        for k in range(f.shape[1])
    ]
    if rows:
        console.table(("", "Hz, first", "last", "damping, first", "last", "grows"), rows,
                      right=(0, 1, 2, 3, 4), fixed=(0, 1, 2, 3, 4))  # fmt: skip
    console.section("notes", found.notes)


def _number(value: float, zero: str, least: float) -> str:
    """A number for people; a dash where there is no such mode."""
    if value != value:
        return "-"
    return zero if zero and abs(value) <= least else f"{value:.5g}" if not zero else f"{value:.3g}"
