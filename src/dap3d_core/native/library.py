"""``load_native``: an exported model seen from Python, for comparison."""

import ctypes
import os
import re
import shutil
import tempfile
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.native.build import PLATFORMS, Platform, build_objects, link, own_platform
from dap3d_core.native.c_source import KINDS, CalledUnit, Variable, units_of
from dap3d_core.native.run.directions import Directions
from dap3d_core.native.run.outputs import SYMBOL, Outputs
from dap3d_core.native.run.prepared import PreparedRun
from dap3d_core.registry.arguments import checked
from dap3d_core.registry.suggestions import did_you_mean
from dap3d_core.simulation import SimulationError

OK, ENDED = 0, 1
#: Functions of dap3d.h: result, name, arguments; what they are of, where they are no pointers.
DECLARED = re.compile(r"\w+_API ([\w *]+?)(dap3d_\w+)\((.*?)\);", re.DOTALL)
TYPES: dict[str, Any] = {
    "void": None, "int": ctypes.c_int, "double": ctypes.c_double, "size_t": ctypes.c_size_t,
    "const char *": ctypes.c_char_p,
}  # fmt: skip


def _type_of(words: str) -> Any:
    """The type of a result or an argument, with its name behind it or without."""
    kind = re.sub(r"\w+$", "", words).strip() if " " in words else words
    return TYPES.get(kind, ctypes.c_void_p)


def _declare(library: Any) -> None:
    """Give the functions of a library their types, those of the header."""
    header = (Path(__file__).parent / "source" / "dap3d.h").read_text(encoding="utf-8")
    for result, name, arguments in DECLARED.findall(header):
        function, words = getattr(library, name), arguments.split(",")
        function.restype = _type_of(result if "*" in result else result.strip())
        function.argtypes = [] if words == ["void"] else [_type_of(word.strip()) for word in words]


class NativeLibrary:
    """The shared library of an exported model.

    Attributes:
        kinds: name of a variable -> "time", "input", "parameter", "output", "state", "derivative",
            "indicator".
        units: name of a variable -> its unit.
    """

    def __init__(self, path: Path) -> None:
        """Args: the file."""
        # a copy: the loader takes a file that was written anew for the one that it knows
        folder = tempfile.mkdtemp()
        library = ctypes.CDLL(str(shutil.copy(path, folder)))
        shutil.rmtree(folder, ignore_errors=True)  # Windows keeps a file that is loaded
        _declare(library)
        self.functions: Any = library
        count = range(library.dap3d_count())
        names = [library.dap3d_name(v).decode() for v in count]
        self.references = {name: v for v, name in enumerate(names)}
        self.kinds = {name: KINDS[library.dap3d_kind(v)] for v, name in enumerate(names)}
        self.units = {name: library.dap3d_unit(v).decode() for v, name in enumerate(names)}

    def start(self, t_end: float = 0.0) -> "NativeRun":
        """Begin a run to t_end, s; 0 for one whose end is not known."""
        return NativeRun(self, t_end)


class NativeRun:
    """A run of an exported model."""

    def __init__(self, library: NativeLibrary, t_end: float) -> None:
        """Args: the library, and the end of the run, s."""
        self._library, self._call = library, library.functions
        self._step_to = self._call.dap3d_step_to
        self._model = self._call.dap3d_create(float(t_end))
        if not self._model:
            raise ValueError(f"t_end is {t_end!r}; it should be a positive number of seconds, or 0")

    def __del__(self) -> None:
        if getattr(self, "_model", None):
            self._call.dap3d_free(self._model)

    @property
    def t(self) -> float:
        """Time reached, s."""
        return float(self._call.dap3d_time(self._model))

    def _reference(self, name: str) -> int:
        if name not in self._library.references:
            hint = did_you_mean(name, self._library.references, "; {}")
            raise KeyError(f"the model has no variable {name!r}{hint}")
        return self._library.references[name]

    def __getitem__(self, name: str) -> float:
        """The value of a variable."""
        return float(self._call.dap3d_get(self._model, self._reference(name)))

    def __setitem__(self, name: str, value: float) -> None:
        """Set an input or a parameter."""
        if self._call.dap3d_set(self._model, self._reference(name), float(value)) != OK:
            raise ValueError(self.message)

    def values(self, names: Sequence[str]) -> Floats:
        """(k,) values of variables."""
        references = np.array([self._reference(name) for name in names], dtype=np.int32)
        values = np.zeros(len(references))
        self._call.dap3d_get_all(
            self._model, references.ctypes.data, len(references), values.ctypes.data
        )
        return values

    @property
    def message(self) -> str:
        """Why the last call failed."""
        return str(self._call.dap3d_message(self._model).decode())

    def step_to(self, t: float) -> bool:
        """Go on to a time, s; False where the model has ended the run before.

        Raises:
            SimulationError: the run cannot go on.
        """
        result = self._step_to(self._model, t)
        if result != OK and result != ENDED:
            raise SimulationError(self.message)
        return bool(result == OK)

    def save(self) -> bytes:
        """The state of the run."""
        state = ctypes.create_string_buffer(self._call.dap3d_state_size())
        self._call.dap3d_save(self._model, state)
        return state.raw

    def load(self, state: bytes) -> None:
        """Continue from a saved state.

        Raises:
            ValueError: it is of another model.
        """
        if len(state) != self._call.dap3d_state_size():
            raise ValueError("the state is not one of this model")
        if self._call.dap3d_load(self._model, state) != OK:
            raise ValueError(self.message)

    def directional(self, unknowns: Sequence[str], along: Mapping[str, float]) -> Floats:
        """(k,) derivatives of outputs or derivatives along a direction of states, inputs, ...

        Args:
            unknowns: names of outputs and derivatives.
            along: name of a state, input, tunable parameter or "time" -> its part.

        Raises:
            SimulationError: there are no such derivatives.
        """
        of = np.array([self._reference(name) for name in unknowns], dtype=np.int32)
        by = np.array([self._reference(name) for name in along], dtype=np.int32)
        seed, found = np.array([*along.values()], dtype=float), np.zeros(len(of))
        pointers = seed.ctypes.data, found.ctypes.data
        if self._call.dap3d_directional(
            self._model, of.ctypes.data, len(of), by.ctypes.data, len(by), *pointers
        ):
            raise SimulationError(self.message)
        return found

    def derivatives(self, t: float, y: Floats) -> Floats:
        """(k,) derivatives of the states y at t."""
        given = np.ascontiguousarray(y, dtype=float)
        if given.shape != (self._call.dap3d_state_count(),):
            raise ValueError(f"y has {given.size} numbers, not {self._call.dap3d_state_count()}")
        rates = np.zeros(len(given))
        if self._call.dap3d_derivatives(
            self._model, float(t), given.ctypes.data, rates.ctypes.data
        ):
            raise SimulationError(self.message)
        return rates


@checked
def load_native(folder: str | os.PathLike[str]) -> NativeLibrary:
    """Load the shared library of a model that ``export_model`` wrote with ``format="c"``.

    Args:
        folder: that was written.

    Raises:
        FileNotFoundError: there is no library for this machine in it.
    """
    place, name = Path(folder), own_platform()
    suffix = PLATFORMS[name].library if name in PLATFORMS else ".so"
    found = sorted((place / name).glob(f"*{suffix}"))
    if not found:
        raise FileNotFoundError(f"{place} has no library for {name}")
    return NativeLibrary(found[0])


@attrs.frozen
class Exported:
    """A model on its way into files.

    Attributes:
        prepared, variables: of the model.
        name: for files.
        outputs: with the function that computes them.
        directions: directional derivatives; None where a function has none.
    """

    prepared: PreparedRun
    variables: list[Variable]
    name: str
    outputs: Outputs
    directions: Directions | None

    @property
    def units(self) -> list[CalledUnit]:
        """Units of compiled code that it calls."""
        return units_of(self.prepared, self.directions)

    def link(self, source: Path, target: Platform, library: Path, archive: Path | None) -> int:
        """Make libraries of a C file, which has data.h beside it; bytes of the shared one."""
        objects = source.parent / target.name
        objects.mkdir(exist_ok=True)
        texts = [(self.outputs.text, SYMBOL)]
        if self.directions is not None:
            texts.append((self.directions.text, self.directions.symbol))
        files = build_objects(self.units, texts, target, objects)
        library.parent.mkdir(parents=True, exist_ok=True)
        link(source, files, target, library, archive)
        return library.stat().st_size
