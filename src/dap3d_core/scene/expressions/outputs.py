"""Check of [outputs]: names, expressions, and the order in which they are evaluated."""

from collections.abc import Mapping
from typing import Any

import attrs

from dap3d_core.scene.errors import MISSING, Key
from dap3d_core.scene.expressions.expression import (
    Call,
    Expression,
    ExpressionError,
    Node,
    fault_of_word,
    read_expression,
)
from dap3d_core.scene.expressions.parameters import in_order, values_of
from dap3d_core.scene.tables import SceneTables, fault_of_name
from dap3d_core.scene.validate.coerce_values import Fault
from dap3d_core.scene.validate.mistake_collector import Collector

#: Tables whose parts have quantities: an output has another name.
OWNERS = ("bodies", "points", "joints", "forces", "inputs")
#: Names that begin those of quantities of the whole scene.
OF_SCENE = ("t", "energy", "work", "constraint", "ground", "animation")
#: Names of dimensions and variables of every data set.
DIMENSIONS = ("time", "point", "axis", "euler", "status", "note")
#: Keys of an output that is a table; longest text of a unit.
KEYS, LONGEST_UNIT = ("value", "unit"), 40
#: Outputs that name outputs that name outputs ...: longest chain.
LONGEST_CHAIN = 50


def read_outputs(report: Collector) -> dict[str, Expression]:
    """The outputs of a scene by name, those first that others name; mistakes are reported."""
    expressions = {}
    numbers = parameters_of(report) if report.scene.outputs else {}
    for name, value in report.scene.outputs.items():
        key: Key = ("outputs", str(name))
        fault = fault_of_quantity(report.scene, name)
        if fault:
            report.add(key, name, f"not a name for an output: {fault}")
        unit = ""
        if isinstance(value, dict):
            report.add_unknown_keys(key, value, KEYS, in_order=True)
            if "unit" in value:
                unit = report.read((*key, "unit"), value["unit"], _read_unit)
            key, value = (*key, "value"), value.get("value", MISSING)
        expression = report.read(key, value, read_expression)
        if not fault and not isinstance(expression, Fault) and not isinstance(unit, Fault):
            expressions[name] = attrs.evolve(expression.with_numbers(numbers), unit=unit)
    return _in_order(report, expressions)


def parameters_of(report: Collector) -> dict[str, float]:
    """The parameters that expressions of quantities may name: not those named as a quantity is."""
    scene = report.scene
    if not scene.parameters:
        return {}
    taken = {"t", "work", *scene.inputs, *scene.outputs}
    return {name: x for name, x in values_of(report).items() if name not in taken}


def _read_unit(value: Any) -> str | Fault:
    """The text of a unit, or its fault."""
    if isinstance(value, str) and value.strip() and value.isprintable():
        if len(value) <= LONGEST_UNIT:
            return value.strip()
        return Fault(f"is too long: at most {LONGEST_UNIT} characters")
    return Fault('should be a unit in quotes, such as "deg"', 'write unit = "1" for none')


def outputs_of(outputs: Mapping[str, Any], parameters: Mapping[str, Any]) -> dict[str, Expression]:
    """The outputs of tables [outputs] and [parameters] alone, such as those of a result.

    Raises:
        SceneError: all mistakes.
    """
    report = Collector(SceneTables(outputs=dict(outputs), parameters=dict(parameters)))
    expressions = read_outputs(report)
    report.raise_mistakes()
    return expressions


def fault_of_quantity(scene: SceneTables, name: Any, but: str = "") -> str:
    """The reason why something cannot name an output or an input; "" where it can.

    but: the table that it stands in.
    """
    if fault := fault_of_name(name) or fault_of_word(name):
        return fault
    if name in DIMENSIONS:
        return "data sets have a dimension or a variable of this name"
    tables = (table for table in OWNERS if table != but)
    table = next((table for table in tables if name in getattr(scene, table)), None)
    return f"there is one of this name in {table} already" if table else ""


def report_unknown(report: Collector, outputs: Mapping[str, Expression]) -> None:
    """Report the quantities in outputs that begin with no name of the scene.

    The limits of a joint have its name and more behind ``_``, points of a contact behind ``#``.
    """
    scene = report.scene
    tables = (*OWNERS, "contacts", "shapes", "outputs")
    known = {*OF_SCENE, *(str(name) for table in tables for name in getattr(scene, table))}
    known |= {str(key[1]) for key, _ in scene.faults if len(key) > 1}  # not read
    for name, expression in outputs.items():
        for quantity in expression.names:
            if not any(f"{quantity}.".startswith((f"{n}.", f"{n}_", f"{n}#")) for n in known):
                head = quantity.partition(".")[0]
                what = f"there is no body, point, joint, contact, force or output {head!r}"
                report.add(("outputs", name), expression.text, what, report.nearest(head, known))


def _in_order(report: Collector, expressions: Mapping[str, Expression]) -> dict[str, Expression]:
    """The same outputs, each behind those that it names."""
    uses = {
        name: [head for head in (n.partition(".")[0] for n in e.names) if head in expressions]
        for name, e in expressions.items()
    }
    texts = {name: e.text for name, e in expressions.items()}
    order = in_order(report, "outputs", uses, texts, "outputs name one another")
    depth: dict[str, int] = {}
    for name in order:
        depth[name] = 1 + max((depth[other] for other in uses[name]), default=0)
        if depth[name] == LONGEST_CHAIN + 1:
            what = f"outputs name one another in a chain of more than {LONGEST_CHAIN}"
            report.add(("outputs", name), expressions[name].text, what)
    return {name: expressions[name] for name in order}


def read_condition(report: Collector, key: Key, value: Any) -> Expression | None:
    """The condition of a key of a scene; None where a mistake is reported."""
    expression: Expression | Fault = report.read(key, value, read_expression)
    if isinstance(expression, Fault):
        return None
    try:
        margin(expression.root)
    except ExpressionError as error:
        report.add(key, value, error.fault.what, remedy=error.fault.remedy)
        return None
    return expression.with_numbers(parameters_of(report))


def margin(node: Node) -> Node:
    """A number that is positive where a condition holds, and passes zero where it begins or ends.

    b - a of a < b, the least of conditions that all hold, the largest of which one does.

    Raises:
        ExpressionError: it compares by == or !=, which hold or fail for an instant alone.
    """
    if not isinstance(node, Call):
        return node
    a, *others = node.arguments
    match node.word:
        case "<" | "<=":
            return Call("-", (others[0], a))
        case ">" | ">=":
            return Call("-", (a, others[0]))
        case "not":
            return Call("neg", (margin(a),))
        case "and":
            return Call("minimum", (margin(a), margin(others[0])))
        case "or":
            return Call("maximum", (margin(a), margin(others[0])))
        case "==" | "!=":
            what = f"compares by {node.word}, which changes for an instant alone"
            raise ExpressionError(what, "compare by <, <=, > or >=")
    return node
