"""Notes on values that are allowed and unusual; they are used unchanged."""

from typing import Any

from dap3d_core.interface.fields import FieldSpec
from dap3d_core.scene.validate.coerce_values import ROUNDING

#: An angle beyond a full turn is probably given in degrees.
TURN = 6.283185307179586


def oddity(spec: FieldSpec, value: Any) -> str:
    """The note on an unusual value of a field, to follow it in a message; "" for no note."""
    if spec.kind == "number":
        low, high = spec.usual
        if low is not None and value < low:
            return f"is less than {low:g}, which is unusual; it is used as it is"
        if high is not None and value > high:
            return f"is more than {high:g}, which is unusual; it is used as it is"
        if spec.unit == "rad" and abs(value) > TURN:
            return "is more than a full turn; angles are in rad"
    elif spec.direction and spec.kind == "vec3":
        length = sum(x * x for x in value) ** 0.5
        if length == 0.0:
            return "is a direction of zero length: it has no effect"
        if abs(length - 1.0) > ROUNDING:
            return f"is a direction of length {length:.9g}, not 1; it is used as it is"
    return ""
