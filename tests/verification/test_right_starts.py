"""Starts that look singular and are not: mechanisms drawn straight, springs of no length."""

import itertools

import numpy as np
import pytest
from scipy.integrate import solve_ivp

import dap3d_core as dap


def straight(lengths, end, *, joint="sph", ends="rev", held=None, unit=1.0):
    """A chain of bars, drawn along x from the origin, whose last end belongs at (end, 0, 0)."""
    scene = dap.Scene(name="straight")
    at = 0.0
    names = [f"bar{k}" for k in range(len(lengths))]
    for name, length in zip(names, lengths, strict=True):
        half = 0.5 * length * unit
        inertia = (0.01 * unit**2, 0.1 * unit**2, 0.1 * unit**2)
        scene.add_body(name, mass=1.0, Jp=inertia, r=(at + half, 0.0, 0.0))
        scene.add_point(f"{name}_1", name, (-half, 0.0, 0.0))
        scene.add_point(f"{name}_2", name, (half, 0.0, 0.0))
        at += 2.0 * half
    scene.add_point("D", "ground", (end * unit, 0.0, 0.0))
    pairs = [("bar0_1", "ground.O", "bar0", "ground", ends)]
    pairs += [(f"{b}_1", f"{a}_2", b, a, joint) for a, b in itertools.pairwise(names)]
    pairs += [(f"{names[-1]}_2", "D", names[-1], "ground", ends)]
    for k, (P_i, P_j, i, j, kind) in enumerate(pairs):
        axes = dict(a_i=f"{i}.z", a_j=f"{j}.z") if kind == "rev" else {}
        scene.add_joint(kind, f"J{k}", P_i=P_i, P_j=P_j, **axes)
    if held:
        scene.simulation.hold = (held,)
    return scene


def ends_of(result, lengths):
    """(bars, 2, 3) both ends of each bar as it starts, from its Euler parameters."""
    ends = []
    for length, r, p in zip(lengths, result.r[0], result.p[0], strict=True):
        e0, e1, e2, e3 = p
        x = np.array([e0 * e0 + e1 * e1 - 0.5, e1 * e2 + e0 * e3, e1 * e3 - e0 * e2]) * 2.0
        ends.append((r - 0.5 * length * x, r + 0.5 * length * x))
    return np.array(ends)


CHAINS = [
    *(((1.0, 1.0, 1.0), end) for end in (2.0, 2.999, 2.5, 1.5, 1.0, 0.5, 2.999999)),
    ((0.4, 1.2, 0.7), 1.7),
    ((1.0, 1.0), 1.5),
    ((1.0, 0.6), 0.7),
    ((1.0, 1.0, 1.0, 1.0), 3.3),
    ((1.0, 1.0, 1.0, 1.0, 1.0), 4.0),
]


@pytest.mark.parametrize("joint", ["sph", "rev"])
@pytest.mark.parametrize(("lengths", "end"), CHAINS)
def test_a_chain_drawn_straight_is_assembled(lengths, end, joint):
    """Its bars lie end to end, from the origin to its pivot; a note says how they were turned.
    A residual of 1e-10 m closes a joint (simulation/initial/assemble.py)."""
    result = dap.simulate(straight(lengths, end, joint=joint), t_end=0.0, dt=0.1)
    ends = ends_of(result, lengths)
    np.testing.assert_allclose(ends[0, 0], 0.0, atol=2e-10)
    np.testing.assert_allclose(ends[-1, 1], [end, 0.0, 0.0], atol=2e-10)
    np.testing.assert_allclose(ends[1:, 0], ends[:-1, 1], atol=2e-10)
    assert np.all(np.abs(result.r[0, :, 2]) < 1e-9)  # hinges at both ends keep it in its plane
    notes = [note for note in result.notes if "singular pose" in note and "turned by" in note]
    assert len(notes) == 1
    assert "For another, draw them a little off" in notes[0]


@pytest.mark.parametrize("end", [2.0, 2.5, 2.99])
def test_a_spatial_chain_drawn_straight_is_assembled(end):
    """On ball joints it may leave the line in any direction: it takes one, always the same."""
    lengths = (1.0, 1.0, 1.0)
    scene = straight(lengths, end, ends="sph")
    first, second = (dap.simulate(scene, t_end=0.0, dt=0.1) for _ in range(2))
    ends = ends_of(first, lengths)
    np.testing.assert_allclose(ends[-1, 1], [end, 0.0, 0.0], atol=2e-10)
    np.testing.assert_allclose(ends[1:, 0], ends[:-1, 1], atol=2e-10)
    np.testing.assert_array_equal(first.u, second.u)


@pytest.mark.parametrize("unit", [1e-3, 1e3])
def test_a_chain_of_any_size_is_assembled(unit):
    lengths = (1.0, 1.0, 1.0)
    result = dap.simulate(straight(lengths, 2.5, unit=unit), t_end=0.0, dt=0.1)
    ends = ends_of(result, [unit * length for length in lengths])
    np.testing.assert_allclose(ends[-1, 1], [2.5 * unit, 0.0, 0.0], atol=2e-10 * max(1.0, unit))


def test_a_held_bar_stays_and_the_others_close_the_gap():
    """The first of three bars is held on the line: the other two are a dyad over 1.5 m, whose bars
    of 1 m lean by acos 0.75."""
    result = dap.simulate(straight((1.0, 1.0, 1.0), 2.5, held="bar0"), t_end=0.0, dt=0.1)
    np.testing.assert_allclose(result.r[0, 0], [0.5, 0.0, 0.0], atol=1e-12)
    cosine = 2.0 * result.p[0, 1, 0] ** 2 - 1.0
    assert cosine == pytest.approx(0.75, abs=1e-9)


def test_a_slider_crank_drawn_straight_is_assembled():
    """Crank 1 m, rod 2 m, slider on a guide along y through (2.5, 0): the triangle of its sides
    does not reach further than 3 m; the guide keeps its x."""
    scene = straight((1.0, 2.0), 2.5, joint="rev")
    del scene.joints["J2"]
    scene.add_body("slider", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(2.5, 0.0, 0.0))
    scene.add_joint("sph", "pin", P_i="bar1_2", P_j="slider.O")
    scene.add_joint("tran", "guide", P_i="slider.O", P_j="D", a_j="ground.y")
    result = dap.simulate(scene, t_end=0.0, dt=0.1)
    assert result.ledger["position"].value < 1e-9
    assert result.r[0, 2, 0] == pytest.approx(2.5, abs=1e-9)


def test_an_assembled_chain_runs_on():
    """Under its weight, in the plane, with its energy kept."""
    scene = straight((1.0, 1.0, 1.0), 2.5)
    scene.add_force("weight", "g", wgt=(0.0, -1.0, 0.0))
    result = dap.simulate(scene, t_end=1.0, dt=0.05)
    assert result.ledger["total energy"].ok
    assert result.ledger["position"].ok


@pytest.mark.parametrize("joint", ["sph", "rev"])
@pytest.mark.parametrize(
    ("lengths", "end"),
    [((1.0, 1.0, 1.0), 3.001), ((1.0, 1.0, 1.0), 3.5), ((0.4, 3.0, 0.7), 1.0), ((1.0, 1.0), 2.1)],
)
def test_bars_that_do_not_reach_are_refused(lengths, end, joint):
    with pytest.raises(dap.AssemblyError, match="do not reach their joints"):
        dap.simulate(straight(lengths, end, joint=joint), t_end=0.0, dt=0.1)


def test_a_chain_that_lies_straight_in_its_place_stays():
    result = dap.simulate(straight((1.0, 1.0, 1.0), 3.0), t_end=0.0, dt=0.1)
    np.testing.assert_array_equal(result.r[0, :, 1:], 0.0)
    assert not any("turned by" in note for note in result.notes)


def sprung(*, k=4.0, c=0.0, r=(0.0, 0.0, 0.0), v=(0.0, 0.5, 0.0), weight=False, **fields):
    """A body of 1 kg on a spring to the origin."""
    scene = dap.Scene(name="sprung")
    scene.add_body("m", mass=1.0, Jp=(1.0, 1.0, 1.0), r=r, r_dot=v)
    scene.add_force("ptp", "spring", P_i="m.O", P_j="ground.O", k=k, c=c, **fields)
    if weight:
        scene.add_force("weight", "g", gravity=9.81)
    return scene


def along(y):
    return np.stack([0.0 * y, y, 0.0 * y], axis=1)


def damped(t):
    """y'' + y' + 4 y = 0 from y = 0, y' = 0.5."""
    w = np.sqrt(3.75)
    return along(0.5 / w * np.exp(-0.5 * t) * np.sin(w * t))


def sagging(t):
    return -9.81 / 4.0 * (1.0 - np.cos(2.0 * t))


def across(t):
    """The damper acts along the line to the anchor, by SciPy's DOP853."""

    def rates(_, y):
        d, v = y[:2], y[2:]
        size = np.hypot(*d)
        u = d / size if size > 0.0 else v / np.hypot(*v)
        pull = 4.0 * d + (u @ v) * u
        return [*v, -pull[0], -pull[1] - 9.81]

    y = solve_ivp(
        rates, (0.0, t[-1]), [0.0, 0.0, 0.5, 0.0], "DOP853", t, rtol=1e-11, atol=1e-12
    ).y  # fmt: skip
    return np.stack([0.0 * t, y[0], y[1]], axis=1)


AT_ANCHOR = {
    "moving": ({}, lambda t: along(0.25 * np.sin(2.0 * t))),
    "damped": (dict(c=1.0), damped),
    "a damper alone": (dict(k=0.0, c=1.0), lambda t: along(0.5 * (1.0 - np.exp(-t)))),
    "at rest": (dict(v=(0.0, 0.0, 0.0)), lambda t: along(0.0 * t)),
    "let go": (
        dict(v=(0.0, 0.0, 0.0), weight=True),
        lambda t: np.stack([0.0 * t, 0.0 * t, sagging(t)], axis=1),
    ),
    "thrown": (
        dict(weight=True),
        lambda t: np.stack([0.0 * t, 0.25 * np.sin(2.0 * t), sagging(t)], axis=1),
    ),
    "thrown and damped": (dict(c=1.0, weight=True), across),
    "through it": (
        dict(r=(0.0, 0.3, 0.0), v=(0.0, 0.0, 0.0)),
        lambda t: along(0.3 * np.cos(2.0 * t)),
    ),
}


@pytest.mark.parametrize("integrator", ["dop853", "radau", "adams", "auto"])
@pytest.mark.parametrize("name", AT_ANCHOR)
def test_a_spring_without_natural_length_may_begin_at_its_anchor(name, integrator):
    """Its force is k d. Errors of some hundred steps at rtol 1e-8 of some metres."""
    fields, exact = AT_ANCHOR[name]
    result = dap.simulate(sprung(**fields), t_end=5.0, dt=0.05, integrator=integrator)
    np.testing.assert_allclose(result.r[:, 0], exact(result.t), atol=1e-7)
    assert result.ledger["energy"].ok
    spring = 0.5 * fields.get("k", 4.0) * np.sum(result.r[:, 0] ** 2, axis=1)
    weight = 9.81 * result.r[:, 0, 2] if fields.get("weight") else 0.0
    # both are of the same state: rounding of some ten J
    np.testing.assert_allclose(result.energy.potential, spring + weight, atol=1e-12)


def test_rate_tension_and_stiffness_at_the_anchor_are_those_beside_it():
    """Of the motion; at rest w = sqrt(k / m) = 2 rad/s in three directions."""
    result = dap.simulate(sprung(c=1.0), t_end=1.0, dt=0.1)
    assert result.quantity("spring.length_rate").values[0] == pytest.approx(0.5)
    assert result.quantity("spring.tension").values[0] == pytest.approx(0.5)  # c 0.5 m/s
    values = dap.linearize(sprung(v=(0.0, 0.0, 0.0))).eigenvalues
    assert np.sort(np.abs(values.imag))[-6:] == pytest.approx(2.0)


@pytest.mark.parametrize(
    "fields", [dict(l0=0.5), dict(f_a=1.0), dict(function="law"), dict(l0=0.5, f_a=1.0)]
)
def test_a_force_that_needs_a_direction_is_refused_at_its_anchor(fields):
    scene = sprung(**fields)
    scene.add_function("a", "law", coeff=[1.0, 4.0, 0.0])
    with pytest.raises(dap.SceneError, match=r"coincide at the start[\s\S]*without l0, f_a"):
        dap.simulate(scene, t_end=0.1)
