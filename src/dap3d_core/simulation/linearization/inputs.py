"""Inputs and outputs of linearised equations, by their names.

Inputs are numbers of force elements, factors on them, and drivers; an output is any quantity of a
result. It is evaluated by the post-processor itself, at states displaced along each state of the
linear system, and differentiated by central differences of sixth order. Accelerations and
multipliers follow the linear equations there, so that what is differentiated is smooth.
"""

from collections.abc import Sequence
from typing import Any, NoReturn

import attrs
import numpy as np

from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.interface.codegen.kernel_arguments import parameters
from dap3d_core.interface.codegen.loop_derivatives import differentiate_loop
from dap3d_core.interface.codegen.loop_source import computes_rate
from dap3d_core.interface.fields import specs_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Group, Model
from dap3d_core.model.element_states import first_states
from dap3d_core.model.state_layout import split
from dap3d_core.result import Result, RunMetadata, find
from dap3d_core.result.arrays import AXES
from dap3d_core.result.errors import UnknownNameError, unknown
from dap3d_core.result.note import information
from dap3d_core.simulation.linearization.mode_motion import displaced_state
from dap3d_core.simulation.linearization.operating_point import OperatingPoint
from dap3d_core.simulation.linearization.state_space import DriverRows, StateSpace

#: Kinds of fields that may be inputs.
NUMBERS = ("number", "vec3")


@attrs.frozen(eq=False)
class Inputs:
    """The effects of unit inputs.

    Attributes:
        wrench: (6 n, inputs) force and moment on each body.
        rate: (s, inputs) rates of the states of elements.
        driver: (drivers, inputs) accelerations of drivers, and behind them numbers that rows read.
        rows: of these; None where there are none.
        units: SI units of the inputs.
        numbers: array of the evaluator and place in it, flat, of the number that an input is; None
            of factors and drivers.
        factors: names of the forces of which an input is a factor.
        notes: of inputs that have no effect, and of those that are accelerations.
    """

    wrench: Floats
    rate: Floats
    driver: Floats
    rows: DriverRows | None
    units: tuple[str, ...]
    numbers: tuple[tuple[str, int] | None, ...]
    factors: frozenset[str]
    notes: tuple[str, ...]


def inputs_of(point: OperatingPoint, names: Sequence[str]) -> Inputs:
    """The effects of inputs, by name.

    Raises:
        UnknownNameError: there is no such force, field or component; names the nearest.
    """
    wrench = np.zeros((6 * point.model.body_count, len(names)))
    rate = np.zeros((point.model.state_count, len(names)))
    units: list[str] = []
    notes: list[str] = []
    numbers: list[tuple[str, int] | None] = []
    drivers, read, last = [], [], []  # places of inputs with the rows that they move
    with point.placed() as evaluator:
        for k, name in enumerate(names):
            element = name.partition(".")[0]
            if name in point.model.input_names:
                gamma = np.zeros(point.model.row_count)
                numbers.append(_by_input(point, evaluator, name, wrench[:, k], rate[:, k], gamma))
                units.append("1")
                if np.any(gamma):
                    read.append(k)
                    last.append(gamma)
                    continue
            elif element not in point.model.force_names:
                drivers.append((k, _driver(point, evaluator, name)))
                numbers.append(None)
                notes.append(information(f"input {name} is the acceleration of this driver"))
                units.append("SI")
                continue
            else:
                unit, number = _force(point, evaluator, name, wrench[:, k], rate[:, k])
                units.append(unit)
                numbers.append(number)
            if not np.any(wrench[:, k]) and not np.any(rate[:, k]):
                notes.append(f"input {name} has no effect at this state")
    rows = None
    if drivers or read:
        by = np.reshape([of for _, of in drivers], (-1, 5, point.model.row_count))
        nu_0, nu_1, *first, acceleration = by.transpose(1, 2, 0)
        found = first[0], first[1], np.column_stack([acceleration, *last])
        rows = DriverRows(nu=(nu_0, nu_1), gamma=found)
    driver = np.eye(len(names))[[*(k for k, _ in drivers), *read]]
    factors = frozenset(name for name in names if name in point.model.force_names)
    return Inputs(wrench, rate, driver, rows, tuple(units), tuple(numbers), factors, tuple(notes))


def _by_input(
    point: OperatingPoint, evaluator: Evaluator, name: str, wrench: Floats, rate: Floats,
    gamma: Floats,
) -> tuple[str, int]:  # fmt: skip
    """Add the derivatives of all forces (6 n,), rates of states (s,) and right-hand sides of the
    accelerations of rows by an input of the scene.

    Returns:
        where its number is.
    """
    model, start = point.model, point.model.joint_start
    row = int(model.input_rows[model.input_names.index(name)])
    for loop, (kind, group) in enumerate(evaluator.loop_groups):
        for column in range(len(group.type_info.layout.functions)):
            mine = group.functions[:, column] == row
            if not np.any(mine):
                continue
            if kind in ("wrench", "rate"):
                _add(point, evaluator, loop, mine, wrench, rate, functions=[(column, 0)])
            elif kind == "friction":
                force = model.force_names[int(group.members[np.argmax(mine)])]
                words = f"{force}, which reads it, acts by reactions of joints"
                raise UnknownNameError(f"input {name!r}: {words}")
            elif kind == "acceleration":
                first = tuple(evaluator.system.groups[loop].tolist())
                own = differentiate_loop(group.type_info, kind, point.t, evaluator.system, first,
                                         functions=[(column, 0)]).outputs  # fmt: skip
                for place in np.flatnonzero(mine):
                    joint = int(group.members[place])
                    if np.any(own["nu"][1][place, :, -1]):
                        _refuse_speed(name, model.joint_names[joint])
                    gamma[start[joint] : start[joint + 1]] += own["gamma"][1][place, :, -1]
    return "F", row * evaluator.system.F.shape[1]


def _add(
    point: OperatingPoint, evaluator: Evaluator, loop: int, mine: Any, wrench: Floats,
    rate: Floats, **by: Any,
) -> None:  # fmt: skip
    """Add what instances of a loop exert, or its derivative and that of rates by a number of each.

    Args:
        mine: (m,) True for these instances.
        by: ``numbers`` or ``functions`` of ``differentiate_loop``, one of them.
    """
    kind, group = evaluator.loop_groups[loop]
    first = tuple(evaluator.system.groups[loop].tolist())
    for what in ("rate", kind) if by and computes_rate(group.type_info) else (kind,):
        own = differentiate_loop(group.type_info, what, point.t, evaluator.system, first, **by)
        value, slope = own.outputs[what]
        part = (slope[..., -1] if by else value)[mine]
        if what == "wrench":  # (m, slots, 6)
            forces = np.zeros((point.model.body_count + 1, 6))
            np.add.at(forces, own.bodies[mine][:, : part.shape[1]], part)
            wrench += forces[1:].ravel()
        else:
            places = first_states(point.model.acting, group)[mine, None]
            rate[places + np.arange(part.shape[1])] += part


def _refuse_speed(name: str, joint: str) -> NoReturn:
    raise UnknownNameError(
        f"input {name!r} is read by the driver {joint}, whose velocity jumps with it: equations of "
        f"motion have no such input. Drive {joint} by a function of time in its place, and name "
        f"{joint} itself: its acceleration is the input then"
    )


def _has_one_function(group: Group) -> bool:
    """True if a type of joint has one function of time, and no input."""
    specs, fields = specs_of(group.type_info.type), group.type_info.layout.functions
    return [specs[field].kind != "input" for field in fields] == [True]


def _driver(point: OperatingPoint, evaluator: Evaluator, name: str) -> list[Floats]:
    """(rows,) each: derivatives of nu by f, f_dot, of gamma by f, f_dot, f_ddot of a driver."""
    model = point.model
    for loop, (kind, group) in enumerate(evaluator.loop_groups):
        names = [model.joint_names[k] for k in group.members] if kind == "acceleration" else []
        if name not in names or not _has_one_function(group):
            continue
        i0, p0, count = evaluator.system.groups[loop].tolist()
        orders = [(0, order) for order in range(3)]
        own = differentiate_loop(group.type_info, kind, point.t, evaluator.system, (i0, p0, count),
                                 functions=orders)  # fmt: skip
        place = names.index(name)
        start = int(model.joint_start[group.members[place]])
        result = []
        for level, order in (("nu", -3), ("nu", -2), ("gamma", -3), ("gamma", -2), ("gamma", -1)):
            slope = own.outputs[level][1][place, :, order]
            column = np.zeros(model.row_count)
            column[start : start + len(slope)] = slope
            result.append(column)
        return result
    known = _inputs_known(point, evaluator)
    element = name.removeprefix("inputs.").partition(".")[0]  # sweeps say inputs.NAME.value
    if element in known:
        raise UnknownNameError(f"input {name!r}: {element} is an input as a whole; name {element}")
    raise unknown("input, force or driver", element, known)


def _inputs_known(point: OperatingPoint, evaluator: Evaluator) -> list[str]:
    """Names of forces, and of joints with one function of time."""
    known = [*point.model.input_names, *point.model.force_names]
    for kind, group in evaluator.loop_groups:
        if kind == "acceleration" and _has_one_function(group):
            known += [point.model.joint_names[k] for k in group.members]
    return known


def _force(
    point: OperatingPoint, evaluator: Evaluator, name: str, wrench: Floats, rate: Floats
) -> tuple[str, tuple[str, int] | None]:
    """Forces (6 n,) and rates of states (s,) by a unit input; its unit, and where its number is."""
    element, _, field = name.partition(".")
    number = point.model.force_names.index(element)
    for loop, (kind, group) in enumerate(evaluator.loop_groups):
        if kind == "wrench" and number in group.members:
            unit, columns = _columns(group, name, field) if field else ("1", [])
            mine = group.members == number
            by = {"numbers": columns} if columns else {}
            _add(point, evaluator, loop, mine, wrench, rate, **by)
            if not columns:
                return unit, None
            first = int(evaluator.system.groups[loop, 1])
            place = int(np.argmax(mine)) * group.type_info.layout.par_width + columns[0]
            return unit, ("par", first + place)
    raise UnknownNameError(f"input {name!r}: {element} acts by reactions of joints alone")


def _columns(group: Group, name: str, field: str) -> tuple[str, list[int]]:
    """Unit of an input, and the index of its number among those of an element."""
    field, _, axis = field.partition(".")
    type_info = group.type_info
    specs, layout = specs_of(type_info.type), type_info.layout
    read = [n for k in ("wrench", "rate") if k in type_info.kernels
            for n in parameters(type_info.kernels[k])]  # fmt: skip
    prepared: Any = getattr(type_info.type.prepare, "__code__", None)
    known = [
        n
        for n, spec in specs.items()
        if spec.kind in NUMBERS and n in layout.numbers and n in read
        and not (prepared and n in prepared.co_names)
    ]  # fmt: skip
    if field not in known:
        if field in specs:
            raise UnknownNameError(
                f"{field} of force {name.partition('.')[0]} is no number that its force depends on "
                f"directly, so it cannot be an input (numbers: {', '.join(known) or 'none'})"
            )
        raise unknown(f"input {name!r}: no number", field, known)
    offset, shape = layout.numbers[field]
    if not shape and not axis:
        return specs[field].unit or "1", [offset]
    if shape == (3,) and axis in AXES:
        return specs[field].unit or "1", [offset + AXES.index(axis)]
    what = f"a component of {field} (x, y or z)" if shape == (3,) else f"{field} alone"
    raise UnknownNameError(f"input {name!r}: name {what}")


#: Abscissae and weights of the sixth-order central difference, and of that of fourth order.
ABSCISSAE = np.array([-3.0, -2.0, -1.0, 1.0, 2.0, 3.0])
WEIGHTS = np.array([-1.0, 9.0, -45.0, 45.0, -9.0, 1.0]) / 60.0
LOWER = np.array([0.0, 1.0, -8.0, 8.0, -1.0, 0.0]) / 12.0
#: Both agree to this part of a smooth output, and to this part of its value over the step, which is
#: rounding. Else steps are so much shorter, and tried so often.
SMOOTH, VALUE_ROUNDING, SHORTER, TRIES = 1e-8, 1e-12, 16.0, 8
#: Largest displacement of a body, as a part of the model's size or in rad, and of a velocity.
STEP = 2e-3
#: Least size of a state of an element, of which steps are parts.
LEAST = 1e-3


def output_derivatives(
    point: OperatingPoint, space: StateSpace, inputs: Inputs, names: Sequence[str]
) -> tuple[Floats, Floats]:
    """Derivatives of quantities: C (outputs, states) and D (outputs, inputs).

    Raises:
        UnknownNameError: there is no such quantity, or it is a vector; names the nearest.
    """
    states = len(space.A)
    own = np.zeros((states, point.model.state_count))
    own[:, point.kept] = space.own
    directions = [
        (space.displacement[:, k], space.velocity[:, k], space.acceleration[:, k],
         space.multipliers[:, k], own[k]) for k in range(states)
    ]  # fmt: skip
    unmoved = np.zeros(own.shape[1])
    none = np.zeros(6 * point.model.body_count)
    for wrench, driver in zip(inputs.wrench.T, inputs.driver.T, strict=True):
        a_change = space.acceleration_by_force @ wrench + space.acceleration_by_driver @ driver
        lam_change = space.multipliers_by_force @ wrench + space.multipliers_by_driver @ driver
        directions.append((none, none, a_change, lam_change, unmoved))
    rest = (none, none, none, np.zeros_like(point.tangent.multipliers), unmoved)
    matrix = _along(point, directions, rest, names, inputs.factors)
    for k, number in enumerate(inputs.numbers):
        if number is not None:
            matrix[:, states + k] += _by_number(point, *number, rest, names)
    return matrix[:, :states], matrix[:, states:]


def _along(
    point: OperatingPoint, directions: Sequence[Any], rest: Any, names: Sequence[str],
    factors: frozenset[str],
) -> Floats:  # fmt: skip
    """(outputs, directions) derivatives of quantities along directions; ``rest`` leads nowhere.

    A step that is short for bodies may turn a reaction, of which an output is the norm, around:
    where differences of two orders are apart, shorter ones are taken.
    """
    steps = np.array([_step(point, *direction) for direction in directions])
    found = np.full((len(names), len(directions)), np.nan)
    missed, left = np.full(found.shape, np.inf), np.arange(len(directions))
    for _ in range(TRIES):
        rows = [_row(point, x * steps[k], directions[k]) for k in left.tolist() for x in ABSCISSAE]
        values = _values(point, [*rows, _row(point, 0.0, rest)], names, factors)
        changes, given = values[:, :-1] - values[:, -1:], values[:, -1:]
        slopes, lower = (_slopes(changes, w) / steps[left] for w in (WEIGHTS, LOWER))
        apart = np.abs(slopes - lower)
        takes = apart < missed[:, left]  # not of NaN
        found[:, left] = np.where(takes, slopes, found[:, left])
        missed[:, left] = np.where(takes, apart, missed[:, left])
        limit = SMOOTH * np.abs(found[:, left]) + VALUE_ROUNDING * np.abs(given) / steps[left]
        left = left[~np.all(missed[:, left] <= limit, axis=0)]
        if not len(left):
            break
        steps /= SHORTER
    return found


def _slopes(values: Floats, weights: Floats = WEIGHTS) -> Floats:
    """(outputs, d) differences of values (outputs, abscissae of d directions), of unit steps."""
    return values.reshape(len(values), -1, len(ABSCISSAE)) @ weights


def _values(
    point: OperatingPoint, rows: list[Floats], names: Sequence[str], factors: frozenset[str]
) -> Floats:
    """(outputs, rows) quantities at reported rows; errors as of ``output_derivatives``."""
    record = RunMetadata(scene_text=point.compiled.scene_text)
    result = Result.of_run(point.model, np.array(rows), record, lambda: point.evaluator)
    values = np.zeros((len(names), len(rows)))
    for k, name in enumerate(names):
        quantity = find(result, name)
        if quantity.values.ndim > 1:
            first = quantity.columns[0]
            raise UnknownNameError(f"output {name!r} has components: name one, as {first}")
        if factor := _factor_in(point.model, result, name, factors):
            raise UnknownNameError(
                f"output {name!r} depends on {factor} itself, a factor of which is an input; "
                f"name a number of it, as {factor}.FIELD"
            )
        if "work" in _read_by(result, name):
            raise UnknownNameError(f"output {name!r}: work depends on the way, not on the state")
        if not np.isfinite(quantity.values[-1]):
            raise UnknownNameError(f"output {name!r} has no value at this state")
        values[k] = quantity.values
    return values


def _read_by(result: Result, name: str) -> set[str]:
    """Names of the quantities that a quantity is, or is computed from."""
    head = name.partition(".")[0]
    operands = find(result, head).operands if head in result.outputs else ()
    return {name}.union(*(_read_by(result, operand) for operand in operands))


def _factor_in(model: Model, result: Result, name: str, factors: frozenset[str]) -> str:
    """A force with a factor as an input on which a quantity depends by itself; "" for none."""
    for read in _read_by(result, name) if factors else ():
        element = read.partition(".")[0]
        if element in factors and find(result, read).owner == "force":
            return element
        for group in model.forces if read in ("energy.potential", "energy.total") else ():
            for member in group.members if "energy" in group.type_info.kernels else ():
                if model.force_names[int(member)] in factors:
                    return model.force_names[int(member)]
    return ""


def _by_number(
    point: OperatingPoint, array: str, place: int, rest: Any, names: Sequence[str]
) -> Floats:
    """(outputs,) derivatives of quantities by a number that elements read, in a state and motion
    that stay.
    """
    numbers = getattr(point.evaluator.system, array).reshape(-1)
    number = float(numbers[place])
    h = STEP * (abs(number) or 1.0)
    columns = []
    try:
        for x in (*ABSCISSAE, 0.0):
            numbers[place] = number + x * h
            columns.append(_values(point, [_row(point, 0.0, rest)], names, frozenset()))
    finally:
        numbers[place] = number
    values = np.hstack(columns)
    return _slopes(values[:, :-1] - values[:, -1:])[:, 0] / h


def _step(point: OperatingPoint, *direction: Floats) -> float:
    """A step along a direction that moves everything by about STEP of its size."""
    model = point.model
    length = model.part_size
    _, _, v, w = split(point.u)
    weights = np.tile(np.repeat([1.0 / length, 1.0], 3), model.body_count)
    speeds = np.abs(np.hstack([v, w]).ravel()) * weights
    speed = max(float(np.max(speeds, initial=0.0)), 1.0)
    largest = max(
        float(np.max(np.abs(direction[0]) * weights)),
        float(np.max(np.abs(direction[1]) * weights)) / speed,
        float(np.max(np.abs(direction[4]) / np.maximum(np.abs(point.states), LEAST), initial=0.0)),
    )
    return STEP / largest if largest > 0.0 else 1.0


def _row(point: OperatingPoint, h: float, direction: tuple[Floats, ...]) -> Floats:
    """A reported row of the state displaced by h along a direction."""
    model, evaluator = point.model, point.evaluator
    x, v_change, a_change, lam_change, z_change = direction
    evaluator.states = point.states + h * z_change
    u = displaced_state(point.u, h * x, h * v_change)
    layout = model.report_layout
    report = evaluator.report(point.t, u)
    report[layout["v_dot"]] = point.tangent.a + h * a_change
    report[layout["Lam"]] = point.tangent.multipliers + h * lam_change
    return np.concatenate([[point.t], evaluator.integrated(u), report])
