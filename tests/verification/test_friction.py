"""Friction in joints that fades below v_tol: closed forms, energy, and its limits.
Tolerances: the multipliers settle to 1e-10 of their size; rtol 1e-9 over a second leaves less than
1e-8."""

from inspect import signature

import numpy as np
import pytest
from verification.test_sticking_under_load import incline, leaning_disk, wheel

import dap3d_core as dap
from dap3d_joints.coulomb import fading

G = 9.81
SLOPE = np.radians(30.0)
METHODS = ["standard", "lsq"]


@pytest.mark.parametrize("method", METHODS)
@pytest.mark.parametrize("mu", [0.0, 0.2, 0.5])
def test_a_block_slides_down_an_incline(method, mu):
    """a = g (sin - mu cos), 3.205858158 m/s^2 for mu 0.2, once tanh(v / v_tol) = 1."""
    result = dap.simulate(incline(SLOPE, mu, v_tol=1e-3), t_end=1.0, dt=0.5, method=method)
    wanted = G * (np.sin(SLOPE) - mu * np.cos(SLOPE))
    assert np.linalg.norm(result.rdd[-1, 0]) == pytest.approx(wanted, rel=1e-9)
    assert np.linalg.norm(result.Lam[-1, 3:]) == pytest.approx(2.0 * G * np.cos(SLOPE), rel=1e-9)


def test_a_block_that_should_stick_creeps():
    """Where mu > tan(30 deg) the block ends at the speed at which friction carries it."""
    mu, v_tol = 0.8, 1e-3
    result = dap.simulate(incline(SLOPE, mu, v_tol=v_tol), t_end=0.1, dt=0.05, rtol=1e-6)
    creep = v_tol * np.arctanh(np.tan(SLOPE) / mu)
    assert np.linalg.norm(result.rd[-1, 0]) == pytest.approx(creep, rel=1e-6)


def test_a_loaded_pin_stops_its_wheel():
    """rev: a balanced wheel, load m g on a pin of radius r: w' = -mu r m g / J until it rests."""
    scene, moment, J = wheel(spin=20.0)
    scene.forces["rub"].fields["v_tol"] = 1e-3
    result = dap.simulate(scene, t_end=2.0, dt=1.0)
    wanted = 20.0 - moment / J * result.t
    assert result.w[:, 0, 1] == pytest.approx(wanted, rel=1e-9)
    assert result.ledger["energy"].ok


def test_a_sliding_disk_is_braked_by_the_ground():
    """disk z: a disk upright and not turning, sliding sideways: a = -mu g; its load is m g."""
    mu, radius, mass = 0.2, 0.5, 3.0
    scene = dap.Scene(name="sliding disk")
    scene.add_body("disk", mass=mass, Jp=(1e3, 1e3, 1e3), r=(0.0, 0.0, radius),
                   r_dot=(2.0, 0.0, 0.0))  # fmt: skip
    scene.add_joint("disk", "contact", body_i="disk", slip="z", radius=radius)
    scene.add_force("weight")
    scene.add_force("friction", joint="contact", mu=mu, v_tol=1e-3)
    result = dap.simulate(scene, t_end=0.5, dt=0.5)
    # the rim also turns back: F R / J = 2e-3 of the acceleration's size is left out of neither side
    turn = mu * mass * G * radius / 1e3
    assert result.rd[-1, 0, 0] == pytest.approx(2.0 - mu * G * 0.5, rel=1e-9)
    assert result.w[-1, 0, 1] == pytest.approx(turn * 0.5, rel=1e-6)
    assert result.Lam[-1, 0] == pytest.approx(mass * G, rel=1e-9)


@pytest.mark.parametrize(("direction", "settles"), [(-1.0, True), (1.0, False)])
def test_multipliers_that_do_not_settle_are_reported(direction, settles):
    """Painleve's paradox: a light leaning disk slides towards its contact, at s = R (c, -sigma).
    Friction presses it down by mu sigma c R^2 / J for each newton of load, which carries
    1 / m + c^2 R^2 / J: above mu = 1.04 here no load is in balance. Sliding the other way is
    plain."""
    scene = leaning_disk(direction, mu=3.0, v_tol=1e-3)
    notes = " ".join(dap.simulate(scene, t_end=0.0).notes)
    assert ("did not settle" in notes) is not settles


def test_a_scene_without_friction_compiles_and_keeps_nothing_of_it():
    """No loop, no memory: the arrays are empty."""
    scene = incline(SLOPE, 0.0, v_tol=1e-3)
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
