"""Forces of contacts in a given motion: unknown where they are closed, within their cones."""

import attrs
import numpy as np

from dap3d_core.formulations.contacts.contact_table import GAP, REACH, ContactTable, find_grips
from dap3d_core.formulations.contacts.rows import put_rows
from dap3d_core.formulations.evaluator import Evaluator
from dap3d_core.kernels.array_types import Floats
from dap3d_core.simulation.errors import SimulationError

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

    wrenches: Floats
    known: Floats
    cones: dict[int, Cone]
    Lam: list[int]
    scale: list[float]
    states: Floats
    loaded: Floats
    load: dict[int, float]

    def take_loads(self, table: ContactTable, Lam: Floats) -> None:
        """Take the loads of joints from multipliers (rows,)."""
        for c, (rows, pushes) in table.loads.items():
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
        return Closed(wrenches, known, cones, places, scale, states, loaded, load)

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
