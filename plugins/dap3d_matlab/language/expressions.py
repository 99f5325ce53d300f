"""Evaluates MATLAB expressions of a small part of the language."""

import math
import re
from collections.abc import Callable
from typing import TYPE_CHECKING, Any

import numpy as np

from dap3d_core.registry.suggestions import nearest
from dap3d_matlab.language.operators import (
    EXTRAS,
    OPERATIONS,
    Operation,
    RefusalError,
    ReportedError,
    check_size,
    checked,
    numbers,
)
from dap3d_matlab.language.parse import SourceFile, text_of
from dap3d_matlab.language.structures import MAKERS
from dap3d_matlab.language.values import (
    LARGEST_MATRIX,
    Broken,
    Numbers,
    Struct,
    copied,
    kind_of,
    make,
    size_of,
)

if TYPE_CHECKING:
    from tree_sitter import Node

#: Functions of each element of a matrix.
_ELEMENTWISE: dict[str, Callable[[Numbers], Numbers]] = {
    "sqrt": np.sqrt,
    "abs": np.abs,
    "sin": np.sin,
    "cos": np.cos,
    "tan": np.tan,
    "asin": np.arcsin,
    "acos": np.arccos,
    "atan": np.arctan,
    "exp": np.exp,
    "deg2rad": np.deg2rad,
}
_FILLED: dict[str, Callable[[int, int], Numbers]] = {
    "zeros": lambda rows, columns: np.zeros((rows, columns)),
    "ones": lambda rows, columns: np.ones((rows, columns)),
    "eye": lambda rows, columns: np.eye(rows, columns),
}
_FUNCTIONS = (*_ELEMENTWISE, "atan2", "norm", "diag", *_FILLED)
#: Maximal nesting of brackets.
DEEPEST = 50
#: Maximal number of entries of all arrays in the expressions of a file: some seconds of work.
MOST_ENTRIES = 3_000_000

_NUMBER = re.compile(r"(\d++\.?\d*+|\.\d++)([eEdD][+-]?\d++)?")
_OUTSIDE = {
    "lambda": "a function handle",
    "range": "a range",
    "cell": "a cell array",
    "comparison_operator": "a comparison",
    "boolean_operator": "a logical expression",
    "not_operator": "a logical expression",
    "handle_operator": "a function handle",
    "metaclass_operator": "a class",
    "boolean": "a truth value",
    "superclass": "a class",
}


def _call(name: str, values: list[Numbers], node: "Node") -> Numbers:
    """The value of one of ``_FUNCTIONS``."""
    if name in _FILLED:
        return _filled(name, values, node)
    count = 2 if name == "atan2" else 1
    if len(values) != count:
        words = "one argument" if count == 1 else f"{count} arguments"
        raise RefusalError(node, f"the function {name} takes {words} here")
    with np.errstate(all="ignore"):
        if name in _ELEMENTWISE:
            return checked(_ELEMENTWISE[name](values[0]), node)
        if name == "atan2":
            if values[0].shape != values[1].shape:
                raise RefusalError(node, "the arguments of atan2 have different sizes")
            return checked(np.arctan2(*values), node)
        if name == "norm":
            if min(values[0].shape) != 1:
                raise RefusalError(node, "norm takes a vector here")
            return checked(np.array([[float(np.linalg.norm(values[0]))]]), node)
    vector = values[0]
    if min(vector.shape) != 1 or vector.size > 10:
        raise RefusalError(node, "diag takes a vector here")
    return np.diag(vector.ravel())


def _filled(name: str, values: list[Numbers], node: "Node") -> Numbers:
    sizes = [v for value in values for v in value.ravel().tolist()] or [1.0]
    if len(sizes) > 2 or not all(s.is_integer() and 0 <= s <= LARGEST_MATRIX for s in sizes):
        raise RefusalError(node, f"the function {name} takes one or two sizes here")
    rows, columns = int(sizes[0]), int(sizes[-1])
    check_size(rows * columns, node)
    return _FILLED[name](rows, columns)


def _length(value: Any) -> int:
    """The cost of copying a value other than a matrix, in entries of a matrix."""
    return 10 * len(value) if isinstance(value, list) else 1


def named_children(node: "Node") -> list["Node"]:
    """The children of a node with a meaning."""
    return [n for n in node.children if n.is_named and n.type not in EXTRAS]


class Expressions:
    """Evaluates expressions.

    Args:
        source: their file.
        variables: values by name.
    """

    def __init__(self, source: SourceFile, variables: dict[str, Any]) -> None:
        self.source, self.variables = source, variables
        self._depth = self._entries = 0
        self._lengths: list[int] = []  # values of ``end``, innermost last
        self._kinds: dict[str, Callable[[Node], Any]] = {
            "number": self._number,
            "string": self._text,
            "identifier": self._name,
            "parenthesis": self._only,
            "matrix": self._matrix,
            "function_call": self._call,
            "field_expression": self._field,
            "end_keyword": self._end,
            **dict.fromkeys(OPERATIONS, lambda node: Operation(node, self.value).result()),
        }

    def value(self, node: "Node") -> Any:
        """The value of an expression: a matrix, text, a structure or a list of structures.

        Raises:
            RefusalError: it is outside the language, or wrong.
            ReportedError: it needs a broken value.
        """
        evaluate = self._kinds.get(node.type)
        if evaluate is None:
            what = _OUTSIDE.get(node.type, f"this ({node.type.replace('_', ' ')})")
            raise RefusalError(node, f"{what} is outside the language that is read")
        if self._depth >= DEEPEST:
            raise RefusalError(node, f"more than {DEEPEST} brackets within brackets")
        self._depth += 1
        try:
            value = evaluate(node)
        finally:
            self._depth -= 1
        self._entries += value.size if isinstance(value, np.ndarray) else _length(value)
        if self._entries > MOST_ENTRIES:
            words = f"more than {MOST_ENTRIES} entries of arrays in one file"
            raise RefusalError(node, f"{words}; what follows is not read")
        return value

    @property
    def are_spent(self) -> bool:
        """True if the file has reached ``MOST_ENTRIES``."""
        return self._entries > MOST_ENTRIES

    def _number(self, node: "Node") -> Numbers:
        text = text_of(node)
        if not _NUMBER.fullmatch(text):
            raise RefusalError(node, "not a decimal number")
        return checked(np.array([[float(text.lower().replace("d", "e"))]]), node)

    def _text(self, node: "Node") -> str:
        text = text_of(node)
        return text[1:-1].replace(text[0] * 2, text[0])

    def _only(self, node: "Node") -> Any:
        inner = named_children(node)
        if len(inner) != 1:
            raise RefusalError(node, "one expression is needed between the brackets")
        return self.value(inner[0])

    def _name(self, node: "Node") -> Any:
        name = text_of(node)
        if name in self.variables:
            value = self.variables[name]
            if isinstance(value, Broken):
                raise ReportedError
            return value
        if name == "pi":
            return np.array([[math.pi]])
        if name in MAKERS:
            return make(MAKERS[name], self.source.place(node))
        raise self._unknown(node, name)

    def _unknown(self, node: "Node", name: str) -> RefusalError:
        if name in _FUNCTIONS:
            return RefusalError(node, f"the function {name} needs arguments")
        known = [*self.variables, "pi", *_FUNCTIONS, *MAKERS]
        return RefusalError(node, f"{name} is not defined in this file", "", nearest(name, known))

    def _matrix(self, node: "Node") -> Any:
        rows = [n for n in named_children(node) if n.type == "row"]
        parts = [[self.value(n) for n in named_children(row)] for row in rows]
        flat = [v for row in parts for v in row]
        if any(isinstance(v, (Struct, list)) for v in flat):
            return self._array_of(node, flat)
        if any(isinstance(v, str) for v in flat):
            raise RefusalError(node, "text in brackets is not read")
        filled = [[numbers(v, node) for v in row if v.size] for row in parts]
        filled = [row for row in filled if row]
        if not filled:
            return np.zeros((0, 0))
        check_size(sum(v.size for row in filled for v in row), node)
        try:
            matrix = np.vstack([np.hstack(row) for row in filled])
        except ValueError:
            sizes = "; ".join(" ".join(size_of(v) for v in row) for row in filled)
            what = f"rows and columns do not fit together (sizes {sizes})"
            raise RefusalError(node, what) from None
        return checked(matrix, node)

    def _array_of(self, node: "Node", parts: list[Any]) -> list[Any]:
        """Structures in brackets, as an array."""
        array: list[Any] = []
        for part in parts:
            if isinstance(part, np.ndarray) and part.size == 0:
                continue
            if not isinstance(part, (Struct, list)):
                raise RefusalError(node, f"structures and {kind_of(part)} in one array")
            array += part if isinstance(part, list) else [part]
            check_size(len(array), node)
        kinds = {v.structure.kind for v in array if isinstance(v, Struct)}
        if len(kinds) > 1:
            words = " and ".join(sorted(f"{k}_struct" for k in kinds))
            raise RefusalError(node, f"{words} in one array")
        return list(copied(array))

    # ---------------------------------------------------------------- calls and elements

    def _call(self, node: "Node") -> Any:
        """An element of a variable, or a function: MATLAB writes both with brackets."""
        name_node = node.child_by_field_name("name")
        if name_node is None or name_node.type != "identifier":
            raise RefusalError(node, "this call is outside the language that is read")
        name = text_of(name_node)
        arguments = arguments_of(node)
        if name in self.variables:
            return self.element(node, self._name(name_node), arguments)
        if name in MAKERS and not arguments:
            return make(MAKERS[name], self.source.place(node))
        if name not in _FUNCTIONS:
            what = f"the function {name} is outside the language that is read; nothing is run"
            near = nearest(name, [*_FUNCTIONS, *MAKERS, *self.variables])
            remedy = "" if near else f"functions that are read: {', '.join(_FUNCTIONS)}"
            raise RefusalError(node, what, remedy, near)
        return _call(name, [numbers(self.value(n), n) for n in arguments], node)

    def element(self, node: "Node", value: Any, arguments: list["Node"]) -> Any:
        """An element of a matrix or of an array of structures."""
        if isinstance(value, Struct):
            value = [value]
        if isinstance(value, list):
            (k,) = self.indices(node, arguments, (len(value),))
            if isinstance(value[k], Broken):
                raise ReportedError
            return value[k]
        matrix = numbers(value, node)
        return np.array([[matrix[self.at(node, matrix, arguments)]]])

    def at(self, node: "Node", matrix: Numbers, arguments: list["Node"]) -> tuple[int, int]:
        """Row and column, from 0, of one element; a single index counts down the columns."""
        if len(arguments) == 1:
            (k,) = self.indices(node, arguments, (matrix.size,))
            return k % matrix.shape[0], k // matrix.shape[0]
        row, column = self.indices(node, arguments, matrix.shape)
        return row, column

    def indices(
        self, node: "Node", arguments: list["Node"], lengths: tuple[int, ...], room: int = 0
    ) -> tuple[int, ...]:
        """Indices from 0, one for each length; ``room``: allowed excess over the length."""
        if len(arguments) != len(lengths):
            raise RefusalError(node, f"{len(lengths)} indices are needed here")
        indices = []
        for argument, length in zip(arguments, lengths, strict=True):
            if argument.type == "spread_operator":
                raise RefusalError(node, "several elements at once (:) are not read")
            self._lengths.append(length)
            try:
                index = numbers(self.value(argument), argument)
            finally:
                self._lengths.pop()
            if index.size != 1 or not float(index[0, 0]).is_integer():
                raise RefusalError(node, "an index is one whole number")
            k = int(index[0, 0])
            if not 1 <= k <= length + room:
                raise RefusalError(node, f"index {k} is outside; there are {length} elements")
            indices.append(k - 1)
        return tuple(indices)

    def _end(self, node: "Node") -> Numbers:
        if not self._lengths:
            raise RefusalError(node, "end means something in an index alone")
        return np.array([[float(self._lengths[-1])]])

    def _field(self, node: "Node") -> Any:
        """A field of a structure: ``B1.r``, ``Bodies(2).r(3)``."""
        owner, field, arguments = self.parts_of(node)
        value = self.value(owner)
        if isinstance(value, list) and len(value) == 1:
            value = value[0]
        if not isinstance(value, Struct):
            raise RefusalError(node, f"{text_of(owner)} is {kind_of(value)}, which has no fields")
        check_field(node, value, field)
        content = value.value(field)
        if isinstance(content, Broken):
            raise ReportedError
        return content if arguments is None else self.element(node, content, arguments)

    def parts_of(self, node: "Node") -> tuple["Node", str, list["Node"] | None]:
        """Owner, name of the field, and its indices or None."""
        owner = node.child_by_field_name("object")
        named = [n for n in node.children_by_field_name("field") if n.type not in (".", *EXTRAS)]
        if owner is None or owner.type not in ("identifier", "function_call") or len(named) != 1:
            raise RefusalError(node, "fields of fields are not read")
        (field,) = named
        if field.type == "identifier":
            return owner, text_of(field), None
        name = field.child_by_field_name("name") if field.type == "function_call" else None
        if name is None:
            raise RefusalError(node, "a field is named by a word here")
        return owner, text_of(name), arguments_of(field)


def arguments_of(node: "Node") -> list["Node"]:
    """The arguments of a call."""
    arguments = next((n for n in node.children if n.type == "arguments"), None)
    return [] if arguments is None else named_children(arguments)


def check_field(node: "Node", struct: Struct, field: str) -> None:
    """Check that a structure has a field.

    Raises:
        RefusalError: it has none of this name.
    """
    structure = struct.structure
    known = structure.known
    if field not in known:
        near = structure.slips.get(field) or nearest(field, known)
        what = f"a {structure.kind}_struct has no field {field}"
        given = [n for n in known if n not in structure.computed]
        raise RefusalError(node, what, f"its fields: {', '.join(given)}", near)
