"""Summary of a sweep: status of its points, extremes of its outputs, failures."""

import json
from typing import TYPE_CHECKING, Any

from dap3d_core.cli.console.console import Terminal, scene_name, seconds
from dap3d_core.result.arrays import LARGE

if TYPE_CHECKING:
    import xarray

#: Failed points that are printed, and that JSON holds.
LISTED, MOST_FAILING = 10, 1000
#: Status of a failed point -> word.
FAILURES = {2: "stopped", 3: "failed"}
#: Status -> its text in the summary.
COUNTS = {"done": "done", "stopped": "stopped early", "failed": "failed", "open": "not run"}


def sweep_data(dataset: "xarray.Dataset") -> dict[str, Any]:
    """The summary of a sweep as data."""
    import numpy as np

    status = dataset["status"].values
    counts = np.bincount(status.ravel().clip(0, 3), minlength=4).tolist()
    about, failing = dataset.attrs, np.argwhere(status >= 2)
    return {
        "model": about["model"],
        "points": int(status.size),
        **dict(zip(("open", "done", "stopped", "failed"), counts, strict=True)),
        "design": about["design"],
        "shape": list(status.shape),
        "seed": about.get("seed"),
        "varied": json.loads(about["varied"]),
        "outputs": [
            _output(dataset, output)
            for output in json.loads(about["outputs"])
            if output["name"] in dataset.variables
        ],
        "failing": [_failure(dataset, tuple(map(int, row))) for row in failing[:MOST_FAILING]],
        "versions": json.loads(about["versions"]),
    }


def _output(dataset: "xarray.Dataset", about: dict[str, str]) -> dict[str, Any]:
    """An output with its extremes and their points, read block by block; None if there are none."""
    import numpy as np

    variable = dataset[about["name"]]
    extremes: dict[str, tuple[Any, Any]] = {"min": (None, None), "max": (None, None)}
    rows = len(variable)
    step = max(1, LARGE * rows // max(variable.nbytes, 1))
    for first in range(0, rows, step):
        values = variable[first : first + step].values
        if np.isnan(values).all():
            continue
        for word, place in (("min", np.nanargmin(values)), ("max", np.nanargmax(values))):
            row, *rest = np.unravel_index(place, values.shape)
            value, best = float(values.flat[place]), extremes[word][0]
            if best is None or (value < best if word == "min" else value > best):
                extremes[word] = value, (int(row) + first, *map(int, rest))
    data: dict[str, Any] = dict(about)
    for word, (value, index) in extremes.items():
        data[word] = value
        data[f"at_{word}"] = None if index is None else _point(dataset, variable.dims, index)
    return data


def _point(
    dataset: "xarray.Dataset", dimensions: tuple[Any, ...], index: tuple[int, ...]
) -> dict[str, Any]:
    """The values of the parameters, and the time, at an index."""
    places = dict(zip(dimensions, index, strict=True))
    point: dict[str, Any] = {"point": places["point"]} if "point" in places else {}
    for name, coordinate in dataset.coords.items():
        if set(coordinate.dims) <= places.keys():
            place = tuple(places[dimension] for dimension in coordinate.dims)
            point[str(name)] = coordinate.values[place].item()
    return point


def _failure(dataset: "xarray.Dataset", index: tuple[int, ...]) -> dict[str, Any]:
    """A point that stopped early or failed."""
    status = dataset["status"]
    at, word = _point(dataset, status.dims, index), FAILURES[min(int(status[index]), 3)]
    return {"at": at, "status": word, "note": str(dataset["note"][index].values)}


def show_sweep(console: Terminal, data: dict[str, Any], file: str = "") -> None:
    """Print the summary of a sweep in a file, perhaps with its ``points_per_second``."""
    total = data["points"]
    console.title(f"{scene_name(data['model'])}: {total:,} {'point' if total == 1 else 'points'}")
    rate = data.get("points_per_second")
    time = f"{seconds(data['wall_time_s'])}, {rate:.3g} points/s" if rate else ""
    console.facts(
        [
            ("points", ", ".join(f"{data[k]:,} {text}" for k, text in COUNTS.items() if data[k])),
            ("design", _design(data)),
            *((f"{v['name']}", _values(v["spec"])) for v in data["varied"]),
            ("time", time),
            ("file", file),
        ]
    )
    rows = [
        (label if word == "min" else "", word, f"{one[word]:.6g}", _in_words(one[f"at_{word}"]))
        for one in data["outputs"]
        for label in [one["name"] + (f" [{one['unit']}]" if one["unit"] not in ("", "1") else "")]
        for word in ("min", "max")
        if one[word] is not None
    ]
    if rows:
        console.table(("output", "", "value", "where"), rows, right=(2,), fixed=(1, 2))


def show_failing(console: Terminal, data: dict[str, Any], others: str) -> None:
    """Print the first failed points, and how to list the others."""
    failing = data["failing"]
    if not failing:
        return
    count = data["stopped"] + data["failed"]
    console.say(f"{count:,} of {data['points']:,} points went wrong:", "red")
    console.items([f"{_in_words(f['at'])}: {_reason(f)}" for f in failing[:LISTED]])
    if count > LISTED:
        console.say(f"and {count - LISTED:,} more: {others}", whole=True)


def _reason(failed: dict[str, Any]) -> str:
    """How a point ended, once: notes of runs say that they stopped."""
    note: str = failed["note"]
    return note if note.startswith("the run stopped") else f"{failed['status']}: {note}"


def _in_words(at: dict[str, Any]) -> str:
    """A point in words."""
    shown = {k: v if isinstance(v, str) else f"{v:.6g}" for k, v in at.items()}
    return ", ".join(f"point {v}" if k == "point" else f"{k} = {v}" for k, v in shown.items())


def _design(data: dict[str, Any]) -> str:
    if data["seed"] is None:
        return f"{data['design']} {' x '.join(f'{n:,}' for n in data['shape'])}"
    return f"{data['design']}, {data['points']:,} samples, seed {data['seed']}"


def _values(spec: Any) -> str:
    """The values of a varied parameter: its form, or a list."""
    if isinstance(spec, str):
        return spec
    return ", ".join(f"{x:.6g}" for x in spec[:12]) + (", ..." if len(spec) > 12 else "")
