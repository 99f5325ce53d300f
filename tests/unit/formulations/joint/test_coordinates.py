"""Joint coordinates of a model: starts of runs."""

import numpy as np
import pytest
from support import state_types, trees
from unit.formulations.joint_loops.test_equations import ladder

import dap3d_core as dap
from dap3d_core.formulations.joint import coordinates as module
from dap3d_core.simulation import CompiledModel


def start_of(coordinates, u):
    """State and constants of the tree at the start of a run from u."""
    y = coordinates.start(u)
    return y, coordinates.evaluator.system.tree.constants.copy()


def test_runs_from_one_state_compute_its_reference_once(monkeypatch):
    """Reports at other states, and another start, leave a start as it is."""
    made = []

    class Counted(module.Reference):
        def __init__(self, *arguments):
            made.append(1)
            super().__init__(*arguments)

    monkeypatch.setattr(module, "Reference", Counted)
    model = CompiledModel(trees.random_tree(4, seed=2, free=0.3), method="joint")
    coordinates, u = model.evaluator.coordinates, model.model.u0
    other = u.copy()
    other[-6:] += 0.5
    first = start_of(coordinates, u)
    count = len(made)
    again = start_of(coordinates, u)
    assert len(made) == count
    with coordinates.at(other) as y:
        assert not np.array_equal(y, first[0])
    after_report, elsewhere, back = (start_of(coordinates, x) for x in (u, other, u))
    assert not np.array_equal(elsewhere[0], first[0])
    for found in (again, after_report, back):
        assert all(np.array_equal(a, b) for a, b in zip(found, first, strict=True))
    y = coordinates.start(u)
    y[:] = np.nan  # as an integration writes into its state
    assert np.array_equal(coordinates.start(u), first[0])


def test_evaluations_at_a_state_know_the_states_of_elements():
    """Springs with dampers in series, of which one stretches already: rates as of standard."""
    rates = []
    for method in ("joint", "standard"):
        model = CompiledModel(state_types.stated(), method=method)
        assert model.evaluator.method == method
        rates.append(model.evaluator.state_rates(0.0, model.model.u0))
    assert rates[0] == pytest.approx(rates[1], rel=1e-14)


def test_bodies_are_placed_in_an_array_with_room_for_states_of_elements():
    """Compiled code writes the states behind the bodies, beyond an array that is too short."""
    evaluator = CompiledModel(state_types.stated(), method="joint").evaluator
    y = evaluator.coordinates.start(evaluator.model.u0)
    place = evaluator.coordinates.placer(y)
    place()
    _, placed, _ = getattr(place, "arguments", None) or place.args
    assert np.array_equal(placed, evaluator.body_state(y))


@pytest.mark.every(4)
@pytest.mark.parametrize("ends", [("a", "b"), ("b", "a")])
def test_a_weld_of_free_bodies_joins_them_either_way(ends):
    """Two spinning bodies as one: the far one is carried along."""
    scene = dap.Scene(name="welded")
    scene.add_body("a", mass=1.0, Jp=(0.1, 0.2, 0.3), w=(0.0, 0.0, 2.0))
    scene.add_body("b", mass=1.0, Jp=(0.1, 0.2, 0.3), r=(1.0, 0.0, 0.0), r_dot=(0.0, 2.0, 0.0),
                   w=(0.0, 0.0, 2.0))  # fmt: skip
    scene.add_joint("weld", "J", body_i=ends[0], body_j=ends[1])
    result = dap.simulate(scene, method="joint", t_end=1.0, dt=0.5, rtol=1e-10)
    c, s = np.cos(2.0 * result.t), np.sin(2.0 * result.t)
    middle = np.stack([0.5 + 0.0 * c, result.t, 0.0 * c], axis=1)
    arm = 0.5 * np.stack([c, s, 0.0 * c], axis=1)
    np.testing.assert_allclose(result.r[:, 1], middle + arm, rtol=0, atol=1e-8)
    np.testing.assert_allclose(result.r[:, 0], middle - arm, rtol=0, atol=1e-8)


def test_the_cost_is_known_without_a_run_by_method_joint():
    """A third of that of standard for chains; a ladder on two chains costs more than there."""
    chain, net = (
        CompiledModel(scene, method="standard")
        for scene in (trees.mixed_chain(20), ladder(12))
    )  # fmt: skip
    assert 0.2 < module.cost_over_standard(chain.model, chain.evaluator.plan) < 0.6
    assert module.cost_over_standard(net.model, net.evaluator.plan) > 1.2


#: Fields of joints of a plate, as body i, on ground.
JOINTS = {
    "rev": {"a_i": "plate.y", "a_j": "ground.y"},
    "cyl": {"a_i": "plate.y", "a_j": "ground.y"},
    "planar": {"a_i": "plate.y", "a_j": "ground.y"},
    "tran": {"a_j": "ground.y"},
    "univ": {"a_i": "plate.x", "n_j": "ground.y"},
}


def on_ground(type_, *, is_reversed):
    """A plate on ground; reversed, the plate is body j."""
    scene = dap.Scene(name="plate")
    scene.add_body("plate", mass=3.0, Jp=(0.1, 0.2, 0.3))
    fields = {"P_i": "plate.O", "P_j": "ground.O", **JOINTS[type_]}
    if is_reversed:
        other = {"plate": "ground", "ground": "plate"}
        parts = {field: value.split(".") for field, value in fields.items()}
        fields = {field: f"{other[body]}.{what}" for field, (body, what) in parts.items()}
    scene.add_joint(type_, "joint", **fields)
    return scene


@pytest.mark.parametrize("is_reversed", [False, True])
@pytest.mark.parametrize("type_", JOINTS)
def test_rates_are_those_of_the_velocities_of_bodies_in_every_pose(type_, is_reversed):
    """Velocities that jump by nothing leave rates as they are, where joints have moved on."""
    compiled = CompiledModel(on_ground(type_, is_reversed=is_reversed), method="joint")
    coordinates = compiled.evaluator.coordinates
    y = coordinates.start(compiled.model.u0)
    layout = coordinates.nodes.layout
    for name in ("angles", "lengths"):
        y[layout[name]] += 0.4 + 0.3 * np.arange(layout.length(name))
    for name in ("angle_rates", "length_rates"):
        y[layout[name]] = 0.7 - 0.5 * np.arange(layout.length(name))
    jumped = coordinates.with_jump(y, np.zeros(6), compiled.evaluator.states, 0.0)
    np.testing.assert_allclose(jumped, y, atol=1e-14)


@pytest.mark.parametrize("is_reversed", [False, True])
def test_a_plate_in_a_plane_is_hit_as_by_other_methods(is_reversed):
    scene = on_ground("planar", is_reversed=is_reversed)
    scene.bodies["plate"].w = (0.0, 3.0, 0.0)
    scene.bodies["plate"].r_dot = (0.3, 0.0, 0.1)
    scene.add_body("ball", mass=0.5, Jp=(0.002, 0.002, 0.002), r=(0.3, 0.02, 0.2),
                   r_dot=(0.1, 0.1, -2.0))  # fmt: skip
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.06, P_j="plate.O",
                      a_j="plate.z", e=0.5, mu=0.3)  # fmt: skip
    ways = [dap.simulate(scene, t_end=0.3, dt=0.3, method=m, rtol=1e-10, atol=1e-12)
            for m in ("lsq", "joint")]  # fmt: skip
    assert ways[1].ledger["energy"].ok
    assert ways[0].events
    np.testing.assert_allclose(ways[1].u[-1], ways[0].u[-1], atol=1e-8)
