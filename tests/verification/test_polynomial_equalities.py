"""Equalities of joints of MJCF with a polynomial: masses that follow a wheel, by its energy."""

import numpy as np
import pytest
from support.plain import long_in_plain_python

import dap3d_core as dap

MODEL = """<mujoco><compiler angle="radian"/><option gravity="0 0 0"/><worldbody>
<body name="wheel"><joint name="p" axis="0 0 1" ref="0.2" range="-2 2"/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.3 0.3 0.3"/></body>
<body name="sled" pos="1 0 0"><joint name="s" type="slide" axis="0.6 0.8 0" ref="0.1"/>
  <inertial pos="0 0 0" mass="2" diaginertia="0.1 0.1 0.1"/></body>
<body name="flap" pos="-1 0 0"><joint name="f" axis="0 1 0"/>
  <inertial pos="0 0 0" mass="1" diaginertia="0.2 0.5 0.2"/></body>
</worldbody><equality><joint joint1="s" joint2="p" polycoef="{s}"/>
<joint joint1="f" joint2="p" polycoef="{f}"/></equality></mujoco>"""
SLED, FLAP = (0.05, 0.4, -0.3, 0.2, 0.1), (0.1, -0.8, 0.5, 0.0, -0.2)
#: Inertia of the wheel that couples them, beside what they move.
LIGHT = 1e-6


def written(path):
    numbers = (" ".join(map(str, one)) for one in (SLED, FLAP))
    path.write_text(MODEL.format(**dict(zip("sf", numbers, strict=True))))
    return path


@long_in_plain_python
@pytest.mark.parametrize("q", [0.2, 0.9])
def test_motion(tmp_path, q):
    """The followers are on their curves, and the rate has the energy of the start."""
    scene, report = dap.import_model(
        written(tmp_path / "a.xml"), positions={"p": q}, rates={"p": 1.0}
    )
    assert not [one for one in report.left_out if one.motion]
    result = dap.simulate(scene, t_end=0.5, dt=0.05, rtol=1e-10, atol=1e-12)
    polynomial = np.polynomial.polynomial
    x = result.quantity("p.angle").values + q - 0.2
    sled, flap = (polynomial.polyval(x, one) for one in (SLED, FLAP))
    moved = result.r[:, list(scene.bodies).index("sled")] @ [0.6, 0.8, 0.0] - 0.6
    assert np.abs(moved - sled).max() <= 1e-9
    turned = result.quantity("f.angle").values
    assert np.abs(turned - turned[0] - (flap - flap[0])).max() <= 1e-9
    slopes = [polynomial.polyval(x, polynomial.polyder(one)) for one in (SLED, FLAP)]
    inertia = 0.3 + 2.0 * slopes[0] ** 2 + 0.5 * slopes[1] ** 2
    rate = result.w[:, list(scene.bodies).index("wheel"), 2]
    assert np.abs(rate - np.sqrt(inertia[0] / inertia)).max() <= 2.0 * LIGHT
    assert np.ptp(rate) > 0.1


def test_export(tmp_path):
    """The curve goes back to MJCF, counted from the scene's pose, and to URDF with a remark."""
    scene, _ = dap.import_model(written(tmp_path / "a.xml"))
    dap.export_model(scene, tmp_path / "b.xml", format="mjcf")
    text = (tmp_path / "b.xml").read_text()
    for curve in (SLED, FLAP):
        again = [float(x) for line in text.splitlines() if "polycoef" in line
                 for x in line.split('polycoef="')[1].split('"')[0].split()]  # fmt: skip
        assert any(np.allclose(again[k : k + 5], (0.0, *curve[1:]), atol=1e-14) for k in (0, 5))
    report = dap.export_model(scene, tmp_path / "b.urdf")
    assert any("polynomial" in one.text and one.motion for one in report.translated)


def test_beyond_half_a_turn_is_said(tmp_path):
    path = written(tmp_path / "a.xml")
    path.write_text(path.read_text().replace('range="-2 2"', ""))
    _, report = dap.import_model(path)
    assert any("half a turn" in one.text and one.motion for one in report.translated)
