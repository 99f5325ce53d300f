"""The models of the manual, from their MATLAB folders, move as the shipped scenes do."""

import attrs
import numpy as np
import pytest
from support.matlab import MODELS

import dap3d_core as dap
from dap3d_core.scene import AnimationPoint

NAMES = ("bodies2", "pen1", "pen2", "fourbar2", "fourbar3", "fourbar4", "tri")
#: The numbers of both are the same doubles; only sums over forces may be taken in another order,
#: and the state holds values of order 1 to 100.
ROUNDING = 1e-12


def plain_law_of_the_ball(text, stub):
    """The stub with its law filled in from the shipped plugin, numbers in place of the fields."""
    for name, number in (("R", "0.1"), ("k", "2000.0"), ("c", "5.0")):
        assert f"    {name}: float = number(default={number}" in text
    lines = text[text.index("        delta = r_i[2] - R") : text.index("    def energy")]
    law = lines.replace("- R", "- 0.1").replace("-k *", "-2000.0 *").replace("- c *", "- 5.0 *")
    switch = text[text.index("    def switch(r_i, R):") : text.index("@hookimpl")]
    law += switch.replace("r_i, R", "r_i").replace("- R", "- 0.1")
    start = stub.index("        raise NotImplementedError")
    return stub[:start] + law.rstrip() + "\n\n\n" + stub[stub.index("@hookimpl") :]


def runs_of(imported, name, t_end, **options):
    """The reported states of the imported scene and of the shipped model, in the same settings."""
    model = dap.load(name)
    imported.simulation = attrs.evolve(model.simulation)
    settings = {"t_end": t_end, "dt": t_end / 4, **options}
    return dap.simulate(imported, **settings), dap.simulate(model, **settings)


@pytest.mark.parametrize("name", NAMES)
def test_a_model_moves_as_the_shipped_scene(name):
    scene, report = dap.import_matlab(MODELS / name)
    assert scene.name == name
    assert report.unused == []
    found, expected = runs_of(scene, name, 0.4)
    assert found.status == expected.status == "done"
    np.testing.assert_array_equal(found.t, expected.t)
    np.testing.assert_allclose(found.u, expected.u, rtol=0.0, atol=ROUNDING)
    assert np.abs(found.u[-1] - found.u[0]).max() > 1e-3, "it moves"


def test_the_ball_moves_as_the_shipped_scene_with_its_force_filled_in(tmp_path):
    """Before and after the first touch, which is at 0.428 s."""
    scene, report = dap.import_matlab(MODELS / "ball1")
    assert scene.forces["F1"].type == "user"
    assert scene.forces["F1"].fields == {"body_i": "body1"}
    plugin = (dap.shipped_models()["ball1"] / "plugin.py").read_text()
    (tmp_path / "plugin.py").write_text(plain_law_of_the_ball(plugin, report.stub))
    found = dap.load(scene.save(tmp_path / "scene.toml"))
    found, expected = runs_of(found, "ball1", 0.6, allow_code=True)
    np.testing.assert_allclose(found.u, expected.u, rtol=0.0, atol=ROUNDING)
    assert found.u[-1, 9] > 0.0, "it goes up again"


def test_every_file_of_the_folders_is_read():
    for name in (*NAMES, "ball1"):
        _, report = dap.import_matlab(MODELS / name)
        states = {f.state for f in report.files}
        assert states <= {"read", "absent", "shown"}, name
        assert {f.name for f in report.files if f.state != "absent"} == {
            p.name for p in (MODELS / name).iterdir()
        }


def test_names_and_drawing_of_a_model():
    """What no motion shows: names, colours, animation points, limits."""
    scene, report = dap.import_matlab(MODELS / "bodies2")
    assert list(scene.bodies) == ["body1", "body2"]
    assert [b.color for b in scene.bodies.values()] == ["b", "r"]
    assert list(scene.vectors2) == ["d1", "d2"]
    assert list(scene.forces) == ["F1", "F2", "F3"]
    assert scene.animation.points == [
        AnimationPoint("body1", (-0.5, 0.0, 0.0)),
        AnimationPoint("body1", (0.0, -0.6, 0.0)),
        AnimationPoint("body2", (0.0, 0.6, 0.0)),
    ]
    assert scene.animation.limits == dap.load("bodies2").animation.limits
    assert report.names["body2"] == "Bodies(2) (B2)"
    assert report.names["d1"] == "Vectors2(1) (V1)"
    assert [str(r) for r in report.defaulted] == [
        "inForces.m:4: S1: f_a = 0",
        "inForces.m:11: S2: f_a = 0",
        "inForces.m:15: S3: gravity = 9.81, wgt = [0;0;-1]",
    ]
