"""Kernels to LLVM IR by running them once with symbolic numbers.

Whatever Python does on the way (helpers, closures, loops over constants, tuples) is gone
afterwards; the operations on numbers are recorded as they happen. A kernel may do anything that
Python can, except decide by a number: it has no value yet.
"""

import ast
import traceback
from collections.abc import Callable, Mapping
from pathlib import Path
from types import SimpleNamespace
from typing import Any, NoReturn

from dap3d_core.kernels.compiler import types as t
from dap3d_core.kernels.compiler.functions import Program
from dap3d_core.kernels.compiler.writer import EXACT, LIBRARY, Writer

_REMEDY = "use the functions of dap3d_core.kernels: sqrt, sin, minimum, ..., where(condition, a, b)"


class TraceError(TypeError):
    """An operation that needs the value of a symbolic number; says what to write instead."""


class _MissingError(TraceError, AttributeError):
    """The same for a missing attribute, so that ``hasattr`` works."""


class Tracer(Writer):
    """Records the operations of a kernel; has its functions for symbolic numbers."""

    def __init__(self) -> None:
        self.program = Program()
        super().__init__(self.program.needs)

    def refuse(self, node: Any, why: str, remedy: str) -> NoReturn:
        """Raise a TraceError, with the remedy for kernels; its line is in the traceback."""
        raise TraceError(f"has {why}; {_REMEDY}")

    def decide(self, condition: t.Value) -> bool:
        """Refuse to branch on a number."""
        raise TraceError("branches on a number; use where(condition, a, b)")

    def value(self, x: Any, like: t.Scalar = t.FLOAT) -> t.Value:
        """A number of a kernel: symbolic, or a constant, a float unless it is of the type given."""
        if isinstance(x, Symbol):
            return x.value
        constant = t.constant(x)
        if constant is not None and constant.type == like:
            return constant
        if isinstance(x, (tuple, list, str)) or x is None:
            raise TraceError(f"takes a {type(x).__name__} for a number; "
                             "for vectors use add, sub, scale, dot")  # fmt: skip
        return t.Value(t.FLOAT, (t.bits(float(x)),), float(x))

    def word(self, x: Any) -> str:
        """The LLVM value of a number, as a double."""
        return self.cast(None, self.value(x), t.FLOAT).word

    def index(self, k: Any) -> str:
        """The LLVM value of an index."""
        return self.whole(None, self.value(k, t.INT)).word

    def __getattr__(self, name: str) -> Callable[..., "Symbol"]:
        """A function of floats: sqrt, sin, ..."""
        if name not in (*EXACT, *LIBRARY):
            raise AttributeError(name)
        return lambda *numbers: self.symbol(self.call(name, *map(self.word, numbers)))

    def symbol(self, value: t.Value) -> Any:
        """A result as kernels see it."""
        return Symbol(self, value)

    def where(self, condition: "Symbol", a: Any, b: Any) -> Any:
        """``a`` where the condition holds, else ``b``."""
        test = self.cast(None, condition.value, t.BOOL)
        return self.symbol(self.select(None, test, self.value(a), self.value(b)))

    def integer(self, x: Any) -> "Symbol":
        """A float as an integer, an index or a count."""
        return Symbol(self, self.cast(None, self.value(x), t.INT))

    def row_of(self, row: Any, array: "NumberArray", place: Any, rows: Any, width: int,
               x: Any) -> "Symbol":  # fmt: skip
        """Index at which a row of a table begins, found by a function of the subset."""
        types = t.Array(t.FLOAT, 1), t.INT, t.INT, t.INT, t.FLOAT
        name, result = self.program.function(row, types) or ("", t.INT)
        place, rows = (self.integer(k).value.word for k in (place, rows))
        given = (f"ptr {array.base}, i64 0, i64 {place}, i64 {rows}, i64 {width}, "
                 f"double {self.word(x)}")  # fmt: skip
        return Symbol(self, self.emit(result, f"call i64 @{name}({given})"))


def _operation(op: ast.operator) -> tuple[Any, Any]:
    def operate(self: "Symbol", other: Any) -> "Symbol":
        given = self.tracer.value(other, self.value.type)
        return self.tracer.symbol(self.tracer.operation(None, op, self.value, given))

    def reflected(self: "Symbol", other: Any) -> "Symbol":
        given = self.tracer.value(other, self.value.type)
        return self.tracer.symbol(self.tracer.operation(None, op, given, self.value))

    return operate, reflected


def _comparison(op: ast.cmpop) -> Any:
    def compare(self: "Symbol", other: Any) -> "Symbol":
        given = self.tracer.value(other)
        return self.tracer.symbol(self.tracer.comparison(None, op, self.value, given))

    return compare


class Symbol:
    """A symbolic number or truth value: known when the code runs.

    It refuses everything that needs it now. Kernels see floats and conditions; the text of loops
    has integers, too.
    """

    __slots__ = ("tracer", "value")
    __hash__ = None

    def __init__(self, tracer: Tracer, value: t.Value) -> None:
        self.tracer, self.value = tracer, value

    __add__, __radd__ = _operation(ast.Add())
    __sub__, __rsub__ = _operation(ast.Sub())
    __mul__, __rmul__ = _operation(ast.Mult())
    __truediv__, __rtruediv__ = _operation(ast.Div())
    __and__, __rand__ = _operation(ast.BitAnd())
    __or__, __ror__ = _operation(ast.BitOr())
    __xor__, __rxor__ = _operation(ast.BitXor())
    __lt__, __le__ = _comparison(ast.Lt()), _comparison(ast.LtE())
    __gt__, __ge__ = _comparison(ast.Gt()), _comparison(ast.GtE())
    __eq__, __ne__ = _comparison(ast.Eq()), _comparison(ast.NotEq())

    def __invert__(self) -> "Symbol":
        return self ^ True

    def __neg__(self) -> "Symbol":
        return self.tracer.symbol(self.tracer.negative(None, self.value))

    def __pos__(self) -> "Symbol":
        return self

    def __abs__(self) -> "Symbol":
        return self.tracer.fabs(self)

    def __pow__(self, n: Any) -> Any:
        """Products for integer constants, a square root for 0.5, else ``pow`` of the C library."""
        if isinstance(n, int) and abs(n) <= 64:
            result, power, left = None, self, abs(n)
            while left:
                if left & 1:
                    result = power if result is None else result * power
                left >>= 1
                if left:
                    power = power * power
            result = 1.0 if result is None else result
            return 1.0 / result if n < 0 else result
        if isinstance(n, float) and n == 0.5:
            return self.tracer.sqrt(self)
        return self.tracer.pow(self, n)

    def __rpow__(self, x: Any) -> "Symbol":
        return self.tracer.pow(x, self)

    def sqrt(self) -> "Symbol":
        """The square root, for ``numpy.sqrt``."""
        return self.tracer.sqrt(self)

    def rint(self) -> "Symbol":
        """The nearest integer, for ``numpy.rint``."""
        return self.tracer.rint(self)

    @property
    def real(self) -> "Symbol":
        """The number itself: conditions of complex numbers compare real parts."""
        return self

    def _refuse(self, *arguments: Any) -> NoReturn:
        raise TraceError(f"needs the number itself; {_REMEDY}")

    __float__ = __int__ = __index__ = __complex__ = __len__ = __iter__ = _refuse
    __round__ = __floor__ = __ceil__ = __trunc__ = _refuse
    __floordiv__ = __mod__ = __rfloordiv__ = __rmod__ = __divmod__ = _refuse

    def __bool__(self) -> bool:
        return self.tracer.decide(self.value)

    def __getattr__(self, name: str) -> NoReturn:
        raise _MissingError(f"reads {name} of a number; {_REMEDY}")

    def __getitem__(self, k: Any) -> NoReturn:
        raise TraceError("takes a part of a number; tuples have parts")


class NumberArray:
    """An array of a loop: one-dimensional, or with rows of a known width."""

    def __init__(self, tracer: Tracer, base: str, item: str = "double", width: int = 0) -> None:
        self.tracer, self.base, self._item, self._width = tracer, base, item, width

    def _at(self, k: Any) -> str:
        if isinstance(k, tuple):
            k = k[0] * self._width + k[1]
        at = f"getelementptr inbounds {self._item}, ptr {self.base}, i64 {self.tracer.index(k)}"
        return self.tracer.new(at)

    def __getitem__(self, k: Any) -> Symbol:
        text = f"load {self._item}, ptr {self._at(k)}, align 8"
        type_ = t.INT if self._item == "i64" else t.FLOAT
        return Symbol(self.tracer, self.tracer.emit(type_, text))

    def __setitem__(self, k: Any, x: Any) -> None:
        word = self.tracer.word(x)
        self.tracer.line(f"store double {word}, ptr {self._at(k)}, align 8")


_LOOP = """define void @{symbol}(double %t, ptr %arrays, i64 %i0, i64 %p0, i64 %count,
                           ptr %out1, ptr %out2, ptr %out3) nounwind {{
entry:
{head}
  %some = icmp sgt i64 %count, 0
  br i1 %some, label %instance, label %exit
instance:
  %q = phi i64 [0, %entry], [%following, %instance]
{body}
  %following = add nsw i64 %q, 1
  %more = icmp slt i64 %following, %count
  br i1 %more, label %instance, label %exit
exit:
  ret void
}}
"""


def trace(
    symbol: str, namespace: dict[str, Any], members: Mapping[str, tuple[int, str, int]]
) -> str:
    """LLVM IR of a group loop.

    Args:
        symbol: name of its function.
        namespace: of the module with the Python function ``loop`` (runtime/loop_modules.py).
        members: for each array that it reads: index of its address in the struct, LLVM type of its
            items, width of its rows (0: one-dimensional).

    Raises:
        CompileError: with the line of the kernel, and what to write instead.
    """
    tracer, arrays, head = Tracer(), SimpleNamespace(), []
    for name, (word, item, width) in members.items():
        head += [f"  %{name}.at = getelementptr inbounds i64, ptr %arrays, i64 {word}",
                 f"  %{name} = load ptr, ptr %{name}.at, align 8"]  # fmt: skip
        setattr(arrays, name, NumberArray(tracer, f"%{name}", item, width))
    outputs = [NumberArray(tracer, f"%out{k}") for k in (1, 2, 3)]
    i0, p0, count, q = (Symbol(tracer, t.Value(t.INT, (f"%{name}",)))
                        for name in ("i0", "p0", "count", "q"))  # fmt: skip
    namespace["range"] = lambda count: [q]  # one symbolic instance
    try:
        namespace["loop"](
            Symbol(tracer, t.Value(t.FLOAT, ("%t",))), arrays, i0, p0, count, *outputs
        )
    except Exception as error:
        raise t.CompileError(f"{_reason(error)}{_line_of(error)}") from error
    body = "\n".join(tracer.lines)
    tracer.program.text.append(_LOOP.format(symbol=symbol, head="\n".join(head), body=body))
    return tracer.program.module()


def _reason(error: BaseException) -> str:
    if isinstance(error, TraceError):
        return f"it {error}"
    return f"{type(error).__name__}: {error}; {_REMEDY}"


def _line_of(error: BaseException) -> str:
    """The line of the kernel: the last one outside this package."""
    ours = Path(__file__).parents[1]
    line = ""
    for frame in traceback.extract_tb(error.__traceback__):
        if not frame.filename.startswith("<") and not Path(frame.filename).is_relative_to(ours):
            line = f" [{frame.filename}:{frame.lineno}]"
    return line
