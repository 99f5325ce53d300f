"""The shipped scenes hold the numbers of the reference simulators, assembled and complete."""

import tomllib

import ball1
import bodies2
import numpy as np
import pytest
from check_expected import BENCHMARKS, NAMES, folder_of, reference
from rigid import rotation

import dap3d_core as dap

#: Models that are a system of the generic simulator, too.
ALL = (*NAMES, *BENCHMARKS)
SYSTEMS = [name for name in ALL if name not in ("bodies2", "ball1")]
SLOTS = {
    **dict.fromkeys(("P_i", "P_j"), "points"),
    **dict.fromkeys(("a_i", "a_j"), "vectors"),
    "d": "vectors2",
    "function": "functions",
    "body": "bodies",
    "body_i": "bodies",
    "body_j": "bodies",
}
AXES = {axis: row.tolist() for axis, row in zip("xyz", np.eye(3), strict=True)}


def load(model):
    """The tables of a scene, with numbers in place of expressions of its parameters."""
    return tomllib.loads(dap.load(folder_of(model)).resolved().to_toml())


def offered(scene):
    """What every body has without a declaration: its origin and its axes."""
    return {f"{b}.{word}" for b in [*scene["bodies"], "ground"] for word in ("O", *AXES)}


def place(scene, name):
    body, _, origin = name.partition(".")
    point = {"body": body, "sPp": [0.0, 0.0, 0.0]} if origin else scene["points"][name]
    local = np.array(point["sPp"])
    if point["body"] == "ground":
        return local
    body = scene["bodies"][point["body"]]
    return np.array(body["r"]) + rotation(np.array(body.get("p", [1.0, 0.0, 0.0, 0.0]))) @ local


def direction(scene, name):
    body, _, axis = name.partition(".")
    vector = {"body": body, "sp": AXES[axis]} if axis else scene["vectors"][name]
    body = scene["bodies"].get(vector["body"], {})
    return rotation(np.array(body.get("p", [1.0, 0.0, 0.0, 0.0]))) @ np.array(vector["sp"])


@pytest.mark.parametrize("model", ALL)
def test_every_name_is_declared(model):
    scene = load(model)
    assert scene["scene"]["name"] == model
    assert scene["scene"]["schema"] == 1
    known = {table: set(scene.get(table, {})) for table in set(SLOTS.values())}
    known["bodies"].add("ground")
    for table in ("points", "vectors"):
        known[table] |= offered(scene)
    tables = ("points", "vectors", "vectors2", "joints", "forces")
    entries = [entry for table in tables for entry in scene.get(table, {}).values()]
    for entry in entries + scene.get("animation", {}).get("points", []):
        for key, table in SLOTS.items():
            assert entry.get(key) is None or entry[key] in known[table], (key, entry)


@pytest.mark.parametrize("model", SYSTEMS)
def test_bodies_are_those_of_the_reference(model):
    scene, system = load(model), reference(model).SYSTEM
    assert list(scene["bodies"]) == [body.name for body in system.bodies]
    for body in system.bodies:
        given = scene["bodies"][body.name]
        assert given["mass"] == body.mass
        assert np.array_equal(given["Jp"], body.Jp)
        assert tuple(given["r"]) == body.r
        assert tuple(given.get("p", (1.0, 0.0, 0.0, 0.0))) == body.p
        assert tuple(given.get("r_dot", (0.0, 0.0, 0.0))) == body.v
        # a product of matrices: rounding of numbers of 10, which depends on the processor
        assert given.get("w", (0.0, 0.0, 0.0)) == pytest.approx(body.w, rel=0.0, abs=1e-14)
    assert ("gravity" in scene["forces"]) == system.weight
    if system.weight:
        down = scene["forces"]["gravity"].get("wgt", [0.0, 0.0, -1.0])
        assert tuple(-x for x in down) == system.up
    given = [f for f in scene["forces"].values() if f["type"] == "ptp"]
    data = [(f["k"], f.get("c", 0.0), f["l0"]) for f in given]
    assert data == [(x.k, x.c, x.length) for x in system.springs]


@pytest.mark.parametrize("model", SYSTEMS)
def test_joints_are_those_of_the_reference_and_assembled(model):
    scene, system = load(model), reference(model).SYSTEM
    drivers = [system.driver.name] if system.driver else []
    assert sorted(scene["joints"]) == sorted([joint.name for joint in system.joints] + drivers)
    for name, joint in scene["joints"].items():
        if joint["type"] in ("sph", "rev"):
            apart = place(scene, joint["P_i"]) - place(scene, joint["P_j"])
            assert np.abs(apart).max() < 1e-12, name
        if joint["type"] in ("rev", "cyl"):
            axes = direction(scene, joint["a_i"]), direction(scene, joint["a_j"])
            assert axes[0] @ axes[1] == pytest.approx(1.0, rel=0, abs=1e-12), name
        if "d" in joint:
            ends = scene["vectors2"][joint["d"]]
            d = place(scene, ends["P_j"]) - place(scene, ends["P_i"])
        if joint["type"] in ("cyl", "tran"):
            aside = np.cross(d, direction(scene, joint["a_j"]))
            assert np.abs(aside).max() < 1e-12, name
        if joint["type"] == "sph-sph":
            assert np.linalg.norm(d) == pytest.approx(joint["length"], rel=0, abs=1e-12)


def test_bodies2_and_ball1_are_those_of_the_reference():
    scene = load("bodies2")
    for i, name in enumerate(bodies2.NAMES):
        body = scene["bodies"][name]
        assert (body["mass"], body["r"]) == (bodies2.MASS[i], bodies2.R0[i].tolist())
        assert body["Jp"] == np.diag(bodies2.JP[i]).tolist()
    for name, spring in (("d1", "spring1"), ("d2", "spring2")):
        ends = scene["vectors2"][name]
        d = place(scene, ends["P_j"]) - place(scene, ends["P_i"])
        assert np.linalg.norm(d) == scene["forces"][spring]["l0"]  # unstretched
        assert (scene["forces"][spring]["k"], scene["forces"][spring]["c"]) == (100.0, 2.0)
    scene = load("ball1")
    assert scene["bodies"]["ball"]["r"] == [0.0, 0.0, ball1.Z0]
    contact = scene["forces"]["contact"]
    given = (contact["R"], contact["k"], contact["c"], scene["bodies"]["ball"]["mass"])
    assert given == (ball1.RADIUS, ball1.K, ball1.DAMPING, ball1.MASS)
