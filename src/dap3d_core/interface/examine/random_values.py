"""Random arguments of kernels and ``prepare``, for the examination of types."""

import math
import random
from typing import Any

from dap3d_core.interface.codegen.kernel_arguments import PARTIALS, SEVERAL, KernelArgument
from dap3d_core.interface.fields import FieldSpec
from dap3d_core.interface.types import BodyPose, pose


def numbers(rng: random.Random, n: int) -> tuple[float, ...]:
    """Numbers of size 0.5 to 1.5, of either sign."""
    return tuple(rng.uniform(0.5, 1.5) * rng.choice((-1.0, 1.0)) for _ in range(n))


def unit(values: tuple[float, ...]) -> tuple[float, ...]:
    """The same direction with length 1."""
    length = math.sqrt(sum(x * x for x in values))
    return tuple(x / length for x in values)


def random_pose(rng: random.Random) -> BodyPose:
    """A pose off the origin and turned."""
    return pose(numbers(rng, 3), unit(numbers(rng, 4)))


def random_value(shape: tuple[int, ...], rng: random.Random) -> Any:
    """A number, a vector, a rotation matrix (3, 3), Euler parameters (4,), or tuples of these."""
    if shape == ():
        return rng.uniform(0.5, 1.5)
    if shape == (3, 3):
        return random_pose(rng).A
    if shape == (4,):
        return unit(numbers(rng, 4))
    if len(shape) > 1:
        return tuple(random_value(shape[1:], rng) for _ in range(shape[0]))
    return numbers(rng, shape[0])


def random_quantity(quantity: KernelArgument, rng: random.Random) -> Any:
    """A random argument of a kernel: numbers, a table, or a function to be called."""
    if quantity.derivative == SEVERAL:
        return tuple(_random_line(rng) for _ in range(3))
    if quantity.derivative >= 0:
        return _known_function(quantity)
    if quantity.columns:
        rows = [(float(k), *numbers(rng, quantity.columns - 1)) for k in range(3)]
        return [x for row in rows for x in row], 0, len(rows), (0.0,) * quantity.columns
    return random_value(quantity.shape, rng)


def _known_function(quantity: KernelArgument) -> Any:
    """A function, or the derivative of it that is wanted: kernels may solve equations of both."""
    size, order = 1.0 + 0.05 * (ord(quantity.name[0]) % 7), quantity.derivative
    if quantity.arguments == 1:
        return lambda x: size * 0.25**order * math.exp(0.25 * x)
    which = PARTIALS[order]
    size *= 0.25 ** which.count("x") * 0.2 ** which.count("y")
    return lambda x, y: size * math.exp(0.25 * x + 0.2 * y)


def _random_line(rng: random.Random) -> Any:
    a, b = rng.uniform(0.5, 1.5), rng.uniform(0.5, 1.5)
    return lambda x: (a + b * x, b, 0.0, 0.0)


def random_field(spec: FieldSpec, rng: random.Random) -> Any:
    """A random value of a field, in the form that ``prepare`` takes."""
    if spec.by_rows:  # its ends come again, as those of a period have to
        rows = [(*row, row[0]) for row in (numbers(rng, 5) for _ in range(5))]
        return (*rows, rows[0])
    if spec.kind == "table":
        return tuple(float(k) + rng.uniform(0.0, 0.5) for k in range(6)) if spec.given else None
    if spec.kind == "angle":
        return None
    if spec.kind in ("point", "vec3", "vector2"):
        return numbers(rng, 3)
    if spec.positive and spec.kind == "numbers":
        return tuple(x * x + 0.01 for x in numbers(rng, spec.columns))
    if spec.kind in ("numbers", "square"):
        return numbers(rng, spec.columns)
    if spec.kind == "vector":
        return unit(numbers(rng, 3))
    if spec.kind == "matrix":
        return random_pose(rng).A
    if spec.kind == "number":
        low = 0.5 if spec.minimum is None else spec.minimum + 0.5
        value = rng.uniform(low, low + 1.0)
        value = value if spec.maximum is None else min(value, spec.maximum)
        return float(math.ceil(low)) if spec.whole else value
    if spec.kind == "choice":
        return spec.choices[0]
    if spec.kind == "functions":
        return ("f", "g", "h")
    named = spec.kind in ("function", "input", "joint_fields")
    return None if named or spec.size else spec.kind
