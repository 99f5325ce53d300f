"""[parameters] of a scene: numbers by name, and text that begins with "=" in their place."""

from collections.abc import Mapping, Sequence
from graphlib import CycleError, TopologicalSorter
from typing import Any, TypeVar

import attrs

from dap3d_core.scene.errors import Key
from dap3d_core.scene.expressions.expression import (
    Expression,
    ExpressionError,
    fault_of_word,
    read_expression,
)
from dap3d_core.scene.tables import NAMED, Element, SceneTables, fault_of_name
from dap3d_core.scene.validate.coerce_values import Fault, number_of
from dap3d_core.scene.validate.mistake_collector import Collector

Tables = TypeVar("Tables", bound=SceneTables)
#: How text begins that is an expression of parameters.
MARK = "="


def resolve(scene: Tables) -> Tables:
    """A copy of a scene with numbers in place of expressions of its parameters.

    Settings of the run have no expressions.

    Raises:
        SceneError: all mistakes in parameters and expressions, located.
    """
    result = scene.copy()
    report = Collector(result)
    put_numbers(report)
    report.raise_mistakes()
    return result


def put_numbers(report: Collector) -> None:
    """Put numbers in place of expressions in the collector's scene.

    An expression without a number remains, and later mistakes at its key are muted.
    """
    scene, values = report.scene, values_of(report)
    for table in NAMED:
        for name, part in getattr(scene, table).items():
            _resolve_part(report, (table, name), part, values)
    for k, point in enumerate(scene.animation.points):
        point.sPp = _resolve(report, ("animation", "points", k, "sPp"), point.sPp, values)
    limits = _resolve(report, ("animation", "limits"), scene.animation.limits, values)
    scene.animation = attrs.evolve(scene.animation, limits=limits)
    scene.parameters = dict(values)


def _resolve_part(report: Collector, key: Key, part: Any, values: Mapping[str, float]) -> None:
    """Put numbers in the fields of a body, point, vector or element."""
    if isinstance(part, Element):
        for field, value in part.fields.items():
            part.fields[field] = _resolve(report, (*key, field), value, values)
        return
    for field in attrs.fields_dict(type(part)):
        if field not in ("name", "body", "P_i", "P_j", "color"):
            place = (*key, field.rstrip("_"))  # with_ of materials
            value = _resolve(report, place, getattr(part, field), values)
            setattr(part, field, value)


def _resolve(report: Collector, key: Key, value: Any, values: Mapping[str, float]) -> Any:
    """A value, lists and tables within it as well, with numbers for its expressions."""
    if isinstance(value, Mapping):
        return {k: _resolve(report, (*key, k), one, values) for k, one in value.items()}
    if type(value) is tuple:
        return tuple(_resolve(report, (*key, k), one, values) for k, one in enumerate(value))
    if type(value) is not str or not value.startswith(MARK):
        return value
    expression = _expression(report, key, value)
    number = None if expression is None else _value(report, key, expression, values)
    if number is None:
        report.muted.add(key)
    return value if number is None else number


def _expression(report: Collector, key: Key, value: str) -> Expression | None:
    """The expression behind the mark, of parameters of the scene; None where it is a mistake."""
    expression = report.read(key, value, lambda text: read_expression(text.removeprefix(MARK)))
    if isinstance(expression, Fault):
        return None
    declared = report.scene.parameters
    unknown = next((name for name in expression.names if name not in declared), None)
    if unknown is not None:
        what = f"there is no parameter {unknown!r}; parameters: {', '.join(declared) or 'none'}"
        report.add(key, value, what, report.nearest(unknown, declared))
        return None
    return expression


def _value(
    report: Collector, key: Key, expression: Expression, values: Mapping[str, float]
) -> float | None:
    """The number that an expression gives; None after a mistake in it or its parameters."""
    if not values.keys() >= set(expression.names):
        return None
    try:
        number = number_of(float(expression.evaluate(values)))
    except ExpressionError as error:
        number = error.fault
    if isinstance(number, Fault):
        given = ", ".join(f"{name} = {values[name]:g}" for name in expression.names)
        what = f"has no finite value{f' for {given}' if given else ''}"
        report.add(key, f"{MARK}{expression.text}", what)
        return None
    return number


def values_of(report: Collector) -> dict[str, float]:
    """The values of the parameters without mistakes, in the order of the scene."""
    values: dict[str, float] = {}
    expressions: dict[str, Expression] = {}
    for name, given in report.scene.parameters.items():
        key = ("parameters", str(name))
        if fault := fault_of_name(name) or fault_of_word(name):
            report.add(key, name, f"not a name for a parameter: {fault}")
        elif isinstance(given, str) and given.startswith(MARK):
            if (expression := _expression(report, key, given)) is not None:
                expressions[name] = expression
        else:
            number = report.read(key, given, number_of)
            if not isinstance(number, Fault):
                values[name] = number
    uses = {n: [other for other in e.names if other in expressions] for n, e in expressions.items()}
    written = report.scene.parameters
    for name in in_order(report, "parameters", uses, written, "parameters name one another"):
        number = _value(report, ("parameters", name), expressions[name], values)
        if number is not None:
            values[name] = number
    return {name: values[name] for name in report.scene.parameters if name in values}


def in_order(
    report: Collector,
    table: str,
    uses: Mapping[str, Sequence[str]],
    written: Mapping[str, Any],
    what: str,
) -> list[str]:
    """Names of a table, each behind those that it uses; none, and a mistake, for a circle.

    Args:
        report: takes the mistake.
        table: of the names.
        uses: name -> names that its value uses.
        written: name -> its value.
        what: the fault, without "in a circle".
    """
    try:
        return list(TopologicalSorter(uses).static_order())
    except CycleError as error:
        cycle = error.args[1][::-1]  # each names the next
        circle = f"{what} in a circle: {' -> '.join(cycle)}"
        report.add((table, cycle[0]), written[cycle[0]], circle)
        return []
