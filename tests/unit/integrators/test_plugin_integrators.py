"""Integrators of other packages: found by entry points, checked, run as the methods they are."""

import sys

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.integrators import DOPRI5
from dap3d_core.integrators.plugin_integrators import _of_package, integrator_named, tableau_of
from dap3d_core.interface import PluginError
from dap3d_core.interface.integrators import RungeKuttaMethod

#: Bogacki and Shampine's method of order 3(2), and Ralston's of order 2, of fixed steps.
METHODS = """
from dap3d_core.interface import hookimpl
from dap3d_core.interface.integrators import RungeKuttaMethod

interface_version = 1


@hookimpl
def dap3d_integrators():
    return [
        RungeKuttaMethod(
            keyword="bs32", order=3, a=[[1 / 2], [0, 3 / 4]], b=[2 / 9, 1 / 3, 4 / 9],
            b_hat=[7 / 24, 1 / 4, 1 / 3, 1 / 8],
        ),
        RungeKuttaMethod(keyword="ralston", order={order}, a=[[2 / 3]], b=[1 / 4, 3 / 4]),
    ]
"""


@pytest.fixture
def install(tmp_path, monkeypatch):
    """Put a distribution with both integrators on sys.path; ``order`` is what ralston claims."""
    monkeypatch.syspath_prepend(str(tmp_path))
    monkeypatch.delenv("DAP3D_BLOCK", raising=False)

    def put(order=2):
        (tmp_path / "my_integrators.py").write_text(METHODS.replace("{order}", str(order)))
        info = tmp_path / "my_integrators-1.0.dist-info"
        info.mkdir()
        (info / "METADATA").write_text(
            "Metadata-Version: 2.1\nName: my-integrators\nVersion: 1.0\n"
        )
        entries = "\n".join(f"{name} = my_integrators" for name in ("bs32", "ralston"))
        (info / "entry_points.txt").write_text(f"[dap3d.integrators]\n{entries}\n")

    yield put
    sys.modules.pop("my_integrators", None)
    _of_package.cache_clear()


def top():
    """A free asymmetric body: smooth, and far from stiff."""
    scene = dap.Scene(name="top")
    scene.add_body("body", mass=1.0, Jp=[1.0, 2.0, 3.0], w=[1.0, 0.5, 1.0])
    return scene


def error(scene, exact, **settings):
    result = dap.simulate(scene, t_end=1.0, dt=1.0, **settings)
    return np.max(np.abs(result.w[-1, 0] - exact))


def test_they_converge_with_their_order(install):
    """Halved steps: 2^3 and 2^2 times smaller errors, of fixed steps; by its error to tolerance."""
    install()
    exact = dap.simulate(top(), t_end=1.0, dt=1.0, rtol=1e-13, atol=1e-13).w[-1, 0]
    for name, order in (("bs32", 3), ("ralston", 2)):
        coarse, fine = (error(top(), exact, integrator=name, step=h) for h in (0.01, 0.005))
        assert np.log2(coarse / fine) == pytest.approx(order, abs=0.1)
    loose, tight = (error(top(), exact, integrator="bs32", rtol=x, atol=x) for x in (1e-5, 1e-8))
    assert loose < 1e-4
    assert tight < 1e-7


def test_dense_output_is_of_order_three(install):
    """Reported instants within steps are as good as the steps: 1e-6 at a tolerance of 1e-8."""
    install()
    settings = {"t_end": 1.0, "dt": 0.0137}
    exact = dap.simulate(top(), rtol=1e-13, atol=1e-13, **settings)
    result = dap.simulate(top(), integrator="bs32", rtol=1e-8, atol=1e-10, **settings)
    np.testing.assert_allclose(result.w, exact.w, atol=1e-6)


def test_what_is_wrong_is_named(install, monkeypatch):
    """An order that the tableau has not, an unknown name, a fixed-step method without a step."""
    install(order=3)
    with pytest.raises(PluginError, match="order is a whole number from 1 to 2, not 3"):
        dap.simulate(top(), t_end=1.0, integrator="ralston", step=0.1)
    with pytest.raises(dap.SceneError, match=r'"moreau", "bs32", "ralston".*did you mean .bs32.'):
        dap.simulate(top(), t_end=1.0, integrator="bs23")
    monkeypatch.setenv("DAP3D_BLOCK", "my-integrators")
    with pytest.raises(dap.SceneError, match="should be one of"):
        dap.simulate(top(), t_end=1.0, integrator="bs32")


def test_a_method_of_fixed_steps_needs_a_step(install):
    install()
    with pytest.raises(dap.SceneError, match="step"):
        dap.simulate(top(), t_end=1.0, integrator="ralston")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"b": [1 / 4, 1 / 2, 1 / 4]}, r"not of order 2: sum b_i c_i = 1/2 is off by -0.0625"),
        ({"b": [2 / 9, 1 / 3, 5 / 9]}, r"not of order 1: sum b_i = 1 is off by 0.111"),
        ({"a": [[1 / 2]]}, "a has 2 rows"),
        ({"a": [[1 / 2], [0, 1 / 2, 1 / 4]]}, "at most 1, 2, ... numbers"),
        ({"b_hat": [1.0]}, "b_hat has 3 weights, or 4, not 1"),
        ({"b_hat": [0.5, 0.25, 0.2]}, "the sum of b_hat is 0.95, not 1"),
    ],
)
def test_tableaus_are_checked(changes, words):
    good = {"order": 3, "a": [[1 / 2], [0, 3 / 4]], "b": [2 / 9, 1 / 3, 4 / 9]}
    RungeKuttaMethod(keyword="bs", **good).check()
    with pytest.raises(PluginError, match=words):
        RungeKuttaMethod(keyword="bs", **(good | changes)).check()


def test_dormand_and_prince_written_so_is_dopri5():
    """All but its dense output: the coefficients, the error weights and the controller."""
    a, b = [list(row[:k]) for k, row in enumerate(DOPRI5.a[1:6], 1)], list(DOPRI5.a[6, :6])
    b_hat = list(np.append(b, 0.0) - DOPRI5.e[0])
    method = RungeKuttaMethod(keyword="dp", order=5, a=a, b=b, b_hat=b_hat)
    method.check()
    made = tableau_of(method)
    np.testing.assert_allclose(made.a, DOPRI5.a, atol=1e-15)
    np.testing.assert_allclose(made.c, DOPRI5.c, atol=1e-15)
    np.testing.assert_allclose(made.e, DOPRI5.e, atol=1e-15)
    for name in ("order", "stages", "exponent", "beta", "factor_min", "factor_max", "safety"):
        assert getattr(made, name) == pytest.approx(getattr(DOPRI5, name)), name


def test_those_of_dap3d_are_found_without_looking_further(monkeypatch):
    """No entry point is read for them."""
    monkeypatch.setattr("dap3d_core.registry.extensions.discover", None)
    assert integrator_named("adams").name == "adams"
    assert integrator_named("auto").name == "dop853"
