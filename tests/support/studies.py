"""A small study, and what came of its points."""

import numpy as np

import dap3d_core as dap
from dap3d_core.study import Study, outputs_of

_random = np.random.default_rng(1)
#: Masses in kg and angular velocities in rad/s.
POINTS = np.column_stack([_random.uniform(0.5, 2.0, 200), _random.uniform(-2.0, 2.0, 200)])


#: Rest length and start of the spring below, m.
LENGTH, START = 1.0, 1.25


def spring(mass=1.0, k=4.0):
    """A block on a spring along x, without weight."""
    scene = dap.Scene(name="spring")
    scene.add_body("block", mass=mass, Jp=(1.0, 1.0, 1.0), r=(START, 0.0, 0.0))
    scene.add_force("ptp", "spring", P_i="block.O", P_j="ground.O", k=k, l0=LENGTH)
    return scene


def pendulum():
    """A bob on a hinge with a spring, whose stiffness sets the number of steps."""
    scene = dap.Scene(name="pendulum")
    scene.add_body("bob", mass=1.0, Jp=(0.01, 0.01, 0.01), r=(0.5, 0.0, 0.0))
    scene.add_point("end", "bob", (-0.5, 0.0, 0.0))
    scene.add_point("post", "ground", (1.0, 0.0, 1.0))
    scene.add_joint("rev", "hinge", P_i="end", P_j="ground.O", a_i="bob.y", a_j="ground.y")
    scene.add_force("weight", "gravity")
    scene.add_force("ptp", "spring", P_i="bob.O", P_j="post", k=10.0, l0=0.5)
    return scene


def bob(outputs=("bob.r.z:min", "bob.r.x:series", "energy.total:max"), **settings):
    """A pendulum of 0.5 m of which mass and angular velocity vary."""
    scene = dap.Scene(name="bob")
    scene.add_body("bob", mass=1.0, Jp=(0.01, 0.01, 0.01), r=(0.5, 0.0, 0.0))
    scene.add_point("end", "bob", (-0.5, 0.0, 0.0))
    scene.add_joint("rev", "hinge", P_i="end", P_j="ground.O", a_i="bob.y", a_j="ground.y")
    scene.add_force("weight")
    for name, value in ({"t_end": 0.5, "dt": 0.05} | settings).items():
        setattr(scene.simulation, name, value)
    return Study(scene, ("bodies.bob.mass", "bodies.bob.w.y"), outputs_of(outputs))


def collected(found):
    """Place -> status, note and outputs of a point; each comes once."""
    points = {}
    for places, batch in found:
        for k, place in enumerate(places):
            assert place not in points, f"point {place} came twice"
            values = {name: value[k] for name, value in batch.values.items()}
            points[int(place)] = int(batch.status[k]), batch.notes[k], values
    return points


def same(first, second):
    """Bit for bit."""
    assert first.keys() == second.keys()
    for place, (status, note, values) in first.items():
        assert second[place][:2] == (status, note), place
        assert values.keys() == second[place][2].keys()
        for name, value in values.items():
            assert np.array_equal(value, second[place][2][name], equal_nan=True), (place, name)
