"""Friction in joints that fades below v_tol: closed forms, energy, and its limits.
Tolerances: the multipliers settle to 1e-10 of their size; rtol 1e-9 over a second leaves less than
1e-8."""

from inspect import signature

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_joints.coulomb import fading

G = 9.81
SLOPE = np.radians(30.0)
METHODS = ["standard", "lsq"]


def incline(mu, v_tol=1e-3):
    """A block on a straight guide that falls at 30 degrees, from rest."""
    scene = dap.Scene(name="incline")
    scene.add_body("block", mass=2.0, Jp=(0.1, 0.2, 0.3))
    scene.add_vector("down", "ground", (np.cos(SLOPE), 0.0, -np.sin(SLOPE)))
    scene.add_joint("tran", "guide", P_i="block.O", P_j="ground.O", a_j="down")
    scene.add_force("weight", "gravity")
    scene.add_force("friction", "rub", joint="guide", mu=mu, v_tol=v_tol)
    return scene


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("mu", [0.0, 0.2, 0.5])
def test_a_block_slides_down_an_incline(method, mu):
    """a = g (sin - mu cos), 3.205858158 m/s^2 for mu 0.2, once tanh(v / v_tol) = 1."""
    result = dap.simulate(incline(mu), t_end=1.0, dt=0.5, method=method)
    wanted = G * (np.sin(SLOPE) - mu * np.cos(SLOPE))
    assert np.linalg.norm(result.rdd[-1, 0]) == pytest.approx(wanted, rel=1e-9)
    assert np.linalg.norm(result.Lam[-1, 3:]) == pytest.approx(2.0 * G * np.cos(SLOPE), rel=1e-9)


@pytest.mark.parametrize(("direction", "settles"), [(-1.0, True), (1.0, False)])
def test_multipliers_that_do_not_settle_are_reported(direction, settles):
    """Painleve's paradox: a light leaning disk slides towards its contact, at s = R (c, -sigma).
    Friction presses it down by mu sigma c R^2 / J for each newton of load, which carries
    1 / m + c^2 R^2 / J: above mu = 1.04 here no load is in balance. Sliding the other way is
    plain."""
    lean, radius, mass, J = np.pi / 4, 0.5, 1.0, 1e-2 / 2
    scene = dap.Scene(name="paradox")
    p = (np.cos(lean / 2), np.sin(lean / 2), 0.0, 0.0)  # the disk's axis to (0, 1, 1) / sqrt 2
    scene.add_body("disk", mass=mass, Jp=(J, J, J), p=p, r=(0.0, 0.0, radius * np.cos(lean)),
                   r_dot=(0.0, direction, 0.0))  # fmt: skip
    scene.add_joint("disk", "contact", body_i="disk", slip="z", radius=radius)
    scene.add_force("weight")
    scene.add_force("friction", joint="contact", mu=3.0, v_tol=1e-3)
    notes = " ".join(dap.simulate(scene, t_end=0.0).notes)
    assert ("did not settle" in notes) is not settles


def test_a_scene_without_friction_compiles_and_keeps_nothing_of_it():
    """No loop, no memory: the arrays are empty."""
    scene = incline(0.0)
    del scene.forces["rub"]
    system = dap.compile(scene).evaluator.system
    assert system.friction.size == 0
    assert "friction" not in {kind for kind, _ in dap.compile(scene).evaluator.loop_groups}


REGISTRY = dap.load_registry()
MU, V_TOL, RADIUS = 0.3, 1e-3, 0.2


def laws():
    """(name, type) of each standard joint, or variant of one, that has a friction."""
    found = {}
    for row in REGISTRY.listing():
        if row.kind == "joint" and row.state == "ok":
            type_info = REGISTRY.get("joint", row.keyword)
            for e in (type_info, *(variant for _, variant in type_info.variants)):
                if "friction" in e.kernels:
                    found[f"{row.keyword} {e.type.__name__}"] = e.type
    return found


LAWS = laws()
each = pytest.mark.parametrize("law", LAWS)


def test_the_joints_that_rub():
    """Of the joints that have one; the disk where it slips."""
    assert {name.split()[0] for name in LAWS} == {"sph", "rev", "cyl", "tran", "disk"}
    assert sum(name.startswith("disk") for name in LAWS) == 3


class State:
    """Two bodies in a joint, moving at random; all that a kernel may name."""

    def __init__(self, rng, speed=1.0):
        unit = rng.normal(size=3)
        self.r = {s: rng.normal(size=3) for s in "ij"}
        self.v = {s: speed * rng.normal(size=3) for s in "ij"}
        self.w = {s: speed * rng.normal(size=3) for s in "ij"}
        self.A = np.linalg.qr(rng.normal(size=(3, 3)))[0]
        self.lam = rng.normal(size=6)
        self.lam[0] = abs(self.lam[0])  # the ground under a disk pushes
        self.a_j = unit / np.linalg.norm(unit)
        self.s = {s: rng.normal(size=3) for s in "ij"}

    def named(self):
        found = {"mu": MU, "v_tol": V_TOL, "radius": RADIUS, "a_j": self.a_j}
        found["A_i"] = tuple(map(tuple, self.A))
        for s in "ij":
            found[f"r_{s}"], found[f"v_{s}"], found[f"w_{s}"] = self.r[s], self.v[s], self.w[s]
            found[f"s_P_{s}"], found[f"r_P_{s}"] = self.s[s], self.r[s] + self.s[s]
            found[f"v_P_{s}"] = self.v[s] + np.cross(self.w[s], self.s[s])
        found["d"] = found["r_P_j"] - found["r_P_i"]
        return found

    def wrench(self, law):
        """(force, moment) on each body."""
        friction, known = LAWS[law].friction, self.named()
        known["lam"] = self.lam[: LAWS[law].rows]
        return np.array(friction(*(known[n] for n in signature(friction).parameters)))

    def power(self, law):
        wrench = self.wrench(law)
        return sum(F @ self.v[s] + M @ self.w[s] for (F, M), s in zip(wrench, "ij", strict=False))


@each
def test_friction_never_drives(law):
    """The power of the wrench is negative or zero at any state, fast or within v_tol."""
    for seed in range(50):
        for speed in (1.0, 1e-3, 1e-6):
            assert State(np.random.default_rng(seed), speed).power(law) < 0.0


@each
def test_action_and_reaction(law):
    """Between two bodies force and moment about the origin sum to zero, to rounding of 1e1 N m."""
    state = State(np.random.default_rng(7))
    wrench = state.wrench(law)
    if len(wrench) == 2:
        assert wrench[:, 0].sum(axis=0) == pytest.approx(0.0, abs=1e-14)
        about = [M + np.cross(state.r[s], F) for (F, M), s in zip(wrench, "ij", strict=True)]
        assert np.sum(about, axis=0) == pytest.approx(0.0, abs=1e-14)


@each
def test_friction_at_rest_is_nothing_and_smooth(law):
    """At relative rest the wrench is zero, and so far below v_tol it is linear in the speed."""
    rest = State(np.random.default_rng(3), 0.0)
    assert np.all(rest.wrench(law) == 0.0)
    # tanh(x) = x (1 - x^2 / 3): with |x| < 1e-4 linear to 1e-8
    one, two = (State(np.random.default_rng(3), speed).wrench(law) for speed in (1e-9, 2e-9))
    assert two == pytest.approx(2.0 * one, rel=1e-7)
    assert np.max(np.abs(one)) > 0.0


def test_fast_sliding_gives_mu_times_the_load():
    """Far above v_tol: the force of cyl, tran and the disk, the moments of sph, rev and cyl."""
    state = State(np.random.default_rng(5))
    N = state.lam

    def force(law):
        return np.linalg.norm(state.wrench(law)[0, 0])

    def moment(law):
        F, M = state.wrench(law)[0]
        return np.linalg.norm(M - np.cross(state.s["i"], F))

    across = MU * np.hypot(N[2], N[3])
    assert force("cyl Cylindrical") == pytest.approx(across, rel=1e-12)
    assert moment("cyl Cylindrical") == pytest.approx(RADIUS * across, rel=1e-12)
    assert force("tran Translational") == pytest.approx(MU * np.hypot(N[3], N[4]), rel=1e-12)
    ball = MU * RADIUS * np.linalg.norm(N[:3])
    assert moment("rev Revolute") == pytest.approx(ball, rel=1e-12)
    assert moment("sph Spherical") == pytest.approx(ball, rel=1e-12)
    w = state.w["i"] - state.w["j"]
    assert state.wrench("sph Spherical")[0, 1] == pytest.approx(-ball * w / np.linalg.norm(w))
    for law in ("disk Sliding", "disk NoLateralSlip", "disk NoLongitudinalSlip"):
        assert force(law) == pytest.approx(MU * N[0], rel=1e-12)
        assert state.wrench(law)[0, 0][2] == 0.0  # along the ground


def test_a_ground_that_pulls_does_not_rub():
    """disk: no friction where lambda_z is negative, for there the disk would lift off."""
    state = State(np.random.default_rng(5))
    state.lam[0] = -2.0
    for law in LAWS:
        if law.startswith("disk"):
            assert np.all(state.wrench(law) == 0.0)


def test_the_disk_rubs_against_the_material_point():
    """A disk that rolls without slip feels no friction; one that spins on the spot is pushed on.
    For eta = y the contact is (0, 0, -R); v + w x s = 0 where v_x = w_y R."""
    state = State(np.random.default_rng(1))
    state.A, state.w["i"] = np.eye(3), np.array([0.0, 2.0, 0.0])
    state.v["i"] = np.array([2.0 * RADIUS, 0.0, 0.0])
    assert state.wrench("disk NoLateralSlip") == pytest.approx(0.0, abs=1e-12)
    state.v["i"] = np.zeros(3)
    force, moment = state.wrench("disk NoLateralSlip")[0]
    assert force == pytest.approx([MU * state.lam[0], 0.0, 0.0], abs=1e-12)
    assert moment == pytest.approx([0.0, -RADIUS * force[0], 0.0], abs=1e-12)


def test_fading_is_tanh_over_speed():
    """S(v / v_tol) / v; its limit at rest is 1 / v_tol, reached without a step."""
    for x in (1e-3, 0.5, 3.0, 40.0):
        assert fading(x * V_TOL, V_TOL) == pytest.approx(np.tanh(x) / x / V_TOL, rel=1e-15)
    assert fading(0.0, V_TOL) == 1.0 / V_TOL
    # 1 - x^2 / 3 is 1 to rounding on both sides of the branch at x = 1e-8
    assert fading(0.99e-8 * V_TOL, V_TOL) == pytest.approx(
        fading(1.01e-8 * V_TOL, V_TOL), rel=1e-15
    )
