"""Coefficients of Radau IIA: order conditions, transformation, error estimate, dense output."""

from fractions import Fraction

import numpy as np
import pytest
from support.internals import COEFFICIENTS, STAGES, radau_method


def of(k):
    """The tables of a method, without what pads them."""
    m, s = radau_method(), STAGES[k]
    tables = {name: array[k] for name, array in m.walk()}
    for table in tables.values():
        assert not table[s:].any()
        assert not table[..., s:].any()
    return s, {name: table[(slice(s),) * table.ndim] for name, table in tables.items()}


def radau_polynomial(s):
    """Coefficients, from the constant on, of d^(s-1)/dx^(s-1) [x^(s-1) (x - 1)^s]."""
    p = [Fraction(1)]
    for root in [0] * (s - 1) + [1] * s:
        p = [a - root * b for a, b in zip([Fraction(0), *p], [*p, Fraction(0)], strict=True)]
    for _ in range(s - 1):
        p = [k * a for k, a in enumerate(p)][1:]
    return p


@pytest.mark.parametrize("k", range(3))
def test_abscissae_are_roots_to_their_last_digits(k):
    """Between the neighbours of each the polynomial changes its sign, in exact arithmetic."""
    p = radau_polynomial(STAGES[k])

    def value(x):
        total = Fraction(0)
        for a in reversed(p):
            total = total * x + a
        return total

    assert value(Fraction(1)) == 0
    for c in COEFFICIENTS["c"][k][:-1]:
        below, above = (Fraction(float(np.nextafter(c, to))) for to in (0.0, 1.0))
        assert value(below) * value(above) < 0


@pytest.mark.parametrize("k", range(3))
def test_coefficients_have_order_2s_minus_1(k):
    """B(2 s - 1) and C(s), b the last row of A; A^-1 and its transformation; HW II, IV.5."""
    s, m = of(k)
    A, c = m["A"], m["c"]
    for q in range(1, 2 * s):
        assert A[-1] @ c ** (q - 1) == pytest.approx(1.0 / q, abs=4e-16)
    for q in range(1, s + 1):
        assert A @ c ** (q - 1) == pytest.approx(c**q / q, abs=1e-15)
        # relative to entries of up to 40: A^-1 c^q = q c^(q-1)
        assert m["inverse"] @ c**q == pytest.approx(q * c ** (q - 1), abs=2e-14)
    poles = m["poles"]
    blocks = np.zeros((s, s))
    blocks[0, 0] = poles[0]
    for p in range(1, s, 2):
        alpha, beta = poles[p], poles[p + 1]
        blocks[p : p + 2, p : p + 2] = [[alpha, -beta], [beta, alpha]]
    # T has a condition of up to 1100, A^-1 entries of up to 40
    assert m["T_inverse"] @ m["inverse"] @ m["T"] == pytest.approx(blocks, abs=2e-12)
    assert poles[0] > 0.0
    assert (poles[1::2] > 0.0).all()


@pytest.mark.parametrize("k", range(3))
def test_error_estimate_is_zero_for_polynomials(k):
    """gamma h f(0) + e Z, scaled, up to degree s; of the next one it gives all that is off."""
    s, m = of(k)
    c, e = m["c"], m["e"]
    for q in range(1, s + 1):
        f0 = 1.0 if q == 1 else 0.0
        assert f0 + e @ c**q == pytest.approx(0.0, abs=2e-13)
    # rates x^s: the stages of a quadrature are off by a multiple of ``bulge``
    z = m["A"] @ c**s
    assert z + (e @ z) * m["bulge"] == pytest.approx(c ** (s + 1) / (s + 1), abs=1e-14)


@pytest.mark.parametrize("k", range(3))
def test_transformation_is_known_to_its_last_digit(k):
    """Eigenvectors of the derivatives of polynomials at the abscissae, found with 40 digits."""
    mp = pytest.importorskip("mpmath").mp.clone()
    mp.dps = 40
    s, m = of(k)
    roots = mp.polyroots([mp.mpf(int(a)) for a in radau_polynomial(s)[::-1]], maxsteps=200)
    c = [mp.mpf(0), *sorted(mp.re(root) for root in roots)]
    gap = [mp.fprod(a - b for b in c if a != b) for a in c]
    slopes = mp.matrix(s + 1, s + 1)
    for i in range(s + 1):
        others = [j for j in range(s + 1) if j != i]
        for j in others:
            slopes[i, j] = gap[i] / gap[j] / (c[i] - c[j])
        slopes[i, i] = mp.fsum(1 / (c[i] - c[j]) for j in others)
    poles, vectors = mp.eig(slopes[1:, 1:])
    order = sorted(
        range(s), key=lambda n: mp.im(poles[n])
    )  # conjugates first, the real one between
    T, found = mp.matrix(s, s), [mp.re(poles[order[s // 2]])]
    columns = [[mp.re(vectors[i, order[s // 2]] / vectors[s - 1, order[s // 2]]) for i in range(s)]]
    for n in order[: s // 2]:
        found += [mp.re(poles[n]), -mp.im(poles[n])]
        scaled = [vectors[i, n] / vectors[s - 1, n] for i in range(s)]
        columns += [[mp.re(a) for a in scaled], [mp.im(a) for a in scaled]]
    for j, column in enumerate(columns):
        for i in range(s):
            T[i, j] = column[i]
    exact = {"inverse": slopes[1:, 1:], "A": slopes[1:, 1:] ** -1, "T": T, "T_inverse": T**-1}
    for name, matrix in exact.items():
        assert (m[name] == [[float(a) for a in row] for row in matrix.tolist()]).all()
    assert (m["poles"] == [float(a) for a in found]).all()


def test_published_weights():
    """DD of Hairer's RADAU, of 5 and 7 stages, and of RADAU5."""
    root = np.sqrt(6.0)
    assert of(0)[1]["e"] == pytest.approx([-(13 + 7 * root) / 3, (-13 + 7 * root) / 3, -1 / 3])
    assert of(1)[1]["e"] == pytest.approx(
        [-27.78093394406463, 3.641478498049213, -1.252547721169118, 0.5920031671845429, -0.2]
    )
    assert of(2)[1]["e"] == pytest.approx(
        [-54.37443689412861, 7.000024004259187, -2.355661091987557, 1.132289066106134,
         -0.6468913267673587, 0.3875333853753524, -0.1428571428571429]
    )  # fmt: skip
