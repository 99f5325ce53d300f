"""Forces of contacts in a given motion: unknown where they are closed, within their cones."""

import attrs
import numpy as np

from dap3d_core.formulations.contacts.contact_rows import GAP, REACH, ContactRows, ContactTable
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.scene import Mistake, SceneError
from dap3d_core.scene.errors import MISSING
from dap3d_core.simulation.errors import SimulationError

#: Gap, as a part of the scene's length, and speed, of that length a second, below which what is
#: given closes, and rests on, a contact.
CLOSED, STILL = 1e-6, 1e-6
#: Forces leave a cone by this part of all forces, and no less, where a note says so.
OUTSIDE = 1e-6
#: Passes of Dykstra's algorithm, and the part of the forces that it may leave.
PASSES, LEFT = 20_000, 1e-9


@attrs.frozen(eq=False)
class Closed:
    """The contacts that are closed at one instant.

    Attributes:
        wrenches: (6 n, k) of their unknown forces, of one each.
        known: (6 n,) friction of a size of its own that slides.
        cones: contact -> places among the unknown forces: normal force and friction that sticks,
            and the coefficient of that, or size where there is no normal force.
        Lam: (k,) row among those of contacts of each unknown force.
        states: of elements, with modes and directions of sliding.
    """

    wrenches: Floats
    known: Floats
    cones: dict[int, tuple[list[int], float]]
    Lam: list[int]
    states: Floats


class ContactForces:
    """Finds the closed contacts of a motion, and looks after their cones.

    Attributes:
        table: the contacts.
        outside: of the force that leaves its cone most its size, the instant and the contact.
    """

    def __init__(self, evaluator: Evaluator) -> None:
        """Args: the evaluator of the model, in which all contacts are open.

        Raises:
            SceneError: friction of a joint's load, or in three directions, sticks.
        """
        self.table = table = ContactTable(evaluator)
        loaded = [c for c in range(table.count) if c in table.loads or table.gapless[c]]
        if loaded:
            what = "sticks, by the load of its joint: inverse dynamics does not know how much"
            remedy = "give it a v_tol (w_tol), below which it fades"
            raise SceneError(
                [Mistake(table.names[c], MISSING, what, remedy=remedy) for c in loaded]
            )
        self.outside: tuple[float, float, str] | None = None

    def at(self, t: float, u: Floats) -> Closed:
        """The contacts that a state u (13 n,) closes."""
        table, length = self.table, self.table.evaluator.model.length
        outputs, rows = table.outputs(t, u), ContactRows(table, t, u)
        still, slip = STILL * length, rows.slip
        near = (np.abs(outputs[:, GAP]) < CLOSED * length) & (outputs[:, REACH] >= 0.0)
        columns, places, known = [], list[int](), np.zeros(len(rows.v))
        cones: dict[int, tuple[list[int], float]] = {}
        states = table.evaluator.states.copy()
        closed = (near & (np.abs(slip[:, 0]) < still)) | table.alone
        for c in np.flatnonzero(closed).tolist():
            normal, *across = rows.G[3 * c : 3 * c + 3]
            sliding = float(np.hypot(*slip[c, 1:])) > still
            way = slip[c, 1:] / np.hypot(*slip[c, 1:]) if sliding else np.zeros(2)
            friction = -table.mu[c] * (way @ across)
            own, first = [], len(places)
            if table.alone[c] and sliding:
                known += friction
            elif not table.alone[c]:
                own.append(normal + friction)
                places.append(3 * c)
            for k, tangent in enumerate(across, 1):
                if not sliding and table.mu_s[c] > 0.0 and tangent.any():
                    own.append(tangent)
                    places.append(3 * c + k)
            columns += own
            cones[c] = list(range(first, len(places))), float(table.mu_s[c])
            states[table.mode[c]] = 1.0 if sliding else 2.0
            states[table.way[c]] = way @ rows.frames[c, 1:]
        wrenches = np.array(columns).reshape(-1, len(rows.v)).T
        return Closed(wrenches, known, cones, places, states)

    def within(self, closed: Closed, t: float, A: Floats, side: Floats, x: Floats) -> Floats:
        """Forces x (k,) with A x as near to side: within the cones, where they leave a choice.

        Contacts have the last of them.

        Raises:
            SimulationError: none of the choices was found within the cones.
        """
        size, name = self._outside(closed, x)
        limit = OUTSIDE * max(float(np.linalg.norm(side)), float(np.abs(x).max(initial=0.0)))
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
        if self.outside is None or size > self.outside[0]:
            self.outside = size, t, name
        return x

    def notes(self) -> list[str]:
        """That the motion is none of these contacts."""
        if self.outside is None:
            return []
        size, t, name = self.outside
        return [
            f"contact {name} cannot do its part of the motion: at t = {t:.6g} s it would have to "
            f"pull, or to hold more than its friction does, by {size:.3g} N or N m"
        ]

    def _outside(self, closed: Closed, x: Floats) -> tuple[float, str]:
        """By how much forces leave their cones, at most, and the contact."""
        force, worst, name = x[len(x) - len(closed.Lam) :], 0.0, ""
        moved = self._projected(closed, force)
        for c, (places, _) in closed.cones.items():
            left = float(np.linalg.norm(moved[places] - force[places]))
            if left > worst:
                worst, name = left, self.table.names[c]
        return worst, name

    def _projected(self, closed: Closed, force: Floats) -> Floats:
        """The forces in the cones that are nearest to others."""
        found = force.copy()
        for c, (places, mu) in closed.cones.items():
            x = force[places]
            if self.table.alone[c]:
                found[places] = np.clip(x, -mu, mu)
                continue
            if not places:
                continue
            N, T = x[0], x[1:]
            size = float(np.linalg.norm(T))
            if size > mu * N and size > 0.0:
                share = max(0.0, (N + mu * size) / (1.0 + mu * mu))
                found[places] = np.append(share, mu * share * T / size)
            else:
                found[places] = np.append(max(N, 0.0), T if N > 0.0 else 0.0 * T)
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
