"""Constants that a type makes of its fields before a run, checked."""

import math
from collections.abc import Callable, Mapping
from typing import Any

from dap3d_core.interface.codegen.instance_layout import checked_shape, size
from dap3d_core.interface.codegen.kernel_arguments import can_be_parameter
from dap3d_core.interface.errors import PluginError, where_is
from dap3d_core.interface.fields import specs_of
from dap3d_core.interface.types import BodyPose


def prepared(instance: Any, bodies: Mapping[str, BodyPose]) -> dict[str, Any]:
    """The constants that ``prepare`` returns for an instance, checked, as tuples of floats.

    Raises:
        ValueError: the type refuses these values of its fields, in its own words; or they lead to
            a number that is not finite.
        PluginError: it failed otherwise, or returned something else than a dict of numbers and
            tuples of numbers.
    """
    type_ = type(instance)

    def broken(reason: str) -> PluginError:
        return PluginError(f"{where_is(type_)}.prepare {reason}")

    try:
        constants = instance.prepare(bodies)
    except ValueError:  # a mistake in the scene, in the type's own words
        raise
    except Exception as error:
        raise broken(f"failed: {type(error).__name__}: {error}") from error
    if not isinstance(constants, Mapping):
        raise broken(f"should return a dict; it returned {constants!r}")
    needed = {n for n, s in specs_of(type_).items() if s.kind == "table" and not s.given}
    if lacking := sorted(needed - set(constants)):
        raise broken(f"returns no {', '.join(lacking)}")
    return {name: _constant(name, value, broken) for name, value in constants.items()}


def _constant(name: Any, value: Any, broken: Callable[[str], PluginError]) -> Any:
    if not can_be_parameter(name):
        raise broken(f"returned {name!r}, which no kernel can name as a parameter")
    try:
        constant = _as_floats(value)
        count = size(checked_shape(constant))
    except (TypeError, ValueError, OverflowError):
        count = 0
    if not count:
        raise broken(
            "should return numbers and tuples of numbers or of tuples "
            f"of one length; {name} is {value!r}"
        )
    if not _is_finite(constant):
        raise ValueError(f"{name} comes out as {value!r}, which is not finite")
    return constant


def set_ends(instance: Any, make: Callable[[], Any]) -> None:
    """Give an instance with a vector2 field the ends of that vector as attributes P_i and P_j."""
    if any(spec.kind == "vector2" for spec in specs_of(type(instance)).values()):
        instance.P_i, instance.P_j = make(), make()


def _as_floats(value: Any) -> Any:
    if hasattr(value, "tolist"):
        value = value.tolist()
    if isinstance(value, (tuple, list)):
        return tuple(_as_floats(v) for v in value)
    return float(value)


def _is_finite(value: Any) -> bool:
    return all(map(_is_finite, value)) if isinstance(value, tuple) else math.isfinite(value)
