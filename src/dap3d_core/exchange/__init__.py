"""The exchange layer: results as files of other programs, by exporters of plugins."""

from dap3d_core.exchange.export import (
    Export,
    check_fps,
    export,
    exporter_of,
    result_exporters,
    suffix_of,
)

__all__ = ["Export", "check_fps", "export", "exporter_of", "result_exporters", "suffix_of"]
