"""The table of contacts of shapes: forces that carry weights, files, checkpoints, arrows."""

import base64

import numpy as np
import pytest
from support.ended import leave, shorten_chunks

import dap3d_core as dap
from dap3d_core.result import UnknownNameError
from dap3d_core.result.contact_table import FIELDS
from dap3d_core.view.page_data import page_data

G = 9.81
GIVEN = {"t_end": 0.4, "dt": 0.1, "contact_step": 5e-3}


def stack():
    """A ball of 1 kg in a pit above two of 2 kg side by side, which slide apart on a floor."""
    scene = dap.Scene(name="stack")
    scene.add_material("surface", mu=0.1)
    scene.add_collisions(material="surface")
    for name, mass, r in (("a", 2.0, [-0.1, 0, 0.1]), ("b", 2.0, [0.1, 0, 0.1]),
                          ("top", 1.0, [0.0, 0, 0.1 + 0.1 * 3**0.5])):  # fmt: skip
        scene.add_body(name, mass=mass, Jp=[0.004 * mass] * 3, r=r)
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
    assert len(one) == 4
    assert one.t.tolist() == result.t[1:].tolist()
    assert one.normal == pytest.approx(np.tile([0.0, 0.0, 1.0], (4, 1)))
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
    assert set(data.data_vars) == set(FIELDS)
    assert str(data.shapes.values[0, 1]) in found.contacts.names
    none = dap.simulate(stack(), t_end=1e-3, dt=1e-3, contact="stepping", contact_step=1e-3)
    none.at([0]).save(tmp_path / "none.nc")
    assert len(dap.open(tmp_path / "none.nc").contacts) == 0


def test_a_run_that_is_resumed_has_the_whole_table(result, tmp_path, monkeypatch):
    shorten_chunks(monkeypatch)
    resumed = dap.resume(leave(stack(), tmp_path, 0.25, **GIVEN))
    assert resumed.contacts == result.contacts


def test_a_page_has_an_arrow_for_each_pair(result):
    arrows = page_data(result, stack(), [], None)["arrows"]
    (floor,) = [a for a in arrows if set(a["name"].split(" on ")) == {"floor", "a_ball"}]
    values = np.frombuffer(base64.b64decode(floor["values"]), dtype="<f4").reshape(-1, 3)
    assert values[1:] == pytest.approx(result.contacts.of("a_ball", "floor").force, rel=1e-6)
    assert not values[0].any()
