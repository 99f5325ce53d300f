"""The state of a run between two steps, for controllers and loops of a script."""

import math
from collections.abc import Callable
from functools import partial
from typing import Any

import numpy as np

from dap3d_core.assembly.motion.joint_motion import TRANSLATION
from dap3d_core.assembly.motion.single_coordinate import single_coordinate
from dap3d_core.assembly.turns import ANGLE, COORDINATE, OFFSET, STATE
from dap3d_core.formulations.evaluator import IGNORE_FLOAT_ERRORS, Evaluator
from dap3d_core.integrators.stepping.hold import T, quick_view
from dap3d_core.integrators.stepping.integration import Integration
from dap3d_core.integrators.stepping.integration_state import Y
from dap3d_core.kernels.array_types import Floats
from dap3d_core.kernels.runtime.loop_support import BODY_WIDTH, A, P, R, V, W
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.output.check_outputs import instant_of

Getter = Callable[[], Any]

#: Quantities of bodies that stand in the driver's arrays: first number, and how many.
OF_BODIES = {"r": (R, 3), "p": (P, 4), "rd": (V, 3), "w": (W, 3)}
AXES = {"x": 0, "y": 1, "z": 2}
TURN = 2.0 * math.pi


def _of_bodies(quantity: str, text: str) -> Any:
    """The attribute for a quantity of all bodies."""
    first, count = OF_BODIES[quantity]

    def values(view: "StateView") -> Floats:
        return view._placed[:, first : first + count]

    return property(values, doc=text)


class StateView:
    """The present state of a run: quantities by their names in results, ``state["crank.r.z"]``.

    Positions and velocities of bodies (``r``, ``p``, ``rd``, ``w`` and their components) and the
    coordinate of a joint that has one are read from where they stand; other quantities evaluate the
    scene, which takes some hundred microseconds. Turns of an angle are those that the run has
    counted. Arrays are views: they change with the run, copy what is to be kept.
    """

    def __init__(self, compiled: CompiledModel, evaluator: Evaluator) -> None:
        self._compiled, self._evaluator = compiled, evaluator
        self._getters: dict[str, Getter] = {}
        self._is_placed = False

    def attach(self, integration: Integration) -> None:
        """Show the state of an integration from here on."""
        self._integration = integration
        self._real = quick_view(integration.work.real)
        self._y = quick_view(integration.work.state[Y])
        self._place_bodies = self._evaluator.coordinates.placer(integration.work.state[Y])
        self.changed()

    def changed(self) -> None:
        """The state is another."""
        self._is_placed = False

    @property
    def t(self) -> float:
        """Time, s."""
        return float(self._real[T])

    r: Floats = _of_bodies("r", "(n, 3) positions of the mass centres, m, a view.")
    p: Floats = _of_bodies("p", "(n, 4) Euler parameters, a view.")
    rd: Floats = _of_bodies("rd", "(n, 3) velocities of the mass centres, m/s, a view.")
    w: Floats = _of_bodies("w", "(n, 3) angular velocities, global axes, rad/s, a view.")

    @property
    def u(self) -> Floats:
        """(13 n,) the state in the order of ``Result.u``; a copy."""
        halves = (self.r, self.p), (self.rd, self.w)
        return np.concatenate([np.hstack(half).ravel() for half in halves])

    def __getitem__(self, name: str) -> Any:
        """A quantity by its name in results: a number, or (components,).

        Raises:
            UnknownNameError: there is no such quantity.
            TypeError: the name is no text.
        """
        getter = self._getters.get(name) if isinstance(name, str) else None
        if getter is None:
            getter = self._getters[name] = self._getter(name)
        if not self._is_placed:
            self._place()
        return getter()

    # ---------------------------------------------------------------- how quantities are read

    @property
    def _placed(self) -> Floats:
        """(n, BODY_WIDTH) the bodies in the driver's arrays, placed."""
        if not self._is_placed:
            self._place()
        return self._evaluator.system.body[1:]

    def _place(self) -> None:
        self._place_bodies()
        self._is_placed = True

    def _getter(self, name: str) -> Getter:
        """The function that reads a quantity, once the bodies are placed."""
        if not isinstance(name, str):
            raise TypeError(f"a quantity is named by text such as 'crank.r.z', not by {name!r}")
        owner, _, rest = name.partition(".")
        model = self._evaluator.model
        quantity, _, component = rest.partition(".")
        if owner in model.body_names and owner not in model.point_names and quantity in OF_BODIES:
            first, count = OF_BODIES[quantity]
            row = 1 + model.body_names.index(owner)
            if not component:
                view = self._evaluator.system.body[row, first : first + count]
                view.flags.writeable = False
                return lambda: view
            if component in AXES and count == 3:
                flat = quick_view(self._evaluator.system.body.reshape(-1))
                place = row * BODY_WIDTH + first + AXES[component]
                return lambda: flat[place]
        if owner in model.joint_names and owner not in model.body_names and not component:
            found = self._coordinate(model.joint_names.index(owner), rest)
            if found is not None:
                return found
        self._quantity(name)  # an unknown name is refused here
        return lambda: self._quantity(name)

    def _coordinate(self, joint: int, name: str) -> Getter | None:
        """The function that reads a coordinate, or its rate, of a joint with a single one."""
        found = single_coordinate(self._evaluator.model.motions, joint, name)
        if found is None:
            return None
        coordinate, is_rate = found
        x = quick_view(self._evaluator.system.body.reshape(-1))

        def vector(body: int, first: int, size: int) -> Any:
            place = BODY_WIDTH * body + first
            return x[place : place + size]

        def axes(body: int) -> Any:
            place = BODY_WIDTH * body + A
            return x[place : place + 3], x[place + 3 : place + 6], x[place + 6 : place + 9]

        read = partial(coordinate.rate if is_rate else coordinate.value, vector, axes)
        if is_rate or coordinate.kind == TRANSLATION:
            return read
        return self._counted(read, joint)

    def _counted(self, read: Getter, joint: int) -> Getter:
        """The function that reads an angle with its turns, as the run has counted them."""
        system, model = self._evaluator.system, self._evaluator.model
        joints = model.joint_angles.coordinates[:, 0]  # type: ignore[union-attr]
        row = system.turns[int(np.flatnonzero(joints == joint)[0])]
        par, state, place = quick_view(system.par), int(row[STATE]), int(row[COORDINATE])

        def angle() -> float:
            q = read()
            near = par[state + ANGLE] if place < 0 else self._y[place] + par[state + OFFSET]
            return float(q - TURN * round((q - near) / TURN))

        return angle

    @IGNORE_FLOAT_ERRORS
    def _quantity(self, name: str) -> Any:
        """Any quantity, of a report of this state."""
        integration, text = self._integration, self._compiled.scene_text
        y, complete = integration.work.state[Y], integration.complete
        result = instant_of(text, self._evaluator, self.t, y, complete)
        values = result.quantity(name).values[0]
        self._is_placed = False
        return values if np.ndim(values) else float(values)
