"""A chain of n bodies with spherical joints, written out by hand for this mechanism alone.

The mark for the framework. No plugins, no gather, no lists of functions: body update, rows,
D M^-1 D^T (block tridiagonal), its Cholesky factors and the solution, with loops over constant
extents. It knows that the chain is a chain; the framework has to find out.
"""

import numpy as np

from dap3d_core.kernels.runtime.cache import compiled


@compiled
def rhs(u, du, n, mass, J, A, w, f, s, D, S, x, gravity):
    """du/dt of u = (r, p of each body; v, omega of each body), all in global components."""
    for b in range(n):
        k, m = 7 * b, 7 * n + 6 * b
        e0, e1, e2, e3 = u[k + 3], u[k + 4], u[k + 5], u[k + 6]
        q = 2.0 / (e0 * e0 + e1 * e1 + e2 * e2 + e3 * e3)
        a = A[b]
        a[0, 0] = 1 - q * (e2 * e2 + e3 * e3)
        a[0, 1] = q * (e1 * e2 - e0 * e3)
        a[0, 2] = q * (e1 * e3 + e0 * e2)
        a[1, 0] = q * (e1 * e2 + e0 * e3)
        a[1, 1] = 1 - q * (e1 * e1 + e3 * e3)
        a[1, 2] = q * (e2 * e3 - e0 * e1)
        a[2, 0] = q * (e1 * e3 - e0 * e2)
        a[2, 1] = q * (e2 * e3 + e0 * e1)
        a[2, 2] = 1 - q * (e1 * e1 + e2 * e2)
        for c in range(3):
            w[b, c] = u[m + 3 + c]
        l0 = a[0, 0] * w[b, 0] + a[1, 0] * w[b, 1] + a[2, 0] * w[b, 2]
        l1 = a[0, 1] * w[b, 0] + a[1, 1] * w[b, 1] + a[2, 1] * w[b, 2]
        l2 = a[0, 2] * w[b, 0] + a[1, 2] * w[b, 1] + a[2, 2] * w[b, 2]
        g0 = (J[b, 1] - J[b, 2]) * l1 * l2
        g1 = (J[b, 2] - J[b, 0]) * l2 * l0
        g2 = (J[b, 0] - J[b, 1]) * l0 * l1
        for c in range(3):
            f[b, c] = mass[b] * gravity[c]
            f[b, 3 + c] = a[c, 0] * g0 + a[c, 1] * g1 + a[c, 2] * g2
            # columns of A by 1/sqrt(J): their products are the inverse inertia in global axes
            for d in range(3):
                du[7 * b + d] = 0.0
    for j in range(n):  # joint j: body j (its inner end) to body j - 1 (its outer end)
        for side in range(2):
            b = j - side
            if b < 0:
                continue
            a, base = A[b], 18 * (2 * j + side)
            p0, p1, p2 = s[j, side, 0], s[j, side, 1], s[j, side, 2]
            s0 = a[0, 0] * p0 + a[0, 1] * p1 + a[0, 2] * p2
            s1 = a[1, 0] * p0 + a[1, 1] * p1 + a[1, 2] * p2
            s2 = a[2, 0] * p0 + a[2, 1] * p1 + a[2, 2] * p2
            sign = -1.0 if side == 0 else 1.0
            h = sign / np.sqrt(mass[b])
            c0, c1, c2 = w[b, 0], w[b, 1], w[b, 2]
            k0, k1, k2 = c1 * s2 - c2 * s1, c2 * s0 - c0 * s2, c0 * s1 - c1 * s0
            if side == 0:
                x[j, 0] = x[j, 1] = x[j, 2] = 0.0
            x[j, 0] -= sign * (c1 * k2 - c2 * k1)
            x[j, 1] -= sign * (c2 * k0 - c0 * k2)
            x[j, 2] -= sign * (c0 * k1 - c1 * k0)
            for r in range(3):
                for c in range(3):
                    D[base + 6 * r + c] = 0.0
                D[base + 6 * r + r] = h
            for c in range(3):
                i = sign / np.sqrt(J[b, c])
                a0, a1, a2 = a[0, c], a[1, c], a[2, c]
                D[base + 3 + c] = i * (s2 * a1 - s1 * a2)
                D[base + 9 + c] = i * (s0 * a2 - s2 * a0)
                D[base + 15 + c] = i * (s1 * a0 - s0 * a1)
    for b in range(n):
        a, m = A[b], 7 * n + 6 * b
        h = 1.0 / np.sqrt(mass[b])
        for c in range(3):
            du[m + c] = f[b, c] * h
            moment = a[0, c] * f[b, 3] + a[1, c] * f[b, 4] + a[2, c] * f[b, 5]
            du[m + 3 + c] = moment / np.sqrt(J[b, c])
    for j in range(n):
        for side in range(2):
            b = j - side
            if b < 0:
                continue
            base, m = 18 * (2 * j + side), 7 * n + 6 * b
            for r in range(3):
                for c in range(6):
                    x[j, r] -= D[base + 6 * r + c] * du[m + c]
    for j in range(n):
        o = 18 * j
        for r in range(3):
            for c in range(3):
                t = 0.0
                for e in range(6):
                    t += D[36 * j + 6 * r + e] * D[36 * j + 6 * c + e]
                if j > 0:
                    for e in range(6):
                        t += D[36 * j + 18 + 6 * r + e] * D[36 * j + 18 + 6 * c + e]
                S[o + 3 * r + c] = t
        if j > 0:  # block (j, j-1): they share body j - 1
            for r in range(3):
                for c in range(3):
                    t = 0.0
                    for e in range(6):
                        t += D[36 * j + 18 + 6 * r + e] * D[36 * j - 36 + 6 * c + e]
                    S[o + 9 + 3 * r + c] = t
            before = o - 18
            for r in range(3):
                for c in range(3):
                    t = S[o + 9 + 3 * r + c]
                    for e in range(c):
                        t -= S[o + 9 + 3 * r + e] * S[before + 3 * c + e]
                    S[o + 9 + 3 * r + c] = t * S[before + 4 * c]
            for r in range(3):
                for c in range(r + 1):
                    for e in range(3):
                        S[o + 3 * r + c] -= S[o + 9 + 3 * r + e] * S[o + 9 + 3 * c + e]
        for c in range(3):
            for r in range(c, 3):
                t = S[o + 3 * r + c]
                for e in range(c):
                    t -= S[o + 3 * r + e] * S[o + 3 * c + e]
                S[o + 3 * r + c] = 1.0 / np.sqrt(t) if r == c else t * S[o + 4 * c]
    for j in range(n):
        o = 18 * j
        for r in range(3):
            t = x[j, r]
            if j > 0:
                for c in range(3):
                    t -= S[o + 9 + 3 * r + c] * x[j - 1, c]
            for c in range(r):
                t -= S[o + 3 * r + c] * x[j, c]
            x[j, r] = t * S[o + 4 * r]
    for j in range(n - 1, -1, -1):
        o = 18 * j
        for r in range(2, -1, -1):
            t = x[j, r]
            if j < n - 1:
                for c in range(3):
                    t -= S[o + 27 + 3 * c + r] * x[j + 1, c]
            for c in range(r + 1, 3):
                t -= S[o + 3 * c + r] * x[j, c]
            x[j, r] = t * S[o + 4 * r]
    for j in range(n):
        for side in range(2):
            b = j - side
            if b < 0:
                continue
            base, m = 18 * (2 * j + side), 7 * n + 6 * b
            for r in range(3):
                for c in range(6):
                    du[m + c] += D[base + 6 * r + c] * x[j, r]
    for b in range(n):
        k, m, a = 7 * b, 7 * n + 6 * b, A[b]
        h = 1.0 / np.sqrt(mass[b])
        v0 = du[m + 3] / np.sqrt(J[b, 0])
        v1 = du[m + 4] / np.sqrt(J[b, 1])
        v2 = du[m + 5] / np.sqrt(J[b, 2])
        for c in range(3):
            du[m + c] *= h
            du[m + 3 + c] = a[c, 0] * v0 + a[c, 1] * v1 + a[c, 2] * v2
            du[k + c] = u[m + c]
        e0, e1, e2, e3 = u[k + 3], u[k + 4], u[k + 5], u[k + 6]
        w0, w1, w2 = 0.5 * w[b, 0], 0.5 * w[b, 1], 0.5 * w[b, 2]
        du[k + 3] = -e1 * w0 - e2 * w1 - e3 * w2
        du[k + 4] = e0 * w0 + e3 * w1 - e2 * w2
        du[k + 5] = -e3 * w0 + e0 * w1 + e1 * w2
        du[k + 6] = e2 * w0 - e1 * w1 + e0 * w2


@compiled
def repeat(count, u, du, n, mass, J, A, w, f, s, D, S, x, gravity):
    """Call ``rhs`` count times."""
    for _ in range(count):
        rhs(u, du, n, mass, J, A, w, f, s, D, S, x, gravity)


def chain(n):
    """State and arguments of a horizontal chain of n rods, 1 m and 1 kg, from ground along +x."""
    u = np.zeros(13 * n)
    for b in range(n):
        u[7 * b], u[7 * b + 3], u[7 * n + 6 * b + 3] = b + 0.5, 1.0, 0.1
    s = np.zeros((n, 2, 3))
    s[:, 0, 0], s[:, 1, 0] = -0.5, 0.5
    J = np.tile([0.001, 1 / 12, 1 / 12], (n, 1))
    A, w, f = np.zeros((n, 3, 3)), np.zeros((n, 3)), np.zeros((n, 6))
    D, S, x = np.zeros(36 * n), np.zeros(18 * n + 18), np.zeros((n, 3))
    return u, (n, np.ones(n), J, A, w, f, s, D, S, x, np.array([0.0, 0.0, -9.81]))
