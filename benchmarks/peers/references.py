"""Where the scenes end: references.json, made by ``python benchmarks/peers/references.py``.

Each scene is integrated by SciPy's DOP853 at rtol 3e-14 in coordinates and equations of its own,
which no program that is measured uses: chains by the directions of their rods, loops by one angle,
the ball piece by piece in closed form. The difference to a run at rtol 1e-12 is stored as the
uncertainty.
"""

import json
import math
from pathlib import Path

import mechanisms as scenes
import numpy as np
from scipy.integrate import solve_ivp
from scipy.linalg import solveh_banded
from scipy.optimize import brentq

FILE = Path(__file__).with_name("references.json")


def final(f, y0, t_end, rtol):
    """The state at the end."""
    return solve_ivp(f, (0.0, t_end), y0, "DOP853", [t_end], rtol=rtol, atol=0.1 * rtol).y[:, -1]


def quaternion_rate(q, w):
    """Rate of a quaternion (scalar first) at an angular velocity in body axes."""
    return 0.5 * np.concatenate([[-q[1:] @ w], q[0] * w + np.cross(q[1:], w)])


def turning(mechanism, rtol):
    """One body about a fixed point (its mass centre if free): quaternion and omega'."""
    body, gravity = mechanism.bodies[0], mechanism.gravity
    arm = body.x
    J = body.J + body.mass * (arm @ arm - arm**2)

    def f(_, y):
        q, w = y[:4], y[4:]
        A = scenes.rotation_of(q)
        moment = np.cross(arm, -body.mass * gravity * A[2])
        return np.concatenate([quaternion_rate(q, w), (moment - np.cross(w, J * w)) / J])

    A = scenes.rotation_of(final(f, np.r_[1.0, 0.0, 0.0, 0.0, body.w], mechanism.t_end, rtol)[:4])
    return {"x": (A @ arm)[None], "R": A[None]}


def chain(mechanism, rtol):
    """Directions u of the rods and their rates; the spin about each rod never changes.

    Jt u'' = -Jt |u'|^2 u + (T - Jx s u') x u, with T the moment of the forces in the two joints;
    these follow from a block tridiagonal system: the ends of neighbours accelerate alike.
    """
    n, spin, m, L = mechanism.size, mechanism.bodies[0].w[0], 1.0, 1.0
    Jx, Jt, _ = mechanism.bodies[0].J
    q, one = L * L / (4 * Jt), np.eye(3)

    def f(_, y):
        u, du = y.reshape(2, n, 3)
        across = q * (one - u[:, :, None] * u[:, None, :])
        own = -np.sum(du * du, 1)[:, None] * u - spin * Jx / Jt * np.cross(du, u)
        diagonal, right = one / m + across, 0.5 * L * own
        diagonal[1:] += one / m + across[:-1]
        right[1:] += 0.5 * L * own[:-1]
        right[0, 2] += mechanism.gravity
        beside = across[:-1] - one / m
        # upper diagonals 0 to 5 as LAPACK keeps them: row 5 - (j - i), column j
        band = np.zeros((6, n, 3))
        for i in range(3):
            for j in range(3):
                if j >= i:
                    band[5 - (j - i), :, j] = diagonal[:, i, j]
                band[5 - (j + 3 - i), 1:, j] = beside[:, i, j]
        force = solveh_banded(band.reshape(6, 3 * n), right.ravel()).reshape(n, 3)
        both = force.copy()
        both[:-1] += force[1:]
        ddu = own - L / (2 * Jt) * (both - u * np.sum(u * both, 1)[:, None])
        return np.concatenate([du.ravel(), ddu.ravel()])

    y0 = np.zeros((2, n, 3))
    y0[0, :, 0] = 1.0
    u = final(f, y0.ravel(), mechanism.t_end, rtol)[: 3 * n].reshape(n, 3)
    return {"x": L * (np.cumsum(u, 0) - u / 2)}


def four_bar(mechanism, rtol):
    """By the crank angle: a e^(i crank) + b e^(i coupler) = d + c e^(i follower), twice derived."""
    a, b, c, d = scenes.CRANK, scenes.COUPLER, scenes.FOLLOWER, scenes.BASE
    lengths = np.array([a, b, c])

    def angles(crank):
        tip, top = scenes.four_bar_points(crank)
        coupler = math.atan2(top[2] - tip[2], top[0] - tip[0])
        return np.array([crank, coupler, math.atan2(top[2], top[0] - d)])

    def centres(e):
        """Complex mass centres, up to constants, when e holds the rods' complex directions."""
        return np.array([a / 2 * e[0], a * e[0] + b / 2 * e[1], c / 2 * e[2]])

    def f(_, y):
        e = np.exp(1j * angles(y[0]))
        K = np.array([[(b * 1j * e[1]).real, (-c * 1j * e[2]).real],
                      [(b * 1j * e[1]).imag, (-c * 1j * e[2]).imag]])  # fmt: skip
        right = -a * 1j * e[0]
        first = np.r_[1.0, np.linalg.solve(K, [right.real, right.imag])]
        right = a * e[0] + b * e[1] * first[1] ** 2 - c * e[2] * first[2] ** 2
        second = np.r_[0.0, np.linalg.solve(K, [right.real, right.imag])]
        z1, z2 = centres(1j * e * first), centres(1j * e * second - e * first**2)
        J = lengths**2 / 12
        M = np.sum(abs(z1) ** 2) + J @ first**2
        h = np.sum((z1.conj() * z2).real) + J @ (first * second)
        return np.array([y[1], (-mechanism.gravity * np.sum(z1.imag) - h * y[1] ** 2) / M])

    e = np.exp(1j * angles(final(f, [math.pi / 2, -0.5], mechanism.t_end, rtol)[0]))
    z = centres(e) + np.array([0.0, 0.0, d])
    return {"x": np.stack([z.real, 0 * z.real, z.imag], 1)}


def four_bars(mechanism, rtol):
    """All cranks stay parallel: one pendulum."""
    n = mechanism.size
    k = -mechanism.gravity * ((n + 1) / 2 + n) / ((n + 1) / 3 + n)
    y = final(lambda _, y: [y[1], k * math.cos(y[0])], [math.pi / 2, -1.0], 10.0, rtol)
    c, s = math.cos(y[0]), math.sin(y[0])
    x = [[0.5 * c, 0.0, 0.5 * s]]
    for i in range(n):
        x += [[i + 0.5 + c, 0.0, s], [i + 1 + 0.5 * c, 0.0, 0.5 * s]]
    return {"x": np.array(x)}


def ball(mechanism, _):
    """Free fall and damped oscillation in turn, each in closed form."""
    t, z, v = 0.0, float(mechanism.bodies[0].x[2]), 0.0
    touching = False
    while True:
        move, lasts = _touching(z, v) if touching else _flying(z, v)
        if t + lasts >= mechanism.t_end:
            return {"x": np.array([[0.0, 0.0, move(mechanism.t_end - t)[0]]])}
        t, (z, v), touching = t + lasts, move(lasts), not touching


def _flying(z, v):
    """Height and velocity after a time without contact, and how long that lasts."""
    g, above = scenes.GRAVITY, z - scenes.RADIUS
    if v * v + 2 * g * above >= 0.0:  # comes down from above
        lasts = (v + math.sqrt(v * v + 2 * g * above)) / g
    else:  # stays in the hollow that it left while the damper held it: the force vanishes there
        lasts = 2 * (v - scenes.DAMPING * g / scenes.STIFFNESS) / g
    return lambda s: (z + v * s - 0.5 * g * s * s, v - g * s), lasts


def _touching(z, v):
    """The same in contact, until the force vanishes."""
    k, c = scenes.STIFFNESS, scenes.DAMPING
    rest, decay = scenes.RADIUS - scenes.GRAVITY / k, c / 2
    beat = math.sqrt(k - decay**2)
    A, B = z - rest, (v + decay * (z - rest)) / beat

    def move(s):
        cos, sin, fade = math.cos(beat * s), math.sin(beat * s), math.exp(-decay * s)
        x, swing = fade * (A * cos + B * sin), fade * beat * (B * cos - A * sin)
        return rest + x, swing - decay * x

    def force(s):
        z, v = move(s)
        return k * (scenes.RADIUS - z) - c * v

    grid = np.linspace(0.0, 2 * math.pi / beat, 1000)[1:]
    pulls = [i for i, s in enumerate(grid) if force(s) < 0.0]
    if not pulls:
        return move, math.inf
    return move, brentq(force, grid[pulls[0] - 1], grid[pulls[0]], xtol=1e-16)


MAKERS = {
    "free-body": turning, "heavy-top": turning, "spherical-chain": chain, "revolute-chain": chain,
    "four-bar": four_bar, "four-bars": four_bars, "ball": ball,
}  # fmt: skip


def load():
    """All references by the keys of their scenes."""
    return json.loads(FILE.read_text())


def _packed(values):
    """Shortest text that gives the numbers back to 1e-15."""
    return [float(f"{v:.15g}") if abs(v) > 1e-15 else 0 for v in np.ravel(values).tolist()]


def main():
    """Make all references."""
    found = {}
    for mechanism in scenes.all_mechanisms():
        make = MAKERS[mechanism.name]
        best, other = make(mechanism, 3e-14), make(mechanism, 1e-12)
        what = "R" if mechanism.name == "free-body" else "x"
        unsure = float(np.max(np.abs(best[what] - other[what])))
        found[mechanism.key] = {what: _packed(best[what]), "uncertainty": float(f"{unsure:.1e}")}
        print(f"{mechanism.key:24} {unsure:.1e}", flush=True)
    lines = ",\n".join(f'"{k}": {json.dumps(v, separators=(",", ":"))}' for k, v in found.items())
    FILE.write_text("{\n" + lines + "\n}\n")


if __name__ == "__main__":
    main()
