"""The double pendulum to as many digits as are asked for, by Taylor series of its own equations.

Two uniform rods of 1 m and 1 kg, s_i, c_i the sines and cosines of their angles from straight down,
w_i the rates, S and C those of the difference of the angles:

    s_i' = c_i w_i,  c_i' = -s_i w_i
    4/3 w_1' + C/2 w_2' = -S w_2^2 / 2 - 3/2 g s_1
    C/2 w_1' + 1/3 w_2' =  S w_1^2 / 2 - 1/2 g s_2

All of it is products and one division, so every coefficient of the series follows from those before
it. Decimals carry any number of digits, of which the motion loses some each second for ever.
"""

from decimal import Decimal, localcontext
from operator import mul

G = Decimal("9.81")
HALF = Decimal("0.5")
#: From rest, both rods along +x: s_1, c_1, w_1, s_2, c_2, w_2.
LEVEL = tuple(map(Decimal, (1, 0, 0, 1, 0, 0)))


def _product(a, b, k):
    """Coefficient k of the product of two series."""
    return sum(map(mul, a[: k + 1], b[k::-1]), Decimal(0))


def series(state, order):
    """Six lists of ``order`` + 1 coefficients: the motion from ``state`` as series of time."""
    third = Decimal(1) / 3
    s1, c1, w1, s2, c2, w2 = motion = [[x] for x in state]
    S, C, q1, q2, right1, right2, det = ([] for _ in range(7))
    up1, up2, rate1, rate2 = ([] for _ in range(4))
    for k in range(order):
        S.append(_product(s1, c2, k) - _product(c1, s2, k))
        C.append(_product(c1, c2, k) + _product(s1, s2, k))
        q1.append(_product(w1, w1, k))
        q2.append(_product(w2, w2, k))
        right1.append(-HALF * _product(S, q2, k) - 3 * HALF * G * s1[k])
        right2.append(HALF * _product(S, q1, k) - HALF * G * s2[k])
        det.append((Decimal(4) / 9 if k == 0 else 0) - _product(C, C, k) / 4)
        up1.append(third * right1[k] - HALF * _product(C, right2, k))
        up2.append(4 * third * right2[k] - HALF * _product(C, right1, k))
        for rate, up in ((rate1, up1), (rate2, up2)):  # rate det = up
            rate.append((up[k] - sum(map(mul, rate, det[k:0:-1]), Decimal(0))) / det[0])
        n = k + 1
        new = (_product(c1, w1, k), -_product(s1, w1, k), rate1[k],
               _product(c2, w2, k), -_product(s2, w2, k), rate2[k])  # fmt: skip
        for values, derivative in zip(motion, new, strict=True):
            values.append(derivative / n)
    return motion


def states(times, start=LEVEL, digits=50):
    """The motion at the instants ``times``, ascending from 0: six decimals each.
    A step is so long that its last terms are below 10^-digits, and the series has a term for
    each digit and a few: steps are then some tenths of the radius of convergence."""
    order, found = digits + 10, []
    with localcontext() as context:
        context.prec = digits
        state, t, small = tuple(map(Decimal, start)), Decimal(0), Decimal(10) ** -digits
        coefficients, reach = None, Decimal(0)
        for wanted in map(Decimal, map(str, times)):
            while coefficients is None or wanted > t + reach:
                if coefficients is not None:
                    state, t = _value(coefficients, reach), t + reach
                coefficients = series(state, order)
                reach = _reach(coefficients, small)
            found.append(_value(coefficients, wanted - t))
    return found


def _reach(coefficients, small):
    """The time at which the last terms are ``small``; from rest most of four orders are zero."""
    order = len(coefficients[0]) - 1
    sizes = {k: max(abs(x[k]) for x in coefficients) for k in range(order - 3, order + 1)}
    return min((small / size) ** (Decimal(1) / k) for k, size in sizes.items() if size)


def _value(coefficients, h):
    """The series at h, by Horner's rule."""
    values = []
    for series_of_one in coefficients:
        value = Decimal(0)
        for coefficient in reversed(series_of_one):
            value = value * h + coefficient
        values.append(value)
    return tuple(values)


def energy(state):
    """Kinetic and potential energy of a state, J; zero at level rest."""
    s1, c1, w1, s2, c2, w2 = state
    kinetic = 2 * w1 * w1 / 3 + w2 * w2 / 6 + HALF * w1 * w2 * (c1 * c2 + s1 * s2)
    return kinetic - G * (3 * c1 + c2) / 2
