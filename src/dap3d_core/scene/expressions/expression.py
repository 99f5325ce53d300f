"""Expressions of named values: parsed into a small tree, bounded in size, never executed.

    0.5 * (left.r.z + right.r.z) - where(t < 1, 0, 'J1.lambda.1')

A name is a dotted word; any other name stands in quotes. Python's parser reads the text, of whose
syntax only numbers, names, arithmetic, comparisons and calls of ``WORDS`` are accepted.
"""

import ast
import keyword
import math
from collections.abc import Callable, Iterator, Mapping
from functools import reduce
from typing import Any, Final, NamedTuple

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.syntax import parse
from dap3d_core.registry.suggestions import nearest
from dap3d_core.scene.coerce import canonical
from dap3d_core.scene.expressions.units import (
    Carried,
    UnitError,
    constant,
    number_of_call,
    unit_of_call,
)
from dap3d_core.scene.validate.coerce_values import Fault

Function = Callable[..., Any]

#: Longest text, in characters, and deepest nesting of operations.
LONGEST, DEEPEST = 2000, 100
CONSTANTS: Final[Mapping[str, float]] = {
    "pi": math.pi,
    **{symbol: constant(symbol) for symbol in ("deg", "rpm", "mm", "g0")},
}


class Word(NamedTuple):
    """A function: number of its arguments, its values, and whether it takes vectors as a whole."""

    arity: int
    function: Function
    takes_vectors: bool = False


def _where(condition: Floats, value: Floats, otherwise: Floats) -> Floats:
    chosen = np.where(condition != 0.0, value, otherwise)
    return np.where(np.isnan(condition), np.nan, chosen)


def _truth(function: Function) -> Function:
    """A comparison that gives 1 or 0, and NaN of NaN."""

    def truth(*values: Floats) -> Floats:
        is_nan = reduce(np.logical_or, map(np.isnan, values))
        return np.where(is_nan, np.nan, function(*values))

    return truth


def _dot(a: Floats, b: Floats) -> Floats:
    return np.asarray(np.sum(a * b, axis=-1))


#: Functions by name: the functions of kernels for numbers, and three of vectors.
WORDS: Final[Mapping[str, Word]] = {
    **{name: Word(1, getattr(np, name)) for name in
       ("sin", "cos", "tan", "exp", "log", "sqrt", "abs", "sign", "floor", "sinh", "cosh", "tanh")},
    "asin": Word(1, np.arcsin),
    "acos": Word(1, np.arccos),
    "atan": Word(1, np.arctan),
    "atan2": Word(2, np.arctan2),
    "mod": Word(2, np.mod),
    "hypot": Word(2, np.hypot),
    "minimum": Word(2, np.minimum),
    "maximum": Word(2, np.maximum),
    "where": Word(3, _where),
    "dot": Word(2, _dot, takes_vectors=True),
    "norm": Word(1, lambda a: np.sqrt(_dot(a, a)), takes_vectors=True),
    "cross": Word(2, np.cross, takes_vectors=True),
}  # fmt: skip
#: Operators by the class of Python's syntax tree: sign and function; true is 1, false is 0.
OPERATORS: Final[Mapping[type[ast.AST], tuple[str, Function]]] = {
    ast.Add: ("+", np.add),
    ast.Sub: ("-", np.subtract),
    ast.Mult: ("*", np.multiply),
    ast.Div: ("/", np.divide),
    ast.Mod: ("%", np.mod),
    ast.Pow: ("**", np.power),
    ast.Lt: ("<", _truth(np.less)),
    ast.LtE: ("<=", _truth(np.less_equal)),
    ast.Gt: (">", _truth(np.greater)),
    ast.GtE: (">=", _truth(np.greater_equal)),
    ast.Eq: ("==", _truth(np.equal)),
    ast.NotEq: ("!=", _truth(np.not_equal)),
    ast.And: ("and", _truth(np.logical_and)),
    ast.Or: ("or", _truth(np.logical_or)),
    ast.Not: ("not", _truth(np.logical_not)),
    ast.USub: ("neg", np.negative),
}
_FUNCTIONS: Final[Mapping[str, Function]] = {
    **dict(OPERATORS.values()),
    **{name: word.function for name, word in WORDS.items()},
}
ALLOWED = (
    f"an expression has numbers, names, + - * / % **, comparisons, and, or, not, "
    f"{', '.join(CONSTANTS)} and the functions {', '.join(WORDS)}"
)
QUOTES = "a name of other characters than letters, digits and _ stands in quotes: 'J1.lambda.1'"


class Call(NamedTuple):
    """An operator or a function, by its sign or word, of its arguments."""

    word: str
    arguments: "tuple[Node, ...]"


#: A number, a name, or a call.
Node = float | str | Call


class ExpressionError(ValueError):
    """The text is no expression, or it cannot be evaluated.

    Attributes:
        fault: what is wrong, the remedy, the nearest right spelling.
    """

    def __init__(self, what: str, remedy: str = "", near: str = "") -> None:
        super().__init__(what)
        self.fault = Fault(what, remedy, near)


@attrs.frozen
class Expression:
    """A parsed expression.

    Attributes:
        text: as written.
        root: its tree.
        names: the names in it, each once, in their order.
        unit: the unit that is declared for its value; "" for none.
        parameters: names that numbers have taken the place of.
    """

    text: str
    root: Node = attrs.field(repr=False)
    names: tuple[str, ...]
    unit: str = ""
    parameters: tuple[str, ...] = ()

    def with_numbers(self, numbers: Mapping[str, float]) -> "Expression":
        """The expression with numbers in place of some of its names."""
        names = tuple(name for name in self.names if name not in numbers)
        given = tuple(name for name in self.names if name in numbers)
        root = self.fold(lambda name: numbers.get(name, name), lambda w, *a: Call(w, a))
        return attrs.evolve(self, root=root, names=names, parameters=given) if given else self

    def evaluate(self, values: Mapping[str, Any]) -> Any:
        """The value of the expression, NaN where it is not finite.

        Args:
            values: of each name: numbers; or scalars (nt,) and vectors (nt, components).

        Returns:
            A number, (nt,) or (nt, components).

        Raises:
            ExpressionError: a function of vectors has others, or the components do not match.
        """
        with np.errstate(all="ignore"):
            value = np.asarray(self.fold(lambda name: np.asarray(values[name], float), _apply))
        return np.where(np.isfinite(value), value, np.nan)

    def carried_unit(self, units: Mapping[str, Carried]) -> Carried:
        """The unit of its value from those of its names.

        Raises:
            ExpressionError: it adds or compares unlike units.
        """
        try:
            carried: Carried = self.fold(units.__getitem__, unit_of_call)
        except UnitError as error:
            raise ExpressionError(str(error)) from None
        return carried

    def fold(self, of_name: Callable[[str], Any], of_call: Callable[..., Any]) -> Any:
        """Replaces names, then calls from the inside, as ``of_call(word, *arguments)``."""

        def folded(node: Node) -> Any:
            if isinstance(node, Call):
                return of_call(node.word, *map(folded, node.arguments))
            return of_name(node) if isinstance(node, str) else node

        return folded(self.root)


def parse_expression(text: str) -> Expression:
    """Parses an expression.

    Raises:
        ExpressionError: it is none, or too long, too deep, or has a constant that is not finite.
    """
    if not text.strip():
        raise ExpressionError("is empty", ALLOWED)
    text = canonical(text)
    if len(text) > LONGEST:
        what = f"is too long: {len(text)} characters; at most {LONGEST} are read"
        raise ExpressionError(what, "divide it into several that name one another")
    if "\\" in text:
        raise ExpressionError("has a backslash, which is in no expression", ALLOWED)
    try:
        source = f"({text}\n)"
        body = parse(source, "eval").body
        if not text.isascii():
            _restore_names(body, source)
        root = _node(body, DEEPEST)
    except SyntaxError as error:
        reason = str(error.msg).partition(". ")[0]
        raise ExpressionError(f"is no expression: {reason}", f"{ALLOWED}; {QUOTES}") from None
    except (RecursionError, MemoryError):
        raise _too_deep() from None
    except ExpressionError:
        raise
    except ValueError:  # NUL, surrogates, integers of thousands of digits
        raise ExpressionError("is no expression", ALLOWED) from None
    return Expression(text, root, tuple(dict.fromkeys(_names(root))))


def _restore_names(tree: ast.AST, source: str) -> None:
    """Put names as written in the place of those that Python's parser has changed (to form NFKC).

    It takes a micro sign for the Greek mu, and a ligature for its letters.
    """
    for node in ast.walk(tree):
        if isinstance(node, ast.Name):
            node.id = ast.get_source_segment(source, node) or node.id
        elif isinstance(node, ast.Attribute):
            written = ast.get_source_segment(source, node) or node.attr
            node.attr = written.rpartition(".")[2].split()[-1]


def read_expression(value: Any) -> Expression | Fault:
    """The expression of a value in a scene, or its fault."""
    if not isinstance(value, str):
        return Fault('should be an expression in quotes, such as "A.r.z - B.r.z"', ALLOWED)
    try:
        return parse_expression(value)
    except ExpressionError as error:
        return error.fault


def fault_of_word(name: str) -> str:
    """The reason why expressions could not name something by this name; "" where they can."""
    if not name.isidentifier() or keyword.iskeyword(name):
        return "it is a word of letters, digits and _, which begins with a letter"
    if name in WORDS or name in CONSTANTS:
        return "expressions have a function or a constant of this name"
    return ""


def _apply(word: str, *arguments: Any) -> Any:
    """The value of a call; scalars (nt,) are aligned with vectors (nt, components)."""
    values = [np.asarray(value) for value in arguments]
    is_vector = [value.ndim == 2 for value in values]
    if word in WORDS and WORDS[word].takes_vectors:
        if not all(is_vector):
            raise ExpressionError(f"{word} takes vectors, such as crank.r, and not numbers")
        if word == "cross" and any(value.shape[1] != 3 for value in values):
            raise ExpressionError("cross takes two vectors of three components")
    elif any(is_vector):
        values = [v[:, None] if v.ndim == 1 else v for v in values]
    counts = {v.shape[1] for v in values if v.ndim == 2 and v.shape[1] != 1}
    if len(counts) > 1:
        different = " and ".join(map(str, sorted(counts)))
        raise ExpressionError(f"'{word}' of vectors of {different} components")
    return _FUNCTIONS[word](*values)


def _call(word: str, *arguments: Node) -> Node:
    """A call, or its value where its arguments are numbers."""
    numbers = [argument for argument in arguments if isinstance(argument, float)]
    if len(numbers) < len(arguments):
        return Call(word, arguments)
    with np.errstate(all="ignore"):
        value = float(_apply(word, *numbers))
    if not math.isfinite(value):
        listed = " and ".join(f"{number:g}" for number in numbers)
        raise ExpressionError(f"'{word}' of {listed} is not a finite number")
    try:
        return number_of_call(value, word, *numbers)
    except UnitError as error:
        raise ExpressionError(str(error)) from None


def _node(tree: ast.AST, depth: int) -> Node:
    """The node of a part of Python's syntax tree."""
    if depth < 0:
        raise _too_deep()
    inner = depth - 1
    match tree:
        case ast.Constant(value=int() | float() as number) if not isinstance(number, bool):
            return _number(number)
        case ast.Constant(value=str() as name):
            if not name.strip() or not name.isprintable():
                raise ExpressionError(
                    "has an empty name or one of unprintable characters in quotes"
                )
            return name
        case ast.Name() | ast.Attribute():
            return _named(tree)
        case ast.UnaryOp(op=ast.UAdd(), operand=operand):
            return _node(operand, inner)
        case ast.UnaryOp(op=op, operand=operand) if type(op) in OPERATORS:
            return _call(OPERATORS[type(op)][0], _node(operand, inner))
        case ast.BinOp(left=left, op=op, right=right) if type(op) in OPERATORS:
            return _call(OPERATORS[type(op)][0], _node(left, inner), _node(right, inner))
        case ast.Compare(left=left, ops=ops, comparators=others):
            return _comparison([left, *others], ops, inner)
        case ast.BoolOp(op=op, values=values):
            return _joined(OPERATORS[type(op)][0], [_node(value, inner) for value in values])
        case ast.Call():
            return _function(tree, inner)
    raise _refused(tree)


def _number(number: float) -> float:
    try:
        value = float(number)
    except OverflowError:
        value = math.inf
    if not math.isfinite(value):
        raise ExpressionError("has a number that is too large")
    return value


def _named(tree: ast.Name | ast.Attribute) -> Node:
    """A constant, or the name that dots join."""
    parts: list[str] = []
    head: ast.AST = tree
    while isinstance(head, ast.Attribute):
        parts.append(head.attr)
        head = head.value
    if isinstance(head, ast.Constant) and isinstance(head.value, str):
        raise ExpressionError("has a name with a part in quotes", f"{QUOTES}, as a whole")
    if not isinstance(head, ast.Name):
        raise ExpressionError("a dot joins parts of a name, and nothing else", ALLOWED)
    name = ".".join((head.id, *reversed(parts)))
    if name in WORDS:
        raise ExpressionError(f"{name} is a function: write {name}(...)")
    return CONSTANTS.get(name, name)


def _comparison(terms: list[ast.expr], ops: list[ast.cmpop], depth: int) -> Node:
    """A comparison; of several in a row, a < b < c, all hold."""
    if any(type(op) not in OPERATORS for op in ops):
        raise ExpressionError("compares by another operator than < <= > >= == !=", ALLOWED)
    nodes = [_node(term, depth) for term in terms]
    pairs = zip(nodes[:-1], ops, nodes[1:], strict=True)
    return _joined("and", [_call(OPERATORS[type(op)][0], a, b) for a, op, b in pairs])


def _joined(word: str, nodes: list[Node]) -> Node:
    if len(nodes) > DEEPEST:  # one level for each
        raise _too_deep()
    node = nodes[0]
    for other in nodes[1:]:
        node = _call(word, node, other)
    return node


def _function(tree: ast.Call, depth: int) -> Node:
    name = tree.func.id if isinstance(tree.func, ast.Name) else ""
    word = WORDS.get(name)
    if word is None:
        given = ast.unparse(tree.func) if isinstance(tree.func, ast.Name | ast.Attribute) else ""
        what = f"there is no function {given!r}" if given else "calls something without a name"
        raise ExpressionError(what, ALLOWED, nearest(name, WORDS))
    if tree.keywords or len(tree.args) != word.arity:
        count = f"{word.arity} argument{'s' if word.arity > 1 else ''}"
        raise ExpressionError(f"{name} takes {count}, without keywords")
    arguments = [_node(argument, depth) for argument in tree.args]
    if word.takes_vectors and any(isinstance(argument, float) for argument in arguments):
        raise ExpressionError(f"{name} takes vectors, such as crank.r, and not numbers")
    return _call(name, *arguments)


#: How operators that are none here are written.
_OPERATORS: Final[Mapping[type[ast.AST], str]] = {
    ast.BitXor: "^", ast.BitAnd: "&", ast.BitOr: "|", ast.FloorDiv: "//",
}  # fmt: skip
#: Python's syntax that users may try, in words.
_SYNTAX: Final[Mapping[type[ast.AST], str]] = {
    ast.IfExp: "a condition is written where(condition, value, otherwise)",
    ast.Subscript: "a component is named by a dot, crank.r.z or 'J1.lambda.1'",
    ast.BitXor: "a power is written **",
    ast.BitAnd: "conditions are joined by and",
    ast.BitOr: "conditions are joined by or",
    ast.FloorDiv: "the whole part is floor(a / b)",
    ast.Tuple: "one expression is written without commas",
}


def _refused(tree: ast.AST) -> ExpressionError:
    """The error for syntax that is Python's alone."""
    operator = getattr(tree, "op", tree)
    remedy = _SYNTAX.get(type(operator)) or _SYNTAX.get(type(tree), ALLOWED)
    sign = _OPERATORS.get(type(operator))
    found = f"operator {sign}" if sign else f"Python syntax {type(operator).__name__}"
    return ExpressionError(f"has the {found}, no arithmetic", remedy)


def _too_deep() -> ExpressionError:
    remedy = "divide it into several that name one another"
    return ExpressionError(f"is nested too deeply: at most {DEEPEST} levels", remedy)


def _names(node: Node) -> Iterator[str]:
    if isinstance(node, str):
        yield node
    elif isinstance(node, Call):
        for argument in node.arguments:
            yield from _names(argument)
