"""Root loci: eigenvalues in the complex plane, against closed forms."""

import matplotlib
import numpy as np
import pytest
from unit.study.test_modes_over import oscillators

import dap3d_core as dap


def loci(values):
    """One mass of 2 kg on 200 N/m whose damper varies; 40 N s/m are critical."""
    scene = oscillators()
    for table, name in ((scene.bodies, "b"), (scene.joints, "rail_b"), (scene.forces, "spring_b")):
        del table[name]
    return dap.modes_over(scene, "forces.spring_a.c", values)


@pytest.fixture(scope="module")
def found():
    """From growth to two decays."""
    matplotlib.use("Agg")
    return loci("-4:60:33")


def points_of(ax):
    """All points of the lines, as complex numbers, and the colours' values."""
    [lines] = ax.collections[:1]
    return np.array(lines.get_segments()) @ np.array([1.0, 1.0j]), lines.get_array()


@pytest.mark.slow
def test_locus_is_a_circle_and_the_real_axis(found):
    """Pairs lie on |lambda| = 10 rad/s, both halves; behind, the product of the two is 100."""
    z, _ = points_of(dap.plot(found, "eigenvalues"))
    away = np.abs(z.imag) > 2.0  # near the meeting point the locus is interpolated
    np.testing.assert_allclose(np.abs(z[away]), 10.0, rtol=2e-3)
    assert np.any(z.imag > 9.0)
    assert np.any(z.imag < -9.0)
    np.testing.assert_allclose(z.real.min(), (-60.0 - np.sqrt(2000.0)) / 4.0, rtol=1e-9)


@pytest.mark.slow
def test_pairs_meet_on_the_axis(found):
    """The locus is without a gap: at critical damping both halves are at -10 1/s."""
    z, c = points_of(dap.plot(found, "eigenvalues"))
    on_axis = z[np.all(np.abs(z.imag) <= 1e-9, axis=1)]
    assert np.min(np.abs(on_axis + 10.0)) < 0.02
    near = c[np.min(np.abs(z + 10.0), axis=1) < 0.5]
    np.testing.assert_allclose(near, 40.0, atol=2.0)


@pytest.mark.slow
def test_direction_of_the_values_does_not_matter(found):
    """From the last value to the first the same pieces are drawn, in the same colours."""
    pieces = []
    for one in (found, loci("60:-4:33")):
        z, c = points_of(dap.plot(one, "eigenvalues"))
        middle = z.mean(axis=1)
        pieces.append(np.unique(np.column_stack([middle.real, middle.imag, c]).round(6), axis=0))
    np.testing.assert_allclose(*pieces, atol=2e-6)


@pytest.mark.slow
def test_growing_side_and_bar(found, tmp_path):
    """What grows is tinted; a bar has the values of the parameter."""
    from dap3d_core.plot import save_plot

    path = save_plot(found, ["eigenvalues"], tmp_path / "locus.svg")
    text = path.read_text()
    assert "forces.spring_a.c" in text
    assert "first value" in text
    ax = dap.plot(found, "eigenvalues")
    assert ax.get_xlabel() == "real part [1/s]"
    assert len(ax.patches) == 1


def test_undamped_modes_are_on_the_axis():
    """Without damping all are on the imaginary axis."""
    ax = dap.plot(dap.modes_over(oscillators(), "forces.spring_a.k", "100:300:3"), "eigenvalues")
    z, _ = points_of(ax)
    assert np.all(z.real == 0.0)
    assert ax.get_xlim()[0] < -5.0


def test_modes_that_are_close_have_one_label():
    """Letters of their own would lie on one another."""
    scene = dap.Scene(name="springs")
    for k, stiffness in enumerate((100.0, 102.0, 900.0)):
        scene.add_body(f"b{k}", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(1.0, float(k), 0.0))
        scene.add_point(f"o{k}", "ground", (0.0, float(k), 0.0))
        scene.add_joint("tran", P_i=f"b{k}.O", P_j=f"o{k}", a_j="ground.x")
        scene.add_force("ptp", P_i=f"b{k}.O", P_j=f"o{k}", k=stiffness, l0=1.0)
    ax = dap.plot(dap.linearize(scene))
    assert [text.get_text() for text in ax.texts] == ["1, 2", "3"]
