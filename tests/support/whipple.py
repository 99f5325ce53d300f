"""Linear equations of the Whipple bicycle, from the appendix of the benchmark paper.
J. P. Meijaard, J. M. Papadopoulos, A. Ruina, A. L. Schwab: Linearized dynamics equations for the
balance and steer of a bicycle: a benchmark and review, Proc. R. Soc. A 463 (2007) 1955-1982,
appendix A: M q'' + v C1 q' + (g K0 + v^2 K2) q = 0 of lean (to the right) and steer (to the right).
Its axes: x forward, y to the right, z downward. Numbers are those of its table 1."""

import numpy as np

GRAVITY, WHEELBASE, TRAIL, TILT = 9.81, 1.02, 0.08, np.pi / 10
REAR_RADIUS, FRONT_RADIUS = 0.3, 0.35


def matrices():
    """M, C1, K0, K2."""
    w, c, r_R, r_F = WHEELBASE, TRAIL, REAR_RADIUS, FRONT_RADIUS
    m_R, m_B, m_H, m_F = 2.0, 85.0, 4.0, 3.0
    x_B, z_B, x_H, z_H = 0.3, -0.9, 0.9, -0.7
    R_xx, R_yy, F_xx, F_yy = 0.0603, 0.12, 0.1405, 0.28
    B_xx, B_zz, B_xz = 9.2, 2.8, 2.4
    H_xx, H_zz, H_xz = 0.05892, 0.00708, -0.00756
    sine, cosine = np.sin(TILT), np.cos(TILT)

    m_T = m_R + m_B + m_H + m_F
    x_T = (x_B * m_B + x_H * m_H + w * m_F) / m_T
    z_T = (-r_R * m_R + z_B * m_B + z_H * m_H - r_F * m_F) / m_T
    T_xx = R_xx + B_xx + H_xx + F_xx
    T_xx += m_R * r_R**2 + m_B * z_B**2 + m_H * z_H**2 + m_F * r_F**2
    T_xz = B_xz + H_xz - m_B * x_B * z_B - m_H * x_H * z_H + m_F * w * r_F
    T_zz = R_xx + B_zz + H_zz + F_xx + m_B * x_B**2 + m_H * x_H**2 + m_F * w**2

    m_A = m_H + m_F  # the front assembly
    x_A, z_A = (x_H * m_H + w * m_F) / m_A, (z_H * m_H - r_F * m_F) / m_A
    A_xx = H_xx + F_xx + m_H * (z_H - z_A) ** 2 + m_F * (r_F + z_A) ** 2
    A_xz = H_xz - m_H * (x_H - x_A) * (z_H - z_A) + m_F * (w - x_A) * (r_F + z_A)
    A_zz = H_zz + F_xx + m_H * (x_H - x_A) ** 2 + m_F * (w - x_A) ** 2
    u_A = (x_A - w - c) * cosine - z_A * sine
    A_ll = m_A * u_A**2 + A_xx * sine**2 + 2 * A_xz * sine * cosine + A_zz * cosine**2
    A_lx = -m_A * u_A * z_A + A_xx * sine + A_xz * cosine
    A_lz = m_A * u_A * x_A + A_xz * sine + A_zz * cosine

    mu = c / w * cosine
    S_R, S_F = R_yy / r_R, F_yy / r_F
    S_T, S_A = S_R + S_F, m_A * u_A + mu * m_T * x_T

    M = [[T_xx, A_lx + mu * T_xz], [A_lx + mu * T_xz, A_ll + 2 * mu * A_lz + mu**2 * T_zz]]
    K0 = [[m_T * z_T, -S_A], [-S_A, -S_A * sine]]
    K2 = [[0.0, (S_T - m_T * z_T) / w * cosine], [0.0, (S_A + S_F * sine) / w * cosine]]
    yaw = mu * S_T + S_F * cosine
    C1 = [[0.0, yaw + T_xz / w * cosine - mu * m_T * z_T],
          [-yaw, A_lz / w * cosine + mu * (S_A + T_zz / w * cosine)]]  # fmt: skip
    return tuple(map(np.array, (M, C1, K0, K2)))


def system(speed):
    """(4, 4) rates of (lean, steer, lean rate, steer rate) at a forward speed, m/s."""
    M, C1, K0, K2 = matrices()
    K, C = GRAVITY * K0 + speed**2 * K2, speed * C1
    inverse = np.linalg.inv(M)
    return np.block([[np.zeros((2, 2)), np.eye(2)], [-inverse @ K, -inverse @ C]])
