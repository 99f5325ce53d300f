"""The law of stops: a gap that closes is reversed by an impulse, or carried where it closes slowly.

With the gap g, its rate g_dot, and the reduced mass m of the two bodies alone:

    g_dot < -v_rest at g = 0: an impulse makes g_dot of it -e g_dot (Newton's law of restitution)
    g < 0: a force max(0, -k g - c g_dot) along g, c = 2 zeta sqrt(k m)

So a body that bounces comes to rest on a spring, and not in ever shorter jumps.
"""

from dap3d_core.kernels import maximum, sqrt, where


def rebound(g_dot, e, v_rest):
    """The change of g_dot by the impulse."""
    return where(g_dot < -v_rest, -(1.0 + e) * g_dot, 0.0)


def carried(g, g_dot, k, zeta, m):
    """The force that carries a closed contact; pushes, and does not pull."""
    c = 2.0 * zeta * sqrt(k * m)
    return where(g < 0.0, maximum(-k * g - c * g_dot, 0.0), 0.0)


def stored(g, k):
    """The potential energy of the contact."""
    return where(g < 0.0, 0.5 * k * g * g, 0.0)


def reduced(m_i, m_j):
    """The reduced mass of two; that of the other where one is ground, with mass zero."""
    held = (m_i <= 0.0) | (m_j <= 0.0)
    total = m_i + m_j
    return where(held, total, m_i * m_j / where(total > 0.0, total, 1.0))
