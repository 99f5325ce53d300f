"""Accelerations of random mechanisms of extreme numbers are those of a dense solution.
An input is the number of a scene. Masses and moments of inertia differ by up to 1e8, lengths are
1e-6 to 1e6 m, spins up to 1e3 rad/s; trees and loops, with redundant rows, springs and weight. The
solution is that of M, D, gamma and the forces, 60 digits, for rows that are independent."""

import mpmath as mp
import numpy as np
import scipy.linalg
from hypothesis import strategies as st
from support import mechanisms
from support.internals import Evaluator
from support.loops import add_loops, add_twins, spatial_four_bar
from support.rotations import rotation
from support.trees import mixed_chain, random_tree

import dap3d_core as dap

#: Parts of the largest acceleration: what three passes of lsq may leave at ordinary numbers, what
#: rounding does at ratios of masses and moments, at most; how often what rounding of a state does.
ROUNDING, OF_RATIO, MOST, OF_STATE = 1e-9, 1e-14, 1e-7, 1e3
#: Singular values, as parts of the largest, of rows that are independent, and that are not.
INDEPENDENT, DEPENDENT = 1e-9, 1e-12


def numbers():
    """Numbers of scenes."""
    return st.integers(0, 2**31).map(lambda n: str(n).encode())


def scene_of(number):
    """A scene, the unit of its lengths in m, and the ratio of its masses and inertias."""
    rng = np.random.default_rng(number)
    scene = mechanism(rng, int(rng.integers(1, 7)), int(rng.integers(2**30)))
    unit = float(10.0 ** rng.choice([0, 0, rng.uniform(-6, 6)]))
    mass = float(10.0 ** rng.choice([0, rng.uniform(-6, 6)]))
    spread, slim = rng.choice([0, 1, 4]), rng.choice([0, 2, 6])
    rate = float(rng.choice([0, 1, 30, 1e3]))
    extremes = []
    for body in scene.bodies.values():
        body.mass = mass * float(10.0 ** (spread * rng.uniform(-1, 1)))
        h = 0.1 * body.mass * unit**2 * (10.0 ** (-slim * rng.random(3)))
        Q = rotation((q := rng.normal(size=4)) / np.linalg.norm(q))
        J = Q @ np.diag(h.sum() - h) @ Q.T
        body.Jp = (0.5 * (J + J.T)).tolist()
        body.r = (unit * np.array(body.r)).tolist()
        body.r_dot, body.w = unit * rate * rng.normal(size=3), rate * rng.normal(size=3)
        extremes += [body.mass, *(np.linalg.eigvalsh(J) / unit**2)]
    for point in scene.points.values():
        point.sPp = (unit * np.array(point.sPp)).tolist()
    for joint in scene.joints.values():
        if "length" in joint.fields:
            joint.fields["length"] *= unit
    first, *_, last = [*scene.bodies] * 2
    if first != last and rng.random() < 0.5:
        scene.add_force("ptp", "spring", P_i=f"{first}.O", P_j=f"{last}.O",
                        k=mass * float(10.0 ** rng.uniform(-2, 8)), l0=unit)  # fmt: skip
    return scene, unit, max(extremes) / min(extremes)


def mechanism(rng, n, seed):
    """A tree, or one with loops, or with redundant rows, of ordinary numbers."""
    made = (
        lambda: random_tree(n, seed, free=0.2),
        lambda: mixed_chain(n),
        lambda: add_loops(random_tree(n + 1, seed), seed, 2, ("sph", "sph-sph", "univ")),
        lambda: add_twins(random_tree(n, seed, joints=("rev", "rev", "sph")), seed, 2),
        lambda: spatial_four_bar(seed),
        mechanisms.door,
        mechanisms.planar_four_bar,
        lambda: mechanisms.four_bar_row(1 + n % 3, 0.3 * rng.random()),
    )
    return made[int(rng.integers(len(made)))]()


def independent_rows(D):
    """Numbers of rows that span all; None where some are neither dependent nor independent."""
    if not len(D):
        return []
    D = D / np.linalg.norm(D, axis=1, keepdims=True)
    values = np.linalg.svd(D, compute_uv=False) / np.linalg.norm(D, 2)
    rank = int(np.sum(values > INDEPENDENT))
    order = scipy.linalg.qr(D.T, mode="r", pivoting=True)[1]
    return None if np.any(values[rank:] > DEPENDENT) else np.sort(order[:rank])


def solution(evaluator, u, kept):
    """(6 n,) accelerations by the rows that are kept."""
    model, n = evaluator.model, evaluator.model.body_count
    rows, forces = evaluator.rows(0.0, u), evaluator.applied_forces(0.0, u)
    A = rotation(u[: 7 * n].reshape(n, 7)[:, 3:])
    w = u[7 * n :].reshape(n, 6)[:, 3:]
    inverse, free, k = mp.zeros(6 * n), mp.zeros(6 * n, 1), len(kept)
    for b in range(n):
        Ab, spin = mp.matrix(A[b].tolist()), mp.matrix(w[b].tolist())
        J, f = Ab * mp.matrix(model.Jp[b].tolist()) * Ab.T, mp.matrix(forces[b].tolist())
        h, first = J * spin, 6 * b
        for c in range(3):
            i, j = (c + 1) % 3, (c + 2) % 3
            f[3 + c] -= spin[i] * h[j] - spin[j] * h[i]
            inverse[first + c, first + c] = 1 / mp.mpf(float(model.mass[b]))
        inverse[first + 3 : first + 6, first + 3 : first + 6] = J**-1
        free[first : first + 6, 0] = inverse[first : first + 6, first : first + 6] * f
    if not k:
        return free
    D = mp.matrix(rows.dense()[kept].tolist())
    S, lacking = D * inverse * D.T, mp.matrix(rows.gamma[kept].tolist()) - D * free
    size = mp.diag([1 / mp.sqrt(S[c, c]) for c in range(k)])
    return free + inverse * D.T * size * mp.lu_solve(size * S * size, size * lacking)


def check_instants(data):
    """Check a scene; "same", "refused", or "between" where its rank is in doubt."""
    scene, unit, ratio = scene_of(int(data))
    try:
        u = dap.compile(scene).start(True, ()).u
    except (dap.SceneError, dap.AssemblyError, dap.SimulationError):
        return "refused"
    method = "lsq" if scene.joints else "unconstrained"
    evaluator = Evaluator(dap.compile(scene).model, method)
    n = evaluator.model.body_count
    lengths = np.tile([1.0, 1.0, 1.0, unit, unit, unit], n)
    kept = independent_rows(evaluator.rows(0.0, u).dense() * np.tile([unit] * 3 + [1.0] * 3, n))
    if kept is None:
        return "between"

    def accelerations(u, kept):
        with mp.workdps(60):
            return np.array(solution(evaluator, u, kept).tolist(), dtype=float)[:, 0] * lengths

    exact, rng = accelerations(u, kept), np.random.default_rng(0)
    size = max(np.max(np.abs(exact)), np.max(np.abs(accelerations(u, []))))
    moved = u * (1.0 + 2.0**-53 * rng.uniform(-1.0, 1.0, size=u.shape))
    limit = size * min(ROUNDING + OF_RATIO * ratio, MOST)
    limit += OF_STATE * np.max(np.abs(accelerations(moved, kept) - exact))
    standard = ("standard",) if len(kept) == len(evaluator.rows(0.0, u).gamma) else ()
    for name in (*standard, method, "joint") if scene.joints else (method, "joint"):
        one = dap.compile(scene, method=name).evaluator
        for found in (one.rhs(0.0, u)[7 * n :], one.report(0.0, u)[: 6 * n]):
            error = np.max(np.abs(found * lengths - exact))
            assert error <= limit, f"{name}: {error:.3g} of {size:.3g} m/s^2, not {limit:.3g}"
    return "same"
