"""A result as a table: a column for each component."""

from collections.abc import Callable
from pathlib import Path
from typing import Any

from dap3d_core.interface.formats import Exporter, ResultExporter, hookimpl
from dap3d_core.result.quantities.csv_table import columns_of, write_csv
from dap3d_core.result.quantities.netcdf_export import why_no_reactions

interface_version = 1


class CsvExporter(ResultExporter):
    """A column for each component, as ``dap3d post`` writes them."""

    keyword, title, suffix = "csv", "CSV", ".csv"

    def write_result(
        self, result: Any, path: Path, *, model: Any, progress: Callable[[int, int], None] | None
    ) -> list[str]:
        """Write a file; returns notes."""
        left_out = why_no_reactions(result)
        write_csv(result, path, columns_of(result, not left_out), force=True)
        return [f"reactions are left out: {left_out}"] if left_out else []


@hookimpl
def dap3d_exporters() -> list[type[Exporter]]:
    """The exporters of this module."""
    return [CsvExporter]
