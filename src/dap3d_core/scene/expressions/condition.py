"""Conditions: expressions of quantities that hold where their value is positive."""

from typing import Any

from dap3d_core.scene.errors import Key
from dap3d_core.scene.expressions.expression import (
    Call,
    Expression,
    ExpressionError,
    Node,
    read_expression,
)
from dap3d_core.scene.expressions.outputs import parameters_of
from dap3d_core.scene.validate.coerce_values import Fault
from dap3d_core.scene.validate.mistake_collector import Collector


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
