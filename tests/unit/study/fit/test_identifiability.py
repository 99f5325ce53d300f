"""What a Jacobian says of parameters."""

import numpy as np
import pytest

from dap3d_core.study.fit.identifiability import NoiseFloor, identify, regularised

FLOOR = NoiseFloor(1e-6, 1e-12)


def jacobian(*columns):
    return np.stack(columns, axis=1)


def identified(names, x, J, scale=None):
    x = np.array(x)
    scale = np.abs(x) if scale is None else np.array(scale)
    held = np.zeros(len(x), dtype=bool)
    return identify(names, x, scale, J, np.zeros_like(J), held, FLOOR)


def test_messages_on_what_cannot_be_told_apart():
    """Quotient, product, powers, sum, ratios: each from predictions that depend on it alone."""
    rng = np.random.default_rng(0)
    f, g = rng.standard_normal((2, 30))
    k, m = 40.0, 2.0
    assert (
        identified("km", (k, m), jacobian(f / k, -f / m))
        .messages[0]
        .endswith("only k / m is determined")
    )
    assert (
        identified("km", (k, m), jacobian(f / k, f / m))
        .messages[0]
        .endswith("only k * m is determined")
    )
    assert (
        identified("km", (k, m), jacobian(f / k, 2 * f / m))
        .messages[0]
        .endswith("k * m^2 is determined")
    )
    assert (
        identified("ab", (0.0, 3.0), jacobian(f, f), (1, 1))
        .messages[0]
        .endswith("a + b is determined")
    )
    found = identified("ab", (3.7, 1.3), jacobian(f, -2 * f)).messages[0]
    assert found.endswith("only a - 2 b is determined")
    c = 0.5
    found = identified("kmc", (k, m, c), jacobian(f / k, -(f + g) / m, g / c))
    assert found.messages[0].startswith("k, m and c cannot be told apart by these data: only their")
    assert found.rank == 2
    found = identified("kmc", (k, m, c), jacobian(f / k, -f / m, g / c))
    assert found.messages == (
        "k and m cannot be told apart by these data: only k / m is determined",
    )
    assert np.isfinite(found.covariance[2, 2])
    found = identified("abc", (1.0, 2.0, 3.0), jacobian(f, g, f + 2 * g))
    assert "changing" in found.messages[0]
    found = identified("abcd", (k, m, 1.0, 2.0), jacobian(f / k, -f / m, g, 2.0 * g))
    assert len(found.messages) == 2
    assert identified("kq", (k, m), jacobian(f, 0.0 * f)).messages == (
        "q has no effect on these data",
    )


def test_a_scale_changes_nothing_of_what_is_identified():
    """Also a parameter of 1e9 beside one of 1e-9 is determined where the data say so."""
    rng = np.random.default_rng(1)
    J = rng.standard_normal((20, 2)) / np.array([1e9, 1e-9])
    found = identified("ab", (1e9, 1e-9), J)
    assert found.messages == ()
    assert found.covariance == pytest.approx(np.linalg.inv(J.T @ J), rel=1e-9)


def test_no_step_goes_along_what_is_lost():
    """The Gauss-Newton step of a regularised Jacobian is the shortest one, over the sizes."""
    rng = np.random.default_rng(2)
    f, residual = rng.standard_normal((2, 20))
    J = jacobian(f, -f * (1.0 + 1e-9), np.zeros(20))
    J[:, 1] += 1e-8 * rng.standard_normal(20)
    kept, rows = regularised(J, FLOOR)
    step, *_ = np.linalg.lstsq(
        np.vstack([kept, rows]), np.append(residual, np.zeros(3)), rcond=None
    )
    best = f @ residual / (f @ f)
    assert step == pytest.approx([best / 2.0, -best / 2.0, 0.0], abs=1e-6)
