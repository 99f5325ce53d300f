"""Directional derivatives of an exported model, by the code of its run in differentiated form.

Each number of the memory becomes a value and one slope (kernels/compiler/derivatives). So there
is a second memory, of pairs: word k of the first is words 2 k and 2 k + 1 of it. Tables of
addresses stand where those of the first would; integers are read from the first.
"""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.assembly.evaluate import place_state
from dap3d_core.formulations import REPORT, RHS
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.compiler.derivatives import differentiate
from dap3d_core.kernels.compiler.types import INT
from dap3d_core.kernels.compiler.units import Entry, Unit, type_of
from dap3d_core.kernels.runtime.array_struct import Arrays, pointer
from dap3d_core.kernels.runtime.cache import compiled
from dap3d_core.native.run.image import Image
from dap3d_core.native.run.outputs import SYMBOL, Outputs
from dap3d_core.native.run.prepared import PreparedRun

#: A number and its slope.
PAIR = 2


@attrs.define(eq=False, kw_only=True, slots=False)
class DirectionArrays(Arrays):
    """Where derivatives are taken, and what comes of it."""

    row: Floats  # (1 + n + report_size,) t, y and report
    rates: Floats  # (n,)
    out: Floats  # (outputs,)


@compiled
def rates_along(place: DirectionArrays, functions: Any, system: Any, loops: Any) -> None:
    """Rates at the time and state of the row."""
    rhs = functions[RHS]
    end = 1 + place.rates.shape[0]
    rhs(place.row[0], place.row[1:end], place.rates, system, loops)


@compiled
def report_along(place: DirectionArrays, functions: Any, system: Any, loops: Any) -> None:
    """The report there."""
    report = functions[REPORT]
    end = 1 + place.rates.shape[0]
    report(place.row[0], place.row[1:end], place.row[end:], system, loops)


@compiled
def bodies_along(place: DirectionArrays, functions: Any, system: Any, loops: Any) -> None:
    """The bodies there, where outputs read no more of a report."""
    place_state(place.row[1 : 1 + place.rates.shape[0]], system)


@compiled
def element_along(
    place: DirectionArrays, values: Any, loops: Any, arrays: Any, q: int, i0: int, p0: int,
    first: int, second: int, third: int,
) -> None:  # fmt: skip
    """A loop of an element, for outputs."""
    loop, v = loops[q], values.values
    one, two, three = v[first:], v[second:], v[third:]
    loop(place.row[0], arrays, i0, p0, 1, pointer(one), pointer(two), pointer(three))


class PairUnit:
    """A unit in differentiated form, which is written for the linker and not loaded here.

    Attributes:
        name, ready_name, symbols: as of ``Unit``.
    """

    def __init__(self, unit: Unit) -> None:
        """Args: the unit."""
        self._unit = unit
        self.name, self.symbols = f"{unit.name}-d{PAIR}", unit.symbols
        self.ready_name = f"{unit.ready_name}-d{PAIR}" if unit.ready_name else ""

    def fresh_text(self, symbols: list[str]) -> str:
        """As of ``Unit``."""
        return differentiate(self._unit.fresh_text(symbols), PAIR)


@attrs.frozen(eq=False)
class PairEntry:
    """A function of such a unit, by its number."""

    unit: PairUnit
    k: int

    @classmethod
    def of(cls, entry: Entry) -> "PairEntry":
        """The differentiated form of a function."""
        return cls(PairUnit(entry.unit), entry.k)


class Directions:
    """Code and memory for directional derivatives.

    Attributes:
        arrays: where they are taken.
        rates, report: differentiated functions; rates are None where steps follow contacts.
        elements: of each call of ``Elements``.
        text, symbol: LLVM IR of the differentiated outputs.
    """

    def __init__(self, prepared: PreparedRun, outputs: Outputs) -> None:
        """Make it.

        Raises:
            CompileError: a function without a derivative is called.
        """
        evaluator, elements = prepared.evaluator, outputs.elements
        n, size = len(prepared.run.present.y), evaluator.report_size
        self.arrays = DirectionArrays(
            row=np.zeros(1 + n + size), rates=np.zeros(n), out=np.zeros(max(1, len(outputs.found)))
        )
        self._prepared, self._elements = prepared, elements
        given = self.arrays, prepared.functions, evaluator.system, evaluator.loops
        self.rates = None if prepared.steps_contacts else _pair(rates_along, given)
        #: A report may be much code: of all equations.
        self._reports = outputs.reads_report or not evaluator.coordinates.are_of_bodies
        self.report = _pair(report_along if self._reports else bodies_along, given)
        calls = elements.calls
        self.elements = [
            _pair(element_along, (self.arrays, elements.arrays, c.table, c.arrays), 6)
            for c in calls
        ]
        self.symbol = f"{SYMBOL}_along"
        self.text = differentiate(outputs.text.replace(SYMBOL, self.symbol), PAIR)
        tables = [prepared.functions, evaluator.loops, *(c.table for c in calls)]
        tables = tables if self._reports or self.rates else []
        self._tables = list({id(table): table for table in tables}.values())
        prepared.more.append(self.arrays)

    @property
    def entries(self) -> list[PairEntry]:
        """All functions that are called."""
        rates = [] if self.rates is None else [self.rates]
        return [*rates, self.report, *self.elements, *self.codes.values()]

    @property
    def codes(self) -> dict[int, PairEntry]:
        """Word of the second memory -> function whose address stands there."""
        image = self._prepared.image
        functions = {RHS} if self.rates else set()
        functions |= {REPORT} if self._reports else set()
        return {
            PAIR * image.at(table) + k: PairEntry.of(entry)
            for table in self._tables
            for k, entry in enumerate(table.entries)
            if table is not self._prepared.functions or k in functions
        }

    def tables(self) -> tuple[list[tuple[int, int, int]], list[tuple[int, int]]]:
        """Addresses in the second memory (word, what it points to: word, memory 1 or 2), shapes."""
        image, arrays = self._prepared.image, self._elements.arrays
        roots: Sequence[Any] = [
            self.arrays, self._prepared.evaluator.system,
            *([arrays] if self._elements.calls else []), *(c.arrays for c in self._elements.calls),
        ]  # fmt: skip
        addresses: list[tuple[int, int, int]] = []
        shapes: list[tuple[int, int]] = []
        for root in {id(root): root for root in roots}.values():
            _add(image, root, addresses, shapes)
        return addresses, shapes


def _pair(function: Any, given: Sequence[Any], integers: int = 0) -> PairEntry:
    types = [*map(type_of, given), *[INT] * integers]
    return PairEntry.of(function.compile(types))


def _add(
    image: Image, struct: Arrays, addresses: list[tuple[int, int, int]],
    shapes: list[tuple[int, int]],
) -> None:  # fmt: skip
    """Add the table of a class of arrays, and those of further ones in it."""
    word = PAIR * image.at(struct)
    for name, type_ in struct.type_of().members:
        member = getattr(struct, name)
        if isinstance(member, Arrays):
            addresses.append((word, PAIR * image.at(member), 2))
            _add(image, member, addresses, shapes)
        elif member is not None and member.size:
            is_float = member.dtype == np.float64
            at = image.at(member)
            addresses.append((word, PAIR * at if is_float else at, 2 if is_float else 1))
        shape = () if isinstance(member, Arrays) or member is None else member.shape
        shapes += [(word + 1 + k, int(n)) for k, n in enumerate(shape)]
        word += len(type_.words)
