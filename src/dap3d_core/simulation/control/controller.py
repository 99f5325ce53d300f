"""Controllers that a script gives a run."""

import math
from collections.abc import Callable, Mapping
from typing import Any

import attrs

from dap3d_core.scene.coerce import plain
from dap3d_core.simulation.control.state_view import StateView


@attrs.frozen(kw_only=True)
class Controller:
    """Something that sets inputs of a scene at equal distances of time.

    ``update`` is called at t = 0 and at each multiple of ``every`` before the end of the run, and
    not in between: what it returns is held until the next time (zero-order hold). Steps end there.

    Attributes:
        every: s, from one sample to the next.
        update: called as update(t, state) with a ``StateView``; returns {input: value} of the
            inputs that it changes, {} for none.
        name: for messages; that of the function where it is left out.

    Raises:
        ValueError: ``every`` is no positive time.
        TypeError: ``update`` is no function.
    """

    every: float = attrs.field(converter=plain)
    update: Callable[[float, StateView], Mapping[str, float]]
    name: str = ""

    def __attrs_post_init__(self) -> None:
        every: Any = self.every
        is_number = isinstance(every, (int, float)) and not isinstance(every, bool)
        if not (is_number and 0.0 < every < math.inf):
            raise ValueError(f"every is {every!r}; it should be a positive number of seconds")
        update: Any = self.update
        if not callable(update):
            words = f"update is {update!r}; it should be a function of t and the state"
            raise TypeError(words)

    @property
    def title(self) -> str:
        """Name of the controller."""
        return self.name or str(getattr(self.update, "__name__", type(self.update).__name__))
