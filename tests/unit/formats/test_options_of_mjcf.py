"""Several <option> of one MJCF file, of files it includes say: each changes what it names."""

import dap3d_core as dap

MODEL = """<mujoco>{}<worldbody><body><freejoint/><geom size="0.1"/></body></worldbody></mujoco>"""


def test_a_later_option_keeps_gravity(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(MODEL.format('<option gravity="0 0 -1.6"/><option cone="elliptic"/>'))
    scene, _ = dap.import_model(path)
    assert scene.forces["gravity"].fields["gravity"] == 1.6
