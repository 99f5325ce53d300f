"""Calls of the core's compiled functions, recorded in plain Python and repeated as machine code.
Records copies of the arguments of each function at some of its calls, with what plain Python
returned and left in the arrays. ``differences`` then compiles all recorded functions at every level
and compares each call in all bits. For a process of its own: it switches the compiler off."""

import importlib
import inspect
import os
import pkgutil
import sys

import attrs
import numpy as np

from dap3d_core.kernels.runtime import cache
from support.at_all_levels import all_made_of, function_of, same_bits, targets
from support.internals import (
    COMPLEX,
    DTYPES,
    FLOAT,
    INT,
    LOOP,
    NOTHING,
    Array,
    Arrays,
    Compiled,
    CompileError,
    Differentiation,
    Floats,
    Known,
    Program,
    Signature,
    Table,
    Tuple,
    array_members,
    differentiate,
    pointer,
    source_digest,
    trace,
    units,
)

#: The calls of a function that are recorded in each scene, from 1: early ones and some later ones.
CALLS = {1, 2, 7, 40, 200}
#: Numbers that wrappers take as an array of one: C calls take no complex ones, and no vectors.
BY_ARRAY = (COMPLEX, FLOAT)
#: Functions that make the tangent of radau: in runs with derivatives they compute values alone.
OF_TANGENTS = {"find_tangent", "differentiate", "differentiate_element", "differentiate_friction",
               "call_element", "bridge_bends", "differentiate_states", "differentiate_by_states",
               "differentiate_rate", "find_rate_tangent"}  # fmt: skip
#: The level of code with derivatives, beside those of ``targets``; numbers for each.
DIFFERENTIATED, COUNT = "differentiated", 3


class PlainTable(list):
    """A table of functions in plain Python, with their signature."""

    signature = None


class Recorder:
    """Runs compiled functions as plain Python and records some of their calls."""

    def __init__(self):
        self.functions = set(all_compiled_functions())
        self.calls = []
        self._counts = {}
        os.environ["DAP3D_PLAIN"] = "1"
        Compiled.__call__ = lambda function, *arguments: self.call(function, arguments)
        original = cache.table_of

        def table_of(signature, functions, **options):
            table = PlainTable(original(signature, functions, **options))
            table.signature = signature
            return table

        for module in list(sys.modules.values()):
            if getattr(module, "table_of", None) is original:
                module.table_of = table_of

    def call(self, function, arguments):
        """Call a function as plain Python."""
        count = self._counts[function] = self._counts.get(function, 0) + 1
        if count not in CALLS:
            return function.__wrapped__(*arguments)
        for parameter in function._parameters[len(arguments) :]:
            arguments += (parameter.default,)
        before, memo = copied(arguments, {}), {}
        result = function.__wrapped__(*arguments)
        self.calls.append((function, before, copied(arguments, memo), copied(result, memo)))
        return result

    def record(self, scenario, *arguments, **options):
        """Record the calls of a scenario; counts start again."""
        self._counts.clear()
        scenario(*arguments, **options)

    def missing(self):
        """Names of compiled functions that were never called."""
        called = {call[0] for call in self.calls}
        return sorted(f"{f.__module__}.{f.__name__}" for f in self.functions - called)


def all_compiled_functions():
    """The compiled functions of the core's floors."""
    for floor in source_digest.COMPILED_LAYERS:
        package = importlib.import_module(f"dap3d_core.{floor}")
        for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
            module = importlib.import_module(info.name)
            yield from (f for f in vars(module).values() if isinstance(f, Compiled))


def copied(value, memo):
    """A deep copy in which arrays share memory as they did."""
    if id(value) in memo:
        return memo[id(value)][1]
    if isinstance(value, np.ndarray):
        base = value
        while isinstance(base.base, np.ndarray):
            base = base.base
        if not base.flags.c_contiguous or value.size == 0:
            return value.copy()
        _, whole = memo.setdefault(id(base), (base, base.copy()))
        offset = value.ctypes.data - base.ctypes.data
        return np.ndarray(value.shape, value.dtype, whole, offset, value.strides)
    if isinstance(value, Arrays):
        fields = {f.alias: getattr(value, f.name) for f in attrs.fields(type(value)) if f.init}
        found = type(value)(**{name: copied(member, memo) for name, member in fields.items()})
        memo[id(value)] = value, found
        return found
    return tuple(copied(item, memo) for item in value) if type(value) is tuple else value


def arrays_in(value):
    """All arrays of an argument."""
    if isinstance(value, np.ndarray):
        yield value
    elif isinstance(value, (Arrays, tuple)):
        for member in value:
            yield from arrays_in(member)


def is_code(value):
    """True for a function, and a module of functions."""
    return inspect.ismodule(value) or (callable(value) and not isinstance(value, Arrays))


def compiled_type(value, parameter):
    """The type of a recorded argument."""
    if isinstance(value, PlainTable):
        return Table(value.signature)
    if is_code(value):
        return Known(value)
    if isinstance(value, tuple):
        return Tuple(tuple(compiled_type(item, parameter) for item in value))
    if isinstance(value, complex):
        return COMPLEX
    type_ = units.type_of(value)
    return FLOAT if type_ == INT and parameter.annotation is float else type_


def is_constant(type_):
    """True for functions, and tuples of them, which are no arguments of machine code."""
    if isinstance(type_, Tuple):
        return all(map(is_constant, type_.items))
    return isinstance(type_, Known)


def wrapper_of(function, types, result):
    """A function of the same arguments that writes the results of a function into an array."""
    names = ", ".join(f"a{k}" for k in range(len(types)))
    given = ", ".join(f"a{k}[0]" if t in BY_ARRAY else f"a{k}" for k, t in enumerate(types))
    lines = [f"def f({names}, out):", f"    r = target({given})", "    k = 0"]
    if result == NOTHING:
        lines[1:] = [f"    target({given})"]
    for path, type_ in leaves("r", result):
        if isinstance(type_, Array):
            lines += [f"    for q in range({path}.size):", f"        out[k] = pointer({path})[q]",
                      "        k += 1"]  # fmt: skip
        else:
            lines += [f"    out[k] = {path}", "    k += 1"]
    return function_of("\n".join(lines) + "\n", target=function, pointer=pointer)


def leaves(path, type_):
    """Path and type of each number or array of a result."""
    if isinstance(type_, Tuple):
        for k, item in enumerate(type_.items):
            yield from leaves(f"{path}[{k}]", item)
    elif type_ != NOTHING:
        yield path, type_


def numbers_of(result):
    """The numbers of a result, in order."""
    if isinstance(result, tuple):
        return [x for item in result for x in numbers_of(item)]
    return [] if result is None else np.ravel(result).tolist()


def exported(translated, function, before, index):
    """Compile a function for recorded arguments: symbol, signature, indices of its arguments."""
    parameters = function._parameters
    types = [compiled_type(v, p) for v, p in zip(before, parameters, strict=True)]
    try:
        result = translated.result_of(function, types)
    except CompileError:  # put into its callers with constants, and needs some of them
        types = [Known(v) if t == INT else t for v, t in zip(before, types, strict=True)]
        result = translated.result_of(function, types)
    wrapper = wrapper_of(function, types, result)
    types = [Array(t, 1) if t in BY_ARRAY else t for t in types]
    symbol = f"recorded_{index}"
    translated.program.export(wrapper, (*types, Array(COMPLEX, 1)), symbol)
    variable = [k for k, t in enumerate(types) if not is_constant(t)]
    signature = Signature((*(types[k] for k in variable), Array(COMPLEX, 1)))
    return symbol, signature, variable


class Translated:
    """What is translated of recorded calls: each function once, whatever is compared of it."""

    def __init__(self):
        self.program, self.signatures = Program(), {}
        self.trial = Program()
        #: Of calls by function and kinds of arguments: what ``exported`` returns.
        self.wrappers = {}
        #: Symbols of the compiled functions that stand in tables.
        self.items = {}

    def result_of(self, function, types):
        """The type of a function's result; what cannot be translated leaves nothing behind."""
        try:
            return self.trial.function(function, types)[1]
        except CompileError:
            self.trial = Program()
            raise


def differences(calls, levels=None, translated=None):
    """Recorded calls that compiled code answers in other bits: functions and levels.

    Args:
        calls: of a recorder.
        levels: some of ``targets``; all where it is None.
        translated: what other comparisons have translated, which is not done again.
    """
    translated = translated or Translated()
    program, wrappers = translated.program, translated.wrappers
    signatures, items, loops = translated.signatures, translated.items, {}
    for function, before, _, _ in calls:
        key = function, tuple(map(kind, before))
        if key not in wrappers:
            wrappers[key] = exported(translated, function, before, len(wrappers))
            signatures[wrappers[key][0]] = wrappers[key][1]
        for table in tables_in(before):
            for item in table:
                if isinstance(item, Compiled) and item not in items:
                    items[item] = f"item_{len(items)}"
                    signatures[items[item]] = program.export(
                        item, table.signature.arguments, items[item]
                    )
                elif isinstance(item, units.Entry):  # a differentiated loop, compiled as it is
                    loops[id(item)] = item, dict.fromkeys((*targets(), DIFFERENTIATED), item)
                elif not isinstance(item, Compiled) and id(item) not in loops:
                    made = made_at(loop_text(item), {"loop": LOOP}, levels)
                    loops[id(item)] = item, {level: e["loop"] for level, e in made.items()}
    found = set()
    for level, entries in made_at(program.module(), signatures, levels).items():

        def with_tables(value, level=level, entries=entries):
            if isinstance(value, tuple):
                return tuple(map(with_tables, value))
            if not isinstance(value, PlainTable):
                return value
            made = (entries[items[f]] if isinstance(f, Compiled) else loops[id(f)][1][level]
                    for f in value)  # fmt: skip
            return units.Functions(value.signature, list(made))

        for function, before, after, result in calls:
            symbol, signature, variable = wrappers[function, tuple(map(kind, before))]
            if level == DIFFERENTIATED and (
                any(map(has_vectors, signature.arguments))
                or computes_values_alone(function, before)
            ):
                continue
            numbers = np.array(numbers_of(result), dtype=complex)
            given, out = copied(before, {}), np.zeros(numbers.size, dtype=complex)
            taken = [given[k] for k in variable]
            by_array = zip(taken, entries[symbol].signature.arguments, strict=False)
            taken = [np.array([v], dtype=DTYPES[t.item]) if is_by_array(v, t) else v
                     for v, t in by_array]  # fmt: skip
            taken = list(map(with_tables, taken))
            if level == DIFFERENTIATED:
                call_differentiated(entries[symbol], [*taken, out])
            else:
                entries[symbol](*taken, out)
            pairs = [(numbers, out)]
            pairs += zip(arrays_in(after), arrays_in(given), strict=True)
            if not all(same_numbers(one, other) for one, other in pairs):
                found.add(f"{function.__module__}.{function.__name__} at {level}")
    return sorted(found)


def tables_in(value):
    """The tables of functions among arguments."""
    if isinstance(value, PlainTable):
        yield value
    elif isinstance(value, tuple):
        for item in value:
            yield from tables_in(item)


def is_by_array(value, type_):
    """Whether a number is to be given as an array."""
    return isinstance(type_, Array) and not isinstance(value, np.ndarray)


def computes_values_alone(function, arguments):
    """Whether a function calls loops that are differentiated already, or may."""
    if function.__name__ == "call_loop":
        return isinstance(arguments[0][arguments[1]], units.Entry)
    of_steps = function.__module__.endswith("radau.step")
    return function.__name__ in OF_TANGENTS or (of_steps and "tangents" in named(function))


def named(function):
    """Names of a function's arguments."""
    return [parameter.name for parameter in function._parameters]


def has_vectors(type_):
    """Whether C calls would have to take vectors: for numbers in a tuple."""
    return isinstance(type_, Tuple) and any(w == "double" for w in type_.words)


def made_at(text, signatures, levels):
    """As ``all_made_of``, with derivatives where that level is asked for."""
    plain = None if levels is None else [level for level in levels if level != DIFFERENTIATED]
    made = all_made_of(text, signatures, plain) if plain is None or plain else {}
    if levels is not None and DIFFERENTIATED in levels:
        made[DIFFERENTIATED] = all_made_of(differentiate(text, COUNT), signatures, ["O0"])["O0"]
    return made


def call_differentiated(entry, arguments):
    """Call a function whose numbers carry derivatives, drawn at random for those of its structs."""
    carried = Differentiation(COUNT)
    holder = carried.wide(Holder(numbers=np.zeros(1)))
    rng = np.random.default_rng(0)

    def words_of(value, type_):
        if isinstance(value, tuple):
            return [w for x, t in zip(value, type_.items, strict=True) for w in words_of(x, t)]
        if isinstance(value, np.ndarray):
            own = value.dtype.kind in "fc"
            if own and value.size:
                slopes = holder.slopes(value)
                slopes[:] = rng.standard_normal(slopes.shape)
            address = units.address_of(holder.matrix(value) if own else value)
            return [address, *value.shape[: type_.ndim]]
        if isinstance(value, Arrays):
            return [carried.wide(value).address]
        return [getattr(value, "address", value)] if type_.words else []  # None has none

    pairs = zip(arguments, entry.signature.arguments, strict=True)
    entry._run(*(word for value, type_ in pairs for word in words_of(value, type_)))
    holder.give()


@attrs.frozen(eq=False, kw_only=True, slots=False)
class Holder(Arrays):
    """A struct whose buffers others share."""

    numbers: Floats


def kind(value):
    """What tells arguments apart that need another compilation."""
    if isinstance(value, PlainTable):
        return value.signature
    if is_code(value):
        return value
    if isinstance(value, tuple):
        return tuple(map(kind, value))
    return (value.dtype.char, value.ndim) if isinstance(value, np.ndarray) else type(value)


def loop_text(loop):
    """LLVM IR of a group loop."""
    text = trace("loop", loop.__globals__, array_members())
    del loop.__globals__["range"]  # its plain Python goes on
    return text


def same_numbers(one, other):
    """Whether arrays are equal in all bits; NaN is NaN."""
    if one.dtype.kind == "i":
        return one.tobytes() == other.tobytes()
    return same_bits(np.ravel(one).view(float), np.ravel(other).view(float))
