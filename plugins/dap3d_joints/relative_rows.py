"""Rows that joints share: points that meet, an axis along another, coordinates, angles."""

from dap3d_core.kernels import add, cross, dot, eye, hstack, neg, row, scale, skew, sub

ZERO = (0.0, 0.0, 0.0)


def point_rows(s_P_i, s_P_j):
    """Jacobian of r_Pj - r_Pi: three rows of body i, and three of body j."""
    return hstack(eye(-1.0), skew(s_P_i)), hstack(eye(1.0), skew(neg(s_P_j)))


def point_gamma(s_P_i, s_P_j, w_i, w_j):
    """Gamma of r_Pj - r_Pi: w_i x (w_i x s_i) - w_j x (w_j x s_j)."""
    return sub(cross(w_i, cross(w_i, s_P_i)), cross(w_j, cross(w_j, s_P_j)))


def axis_rows(a_i, b_j):
    """Jacobian of a_i . b_j: a row of body i, and one of body j."""
    c = cross(a_i, b_j)
    return row(ZERO, c), row(ZERO, neg(c))


def axis_gamma(a_i, b_j, a_i_dot, b_j_dot, w_i, w_j):
    """Gamma of a_i . b_j: (a_i_dot x b + a_i x b_dot) . (w_j - w_i)."""
    c_dot = add(cross(a_i_dot, b_j), cross(a_i, b_j_dot))
    return dot(c_dot, sub(w_j, w_i))


def offset_rows(b_j, s_P_i, r_P_i, r_j):
    """Jacobian of x = b_j . (r_Pi - r_Pj): a row of body i, and one of body j."""
    return row(b_j, cross(s_P_i, b_j)), row(neg(b_j), neg(cross(sub(r_P_i, r_j), b_j)))


def offset_gamma(b_j, b_j_dot, d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j):
    """Gamma of x = b_j . d with d = r_Pi - r_Pj."""
    slide = sub(sub(cross(w_j, d), s_P_j_dot), scale(2.0, d_dot))
    return dot(slide, b_j_dot) - dot(cross(w_i, s_P_i_dot), b_j)


def line_rows(b_j, s_P_i, r_P_i, r_j):
    """Jacobian of d . b_j with d = r_Pj - r_Pi: a row of body i, and one of body j."""
    return row(neg(b_j), neg(cross(s_P_i, b_j))), row(b_j, cross(sub(r_P_i, r_j), b_j))


def line_gamma(b_j, b_j_dot, d, d_dot, s_P_i_dot, s_P_j_dot, w_i, w_j):
    """Gamma of d . b_j with d = r_Pj - r_Pi."""
    slide = sub(add(cross(w_j, d), s_P_j_dot), scale(2.0, d_dot))
    return dot(cross(w_i, s_P_i_dot), b_j) + dot(slide, b_j_dot)


def turning(a_j, u_i):
    """h, by which the angle of u_i about a_j changes at the rate h . (w_i - w_j).

    h = (a_j - Z u_i) / (1 - Z^2) with Z = a_j . u_i, which is a_j where u_i is normal to it.
    """
    Z = dot(a_j, u_i)
    return scale(1.0 / (1.0 - Z * Z), sub(a_j, scale(Z, u_i)))


def turning_rate(a_j, u_i, a_j_dot, u_i_dot):
    """The time derivative of ``turning``."""
    Z, Z_dot = dot(a_j, u_i), dot(a_j_dot, u_i) + dot(a_j, u_i_dot)
    change = sub(a_j_dot, add(scale(Z_dot, u_i), scale(Z, u_i_dot)))
    square = 1.0 / (1.0 - Z * Z)
    return scale(square, add(change, scale(2.0 * Z * Z_dot, turning(a_j, u_i))))
