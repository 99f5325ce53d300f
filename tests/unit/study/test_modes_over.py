"""Modes followed over a parameter, against closed forms."""

import matplotlib
import numpy as np
import pytest

import dap3d_core as dap


def oscillators(c=0.0):
    """Masses of 2 and 1 kg on springs of their own along x; the second has 20 rad/s."""
    scene = dap.Scene(name="oscillators")
    for name, mass, x, k in (("a", 2.0, 1.0, 200.0), ("b", 1.0, 3.0, 400.0)):
        scene.add_body(name, mass=mass, Jp=(1.0, 1.0, 1.0), r=(x, 0.0, 0.0))
        scene.add_joint("tran", f"rail_{name}", P_i=f"{name}.O", P_j="ground.O", a_j="ground.x")
        scene.add_force("ptp", f"spring_{name}", P_i=f"{name}.O", P_j="ground.O", k=k, l0=x,
                        c=c if name == "a" else 0.0)  # fmt: skip
    return scene


@pytest.mark.parametrize("values", ["100:1500:8", [1500.0, 900.0, 800.0, 700.0, 100.0]])
def test_modes_that_cross_stay_themselves(values):
    """sqrt(k / m) against 20 rad/s, also where both are equal, at k = 800 N/m."""
    found = dap.modes_over(oscillators(), "forces.spring_a.k", values)
    exact = np.array([np.sqrt(found.values / 2.0), np.full(len(found.values), 20.0)]).T
    exact = exact[:, np.argsort(exact[0])]
    np.testing.assert_allclose(2.0 * np.pi * found.frequencies, exact, rtol=1e-12)
    np.testing.assert_allclose(found.damping, 0.0, atol=1e-12)
    assert found.stable.all()
    assert found.steady.all()
    assert not found.grows.any()
    assert found.unit == "N/m"


def test_damping_from_growth_to_two_decays():
    """m x'' + c x' + k x = 0: negative c grows; beyond 2 sqrt(k m) = 40 N s/m there are two."""
    found = dap.modes_over(oscillators(), "forces.spring_a.c", [-4.0, 0.0, 20.0, 36.0, 44.0, 60.0])
    assert found.eigenvalues.shape == (6, 3)
    c = found.values
    root = np.sqrt(c * c - 1600.0 + 0.0j)
    first = (-c + root) / 4.0
    second = (-c - root) / 4.0
    pair = np.sort_complex(found.eigenvalues[4:][:, [0, 2]])
    np.testing.assert_allclose(found.eigenvalues[:4, 0], first[:4], rtol=1e-9, atol=1e-9)
    np.testing.assert_allclose(pair, np.sort_complex(np.array([first, second])[:, 4:].T), rtol=1e-9)
    np.testing.assert_allclose(found.eigenvalues[:, 1], 20.0j, rtol=1e-9, atol=1e-9)
    assert np.isnan(found.frequencies[:4, 2]).all()
    assert found.grows.tolist() == [[True, False, False]] + 5 * [[False] * 3]
    assert found.stable.tolist() == [False] + 5 * [True]


def test_picture_has_a_curve_for_each_mode():
    """Frequencies over the parameter, crosses where a motion grows."""
    matplotlib.use("Agg")
    found = dap.modes_over(oscillators(), "forces.spring_a.c", [-4.0, 0.0], modes=1)
    ax = dap.plot(found)
    assert len(ax.lines) == 2  # the mode, and its cross
    assert ax.get_xlabel() == "forces.spring_a.c [N\N{NO-BREAK SPACE}s/m]"
    with pytest.raises(ValueError, match="name no more"):
        dap.plot(found, "a.r.x")


@pytest.mark.parametrize(
    ("parameter", "values", "said"),
    [
        ("forces.spring_a.q", "1:2:3", "spring_a has no number 'q'"),
        ("forces.spring_c.k", "1:2:3", "did you mean 'forces.spring_"),
        ("forces.spring_a.k", "1:2", "add how many, 1:2:9$"),
        ("forces.spring_a.k", "1~2", "values are 1:5:9"),
        ("forces.spring_a.k", [], "no points"),
    ],
)
def test_what_is_refused(parameter, values, said):
    """An unknown parameter with the nearest one; values that are none."""
    with pytest.raises(dap.SceneError, match=said):
        dap.modes_over(oscillators(), parameter, values)
