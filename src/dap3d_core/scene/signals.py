"""Signals of a scene: functions that combine others, and inputs."""

from collections.abc import Sequence

import attrs

from dap3d_core.interface.fields import specs_of
from dap3d_core.scene.errors import dotted
from dap3d_core.scene.expressions.outputs import fault_of_quantity
from dap3d_core.scene.expressions.parameters import in_order
from dap3d_core.scene.validate.coerce_values import number_of
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.validated_scene import Instance, arguments_of

#: Most functions in one combination, each counted as often as it occurs: all become one kernel.
MOST_TERMS = 200
#: First words of the quantities that every result has (result/quantities/catalogue.py).
SYSTEM_NAMES = ("t", "energy", "work", "constraint")


def combine_functions(report: Collector, functions: list[Instance]) -> list[Instance]:
    """The functions with those that they combine; mistakes are reported.

    Args:
        report: takes mistakes: a function that names itself, one of two arguments, or too many
            terms.
        functions: without mistakes of their own, in file order.
    """
    known = {function.name: function for function in functions}
    arguments = arguments_of(functions)
    for function in functions:
        if of_two := [name for name in _terms(function) if arguments.get(name, 1) > 1]:
            what = f"combines functions of one argument; {of_two[0]} takes two"
            report.add(("functions", function.name), _terms(function), what)
            return functions
    uses = {name: _terms(function) for name, function in known.items()}
    order = in_order(report, "functions", uses, uses, "functions combine one another")
    sizes: dict[str, int] = {}
    for name in order:
        if name not in known or not set(uses[name]) <= sizes.keys():
            continue  # one of them has a mistake, which is reported
        sizes[name] = sum(sizes[term] for term in uses[name]) or 1
        if sizes[name] > MOST_TERMS:
            what = f"combines {sizes[name]} functions, counted as often as they occur"
            report.add(("functions", name), uses[name], what, "", f"at most {MOST_TERMS}")
            return functions
        known[name] = attrs.evolve(known[name], terms=tuple(known[term] for term in uses[name]))
    return list(known.values())


def _terms(function: Instance) -> list[str]:
    """Names of the functions that a function combines, in the order of its fields."""
    specs = specs_of(function.type_info.type)
    fields = [field for field, spec in specs.items() if spec.kind == "functions"]
    return [name for field in fields for name in function.values[field]]


def read_inputs(report: Collector) -> dict[str, float]:
    """The values of the inputs at the start of a run, by name; mistakes are reported."""
    inputs = {}
    for name, entry in report.scene.inputs.items():
        fault = fault_of_quantity(report.scene, name, but="inputs")
        if not fault and name in SYSTEM_NAMES:
            fault = "every result has a quantity of this name"
        if fault:
            report.add(("inputs", str(name)), name, f"not a name for an input: {fault}")
        inputs[name] = report.read(("inputs", str(name), "value"), entry.value, number_of)
    return inputs


def note_unread_inputs(report: Collector, elements: Sequence[Instance]) -> None:
    """Note inputs that no joint and no force reads."""
    behind = 1 + len(report.scene.functions)
    read = {index - behind for e in elements for index in e.functions}
    named = {name for e in elements if e.active for name in e.active.names}
    for index, name in enumerate(report.scene.inputs):
        if index not in read and name not in named:
            key = dotted(("inputs", name))
            report.note(f"{key}: no joint and no force reads it", "inputs left unread")
