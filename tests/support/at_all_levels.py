"""Code made quickly, well, and without fused instructions; and programs drawn at random."""

import linecache
from itertools import count
from types import SimpleNamespace

import numpy as np
from hypothesis import strategies as st

from support.internals import Program, objects, units

_count = count()


def targets():
    """Level and processor of each kind of code, by its name."""
    plain = objects.processor()._replace(name="x86-64", features="")
    found = {"O0": (objects.UNOPTIMISED, None), "O3": (objects.OPTIMISED, None)}
    if objects.processor().triple.startswith("x86_64"):
        found["O3 without FMA"] = (objects.OPTIMISED, plain)
    return found


def all_made_of(text, signatures, levels=None):
    """Functions of a module of LLVM IR, by level and symbol; signatures: by their symbols."""
    found = {}
    for name in levels or targets():
        level, target = targets()[name]
        addresses = objects.load(objects.compile_ir(text, level, target), list(signatures))
        unit = SimpleNamespace(addresses=addresses, register_slot=addresses_of(addresses))
        entries = (units.Entry(unit, k, s) for k, s in enumerate(signatures.values()))
        found[name] = dict(zip(signatures, entries, strict=True))
    return found


def addresses_of(addresses):
    """What puts an address into a table."""

    def register_slot(table, index, k):
        table[index] = addresses[k]

    return register_slot


def made_of(text, symbol, signature, levels=None):
    """A function of a module of LLVM IR at all levels, by the level's name."""
    made = all_made_of(text, {symbol: signature}, levels)
    return {name: entries[symbol] for name, entries in made.items()}


def compiled_at_all_levels(function, types):
    """A function of the subset at all levels."""
    program = Program()
    signature = program.export(function, tuple(types), "tried")
    return made_of(program.module(), "tried", signature)


def function_of(source, **names):
    """The function ``f`` of a text, as if it stood in a file."""
    file = f"<program {next(_count)}>"
    linecache.cache[file] = (len(source), None, source.splitlines(keepends=True), file)
    namespace = {"__name__": file, "np": np} | names
    exec(compile(source, file, "exec"), namespace)
    return namespace["f"]


def same_bits(one, other):
    """Whether arrays are equal in all bits; NaN is NaN."""
    nan = np.isnan(one)
    return bool(np.all(nan == np.isnan(other))) and (
        one[~nan].tobytes() == np.asarray(other)[~nan].tobytes()
    )


FLOATS, WHOLES = ("a", "b", "c", "d"), ("i", "j", "k")


@st.composite
def wholes(draw, depth=0):
    """An expression of whole numbers, not large."""
    if depth > 2 or draw(st.booleans()):
        return draw(st.sampled_from([*WHOLES, "n[0]", "n[i % 3]", "2", "-3", "7"]))
    x, y = draw(wholes(depth + 1)), draw(wholes(depth + 1))
    shape = draw(st.sampled_from(
        ["({} + {})", "({} - {})", "(({} * {}) % 89)", "min({}, {})", "({} & {})", "({} | {})",
         "(({}) // 3 + ({}) % 5)", "abs({} - {})", "({} ^ {})", "((({}) >> 2) + {})"]
    ))  # fmt: skip
    return shape.format(x, y)


@st.composite
def conditions(draw, depth=0):
    """A condition."""
    if depth > 1 or draw(st.booleans()):
        kind = draw(st.sampled_from([floats, wholes]))
        relation = draw(st.sampled_from(["<", "<=", ">", ">=", "==", "!="]))
        return f"({draw(kind(3))} {relation} {draw(kind(3))})"
    x, y = draw(conditions(depth + 1)), draw(conditions(depth + 1))
    return draw(st.sampled_from(["({} and {})", "({} or {})", "(not {} or {})"])).format(x, y)


@st.composite
def floats(draw, depth=0):
    """An expression of floats; numpy's, which divide by zero as compiled code does."""
    if depth > 3 or draw(st.booleans()):
        return draw(
            st.sampled_from([*FLOATS, "x[0]", "x[-1]", "x[abs(i) % 4]", "m[abs(j) % 2, 1]"])
        )
    x, y = draw(floats(depth + 1)), draw(floats(depth + 1))
    shape = draw(st.sampled_from(
        ["({} + {})", "({} - {})", "({} * {})", "({} / {})", "min({}, {})", "max({}, {})",
         "(-{} + {})", "(0.1 * {} - 1e-3 * {})", "np.sqrt(abs({} - {}))", "helper({}, {})",
         "({} if ? else {})", "({} * # + {})", "(sin({}) + {})", "(atan2({}, {}))",
         "(exp(-abs({})) * {})"]
    ))  # fmt: skip
    if "?" in shape:
        shape = shape.replace("?", draw(conditions(depth + 1)))
    if "#" in shape:
        shape = shape.replace("#", draw(wholes(2)))
    return shape.format(x, y)


@st.composite
def statements(draw, depth=0, indent="    "):
    """A few statements."""
    lines, more = [], indent + "    "

    def inner():
        return draw(statements(depth + 1, more))

    for _ in range(draw(st.integers(1, 3))):
        kind = draw(st.integers(0, 8 if depth < 2 else 4))
        if kind == 0:
            lines.append(f"{indent}{draw(st.sampled_from(FLOATS))} = {draw(floats())}")
        elif kind == 1:
            lines.append(f"{indent}{draw(st.sampled_from(WHOLES))} = ({draw(wholes())}) % 97")
        elif kind == 2:
            lines.append(f"{indent}x[abs({draw(wholes())}) % 4] = {draw(floats())}")
        elif kind == 3:
            target = draw(st.sampled_from([*FLOATS, "x[1]", "m[1, 2]"]))
            lines.append(f"{indent}{target} {draw(st.sampled_from('+-*'))}= {draw(floats())}")
        elif kind == 4:
            lines.append(f"{indent}a, b, i = {draw(floats())}, a, j")
        elif kind == 5:
            test = draw(conditions())
            lines += [f"{indent}if {test}:", *inner(), f"{indent}else:", *inner()]
        elif kind == 6:
            bounds = draw(st.sampled_from(["4", "1, 4", "3, -1, -1", "abs(k) % 5", "-4, 5, 2"]))
            lines += [f"{indent}for i in range({bounds}):", *inner()]
        elif kind == 7:
            leave, test = draw(st.sampled_from(["break", "continue"])), draw(conditions())
            lines += [f"{indent}for d{depth} in range(5):", f"{more}if {test}:",
                      f"{more}    {leave}", *inner()]  # fmt: skip
        else:
            name, test = f"left{depth}", draw(conditions())
            lines += [f"{indent}{name} = 0", f"{indent}while {name} < 3 and {test}:",
                      f"{more}{name} += 1", *inner()]  # fmt: skip
    return lines


@st.composite
def programs(draw):
    """The text of a function f(x, m, n, out)."""
    start = "    a, b, c, d, i, j, k = x[0], x[1], x[2], x[3], n[0], n[1], n[2]\n"
    end = "    out[0], out[1], out[2], out[3] = a, b, c, d\n    out[4], out[5], out[6] = i, j, k\n"
    return f"def f(x, m, n, out):\n{start}" + "\n".join(draw(statements())) + f"\n{end}"


EDGES = (0.0, -0.0, 1.0, -1.5, 1e308, 5e-324, float("inf"), float("nan"))
VALUES = st.floats(-10.0, 10.0) | st.sampled_from(EDGES)
