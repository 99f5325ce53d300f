"""What is said of a sweep: how its points ended, the extremes of its outputs, what failed."""

import json
from typing import TYPE_CHECKING, Any

from dap3d_core.cli.console.console import Terminal, facts, items, say, seconds, show, table, title
from dap3d_core.result.file.lazy_arrays import LARGE

if TYPE_CHECKING:
    import numpy as np
    import xarray
    from numpy.typing import NDArray

#: Points that went wrong which are listed, and which JSON holds.
LISTED, MOST_FAILING = 10, 1000
WORDS = {2: "stopped", 3: "failed"}


def sweep_facts(dataset: "xarray.Dataset") -> dict[str, Any]:
    """What there is to say of a sweep, as JSON has it."""
    import numpy as np

    status = dataset["status"].values
    counts = np.bincount(status.ravel().clip(0, 3), minlength=4).tolist()
    about = dataset.attrs
    return {
        "model": about["model"],
        "points": int(status.size),
        **dict(zip(("open", "done", "stopped", "failed"), counts, strict=True)),
        "design": about["design"],
        "shape": list(status.shape),
        "seed": about.get("seed"),
        "varied": json.loads(about["varied"]),
        "outputs": [
            _output(dataset, one)
            for one in json.loads(about["outputs"])
            if one["name"] in dataset.variables
        ],
        "failing": _failing(dataset, status),
        "versions": json.loads(about["versions"]),
    }


def _output(dataset: "xarray.Dataset", about: dict[str, str]) -> dict[str, Any]:
    """An output with its least and greatest value, and the points where they are."""
    variable = dataset[about["name"]]
    found: dict[str, Any] = dict(about)
    for word, (value, index) in _extremes(variable).items():
        found[word] = value
        found[f"at_{word}"] = None if index is None else _where(dataset, variable.dims, index)
    return found


def _extremes(variable: "xarray.DataArray") -> dict[str, tuple[Any, Any]]:
    """Least and greatest value, and where they are, found block by block; None for none."""
    import numpy as np

    found: dict[str, tuple[Any, Any]] = {"min": (None, None), "max": (None, None)}
    rows = len(variable)
    step = max(1, LARGE * rows // max(variable.nbytes, 1))
    for first in range(0, rows, step):
        values = variable[first : first + step].values
        if np.isnan(values).all():
            continue
        for word, place in (("min", np.nanargmin(values)), ("max", np.nanargmax(values))):
            row, *rest = np.unravel_index(place, values.shape)
            value, best = float(values.flat[place]), found[word][0]
            if best is None or (value < best if word == "min" else value > best):
                found[word] = value, (int(row) + first, *map(int, rest))
    return found


def _where(
    dataset: "xarray.Dataset", dimensions: tuple[Any, ...], index: tuple[int, ...]
) -> dict[str, Any]:
    """The values of the numbers, and the time, at an index."""
    places = dict(zip(dimensions, index, strict=True))
    found: dict[str, Any] = {"point": places["point"]} if "point" in places else {}
    for name, coordinate in dataset.coords.items():
        if set(coordinate.dims) <= places.keys():
            place = tuple(places[dimension] for dimension in coordinate.dims)
            found[str(name)] = float(coordinate.values[place])
    return found


def _failing(dataset: "xarray.Dataset", status: "NDArray[np.int8]") -> list[dict[str, Any]]:
    """The first points that went wrong."""
    import numpy as np

    found = []
    for row in np.argwhere(status >= 2)[:MOST_FAILING]:
        index = tuple(map(int, row))
        at = _where(dataset, dataset["status"].dims, index)
        note = str(dataset["note"][index].values)
        found.append({"at": at, "status": WORDS[min(int(status[index]), 3)], "note": note})
    return found


def show_sweep(console: Terminal, found: dict[str, Any], name: str = "") -> None:
    """Print what there is to say of a sweep.

    Args:
        console: where.
        found: as ``sweep_facts`` has it, perhaps with ``wall_time_s`` and ``points_per_second``.
        name: file that holds it.
    """
    total = found["points"]
    words = found["model"] or "scene without a name"
    title(console, f"{words}: {total:,} {'point' if total == 1 else 'points'}")
    counts = [f"{found[key]:,} {said}" for key, said in _COUNTS.items() if found[key]]
    facts(
        console,
        [
            ("points", ", ".join(counts)),
            ("design", _design(found)),
            *((f"{v['name']}", _spec(v["spec"])) for v in found["varied"]),
            ("time", _time(found)),
            ("file", name),
        ],
    )
    rows = [
        (label if word == "min" else "", word, f"{one[word]:.6g}", at_words(one[f"at_{word}"]))
        for one in found["outputs"]
        for label in [one["name"] + (f" [{one['unit']}]" if one["unit"] not in ("", "1") else "")]
        for word in ("min", "max")
        if one[word] is not None
    ]
    if rows:
        show(console, table(("output", "", "value", "where"), rows, right=(2,), fixed=(1, 2)))


_COUNTS = {
    "done": "done",
    "stopped": "stopped early",
    "failed": "failed",
    "open": "not run",
}


def show_failing(console: Terminal, found: dict[str, Any], others: str) -> None:
    """Print the first points that went wrong, and how to see the others."""
    failing = found["failing"]
    if not failing:
        return
    count = found["stopped"] + found["failed"]
    say(console, f"{count:,} of {found['points']:,} points went wrong:", "red")
    items(console, [f"{at_words(f['at'])}: {f['status']}: {f['note']}" for f in failing[:LISTED]])
    if count > LISTED:
        say(console, f"and {count - LISTED:,} more: {others}", whole=True)


def at_words(at: dict[str, Any]) -> str:
    """A point in words."""
    head = [f"point {at['point']}"] if "point" in at else []
    return ", ".join([*head, *(f"{k} = {v:.6g}" for k, v in at.items() if k != "point")])


def _design(found: dict[str, Any]) -> str:
    if found["seed"] is None:
        return f"{found['design']} {' x '.join(f'{n:,}' for n in found['shape'])}"
    return f"{found['design']}, {found['points']:,} samples, seed {found['seed']}"


def _spec(spec: Any) -> str:
    return (
        spec
        if isinstance(spec, str)
        else ", ".join(f"{x:.6g}" for x in spec[:12]) + (", ..." if len(spec) > 12 else "")
    )


def _time(found: dict[str, Any]) -> str:
    if not found.get("points_per_second"):
        return ""
    return f"{seconds(found['wall_time_s'])}, {found['points_per_second']:.3g} points/s"
