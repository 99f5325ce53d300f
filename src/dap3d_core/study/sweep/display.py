"""The data set of a sweep as it shows itself at a prompt and in a notebook."""

import json
from html import escape
from typing import Any

import numpy as np
import xarray  # noqa: TID253, this module is loaded where there is a data set

from dap3d_core.result.file.schema import SWEEP
from dap3d_core.scene.display import html_table
from dap3d_core.study.study import PointStatus


class Sweep(xarray.Dataset):  # type: ignore[no-untyped-call]
    """An ``xarray.Dataset`` that shows itself as one line, and in a notebook as two tables.

    Selections of it are of this class, too. What is no sweep any more, such as sums without
    attributes, is shown as xarray does.
    """

    __slots__ = ()

    def __repr__(self) -> str:
        words = self._words()
        return super().__repr__() if words is None else f"<Sweep {words}>"

    def _repr_html_(self) -> str:
        """The numbers that vary and the outputs; all text in them is escaped."""
        words = self._words()
        if words is None:
            return str(super()._repr_html_())
        numbers = [
            (name, self[name].attrs.get("units", ""), self[name].size, *_ends(self[name].values))
            for name in self._varied()
        ]
        outputs = [
            (name, one.attrs.get("units", ""), " x ".join(map(str, one.dims)) or "one point")
            for name, one in self.data_vars.items()
            if name not in ("status", "note")
        ]
        return (
            f"<p><strong>{escape(f'Sweep {words}')}</strong></p>"
            f"{html_table(('number', 'unit', 'values', 'least', 'largest'), numbers)}"
            f"{html_table(('output', 'unit', 'along'), outputs)}"
        )

    def _words(self) -> str | None:
        """Scene, points and how they ended, outputs; None where this is no sweep any more."""
        if SWEEP not in self.attrs or "status" not in self.data_vars:
            return None
        status = self["status"]
        sizes = " x ".join(map(str, status.shape)) or "1"
        along = f" ({', '.join(self._varied())})" if self._varied() else ""
        counts = [(int(np.sum(status.values == s.value)), s.name.lower()) for s in PointStatus]
        ended = ", ".join(f"{n} {word}" for n, word in counts if n) or "none"
        outputs = ", ".join(str(n) for n in self.data_vars if n not in ("status", "note"))
        return f"{self.attrs.get('model', '')!r}: {sizes} points{along}, {ended}; {outputs}"

    def _varied(self) -> list[str]:
        """Names of the numbers that vary here."""
        try:
            names = [str(one["name"]) for one in json.loads(self.attrs["varied"])]
        except (KeyError, TypeError, ValueError):
            return []
        return [name for name in names if name in self.coords]


def _ends(values: Any) -> tuple[Any, Any]:
    """The least and the largest value, as text."""
    if not values.size:
        return "", ""
    return f"{np.min(values):.6g}", f"{np.max(values):.6g}"
