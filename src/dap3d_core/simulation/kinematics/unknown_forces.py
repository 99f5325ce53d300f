"""Unknown forces of inverse dynamics: actuators, and contacts that are closed.

Actuators are drivers and force elements, as wrenches on the bodies. Forces of contacts are within
their cones.
"""

from collections.abc import Sequence
from typing import Any

import attrs
import numpy as np

from dap3d_core.formulations.contacts.contact_table import GAP, REACH, ContactTable, find_grips
from dap3d_core.formulations.contacts.rows import put_rows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.interface.fields import specs_of
from dap3d_core.kernels.array_types import Floats
from dap3d_core.model import Group
from dap3d_core.registry.suggestions import nearest
from dap3d_core.result.errors import UnknownNameError
from dap3d_core.result.post.force_output import ForceLoops, group_of
from dap3d_core.scene import Mistake, SceneError
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.kinematics.driver_coordinate import driver_names

#: Gap, as a part of the scene's length, and speed, of that length a second, below which what is
#: given closes, and rests on, a contact.
CLOSED, STILL = 1e-6, 1e-6
#: Forces leave a cone by this part of all forces, and no less, where a note says so.
OUTSIDE = 1e-6
#: What a length is divided by at least.
TINY = 1e-300
#: Passes of Dykstra's algorithm, and the part of the forces that it may leave.
PASSES, LEFT = 20_000, 1e-9


@attrs.frozen(eq=False)
class DriverActuator:
    """A driver, whose force takes the place of its multiplier: it holds no position any more.

    The force is that on a body, N, or the moment, N m, however long the row of the driver is: that
    of a driven leg is d, not a unit vector.

    Attributes:
        name: of the joint.
        row: its constraint row.
    """

    name: str
    row: int

    def wrench(self, t: float, D: Floats) -> Floats:
        """(6 n,) force and moment on each body of a force or moment of one; D: (rows, 6 n)."""
        return np.asarray(D[self.row] / self.size(D))

    def size(self, D: Floats) -> float:
        """The force, or moment, of a multiplier of one; 1 where it does nothing."""
        forces, moments = D[self.row].reshape(-1, 2, 3).transpose(1, 0, 2)
        sizes = np.linalg.norm(forces if forces.any() else moments, axis=1)
        return float(sizes.max()) or 1.0

    def unit(self, D: Floats) -> str:
        """Unit of its force: N of a row that holds translations."""
        return "N" if D[self.row].reshape(-1, 6)[:, :3].any() else "N m"

    given = 0.0

    def potential(self) -> float:
        """Potential energy that the force of the scene has, J: none."""
        return 0.0


class ForceActuator:
    """A force element; what its type ``actuates`` is its force.

    Attributes:
        name: of the element.
        given: the force in the scene.
    """

    def __init__(self, evaluator: Evaluator, name: str, group: Group, index: int) -> None:
        self.name, self._group, self._evaluator = name, group, evaluator
        self._loops = ForceLoops(evaluator, group, index)
        self._field = field_of(group)
        offset, shape = group.type_info.layout.numbers[self._field]
        numbers = group.numbers[index, offset : offset + (shape[0] if shape else 1)]
        self.given = float(np.linalg.norm(numbers)) if shape else float(numbers[0])
        self.has_direction = not shape or self.given > 0.0

    def wrench(self, t: float, D: Floats) -> Floats:
        """(6 n,) force and moment on each body of an actuation of one, at the bodies as placed."""
        return np.asarray(self._at(t, "wrench", 1.0) - self._at(t, "wrench", 0.0))[6:]

    def unit(self, D: Floats) -> str:
        """Unit of its force: that of the field."""
        return specs_of(self._group.type_info.type)[self._field].unit or "SI"

    def potential(self) -> float:
        """Potential energy that the force of the scene has, J, at the bodies as placed."""
        if not self._loops.has("energy"):
            return 0.0
        one, none = (self._at(0.0, "energy", x)[0] for x in (self.given, 0.0))
        return float(one - none)

    def _at(self, t: float, kind: str, force: float) -> Floats:
        self._loops.parameters.scale_field(self._group, self._field, force)
        out = np.zeros_like(self._evaluator.system.force) if kind == "wrench" else np.zeros(1)
        self._loops.call(kind, t, out)
        return out


Actuator = DriverActuator | ForceActuator


def actuators_of(
    compiled: CompiledModel, evaluator: Evaluator, names: Sequence[str] | str | None
) -> list[Actuator]:
    """The actuators that are named, in their order; None: all drivers.

    Raises:
        SceneError: there is none of a name, or it cannot be an actuator.
    """
    drivers, forces = driver_names(compiled), _actuating_forces(evaluator)
    if names is None:
        names = drivers
    elif isinstance(names, str):
        names = [names]
    if not names and not evaluator.model.contact_count:
        words = "name the actuators whose forces produce the motion"
        remedy = "add drivers, or force elements such as a point-to-point actuator, to the scene"
        if drivers or forces:
            remedy = f"there can be {', '.join([*drivers, *forces])}"
        raise SceneError([Mistake("actuators", [], words, remedy=remedy)])
    found: list[Actuator] = []
    mistakes: list[Mistake] = []
    for name in names:
        if name in [actuator.name for actuator in found]:
            mistakes.append(Mistake("actuators", name, "is named twice"))
        elif name in drivers:
            row = evaluator.model.joint_start[evaluator.model.joint_names.index(name)]
            found.append(DriverActuator(name, int(row)))
        elif name in forces:
            force = ForceActuator(evaluator, name, *forces[name])
            scene, field = compiled.scene, field_of(forces[name][0])
            given = scene.forces[name].fields.get(field)
            if isinstance(given, str) and given in {*scene.functions, *scene.inputs}:
                words = f"its {field} is that of {given}, which an actuator does not set"
                mistakes.append(Mistake("actuators", name, words, remedy=f"give {field} = 0.0"))
            elif not force.has_direction:
                words = "its vector is zero, so it has no direction to act in"
                mistakes.append(Mistake("actuators", name, words, remedy="give it one"))
            found.append(force)
        else:
            mistakes.append(_unknown(compiled, name, [*drivers, *forces]))
    if mistakes:
        raise SceneError(mistakes)
    return found


def _actuating_forces(evaluator: Evaluator) -> dict[str, tuple[Group, int]]:
    """Force elements that can be actuators, with their groups and places there."""
    found = {}
    for k, name in enumerate(evaluator.model.force_names):
        try:
            group, index = group_of(evaluator, name, k)
        except UnknownNameError:
            continue
        if field_of(group):
            found[name] = group, index
    return found


def field_of(group: Group) -> str:
    """The field that the type of a group ``actuates``, or ""."""
    return str(getattr(group.type_info.type, "actuates", ""))


def _unknown(compiled: CompiledModel, name: Any, known: list[str]) -> Mistake:
    near = nearest(name, known) if isinstance(name, str) else ""
    remedy = "" if near else f"actuators: {', '.join(known)}" if known else ""
    scene = compiled.scene
    if name in scene.joints:
        words = "this joint is no driver: what it bears is found as its reaction"
    elif name in scene.forces:
        words = f"a force of type {scene.forces[name].type} has nothing that an actuator sets"
    else:
        words = "there is no driver and no force of this name"
    return Mistake("actuators", name, words, near, remedy)


@attrs.frozen(eq=False)
class Cone:
    """Unknown forces of a contact: a normal force, and discs that are as wide as it times mu.

    Attributes:
        normal: its place among the unknown forces; None of friction without.
        discs: places of friction, or of moments, that hold, and their mu: a size without a normal.
    """

    normal: int | None
    discs: list[tuple[list[int], float]]

    @property
    def places(self) -> list[int]:
        """Of all forces."""
        own = [] if self.normal is None else [self.normal]
        return own + [place for places, _ in self.discs for place in places]

    def project(self, x: Floats, load: float) -> None:
        """Take forces x (k,) to the nearest in the cone, in place; load: of what has no normal."""
        sizes = [float(np.linalg.norm(x[places])) for places, _ in self.discs]
        if self.normal is None:
            for size, (places, mu) in zip(sizes, self.discs, strict=True):
                x[places] *= min(1.0, mu * load / max(size, TINY))
            return
        given, N = x[self.normal], max(x[self.normal], 0.0)
        for _ in self.discs:  # each pass leaves out those that have become wide enough
            over = [(mu, s) for s, (_, mu) in zip(sizes, self.discs, strict=True) if s > mu * N]
            pushed = sum(mu * size for mu, size in over)
            N = max(0.0, (given + pushed) / (1.0 + sum(mu * mu for mu, _ in over)))
        x[self.normal] = N
        for size, (places, mu) in zip(sizes, self.discs, strict=True):
            if size > mu * N:
                x[places] = mu * N * x[places] / size


@attrs.frozen(eq=False)
class Closed:
    """The contacts that are closed at one instant.

    Attributes:
        contacts: what found them.
        wrenches: (6 n, k) of their unknown forces, of one each.
        known: (6 n,) friction of a size of its own that slides.
        cones: contact -> the cone that its forces are in, with those of what resists at it.
        Lam: (k,) row among those of contacts of each unknown force.
        scale: (k,) force or moment, N or N m, for which one of each stands: an ellipse of friction
            is a disc where that across the grain is stretched.
        states: of elements, with modes and directions of sliding.
        loaded: the same where friction of joints, by their load, alone acts.
        load: contact -> by what that size is multiplied: the load that its joint was found to have.
    """

    contacts: "ContactForces"
    wrenches: Floats
    known: Floats
    cones: dict[int, Cone]
    Lam: list[int]
    scale: list[float]
    states: Floats
    loaded: Floats
    load: dict[int, float]

    def take_loads(self, Lam: Floats) -> None:
        """Take the loads of joints from multipliers (rows,)."""
        for c, (rows, pushes) in self.contacts.table.loads.items():
            size = max(Lam[rows[0]], 0.0) if pushes else np.linalg.norm(Lam[rows])
            self.load[c] = float(size)


class ContactForces:
    """Finds the closed contacts of a motion, and looks after their cones.

    Attributes:
        table: the contacts.
        outside: of the force that leaves its cone most its size, the instant and the contact.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: the evaluator of the model, in which all contacts are open."""
        self.table = ContactTable(evaluator)
        self._arrays = self.table.arrays()
        s = self._arrays
        s.arm[:], s.mu[:], s.mu_s[:] = 1.0, self.table.mu, self.table.mu_s  # as rows of the model
        self.outside: tuple[float, float, str] | None = None

    def at(self, t: float, u: Floats) -> Closed:
        """The contacts that a state u (13 n,) closes."""
        table, s, evaluator = self.table, self._arrays, self.table.evaluator
        outputs = table.outputs(t, u)
        find_grips(float(t), s, evaluator.system, table.tensions)
        put_rows(float(t), s, evaluator.system, evaluator.loops)
        still, slip, G = STILL * table.speed, s.slip, s.J[len(s.lam_free) :]
        near = (np.abs(outputs[:, GAP]) < CLOSED * table.length) & (outputs[:, REACH] >= 0.0)
        columns, places, scale = list[Floats](), list[int](), list[float]()
        known = np.zeros(len(s.v))
        cones: dict[int, Cone] = {}
        states, loaded = table.evaluator.states.copy(), table.evaluator.states.copy()
        closed = (near & (np.abs(slip[:, 0]) < still)) | table.alone
        for c in np.flatnonzero(closed).tolist():
            across, under = table.across(c), int(table.under[c])
            if under >= 0 and under not in cones:  # what presses is open
                continue
            tangents = G[3 * c : 3 * c + 3][across]
            size = float(np.linalg.norm(slip[c, across]))
            sliding = size > still[c]
            way = slip[c, across] / size if sliding else 0.0 * slip[c, across]
            acts = way
            if sliding and s.ratio[c] != 1.0:  # an ellipse
                parts = np.array([1.0, s.ratio[c]])
                acts = parts**2 * way / np.linalg.norm(parts * way)
            friction = -s.mu[c] * (acts @ tangents)
            cone = cones.get(under, Cone(None, []))
            if cone.normal is not None:
                columns[cone.normal] = columns[cone.normal] + friction
            elif not table.alone[c]:
                cone = Cone(len(places), [])
                columns.append(G[3 * c] + friction)
                places.append(3 * c)
                scale.append(1.0)
            elif sliding and c not in table.loads:
                known += friction
            first = len(places)
            for k, tangent in enumerate(tangents, across.start):
                stretch = float(s.ratio_s[c]) if k == 2 else 1.0
                if not sliding and s.mu_s[c] * stretch > 0.0 and tangent.any():
                    columns.append(stretch * tangent)
                    places.append(3 * c + k)
                    scale.append(stretch)
            cone.discs.append((list(range(first, len(places))), float(s.mu_s[c])))
            cones |= {c: cone} if under < 0 else {}
            for some in (states, loaded) if c in table.loads and sliding else (states,):
                some[table.mode[c]] = 1.0 if sliding else 2.0
                some[table.way[c]] = table.speed[c] * way @ s.frames[c, across]
        wrenches = np.array(columns).reshape(-1, len(s.v)).T
        load = {c: np.inf if c in table.loads else 1.0 for c in cones}  # unknown at first
        return Closed(self, wrenches, known, cones, places, scale, states, loaded, load)

    def within(self, closed: Closed, t: float, A: Floats, side: Floats, x: Floats) -> Floats:
        """Forces x (k,) with A x as near to side: within the cones, where they leave a choice.

        Contacts have the last of them.

        Raises:
            SimulationError: none of the choices was found within the cones.
        """
        size, name = self._outside(closed, x)
        limit = self._limit(side, x)
        if size <= limit:
            return x
        if np.linalg.matrix_rank(A) < len(x):
            found = self._least_within(closed, A, A @ x)
            if self._outside(closed, found)[0] <= limit:
                return found
            raise SimulationError(
                f"the forces of contacts are not unique at t = {t:.6g} s, and none within their "
                f"cones was found: {name} would have to pull, or to hold more than its friction "
                "does; name other actuators, or check the motion"
            )
        return x

    def take(self, closed: Closed, t: float, x: Floats, side: Floats) -> None:
        """Take note of forces x (k,) that leave their cones, where these are to have that side."""
        size, name = self._outside(closed, x)
        if size > self._limit(side, x) and (self.outside is None or size > self.outside[0]):
            self.outside = size, t, name

    def notes(self) -> list[str]:
        """That the motion is none of these contacts."""
        if self.outside is None:
            return []
        size, t, name = self.outside
        return [
            f"contact {name} cannot do its part of the motion: at t = {t:.6g} s it would have to "
            f"pull, or to hold more than its friction does, by {size:.3g} N or N m"
        ]

    def _limit(self, side: Floats, x: Floats) -> float:
        """By how much forces may leave their cones."""
        return OUTSIDE * max(float(np.linalg.norm(side)), float(np.abs(x).max(initial=0.0)))

    def _outside(self, closed: Closed, x: Floats) -> tuple[float, str]:
        """By how much forces leave their cones, at most, and the contact."""
        force, worst, name = x[len(x) - len(closed.Lam) :], 0.0, ""
        moved = self._projected(closed, force)
        for c, cone in closed.cones.items():
            left = float(np.linalg.norm((moved - force)[cone.places]))
            if left > worst:
                worst, name = left, self.table.names[c]
        return worst, name

    def _projected(self, closed: Closed, force: Floats) -> Floats:
        """The forces in the cones that are nearest to others."""
        found = force.copy()
        for c, cone in closed.cones.items():
            cone.project(found, closed.load[c])
        return found

    def _least_within(self, closed: Closed, A: Floats, side: Floats) -> Floats:
        """The least forces in the cones with A x = side, by Dykstra's alternating projections."""
        inverse = np.linalg.pinv(A, rcond=1e-9)
        count, x, q = A.shape[1] - len(closed.Lam), np.zeros(A.shape[1]), np.zeros(A.shape[1])
        for _ in range(PASSES):
            y = x + inverse @ (side - A @ x)
            if np.linalg.norm(y - x) <= LEFT * np.linalg.norm(y):
                return y
            x = (y + q).copy()
            x[count:] = self._projected(closed, x[count:])
            q += y - x
        return x + inverse @ (side - A @ x)
