"""[parameters] of a scene: numbers by name, and text that begins with "=" in their place."""

from collections.abc import Mapping
from graphlib import CycleError, TopologicalSorter
from typing import Any, TypeVar

import attrs

from dap3d_core.registry.suggestions import nearest
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
    report = Collector(scene)
    values = values_of(report)
    report.raise_mistakes()
    result = scene.copy()
    result.parameters = dict(values)
    for table in NAMED:
        for name, part in getattr(result, table).items():
            _resolve_part(report, (table, name), part, values)
    for k, point in enumerate(result.animation.points):
        point.sPp = _resolve(report, ("animation", "points", k, "sPp"), point.sPp, values)
    result.animation = attrs.evolve(
        result.animation,
        limits=_resolve(report, ("animation", "limits"), result.animation.limits, values),
    )
    report.raise_mistakes()
    return result


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
    expression = report.read(key, value, _read)
    return value if isinstance(expression, Fault) else _value(report, key, expression, values)


def _read(value: str) -> Any:
    """The expression behind the mark, or its fault."""
    return read_expression(value.removeprefix(MARK))


def _value(
    report: Collector, key: Key, expression: Expression, values: Mapping[str, float]
) -> float:
    """The number that an expression gives; a mistake and 0 where it has none."""
    text = f"{MARK}{expression.text}"
    unknown = next((name for name in expression.names if name not in values), None)
    if unknown is not None:
        listed = ", ".join(values) or "none"
        what = f"there is no parameter {unknown!r}; parameters: {listed}"
        report.add(key, text, what, nearest(unknown, values))
        return 0.0
    try:
        number = number_of(float(expression.evaluate(values)))
    except ExpressionError as error:
        number = error.fault
    if isinstance(number, Fault):
        given = ", ".join(f"{name} = {values[name]:g}" for name in expression.names)
        report.add(key, text, f"has no finite value{f' for {given}' if given else ''}")
        return 0.0
    return number


def values_of(report: Collector) -> dict[str, float]:
    """The values of the parameters, in the order of the scene."""
    values: dict[str, float] = {}
    expressions: dict[str, Expression] = {}
    for name, given in report.scene.parameters.items():
        key = ("parameters", str(name))
        if fault := fault_of_name(name) or fault_of_word(name):
            report.add(key, name, f"not a name for a parameter: {fault}")
        if isinstance(given, str) and given.startswith(MARK):
            expression = report.read(key, given, _read)
            if not isinstance(expression, Fault):
                expressions[name] = expression
        else:
            number = report.read(key, given, number_of)
            if not isinstance(number, Fault):
                values[name] = number
    uses = {n: [other for other in e.names if other in expressions] for n, e in expressions.items()}
    try:
        order = list(TopologicalSorter(uses).static_order())
    except CycleError as error:
        cycle = error.args[1][::-1]
        what = f"parameters name one another in a circle: {' -> '.join(cycle)}"
        report.add(("parameters", cycle[0]), report.scene.parameters[cycle[0]], what)
        return {}
    if report.mistakes:
        return {}
    for name in order:
        values[name] = _value(report, ("parameters", name), expressions[name], values)
    return {name: values[name] for name in report.scene.parameters}
