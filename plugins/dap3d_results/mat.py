"""The arrays of a result as a MATLAB file."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from dap3d_core.interface.formats import Exporter, ResultExporter, hookimpl
from dap3d_core.result import Result, ResultError
from dap3d_core.result.file.atomic_write import cannot
from dap3d_core.result.quantities.netcdf_export import dataset_to_write, why_no_reactions

Progress = Callable[[int, int], None]

interface_version = 1


class MatExporter(ResultExporter):
    """All arrays, for MATLAB and Octave."""

    keyword, title, suffix = "mat", "MATLAB", ".mat"

    def write_result(
        self, result: Any, path: Path, *, model: Any, progress: Progress | None
    ) -> list[str]:
        """Write a file; returns notes."""
        left_out = why_no_reactions(result)
        write_mat(result, path, reactions=not left_out)
        return [f"reactions are left out: {left_out}"] if left_out else []


def write_mat(result: Result, path: Path, *, reactions: bool) -> None:
    """Write a file of version 5, which MATLAB and Octave load.

    Its variables are ``t``, the arrays of ``dap3d post`` by their names and with their shapes,
    names as cell arrays, and the structs ``units`` and ``about``.

    Raises:
        ResultError: the file cannot be written, or the model for reactions cannot be had.
    """
    from scipy.io import savemat

    dataset = dataset_to_write(result, reactions)
    variables: dict[str, Any] = {}
    units: dict[str, str] = {}
    for word, array in dataset.variables.items():
        name = {"time": "t"}.get(str(word), str(word))
        values = array.values
        variables[name] = values.astype(object) if values.dtype.kind in "OUS" else values
        units[name] = str(array.attrs.get("units", ""))
    about = {
        "title": result.record.title,
        "status": result.status,
        "method": result.method,
        "integrator": result.integrator,
        "notes": np.array(result.notes, dtype=object),
        "scene": result.scene_text,
    }
    try:
        savemat(path, {**variables, "units": units, "about": about}, appendmat=False,
                long_field_names=True, oned_as="column", do_compression=True)  # fmt: skip
    except OSError as error:
        raise cannot("write", path, error) from error
    except ValueError as error:  # an array of 2 GiB or more
        raise ResultError(
            f"the arrays do not fit into a .mat file ({error}): a smaller fps leaves instants out; "
            "MATLAB reads the result itself as well"
        ) from error


@hookimpl
def dap3d_exporters() -> list[type[Exporter]]:
    """The exporters of this module."""
    return [MatExporter]
