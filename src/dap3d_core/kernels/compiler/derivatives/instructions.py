"""Instructions that slopes are computed by, and derivatives of functions of numbers."""

from collections.abc import Callable, Sequence

from dap3d_core.kernels.compiler.types import CompileError, bits

ZERO, ONE = bits(0.0), bits(1.0)
#: Of functions that derivatives call.
PURE = " nobuiltin nounwind willreturn memory(none)"
#: Constant but for steps.
_FLAT = ("llvm.floor.f64", "llvm.ceil.f64", "llvm.rint.f64")


#: Numbers for each float that fill vectors: a value and its slopes.
FILLING = (2, 4, 8, 16)


def layout(count: int) -> tuple[int, int]:
    """Numbers of an item of an array, of which the first is the value; the first of its slopes.

    Vectors of slopes that lie across lines of the cache take twice as long to load and to store.
    """
    if count in FILLING:
        return count, 1
    register = 4 if count > 4 else 2
    return register * (1 - (1 - count) // register), register


class Instructions:
    """Writes instructions of numbers and of vectors of ``lanes`` numbers."""

    def __init__(self, lanes: int, external: set[str]) -> None:
        """Args:
        lanes: of a vector.
        external: functions of the C library that the module declares.
        """
        self.lanes, self.external = lanes, external
        self.vector = f"<{lanes} x double>"
        self.out: list[str] = []
        self._count = 0
        #: Vectors with a number in all lanes, in the present block.
        self._splats: dict[str, str] = {}

    def is_of_numbers(self, function: str) -> bool:
        """True of functions of the C library."""
        return function.startswith("llvm.") or function in self.external

    def new(self, text: str) -> str:
        """Add an instruction with a result; returns the name of the result."""
        self._count += 1
        self.out.append(f"  %slope.{self._count} = {text}")
        return f"%slope.{self._count}"

    def number(self, operation: str, *words: str) -> str:
        """An operation of numbers."""
        return self.new(f"{operation} double {', '.join(words)}")

    def call(self, function: str, *words: str) -> str:
        """A call of a function of numbers."""
        kind = "" if function.startswith("llvm.") else PURE
        given = ", ".join(f"double {word}" for word in words)
        return self.new(f"call double @{function}({given}){kind}")

    def lanewise(self, operation: str, *words: str) -> str:
        """An operation of vectors."""
        return self.new(f"{operation} {self.vector} {', '.join(words)}")

    def splat(self, word: str) -> str:
        """A number in all lanes."""
        if word not in self._splats:
            v, zeros = self.vector, f"<{self.lanes} x i32> zeroinitializer"
            one = self.new(f"insertelement {v} undef, double {word}, i32 0")
            self._splats[word] = self.new(f"shufflevector {v} {one}, {v} undef, {zeros}")
        return self._splats[word]

    def total(self, a: str, b: str, factor: str, *, is_negative: bool = False) -> str:
        """Vector a, zero where that is "", and vector b times a number, or less these."""
        part = self.lanewise("fmul", b, self.splat(factor))
        if a:
            return self.lanewise("fsub" if is_negative else "fadd", a, part)
        return self.lanewise("fneg", part) if is_negative else part

    def of_function(self, function: str, y: str, values: list[str], slopes: Sequence[str]) -> str:
        """Slopes of a function of the C library, given its value, its arguments and their slopes.

        "" stands for zero.

        Raises:
            CompileError: it has no derivative.
        """
        if function == "nextafter":
            return slopes[0]
        if function not in _FACTORS and function not in _FLAT:
            raise CompileError(f"{function} has no derivative")
        if function in _FLAT or not any(slopes):
            return ""
        found = ""
        for slope, factor in zip(slopes, _FACTORS[function](self, y, *values), strict=True):
            if slope:
                size = self.call("llvm.fabs.f64", factor)
                is_finite = self.new(f"fcmp olt double {size}, {bits(float('inf'))}")
                factor = self.new(f"select i1 {is_finite}, double {factor}, double {ZERO}")
                found = self.total(found, slope, factor)
        return found


# ---------------------------------------------------------------------- derivatives of functions

_D = Instructions


def _fabs(d: _D, y: str, x: str) -> list[str]:
    below = d.new(f"fcmp olt double {x}, {ZERO}")
    return [d.new(f"select i1 {below}, double {bits(-1.0)}, double {ONE}")]


def _negative(d: _D, word: str) -> str:
    return d.new(f"fneg double {word}")


def _asin(d: _D, y: str, x: str) -> list[str]:
    rest = d.number("fsub", ONE, d.number("fmul", x, x))
    return [d.number("fdiv", ONE, d.call("llvm.sqrt.f64", rest))]


def _atan2(d: _D, angle: str, y: str, x: str) -> list[str]:
    square = d.number("fadd", d.number("fmul", x, x), d.number("fmul", y, y))
    return [d.number("fdiv", x, square), d.number("fdiv", _negative(d, y), square)]


def _pow(d: _D, y: str, x: str, n: str) -> list[str]:
    """N x^(n - 1); x^n log x."""
    lower = d.call("pow", x, d.number("fsub", n, ONE))
    return [d.number("fmul", n, lower), d.number("fmul", y, d.call("log", x))]


#: Of each function: writes its derivatives by its arguments, given its value and these.
_FACTORS: dict[str, Callable[..., list[str]]] = {
    "llvm.sqrt.f64": lambda d, y, x: [d.number("fdiv", bits(0.5), y)],
    "llvm.fabs.f64": _fabs,
    "sin": lambda d, y, x: [d.call("cos", x)],
    "cos": lambda d, y, x: [_negative(d, d.call("sin", x))],
    "tan": lambda d, y, x: [d.number("fadd", ONE, d.number("fmul", y, y))],
    "sinh": lambda d, y, x: [d.call("cosh", x)],
    "cosh": lambda d, y, x: [d.call("sinh", x)],
    "tanh": lambda d, y, x: [d.number("fsub", ONE, d.number("fmul", y, y))],
    "exp": lambda d, y, x: [y],
    "log": lambda d, y, x: [d.number("fdiv", ONE, x)],
    "asin": _asin,
    "acos": lambda d, y, x: [_negative(d, _asin(d, y, x)[0])],
    "atan": lambda d, y, x: [d.number("fdiv", ONE, d.number("fadd", ONE, d.number("fmul", x, x)))],
    "atan2": _atan2,
    "hypot": lambda d, r, x, y: [d.number("fdiv", x, r), d.number("fdiv", y, r)],
    "pow": _pow,
}
