"""The arrays of a system as symbols: what a program of the scene reads and writes."""

from collections.abc import Callable, Iterator, Mapping
from typing import Any

import numpy as np

from dap3d_core.assembly.arrays import (
    CHECKPOINTED,
    DOUBTFUL,
    SCRATCH,
    SINGULAR,
    UNSETTLED,
    Floats,
    Integers,
)
from dap3d_core.assembly.metric import METRIC_CONSTANTS
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.formulations.joint import node_layout as node
from dap3d_core.formulations.joint_loops.layout import PART_OF_ROW
from dap3d_core.kernels.compiler.straight_line import Item, StraightLine
from dap3d_core.kernels.compiler.types import FLOAT, Array, Struct
from dap3d_core.kernels.compiler.units import address_of
from dap3d_core.kernels.runtime.array_struct import Arrays
from dap3d_core.kernels.runtime.loop_support import MASS

#: Arrays that outlive an evaluation.
KEPT = (*CHECKPOINTED, "watched")
#: Numbers of arrays in which nothing is ever written that is not zero, or that no program reads.
UNREAD = {"nu": 0.0, "watched": np.nan}
#: Numbers of ``settings`` that a run changes.
COUNTED = (SCRATCH, UNSETTLED, SINGULAR, DOUBTFUL)
#: Members of a system -> flat indices of numbers that differ from run to run; None: all runs are
#: of one model.
Varied = Mapping[str, Integers] | None


def constants(evaluator: Evaluator, varied: Varied = None) -> Iterator[tuple[str, Integers]]:
    """Name of a member, and flat indices of its numbers that no evaluation changes.

    What these are at the start of a run they are at its end, unless an event sets them. With
    ``varied``, what follows from its numbers at the start of a run is not among them either.
    """
    for name, places in _constants(evaluator, varied is None):
        yield name, np.setdiff1d(places, varied[name]) if varied and name in varied else places


def _constants(evaluator: Evaluator, of_start: bool) -> Iterator[tuple[str, Integers]]:
    system = evaluator.system
    par = np.ones(system.par.size, dtype=bool)
    for places in evaluator.turn_places():
        par[places] = False
    yield "par", np.flatnonzero(par)
    settings = np.ones(system.settings.size, dtype=bool)
    settings[list(COUNTED)] = False
    yield "settings", np.flatnonzero(settings)
    yield "weight", np.arange(system.weight.size)
    yield "metric", _of_rows(system.metric, slice(METRIC_CONSTANTS))
    yield "body", _of_rows(system.body, slice(MASS, None))
    if of_start:
        yield "smallest", np.arange(system.smallest.size)
        yield "F", _of_rows(system.F, slice(4, 5))
    if system.tree is not None:
        masses = slice(MASS, None) if of_start else slice(0)
        yield "tree.places", _of_rows(system.tree.places, masses)
        yield "tree.constants", np.arange(system.tree.constants.size)
        yield "tree.work", np.arange(node.WORK_WIDTH)  # of ground, which does not move
        if system.tree.kept is not None:
            yield "tree.kept.settings", np.array([PART_OF_ROW])
            if of_start:
                yield "tree.kept.smallest", np.arange(system.tree.kept.smallest.size)


def _of_rows(array: Floats, columns: slice) -> Integers:
    """Flat indices of columns of an array, and of its first row, which is that of ground."""
    chosen = np.zeros(array.shape, dtype=bool)
    chosen[:, columns] = chosen[0] = True
    return np.flatnonzero(chosen)


def word_of(arrays: Arrays, name: str) -> int:
    """Which word of a struct the address of a member is."""
    members = arrays.type_of().members
    before = members[: [member for member, _ in members].index(name)]
    return sum(len(type_.words) for _, type_ in before)


class SymbolicStruct:
    """A class of arrays whose floats are symbols; its scalars are items of these."""

    def __init__(self, tracer: StraightLine, scalars: dict[str, Any]) -> None:
        self.tracer, self._scalars = tracer, scalars

    def __getattr__(self, name: str) -> Any:
        """The number of a scalar."""
        if name not in self.__dict__["_scalars"]:
            raise AttributeError(name)
        scalar = self._scalars[name]
        return getattr(self, scalar.array)[scalar.index]


class SymbolicSystem:
    """The arrays of an evaluator as symbols.

    Attributes:
        struct: what the functions of the core take for a system.
    """

    def __init__(self, evaluator: Evaluator, tracer: StraightLine, varied: Varied = None) -> None:
        self._tracer = tracer
        #: Of each piece of memory: its first item's address, and its items as symbols.
        self._memory: dict[int, Any] = {}
        #: Of members that are kept from one evaluation to another: name, symbols, pointer, as they
        #: were.
        self._kept: list[tuple[str, Any, Callable[[], str], Any]] = []
        self._constants = dict(constants(evaluator, varied))
        self.struct = self.symbolic(evaluator.system, lambda: "%system", "")

    def symbolic(self, arrays: Arrays, base: Callable[[], str], before: str) -> SymbolicStruct:
        """The arrays of a struct; ``base`` gives its address, ``before`` begins names."""
        struct = SymbolicStruct(self._tracer, type(arrays).scalars)
        for name, type_ in arrays.type_of().members:
            member = getattr(arrays, name)
            pointer = self.pointer(base, word_of(arrays, name))
            if isinstance(type_, Struct) and member is not None:
                member = self.symbolic(member, pointer, f"{before}{name}.")
            elif isinstance(type_, Array) and type_.item is FLOAT:
                member = self._numbers(member, pointer, before + name)
            setattr(struct, name, member)
        return struct

    def pointer(self, base: Callable[[], str], word: int) -> Callable[[], str]:
        """What gives the address of an array, which stands at some word of a struct."""
        new = self._tracer.new
        return lambda: new(
            f"load ptr, ptr {new(f'getelementptr inbounds i64, ptr {base()}, i64 {word}')}, align 8"
        )

    def _numbers(self, array: Floats, pointer: Callable[[], str], name: str) -> Any:
        """Symbols of the numbers of an array; arrays that share memory share them."""
        root = array if array.base is None else array.base
        if id(root) not in self._memory:
            self._memory[id(root)] = root, np.full(root.size, None, dtype=object)
        first = (address_of(array) - address_of(root)) // 8 if array.size else 0
        symbols = self._memory[id(root)][1][first : first + array.size]
        numbers = array.ravel().tolist()
        for k, number in enumerate(numbers):
            if symbols[k] is None:
                symbols[k] = UNREAD.get(name, Item(self._tracer, (pointer, k), number))
        for k in self._constants.get(name, ()):
            symbols[k] = numbers[k]
        if name in KEPT:
            self._kept.append((name, symbols, pointer, symbols.copy()))
        return symbols.reshape(array.shape)

    def stores(self) -> list[tuple[Callable[[], str], int, Any]]:
        """Pointer, index and number of what was written and outlives an evaluation."""
        return [
            (pointer, k, symbols[k])
            for name, symbols, pointer, before in self._kept
            for k in range(len(symbols))
            if symbols[k] is not before[k] and (name, k) != ("settings", SCRATCH)
        ]
