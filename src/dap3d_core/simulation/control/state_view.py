"""The state of a run between two steps, for controllers and loops of a script."""

import math
from collections.abc import Callable
from typing import Any

import numpy as np

from dap3d_core.assembly.motion.joint_motion import ROTATION, TRANSLATION
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
#: Names of the coordinate of a joint that has one, and of its rate.
NAMES = {
    ROTATION: (("angle", "q1"), ("angle_rate", "q1_dot")),
    TRANSLATION: (("length", "q1"), ("length_rate", "q1_dot")),
}


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

    @property
    def r(self) -> Floats:
        """(n, 3) positions of the mass centres, m, a view."""
        return self._placed[:, R : R + 3]

    @property
    def p(self) -> Floats:
        """(n, 4) Euler parameters, a view."""
        return self._placed[:, P : P + 4]

    @property
    def rd(self) -> Floats:
        """(n, 3) velocities of the mass centres, m/s, a view."""
        return self._placed[:, V : V + 3]

    @property
    def w(self) -> Floats:
        """(n, 3) angular velocities, global axes, rad/s, a view."""
        return self._placed[:, W : W + 3]

    @property
    def u(self) -> Floats:
        """(13 n,) the state in the order of ``Result.u``; a copy."""
        body = self._placed
        parts = body[:, R : R + 3], body[:, P : P + 4], body[:, V : V + 3], body[:, W : W + 3]
        return np.concatenate([np.hstack(parts[:2]).ravel(), np.hstack(parts[2:]).ravel()])

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
        for group in self._evaluator.model.motions.motions:
            places = np.flatnonzero(group.joints == joint)
            if not len(places) or len(group.parts) != 1 or group.parts[0].kind not in NAMES:
                continue
            names, rates = NAMES[group.parts[0].kind]
            if name not in (*names, *rates):
                return None
            motion = group.take(places)
            if group.parts[0].kind == TRANSLATION:
                length = _Length(self, motion)
                return length.rate if name in rates else length.value
            angle = _Angle(self, motion)
            return angle.rate if name in rates else angle.value
        return None

    @IGNORE_FLOAT_ERRORS
    def _quantity(self, name: str) -> Any:
        """Any quantity, of a report of this state."""
        integration, text = self._integration, self._compiled.scene_text
        y, complete = integration.work.state[Y], integration.complete
        result = instant_of(text, self._evaluator, self.t, y, complete)
        values = result.quantity(name).values[0]
        self._is_placed = False
        return values if np.ndim(values) else float(values)


class _Coordinate:
    """The coordinate of one joint between bodies i and j, read from the driver's arrays.

    All is as in assembly/motion/coordinates.py, for one joint in plain numbers.
    """

    def __init__(self, view: StateView, motion: Any) -> None:
        evaluator = view._evaluator
        self._view = view
        self._flat = quick_view(evaluator.system.body.reshape(-1))
        self._i = BODY_WIDTH * int(motion.body_i[0])
        self._j = BODY_WIDTH * int(motion.body_j[0])
        self._r0, self._p0 = motion.start.r[0].tolist(), motion.start.p[0].tolist()
        self._axis = motion.axis(0)[0].tolist()

    def _difference(self, first: int) -> tuple[float, float, float]:
        """A vector of body i less that of body j."""
        x, i, j = self._flat, self._i + first, self._j + first
        return x[i] - x[j], x[i + 1] - x[j + 1], x[i + 2] - x[j + 2]

    def _axis_now(self, body: int) -> tuple[float, float, float]:
        """The axis, fixed in a body, in global axes."""
        x, a, (u, v, w) = self._flat, body + A, self._axis
        return (
            x[a] * u + x[a + 1] * v + x[a + 2] * w,
            x[a + 3] * u + x[a + 4] * v + x[a + 5] * w,
            x[a + 6] * u + x[a + 7] * v + x[a + 8] * w,
        )


class _Angle(_Coordinate):
    """The angle of a joint with a single axis."""

    def __init__(self, view: StateView, motion: Any) -> None:
        super().__init__(view, motion)
        system, model = view._evaluator.system, view._evaluator.model
        joints = model.joint_angles.coordinates[:, 0]  # type: ignore[union-attr]
        row = system.turns[int(np.flatnonzero(joints == motion.joints[0])[0])]
        self._par = quick_view(system.par)
        self._state, self._coordinate = int(row[STATE]), int(row[COORDINATE])

    @property
    def _counted(self) -> float:
        """The angle but for rounding, rad."""
        if self._coordinate < 0:
            return float(self._par[self._state + ANGLE])
        return float(self._view._y[self._coordinate] + self._par[self._state + OFFSET])

    def value(self) -> float:
        """The angle, rad."""
        x, i, j = self._flat, self._i + P, self._j + P
        gone = product(
            conjugate(self._p0),
            product(conjugate((x[j], x[j + 1], x[j + 2], x[j + 3])),
                    (x[i], x[i + 1], x[i + 2], x[i + 3])),
        )  # fmt: skip
        a, b, c = self._axis
        q = 2.0 * math.atan2(gone[1] * a + gone[2] * b + gone[3] * c, gone[0])
        return q - TURN * round((q - self._counted) / TURN)

    def rate(self) -> float:
        """Its rate, rad/s."""
        a, w = self._axis_now(self._i), self._difference(W)
        return a[0] * w[0] + a[1] * w[1] + a[2] * w[2]


class _Length(_Coordinate):
    """The length of a joint that slides along one axis, which both bodies share."""

    def value(self) -> float:
        """The length, m."""
        d, x, j = self._difference(R), self._flat, self._j + A
        r = self._r0
        start = [x[j + 3 * k] * r[0] + x[j + 3 * k + 1] * r[1] + x[j + 3 * k + 2] * r[2]
                 for k in range(3)]  # fmt: skip
        a = self._axis_now(self._i)
        return float(sum((d[k] - start[k]) * a[k] for k in range(3)))

    def rate(self) -> float:
        """Its rate, m/s."""
        a, v, d = self._axis_now(self._i), self._difference(V), self._difference(R)
        x, j = self._flat, self._j + W
        w = x[j], x[j + 1], x[j + 2]
        carried = (w[1] * d[2] - w[2] * d[1], w[2] * d[0] - w[0] * d[2], w[0] * d[1] - w[1] * d[0])
        return float(sum((v[k] - carried[k]) * a[k] for k in range(3)))


def conjugate(p: Any) -> tuple[float, ...]:
    """The inverse of unit Euler parameters."""
    return p[0], -p[1], -p[2], -p[3]


def product(a: Any, b: Any) -> tuple[float, ...]:
    """The quaternion product a b."""
    return (
        a[0] * b[0] - a[1] * b[1] - a[2] * b[2] - a[3] * b[3],
        a[0] * b[1] + a[1] * b[0] + a[2] * b[3] - a[3] * b[2],
        a[0] * b[2] - a[1] * b[3] + a[2] * b[0] + a[3] * b[1],
        a[0] * b[3] + a[1] * b[2] - a[2] * b[1] + a[3] * b[0],
    )
