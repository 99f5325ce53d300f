"""Symbolic differentiation of the formulas of a type, with sympy symbols as arguments of kernels.

``KernelArgument.rate`` is the rate of every name that a kernel may use: an arm s_P_i turns with
its body, W_i x s_P_i. With V_i, W_i the velocities of the bodies this gives, for an equation C,

    phi = dC/dt = J v - nu,    so J is the coefficients of V and W in phi, and nu is -phi at rest;
    d phi/dt = J v_dot - gamma, so gamma is -d phi/dt with V_dot = W_dot = 0.

Imported only for a type with formulas to be derived, as it imports sympy.
"""

from collections.abc import Callable, Mapping, Sequence
from typing import Any

import sympy

from dap3d_core.interface.codegen.kernel_arguments import (
    SEVERAL,
    KernelArgument,
    derivative_names,
    parameters,
)
from dap3d_core.interface.derive.branches import Branch, as_argument, expression_of, is_condition
from dap3d_core.interface.derive.program import Expression, Program, Steps, derivative
from dap3d_core.interface.errors import line_of, plain_words
from dap3d_core.kernels import add, cross, dot, sub


class DerivationError(ValueError):
    """A formula cannot be derived; gives reason and remedy."""


def turned(w: Any, A: Any) -> Any:
    """Rate of a rotation matrix: the columns turn with the body."""
    columns = [cross(w, tuple(row[c] for row in A)) for c in range(3)]
    return tuple(tuple(column[r] for column in columns) for r in range(3))


def euler_rate(w: Any, p: Any) -> Any:
    """Rate of Euler parameters for a global angular velocity."""
    e0, e = p[0], (p[1], p[2], p[3])
    half = sympy.Rational(1, 2)
    turning = add(tuple(e0 * x for x in w), cross(w, e))
    return (-half * dot(e, w), *(half * x for x in turning))


def angle_rate(u: Any, v: Any, k: Any, u_dot: Any, v_dot: Any, k_dot: Any) -> Any:
    """Rate of the angle from u to v about k (gather.angle_about): of atan2(y, x)."""
    y, x = dot(k, cross(u, v)), dot(u, v) - dot(u, k) * dot(v, k)
    y_dot = dot(k_dot, cross(u, v)) + dot(k, add(cross(u_dot, v), cross(u, v_dot)))
    x_dot = (dot(u_dot, v) + dot(u, v_dot) - (dot(u_dot, k) + dot(u, k_dot)) * dot(v, k)
             - dot(u, k) * (dot(v_dot, k) + dot(v, k_dot)))  # fmt: skip
    return (x * y_dot - y * x_dot) / (x**2 + y**2)


_WORDS = {"add": add, "sub": sub, "cross": cross, "dot": dot, "turned": turned,
          "euler_rate": euler_rate, "angle_rate": angle_rate}  # fmt: skip


def flat(value: Any) -> list[Expression]:
    """The numbers of a nested tuple, in order."""
    if isinstance(value, (tuple, list)):
        return [x for part in value for x in flat(part)]
    return [expression_of(value)]


class Symbols(Mapping[str, Any]):
    """The named quantities of a type as symbols, with their rates.

    As a mapping it is the namespace of the rates: ``x_NAME``, and the velocities ``V_i`` and
    ``W_i`` of the bodies.
    """

    def __init__(self, names: Mapping[str, KernelArgument], slots: Sequence[str]) -> None:
        self.names = names
        self.owner: dict[Expression, tuple[str, int]] = {}
        self._values: dict[str, Any] = {}
        self._rates: dict[str, list[Expression]] = {}
        self._steps: dict[Expression, Expression] = {}
        self.fresh = sympy.numbered_symbols("step", real=True)
        self.velocities = {f"{v.upper()}_{s}": self._velocity(f"{v}_{s}")
                           for s in slots for v in ("v", "w")}  # fmt: skip
        self.basic = [x for s in slots for v in ("V", "W") for x in self.velocities[f"{v}_{s}"]]
        #: names of the velocity level, as expressions of the velocities of the bodies
        self.motions = {q.name: q.motion for q in names.values() if q.motion} | {
            q.rate_name: q.rate
            for q in names.values()
            if q.rate_name in names and names[q.rate_name].velocity
        }

    def __getitem__(self, key: str) -> Any:
        if key in self.velocities:
            return self.velocities[key]
        if not key.startswith("x_"):
            raise KeyError(key)
        return self.value(key[2:])

    def __iter__(self) -> Any:
        return iter([*self.velocities, *(f"x_{name}" for name in self.names)])

    def __len__(self) -> int:
        return len(self.velocities) + len(self.names)

    def _velocity(self, name: str) -> Any:
        """Three symbols, which a kernel can name unless a field has taken the name."""
        if self.names[name].velocity:
            return self.value(name)
        return tuple(sympy.Dummy(f"{name}[{k}]", real=True) for k in range(3))

    def value(self, name: str) -> Any:
        """The argument of a kernel for a name: symbols in tuples, or a function to be called."""
        if name not in self._values:
            quantity = self.names[name]
            if quantity.derivative == SEVERAL:
                raise DerivationError(
                    f"{name} are several functions; return (f, f', f'', f''') of their combination"
                )
            if quantity.derivative >= 0:
                self._values[name] = self._function(name)
            elif quantity.columns:
                raise DerivationError(
                    f"{name} is a table, and what a table gives cannot be differentiated; "
                    "write the missing formulas by hand"
                )
            else:
                value = self._values[name] = _symbols(name, quantity.shape)
                self.owner |= {s: (name, k) for k, s in enumerate(flat(value))}
        return self._values[name]

    def _function(self, name: str) -> Any:
        """A function of an argument: sympy differentiates it into the next name."""
        quantity = self.names[name]
        suffixes = derivative_names(quantity.arguments)
        own = suffixes[quantity.derivative]
        prefix = name.removesuffix(own)

        def fdiff(self_: Any, argindex: int = 1) -> Any:
            if quantity.arguments > 1:
                suffix = f"_{''.join(sorted(own.strip('_') + 'xy'[argindex - 1]))}"
            else:
                suffix = suffixes[quantity.derivative + 1] if quantity.derivative < 3 else "_none"
            if suffix not in suffixes:
                raise DerivationError(f"the derivative of {name} has no name; write it by hand")
            return self.value(f"{prefix}{suffix}")(*self_.args)

        members = {"fdiff": fdiff, "nargs": quantity.arguments, "is_real": True}
        return type(name, (sympy.Function,), members)

    def rate(self, name: str) -> list[Expression]:
        """The rates of a quantity's numbers, as expressions of the velocities of the bodies."""
        if name not in self._rates:
            quantity = self.names[name]
            if not quantity.derivable:
                raise DerivationError(
                    f"how {name} changes is not known here; write the missing formulas by hand"
                )
            zero = [sympy.Integer(0)] * len(flat(self.value(name)))
            self._rates[name] = self._evaluated(quantity.rate) if quantity.rate else zero
        return self._rates[name]

    def _evaluated(self, code: str) -> list[Expression]:
        """The numbers of an expression of ``KernelArgument`` (text of this program)."""
        return [exact(x) for x in flat(eval(code, {"__builtins__": {}, **_WORDS}, self))]

    def d_dt(self, program: Program) -> Program:
        """Rates of a program's results, at V_dot = W_dot = 0; named rates appear by name."""
        steps = dict(program.steps)

        def named(rate: Expression) -> Expression:
            if rate.is_Atom:
                return rate
            step = next(self.fresh)
            steps[step] = rate
            return step

        for symbol, expression in program.steps.items():
            if symbol in self._steps:
                continue
            if is_condition(expression):
                rate = sympy.Integer(0)
            elif isinstance(expression, Branch):
                condition, *sides = expression.args
                rate = Branch(condition, *(named(self._d_dt(x)) for x in sides))
            else:
                rate = self._d_dt(expression)
            self._steps[symbol] = named(rate)
        return Program(steps, [self._d_dt(x) for x in program.results], self.fresh)

    def _d_dt(self, expression: Expression) -> Expression:
        symbols = sorted(expression.free_symbols, key=str)
        return sympy.Add(*(derivative(expression, s) * self._dot(s) for s in symbols))

    def _dot(self, symbol: Expression) -> Expression:
        if symbol in self._steps:
            return self._steps[symbol]
        if symbol in self.basic:
            return sympy.Integer(0)
        name, k = self.owner[symbol]
        if name in self.motions:
            return self._d_dt(self._evaluated(self.motions[name])[k])
        rate = self.rate(name)[k]
        rate_name = self.names[name].rate_name
        return flat(self.value(rate_name))[k] if rate_name in self.motions else rate

    def motion(self, symbol: Expression) -> Expression:
        """A velocity in terms of those of the bodies; None for other symbols."""
        if symbol in self.basic:
            return symbol
        name, k = self.owner.get(symbol, ("", 0))
        return self._evaluated(self.motions[name])[k] if name in self.motions else None


def _symbols(name: str, shape: tuple[int, ...]) -> Any:
    if not shape:
        return sympy.Symbol(name, real=True)
    return tuple(_symbols(f"{name}[{k}]", shape[1:]) for k in range(shape[0]))


def exact(expression: Expression) -> Expression:
    """With 0.0, 1.0, 0.5 and their like as exact numbers, so that zeros and ones vanish."""
    floats = {x: sympy.Rational(float(x)) for x in expression.atoms(sympy.Float)
              if (2.0 * float(x)).is_integer()}  # fmt: skip
    return expression.xreplace(floats)


def traced(kernel: Callable[..., Any], symbols: Symbols, what: str) -> list[Expression]:
    """The numbers that a kernel returns, as expressions.

    Raises:
        DerivationError: it cannot be evaluated symbolically; gives the remedy.
    """
    try:
        value = kernel(*(as_argument(symbols.value(name)) for name in parameters(kernel)))
        return [exact(x) for x in flat(value)]
    except DerivationError:
        raise
    except Exception as error:
        reason = f"({type(error).__name__}: {error}){line_of(error, kernel)}; {plain_words()}"
        text = f"{what} cannot be differentiated as a formula {reason}; or write the rest by hand"
        raise DerivationError(text) from error


def derive_joint(
    C: Callable[..., Any] | None,
    C_dot: Callable[..., Any] | None,
    position_rows: Sequence[int],
    rows: int,
    symbols: Symbols,
    unknowns: Sequence[str] = (),
) -> tuple[dict[str, Any], Steps]:
    """G, J, gamma and nu of a joint, as nested lists of expressions over the names and steps.

    Args:
        C: of the rows of the position level; None where there is none.
        C_dot: of the other rows, linear in the velocities.
        position_rows: the rows of C.
        rows: number of all rows.
        symbols: the joint's names.
        unknowns: names of those by which G has the derivatives of C.

    Raises:
        DerivationError: gives reason and remedy.
    """
    J: list[Any] = [[None] * rows for _ in range(len(symbols.basic) // 6)]
    gamma, nu = [sympy.Integer(0)] * rows, [sympy.Integer(0)] * rows
    G: list[Any] = []
    steps: Steps = {}
    velocity_rows = [k for k in range(rows) if k not in position_rows]
    for kernel, which, what in ((C, position_rows, "C"), (C_dot, velocity_rows, "C_dot")):
        if kernel is None:
            continue
        program = Program.of(traced(kernel, symbols, what), symbols.fresh)
        phi = symbols.d_dt(program) if what == "C" else program
        rate = symbols.d_dt(phi)
        steps |= rate.steps
        rest = _at_rest(phi, symbols)
        steps |= rest.steps
        for k, row in enumerate(which):
            with_gradient, gradient = program.gradient(k)
            steps |= with_gradient.steps
            if what == "C" and unknowns:
                own = [symbols.value(name) for name in unknowns]
                G.append([gradient.get(s, sympy.Integer(0)) for s in own])
            coefficients = _coefficients(gradient, symbols, of_rates=what == "C_dot")
            for n, block in enumerate(J):
                block[row] = coefficients[6 * n : 6 * n + 6]
            if what == "C_dot":
                _check_linear(program.plain(k), row, symbols)
            gamma[row], nu[row] = -rate.results[k], -rest.results[k]
    return {"G": G, "J": J, "gamma": gamma, "nu": nu}, steps


def _coefficients(
    gradient: Mapping[Expression, Expression], symbols: Symbols, *, of_rates: bool
) -> list[Expression]:
    """Coefficients of the bodies' velocities in the rate of a quantity with this gradient.

    of_rates: the gradient is that of a form in the velocities, by the rates themselves.
    """
    found: list[list[Expression]] = [[] for _ in symbols.basic]
    for symbol, weight in gradient.items():
        if of_rates:
            motion = symbols.motion(symbol)
        else:
            name, k = symbols.owner[symbol]
            motion = symbols.rate(name)[k]
        for u in motion.free_symbols if motion is not None else ():
            if u in symbols.basic:
                found[symbols.basic.index(u)].append(weight * sympy.diff(motion, u))
    return [sympy.Add(*terms) for terms in found]


def _at_rest(phi: Program, symbols: Symbols) -> Program:
    """The program with all bodies at rest, a function of time alone."""
    used = set().union(*(x.free_symbols for x in (*phi.steps.values(), *phi.results)))
    zero = {s: sympy.Integer(0) for s in used if symbols.motion(s) is not None}
    steps: Steps = {}
    for symbol, expression in phi.steps.items():
        rest = expression.xreplace(zero)
        zero[symbol] = rest if rest.is_Atom else next(symbols.fresh)
        if not rest.is_Atom:
            steps[zero[symbol]] = rest
    return Program(steps, [x.xreplace(zero) for x in phi.results], symbols.fresh)


def _check_linear(form: Expression, row: int, symbols: Symbols) -> None:
    rates = {s: symbols.motion(s) for s in form.free_symbols}
    in_velocities = form.xreplace({s: x for s, x in rates.items() if x is not None})
    basic = set(symbols.basic)
    if any(sympy.diff(in_velocities, u).free_symbols & basic for u in basic):
        raise DerivationError(f"row {row + 1} of C_dot is not linear in the velocities")


def derive_wrench(energy: Callable[..., Any], symbols: Symbols) -> tuple[dict[str, Any], Steps]:
    """The wrench of a potential: its gradient along each velocity of each body, reversed."""
    potential = Program.of(traced(energy, symbols, "energy"), symbols.fresh)
    program, gradient = potential.gradient(0)
    force = [-x for x in _coefficients(gradient, symbols, of_rates=False)]
    pairs = [[force[n : n + 3], force[n + 3 : n + 6]] for n in range(0, len(force), 6)]
    return {"wrench": pairs}, program.steps


def derive_rows(switch: Callable[..., Any], symbols: Symbols) -> tuple[dict[str, Any], Steps]:
    """Rows J of a force, whose rates J v are those of its switches as far as its bodies move.

    Raises:
        DerivationError: a switch depends on velocities, or cannot be differentiated.
    """
    velocity = [n for n in parameters(switch) if symbols.names[n].velocity]
    if velocity:
        raise DerivationError(
            f"switch names {velocity[0]}, a quantity of the velocity level, so that its rate is no "
            "J v; write J by hand"
        )
    program = Program.of(traced(switch, symbols, "switch"), symbols.fresh)
    J: list[Any] = [[] for _ in range(len(symbols.basic) // 6)]
    steps: Steps = dict(program.steps)
    for k in range(len(program.results)):
        with_gradient, gradient = program.gradient(k)
        steps |= with_gradient.steps
        coefficients = _coefficients(gradient, symbols, of_rates=False)
        for n, block in enumerate(J):
            block.append(coefficients[6 * n : 6 * n + 6])
    return {"J": J}, steps


def derive_value(
    value: Callable[..., Any], symbols: Symbols, arguments: int = 1
) -> tuple[dict[str, Any], Steps]:
    """(f, f', f'', f''') of a function that gives f alone; partial derivatives of one of two."""
    (f,) = traced(value, symbols, "value")[:1]
    x = symbols.value("x")
    f = f.xreplace({symbols.value("t"): x})  # one number under two names
    if arguments > 1:
        y = symbols.value("y")
        f_x, f_y = derivative(f, x), derivative(f, y)
        return {
            "value": [f, f_x, f_y, derivative(f_x, x), derivative(f_x, y), derivative(f_y, y)]
        }, {}
    found = [f]
    for _ in range(3):
        found.append(derivative(found[-1], x))
    return {"value": found}, {}
