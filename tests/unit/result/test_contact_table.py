"""The table of contacts of shapes: forces that carry weights, files, checkpoints, arrows."""

import base64

import numpy as np
import pytest
from support.ended import leave, shorten_chunks

import dap3d_core as dap
from dap3d_core.result import UnknownNameError

G = 9.81
GIVEN = {"t_end": 0.4, "dt": 0.1, "contact_step": 5e-3}


def stack(apart=1.0):
    """A ball of 1 kg in a pit above two of 2 kg side by side, which slide apart on a floor."""
    scene = dap.Scene(name="stack")
    scene.add_material("surface", mu=0.1)
    scene.add_collisions(material="surface")
    for name, mass, r in (("a", 2.0, [-0.1, 0, 0.1]), ("b", 2.0, [0.1, 0, 0.1]),
                          ("top", 1.0, [0.0, 0, 0.1 + 0.1 * 3**0.5])):  # fmt: skip
        scene.add_body(name, mass=mass, Jp=[0.004 * mass] * 3, r=[apart * x for x in r])
        scene.add_shape("sphere", body=name, name=f"{name}_ball", radius=0.1, collides=True)
    scene.add_shape("plane", "floor", body="ground", collides=True)
    scene.add_force("weight", "gravity")
    return scene


@pytest.fixture(scope="module")
def result():
    return dap.simulate(stack(), **GIVEN)


def test_forces_are_the_momentum_that_bodies_gain(result):
    """Newton's law of the top ball over one step."""
    h = GIVEN["contact_step"]
    fine = dap.simulate(stack(), **GIVEN | {"dt": h})
    k = np.searchsorted(fine.t, 0.1 - 0.5 * h)
    gained = (fine.rd[k, 2] - fine.rd[k - 1, 2]) / h + [0.0, 0.0, G]
    assert fine.contacts.of("top_ball").at(fine.t[k : k + 1]).force.sum(axis=0) == pytest.approx(
        gained, abs=1e-9
    )


def test_a_pair_is_seen_from_either_shape(result):
    one, other = result.contacts.of("a_ball", "floor"), result.contacts.of("floor", "a_ball")
    assert one.t.tolist() == result.t.tolist()
    assert one.normal == pytest.approx(np.tile([0.0, 0.0, 1.0], (5, 1)))
    assert other.force.tolist() == (-one.force).tolist()
    assert {one.names[i] for i in one.pair[:, 0]} == {"a_ball"}
    assert one.point[:, 2] == pytest.approx(0.0, abs=1e-12)
    with pytest.raises(UnknownNameError, match="a_ball"):
        result.contacts.of("ball")


def test_a_file_has_the_table(result, tmp_path):
    result.save(tmp_path / "stack.nc")
    found = dap.open(tmp_path / "stack.nc")
    assert found.contacts == result.contacts
    data = found.contacts.to_xarray()
    assert set(data.data_vars) == {"t", "pair", "mode", "gap", "point", "normal", "force"}
    assert str(data.shapes.values[0, 1]) in found.contacts.names
    dap.simulate(stack(10.0), **GIVEN).save(tmp_path / "none.nc")
    assert len(dap.open(tmp_path / "none.nc").contacts) == 0


def test_a_run_that_is_resumed_has_the_whole_table(result, tmp_path, monkeypatch):
    shorten_chunks(monkeypatch)
    resumed = dap.resume(leave(stack(), tmp_path, 0.25, **GIVEN))
    assert resumed.contacts == result.contacts


def test_a_page_has_an_arrow_for_each_pair(result):
    arrows = dap.view(result).data["arrows"]
    (floor,) = [a for a in arrows if set(a["name"].split(" on ")) == {"floor", "a_ball"}]
    values = np.frombuffer(base64.b64decode(floor["values"]), dtype="<f4").reshape(-1, 3)
    assert values == pytest.approx(result.contacts.of("a_ball", "floor").force, rel=1e-6)


def sliding():
    """A ball that slides on the floor at first; one that bounces; an arm at its limit, a moment."""
    scene = dap.Scene(name="declared")
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=[0, 0, 0.1], r_dot=[3, 0, 0])
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1, mu=0.3)
    scene.add_body("drop", mass=1.0, Jp=[0.01] * 3, r=[0, 1, 0.6])
    scene.add_contact("ball_plane", "pad", P_i="drop.O", radius=0.1, e=1.0)
    scene.add_body("arm", mass=1.0, Jp=[0.1] * 3, r=[0.5, 5, 0])
    scene.add_point("end", "arm", (-0.5, 0.0, 0.0))
    scene.add_point("seat", "ground", (0.0, 5.0, 0.0))
    scene.add_joint("rev", "hinge", P_i="end", P_j="seat", a_i="arm.y", a_j="ground.y", upper=0.0)
    scene.add_force("weight", "gravity", gravity=G)
    return scene


def test_declared_contacts_have_rows_at_all_reported_instants(tmp_path):
    """The ball slides until t = 2/7 3 / (0.3 g) = 0.291 s, the other is in the air at reports."""
    result = dap.simulate(sliding(), t_end=0.5, dt=0.1, rtol=1e-10, atol=1e-12)
    table = result.contacts
    assert np.all(result.contact("hinge_upper").normal_force > 4.0)
    assert table.names == ("ground", "ball", "drop", "arm")
    assert table.t.tolist() == result.t.tolist()
    assert np.all(table.pair == [1, 0])
    assert table.mode.tolist() == [1, 1, 1, 2, 2, 2]
    weight = 2.0 * G
    slides, rolls = [-0.3 * weight, 0.0, weight], [0.0, 0.0, weight]
    assert np.abs(table.force - np.array(3 * [slides] + 3 * [rolls])).max() < 1e-9
    assert np.abs(table.normal - [0.0, 0.0, 1.0]).max() < 1e-15
    assert np.abs(table.point - result.r[:, 0] * [1.0, 1.0, 0.0]).max() < 1e-12
    assert np.abs(table.of("ground", "ball").force + table.force).max() == 0.0
    result.save(tmp_path / "declared.nc")
    assert dap.open(tmp_path / "declared.nc").contacts == table


def test_shapes_and_declared_contacts_are_in_one_table():
    scene = stack()
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=[0, 3, 0.1])
    scene.add_contact("ball_plane", "ground_floor", P_i="ball.O", radius=0.1, mu=0.3)
    result = dap.simulate(scene, **GIVEN)
    own, shapes = result.contacts.of("ball", "ground"), result.contacts.of("floor")
    assert own.force == pytest.approx(np.tile([0.0, 0.0, 2.0 * G], (5, 1)), abs=1e-9)
    assert len(result.contacts.of("a_ball", "floor")) == 5
    assert np.all(np.diff(result.contacts.t) >= 0.0)
    assert len(own) + len(shapes) + len(result.contacts.of("top_ball")) == len(result.contacts)
