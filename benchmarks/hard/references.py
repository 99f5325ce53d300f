"""What is known of the cases: closed forms, and equations of few coordinates of their own.

Nothing here comes from dap3d. Equations are integrated by scipy's DOP853 at 3e-14.
"""

import numpy as np
from scipy.integrate import solve_ivp
from scipy.optimize import brentq
from scipy.special import ellipj, ellipk

G = 9.81


def pendulum(t):
    """(nt, 4) x, y, vx, vy of A01 by Jacobi's elliptic functions.

    sin(th / 2) = k sn(K - w t, k^2), th from straight down, k^2 = 1/2, w = sqrt(g / 1 m).
    """
    k2, w = 0.5, np.sqrt(G)
    quarter = ellipk(k2)
    # a whole number of periods 4 K is taken off first: an argument of 3000 would cost 3 digits
    sn, cn, dn, _ = ellipj(quarter - np.remainder(w * t, 4.0 * quarter), k2)
    sine, cosine = 2.0 * np.sqrt(k2) * sn * dn, 1.0 - 2.0 * k2 * sn * sn
    rate = -2.0 * np.sqrt(k2) * w * cn
    return np.column_stack([-sine, -cosine, -cosine * rate, sine * rate])


def integrated(f, start, t):
    """(nt, n) solution of y' = f(t, y) at the instants t."""
    found = solve_ivp(f, (0.0, t[-1]), start, "DOP853", t_eval=t, rtol=3e-14, atol=1e-15)
    return found.y.T


def free_body(J, w, t):
    """(nt, 7) body components of omega and Euler parameters: Euler's equations, p(0) = identity."""
    J = np.asarray(J, dtype=float)

    def f(_, y):
        w, p = y[:3], y[3:]
        p_dot = 0.5 * np.array([
            -p[1:] @ w,
            p[0] * w[0] + p[2] * w[2] - p[3] * w[1],
            p[0] * w[1] + p[3] * w[0] - p[1] * w[2],
            p[0] * w[2] + p[1] * w[1] - p[2] * w[0],
        ])  # fmt: skip
        return np.concatenate([np.cross(J * w, w) / J, p_dot])

    return integrated(f, [*w, 1.0, 0.0, 0.0, 0.0], t)


def swing(rate, start, t):
    """(nt, 2) phi, phi_dot of phi'' = rate sin(phi), phi from straight up."""
    return integrated(lambda _, y: (y[1], rate * np.sin(y[0])), start, t)


def four_bars(count, t):
    """(nt, 4) x, y, vx, vy of the first joint B0 of A02, from the one equation of the cranks."""
    phi, rate = swing(1.5 * G * (3 * count + 1) / (4 * count + 1), (0.0, 1.0), t).T
    s, c = np.sin(phi), np.cos(phi)
    return np.column_stack([s, c, c * rate, -s * rate])


def on_a_cart(ratio, t):
    """(nt, 4) of a 1 kg pendulum of 1 m on a sliding body of ``ratio`` kg, from rest at level.

    phi from straight down. Momentum along x is zero, so the cart is at -sin(phi) / (1 + ratio)
    from the common centre and phi'' (1 - e cos^2) + e phi_dot^2 sin cos = -g sin, e = 1/(1+ratio).
    Columns: x, y of the bob less those of the cart, the cart's x and velocity times ``1 + ratio``.
    """
    e = 1.0 / (1.0 + ratio)

    def f(_, y):
        s, c = np.sin(y[0]), np.cos(y[0])
        return y[1], -(G * s + e * y[1] ** 2 * s * c) / (1.0 - e * c * c)

    phi, rate = integrated(f, (-0.5 * np.pi, 0.0), t).T
    s, c = np.sin(phi), np.cos(phi)
    return np.column_stack([s, -c, -(s + 1.0), -c * rate])


def bounce(m, k, drop, t):
    """(nt, 2) height of the lowest point and velocity of a ball on a spring k without damping.

    Fall from ``drop`` at rest; in contact y'' = -w^2 y - g from velocity -v; out at +v.
    """
    w, v = np.sqrt(k / m), np.sqrt(2.0 * G * drop)
    fall, touch = v / G, 2.0 * (np.pi - np.arctan(v * w / G)) / w
    s = np.remainder(t + fall, 2.0 * fall + touch)  # flight from the ground, then contact
    flight = np.column_stack([v * s - 0.5 * G * s * s, v - G * s])
    a = w * (s - 2.0 * fall)
    pressed = np.column_stack([
        -v / w * np.sin(a) - G / w**2 * (1.0 - np.cos(a)), -v * np.cos(a) - G / w * np.sin(a)
    ])  # fmt: skip
    return np.where((s <= 2.0 * fall)[:, None], flight, pressed)


def bounces(m, k, c, drop):
    """Instants at which a ball on a spring k and a damper c touches and leaves, until it stays.

    Off the ground it falls freely; on it m y'' = -k y - c y' - m g is a damped sine about its rest
    position, and it leaves where y rises through zero within a turn of that sine, or never.
    """
    decay, rest = 0.5 * c / m, -m * G / k
    w = np.sqrt(k / m - decay**2)
    t, v, found = np.sqrt(2.0 * drop / G), -np.sqrt(2.0 * G * drop), []
    while True:
        found.append(t)
        a, b = -rest, (v - decay * rest) / w

        def height(s, a=a, b=b):
            return rest + np.exp(-decay * s) * (a * np.cos(w * s) + b * np.sin(w * s))

        s = np.linspace(0.0, 2.0 * np.pi / w, 2001)[1:]
        out = np.flatnonzero((height(s[1:]) > 0.0) & (height(s[:-1]) <= 0.0))
        if not len(out):
            return found
        s = brentq(height, s[out[0]], s[out[0] + 1], xtol=1e-18, rtol=1e-15)
        rate = (w * b - decay * a) * np.cos(w * s) - (w * a + decay * b) * np.sin(w * s)
        t, v = t + s, np.exp(-decay * s) * rate
        found.append(t)
        t, v = t + 2.0 * v / G, -v


def euler_disk(radius, lean):
    """The rate, rad/s, at which the contact of a disk runs round whose centre stays where it is.

    With J_t = m R^2 / 4 across (a thin disk): with b = 0, no circle of the centre, the steady
    motion has Omega^2 = m g R / (J_t sin(lean)).
    """
    return np.sqrt(4.0 * G / (radius * np.sin(lean)))


def fall(t):
    """(nt, 2) height and velocity of a body that falls freely from rest."""
    return np.column_stack([-0.5 * G * t * t, -G * t])


def top_axis(theta, precession, t):
    """(nt, 3) axis of a top that precesses steadily about z, at first towards +y."""
    s, c, turned = np.sin(theta), np.cos(theta), precession * t
    return np.column_stack([-s * np.sin(turned), s * np.cos(turned), np.full(len(t), c)])
