"""Inputs of a scene: their names and values, and whether an element reads them."""

from collections.abc import Sequence

from dap3d_core.scene.errors import dotted
from dap3d_core.scene.expressions.outputs import fault_of_quantity
from dap3d_core.scene.validate.coerce_values import number_of
from dap3d_core.scene.validate.mistake_collector import Collector
from dap3d_core.scene.validate.validated_scene import Instance

#: First words of the quantities that every result has (result/quantities/catalogue.py).
SYSTEM_NAMES = ("t", "energy", "work", "constraint")


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
