"""A parameter of a scene and the values that an analysis follows it over."""

from typing import Any

import attrs
import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene import Mistake, SceneError, ValidatedScene
from dap3d_core.study.design import design_of
from dap3d_core.study.parameters import SceneParameter, parameters_named

FORMS = "1:5:9 (from:to:count), 1:100:5:log or 10,50,100 (a list)"


def read_values(own: ValidatedScene, name: str, values: Any) -> tuple[SceneParameter, Floats]:
    """The parameter of a scene of this name and its values (n,), in the order given.

    Raises:
        SceneError: an unknown parameter, with the nearest; invalid values. The keys are
            ``parameter`` and ``values``.
    """
    if isinstance(values, str) and "~" in values:
        raise SceneError([Mistake("values", values, f"values are {FORMS}")])
    mistakes: list[Mistake] = []
    try:
        [parameter] = parameters_named(own, [name])
    except SceneError as error:
        mistakes += [attrs.evolve(m, key="parameter") for m in error.mistakes]
    try:
        numbers = design_of({name: values}, None, "lhs", 0).varied[0].values
    except SceneError as error:  # samples have no order to follow
        mistakes += [attrs.evolve(m, key="values", remedy=m.remedy.partition(", or sample")[0])
                     for m in error.mistakes]  # fmt: skip
    if mistakes or numbers is None:
        raise SceneError(mistakes)
    if parameter.whole and np.any(numbers != np.round(numbers)):
        what = f"{name} is a whole number; list whole values"
        raise SceneError([Mistake("values", values, what)])
    return parameter, numbers
