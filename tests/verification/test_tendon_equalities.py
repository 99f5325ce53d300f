"""Equalities of tendons of MJCF against MuJoCo, where it is installed.

MuJoCo's are soft: its multiplier is solved for with its own mass matrix and the rows of its own
lengths, M a + J^T x = f, J a = 0, at rest. A wheel here has a millionth of the inertia of a joint.
"""

import numpy as np
import pytest
from support.mujoco_models import Oracle
from support.plain import long_in_plain_python

import dap3d_core as dap

MODEL = """<mujoco><worldbody><site name="hook" pos="-0.3 0.1 0.4"/>
<geom name="post" type="cylinder" size="0.15 1" pos="0 0.2 0.2" euler="80 10 0"/>
<body name="a"><joint name="p" axis="0 1 0"/><geom size="0.1" pos="0.5 0.1 0"/>
  <site name="mid" pos="0.3 0.2 -0.1"/><geom name="ball" size="0.1" pos="0.6 0.1 -0.1"/>
  <body name="b" pos="0.5 0 0"><joint name="q" axis="0 1 0.2"/><geom size="0.08" pos="0.3 0.1 0"/>
    <body name="c" pos="0.4 0 0"><joint name="s" type="slide" axis="1 0 0.2"/>
      <geom size="0.06" pos="0.1 0 0.1"/><site name="end" pos="0.1 0.1 -0.2"/></body></body></body>
<body name="d" pos="0 1 0"><joint name="u" axis="1 0 0"/><geom size="0.1" pos="0 0.5 0"/></body>
</worldbody><tendon>
<fixed name="t"><joint joint="p" coef="1"/><joint joint="q" coef="-2"/><joint joint="s" coef="3"/>
</fixed><fixed name="x"><joint joint="u" coef="1.5"/><joint joint="p" coef="0.3"/></fixed>
<spatial name="l"><site site="hook"/><site site="end"/></spatial>
<spatial name="w"><site site="hook"/><geom geom="post"/><site site="mid"/><pulley divisor="2"/>
<site site="mid"/><geom geom="ball"/><site site="end"/></spatial>
</tendon><equality><tendon {equality}/></equality></mujoco>"""


@pytest.mark.parametrize(
    ("equality", "ratio"),
    [('tendon1="t"', 0.0), ('tendon1="t" tendon2="x" polycoef="0 0.7 0 0 0"', 0.7),
     ('tendon1="x"', 0.0), ('tendon1="l"', 0.0), ('tendon1="w"', 0.0)],
)  # fmt: skip
def test_accelerations(tmp_path, equality, ratio):
    """Of three joints, of two tendons with one in common, of two joints, two points, over drums."""
    pytest.importorskip("mujoco")
    path = tmp_path / "a.xml"
    path.write_text(MODEL.format(equality=equality))
    oracle = Oracle(path)
    mujoco, m, d = oracle.mujoco, oracle.model, oracle.data
    mujoco.mj_forward(m, d)
    row, M = np.zeros(m.nv), np.zeros((m.nv, m.nv))
    mujoco.mj_fullM(m, d, M)
    for k, one in enumerate("txlw"):
        share = 1.0 if f'tendon1="{one}"' in equality else -ratio * (f'tendon2="{one}"' in equality)
        for column in range(m.nv):
            h = 1e-6 * np.eye(m.nv)[column]
            lengths = []
            for q in (h, -h):
                d.qpos[:] = q
                mujoco.mj_forward(m, d)
                lengths.append(d.ten_length[k])
            row[column] += share * (lengths[0] - lengths[1]) / 2e-6
    d.qpos[:] = 0.0
    mujoco.mj_forward(m, d)
    free, held = d.qacc_smooth.copy(), np.linalg.solve(M, row)
    d.qacc[:] = free - held * (row @ free) / (row @ held)
    scene, report = dap.import_model(path)
    assert not [one for one in report.left_out if one.motion]
    oracle.check_accelerations(scene, "abcd", 2e-5 * abs(free).max())


@long_in_plain_python
def test_a_sum_stays_where_it_starts(tmp_path):
    """A motion of a second keeps it; a remark says that it is not what the file asks."""
    path = tmp_path / "a.xml"
    path.write_text(MODEL.format(equality='tendon1="t"'))
    scene, report = dap.import_model(path, positions={"p": 0.2})
    assert any("where the scene starts" in one.text for one in report.translated)
    result = dap.simulate(scene, t_end=1.0, dt=0.1, rtol=1e-9, atol=1e-11)
    p, q, s = (result.coordinates(name).q[:, 0] for name in "pqs")
    assert np.ptp(q) > 0.1
    np.testing.assert_allclose(p - 2.0 * q + 3.0 * s, 0.0, rtol=0, atol=1e-7)


def test_of_longer_paths_it_is_left_out(tmp_path):
    path = tmp_path / "a.xml"
    path.write_text(MODEL.format(equality='tendon1="t" tendon2="l"'))
    assert any("equality of two tendons" in one.text for one in dap.import_model(path)[1].left_out)


@pytest.mark.parametrize("wheels", [3, 6])
def test_a_row_of_light_wheels_carries_all(wheels):
    """Of two slides, coupled by wheels of 1e-9 kg m^2, that of 3 kg presses with its 2 kg more.

    To 1e-10: a residual of 1e-12 ends the method, counted by masses of light wheels or what they
    carry.
    """
    scene = dap.Scene(name="balance")
    for name, x, mass in (("a", 0.0, 1.0), ("b", 1.0, 3.0)):
        scene.add_body(name, mass=mass, Jp=[0.01] * 3, r=[x, 0.0, 0.1])
        scene.add_point(f"foot_{name}", body="ground", sPp=[x, 0.0, 0.0])
        scene.add_joint("tran", f"slide_{name}", P_i=f"{name}.O", P_j=f"foot_{name}",
                        a_j="ground.z")  # fmt: skip
        scene.add_shape("sphere", body=name, radius=0.1, collides=True)
    scene.add_shape("plane", body="ground", collides=True)
    before, z = "ground", {"a_j": "ground.z"}
    for k in range(wheels):
        scene.add_body(f"w{k}", mass=1e-9, Jp=[1e-9] * 3)
        scene.add_joint("rev", f"bearing{k}", P_i=f"w{k}.O", P_j="ground.O", a_i=f"w{k}.z",
                        **z)  # fmt: skip
        if k:
            scene.add_joint("follow", f"row{k}", body_i=f"w{k}", a_k=f"{before}.z", **z)
        before = f"w{k}"
    scene.add_joint("follow", "first", body_i="a", a_k="w0.z", along=True, **z)
    scene.add_joint("follow", "last", body_i="b", a_k=f"{before}.z", ratio=-1.0, along=True, **z)
    scene.add_force("weight", "gravity")
    result = dap.simulate(scene, t_end=1e-3, dt=1e-3, contact_step=1e-3, contact="stepping")
    np.testing.assert_allclose(result.rd[-1, :2], 0.0, atol=1e-12)
    np.testing.assert_allclose(result.contacts.force[-1, 2], 2.0 * 9.81, rtol=1e-10)
