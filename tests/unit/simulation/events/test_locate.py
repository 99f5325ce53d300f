"""Events of a script: what they find, what they do, what they refuse. Closed forms of free flight.

Where no other reason is given a tolerance of 1e-13 is some roundings of time.
"""

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.result import UnknownNameError

G = 9.81


@pytest.fixture(scope="module")
def compiled():
    """A stone in flight, tied to ground by a spring without stiffness."""
    scene = dap.Scene(name="flight")
    scene.add_body("stone", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(0.0, 0.0, 2.0), r_dot=(1.0, 0.0, 0.0))
    scene.add_force("weight", "gravity", gravity=G)
    scene.add_force("ptp", "spring", P_i="stone.O", P_j="ground.O", k=0.0, l0=1.0)
    return dap.compile(scene)


def fall(height):
    """When the stone has fallen to a height."""
    return np.sqrt(2.0 * (2.0 - height) / G)


@pytest.mark.parametrize(
    "settings", [{}, {"integrator": "dopri5"}, {"integrator": "rk4", "step": 0.03}]
)
def test_a_run_is_stopped_where_a_quantity_passes_a_level(compiled, settings):
    event = dap.Event("stone.r.z", below=0.5, action="stop")
    result = dap.simulate(compiled, t_end=2.0, dt=0.1, events=[event], **settings)
    assert result.status == "stopped"
    assert result.t[-1] == pytest.approx(fall(0.5), abs=1e-13)
    assert result.r[-1, 0, 2] == pytest.approx(0.5, abs=1e-14)
    assert list(result.t[:-1]) == [pytest.approx(0.1 * k) for k in range(6)]
    (found,) = result.events
    assert (found.name, found.kind, found.direction) == ("stone.r.z below 0.5", "stop", -1)
    assert found.u == tuple(result.u[-1])
    assert "stone.r.z below 0.5" in result.notes[-1]


@pytest.mark.slow
def test_what_is_too_fast_to_be_followed_is_noted(compiled):
    """It nears its level ever faster; a jump that stays on one side is followed, and is cheap."""
    calls = []

    def chirp(t, state):
        return 1.5 + np.sin(1e6 * t * t)

    def jump(t, state):
        calls.append(t)
        return 1.0 if t < 0.37 else 0.5

    result = dap.simulate(compiled, t_end=1.0, events=[dap.Event(chirp, name="chirp")])
    (note,) = [n for n in result.notes if "too fast" in n]
    assert note.startswith("event chirp: from t = 0.0")
    result = dap.simulate(compiled, t_end=1.0, events=[dap.Event(jump)])
    assert not any("too fast" in n for n in result.notes)
    assert len(calls) < 1000


def test_an_event_changes_a_force_for_this_run_alone(compiled):
    """A stiff spring is switched on at x = 0.4: energy then says how much it did."""

    def tie(state):
        assert state["stone.r.x"] == pytest.approx(0.4)
        state.set("spring", k=50.0, l0=0.5)

    event = dap.Event("stone.r.x", above=0.4, action=tie)
    free = dap.simulate(compiled, t_end=1.0, dt=0.1)
    tied = dap.simulate(compiled, t_end=1.0, dt=0.1, events=[event], rtol=1e-11, atol=1e-13)
    assert tied.u[:4] == pytest.approx(free.u[:4], abs=1e-12)
    assert dict(tied.events[0].changes) == {"spring": {"k": 50.0, "l0": 0.5}}
    u = np.array(tied.events[0].u)

    def energy(r, v):
        return 0.5 * v @ v + G * r[2] + 25.0 * (np.linalg.norm(r) - 0.5) ** 2

    start = energy(u[:3], u[7:10])
    for k in range(5, 11):
        assert energy(tied.r[k, 0], tied.rd[k, 0]) == pytest.approx(start, abs=1e-9)
    assert "total energy" not in tied.ledger  # it has a jump
    assert tied.ledger["energy"].ok
    with pytest.raises(OSError, match="changed numbers of force 'spring'"):
        tied.force("spring")
    np.testing.assert_array_equal(dap.simulate(compiled, t_end=1.0, dt=0.1).u, free.u)


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (lambda s: s.set("sprin", k=1.0), "did you mean 'spring'"),
        (lambda s: s.set("spring", kk=1.0), "did you mean 'k'"),
        (lambda s: s.set("spring", P_i=1.0), "no numbers under the name 'P_i'"),
        (lambda s: s.set("spring", k="much"), "k should be a number"),
        (lambda s: s.set("gravity", wgt=(1.0, 2.0)), "a list of 3 numbers; it has 2"),
    ],
)
def test_changes_that_cannot_be_made(compiled, change, words):
    with pytest.raises(ValueError, match=words):
        dap.simulate(compiled, t_end=1.0, events=[dap.Event("t", at=0.5, action=change)])


def test_events_that_make_no_sense(compiled):
    for given, words in (
        ({"below": 1.0, "above": 2.0}, "one level"),
        ({"below": 1.0, "direction": 1}, "direction of its own"),
        ({"direction": 2}, "should be -1, 0 or 1"),
        ({"action": "halt"}, "'stop', 'record' or a function"),
        ({"every": 0.0}, "positive number of seconds"),
        ({"above": np.nan}, "event"),
        ({"above": "1"}, "event"),
        ({"above": np.array([1.0])}, "event"),
        ({"at": True}, "event"),
    ):
        with pytest.raises((ValueError, TypeError), match=words):
            dap.Event("stone.r.z", **given)
    for of in (None, 3):
        with pytest.raises(TypeError, match="event"):
            dap.Event(of, above=1.0)
    with pytest.raises(UnknownNameError, match=r"stone\.r\.z"):
        dap.simulate(compiled, t_end=1.0, events=[dap.Event("stone.r.zz", below=1.0)])
    with pytest.raises(ValueError, match="one number"):
        dap.simulate(compiled, t_end=1.0, events=[dap.Event("stone.r", below=1.0)])


def test_a_file_keeps_the_events(compiled, tmp_path):
    events = [dap.Event("stone.r.z", below=1.5), dap.Event("t", at=0.7)]
    result = dap.simulate(compiled, t_end=1.0, events=events, output=tmp_path / "a.nc")
    assert dap.open(tmp_path / "a.nc").events == result.events
    assert len(result.events) == 2


def test_the_error_of_a_run_with_events_is_estimated_where_both_runs_report_alike(compiled):
    stop = dap.Event("stone.r.z", below=0.5, action="stop")
    result = dap.simulate(compiled, t_end=1.0, events=[stop], estimate_error=True)
    assert result.error.largest["r"] < 1e-9


@pytest.mark.parametrize("angle", ["roll", "yaw"])
def test_angles_that_step_by_a_turn_are_refused(compiled, angle):
    """They would pass every level at pi; pitch, which does not step, is found."""
    with pytest.raises(ValueError, match=rf"stone\.{angle} steps by a turn at pi"):
        dap.simulate(compiled, t_end=0.1, dt=0.1, events=[dap.Event(f"stone.{angle}", at=1.0)])
    watched = [dap.Event("stone.pitch", at=1.0)]
    assert not dap.simulate(compiled, t_end=0.1, dt=0.1, events=watched).events
