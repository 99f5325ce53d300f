"""States of elements as quantities of results."""

import numpy as np
import pytest
from support.state_types import REGISTRY, pulled

import dap3d_core as dap
from dap3d_core.result.errors import UnknownNameError


@pytest.fixture(scope="module")
def result():
    """A run of two forces with states, one of them with two."""
    scene = pulled()
    scene.add_force("test-lag", "lag", body_i="cart", k=2.0, tau=0.5, held_0=(1.0, 2.0, 3.0))
    return dap.simulate(dap.compile(scene, registry=REGISTRY), t_end=0.2, dt=0.1)


def test_states_are_quantities_by_name(result):
    """Numbers and vectors, whole or by components from 1; the first instant has the fields."""
    assert result.quantity("spring.z").values.shape == (3,)
    assert result.quantity("spring.z").values[0] == 0.1
    held = result.quantity("lag.held").values
    assert held.shape == (3, 3)
    assert list(held[0]) == [1.0, 2.0, 3.0]
    assert np.array_equal(result.quantity("lag.held.2").values, held[:, 1])
    assert result.quantity("lag.clock").values == pytest.approx([0.0, 0.1, 0.2], abs=1e-14)


@pytest.mark.parametrize(
    ("name", "words"),
    [
        ("spring.zz", ["has force", "z", "not 'zz'"]),
        ("lag.held.4", ["lag.held has 1, 2, 3, not '4'"]),
        ("spring.z.1", ["no components"]),
        ("spring.i.z", ["not 'z'"]),
    ],
)
def test_a_wrong_name_is_refused(result, name, words):
    """The error lists what there is."""
    with pytest.raises(UnknownNameError) as caught:
        result.quantity(name)
    for word in words:
        assert word in str(caught.value)


def test_a_file_holds_the_states(result, tmp_path):
    """Saved and opened, with their names; xarray has them as a variable."""
    result.save(tmp_path / "r.nc")
    opened = dap.open(tmp_path / "r.nc")
    assert np.array_equal(opened.quantity("lag.held").values, result.quantity("lag.held").values)
    data = result.to_xarray()["states"]
    assert list(data.coords["element_state"].values) == [
        "forces.spring.z", "forces.lag.held.1", "forces.lag.held.2", "forces.lag.held.3",
        "forces.lag.clock",
    ]  # fmt: skip


def test_the_force_of_an_element_follows_its_state(result):
    """A force evaluated again at reported instants takes the states of these."""
    held, force = result.quantity("lag.held").values, result.force("lag").on["i"].force
    assert np.array_equal(force, held)
