"""Functions of time that change more quickly than steps: none is gone over, all are noted."""

import numpy as np
import pytest
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.interface import PluginError
from dap3d_core.result import Note


def turntable(**function):
    """A body that a driver turns about z, and nothing else."""
    scene = dap.Scene(name="turntable")
    scene.add_body("table", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_function(name="f", **function)
    scene.add_joint("rel-rot", "motor", body_i="table", a_j="ground.z", function="f")
    return scene


def angle(result):
    """The angle about z at the end, rad; it grows against the driver's."""
    return -2.0 * np.arctan2(result.p[-1, 0, 3], result.p[-1, 0, 0])


#: A curve that is at rest but for a millisecond, as points of it.
BUMP = [0, 1, 2, 3, 3.9, 3.99, 3.999, 4, 4.0005, 4.001, 4.002, 4.01, 4.1, 5, 6, 7, 8, 9, 10]


@pytest.mark.parametrize(
    "integrator",
    ["dop853", *(pytest.param(n, marks=long_in_plain_python) for n in ("dopri5", "adams"))],
)
@pytest.mark.parametrize(
    "function",
    [
        dict(type="b", x_start=4.0, x_end=4.001),
        dict(type="step", x_start=4.0, x_end=4.001),
        dict(type="c", x_start=4.0, x_end=4.001, f_end=0.25, x_max=4.0005, f_max=1.0),
        dict(type="spline", x=BUMP, y=[float(x > 4.0) for x in BUMP]),
    ],
    ids=["b", "step", "c", "spline"],
)
def test_a_quick_change_in_a_long_rest_is_not_missed(integrator, function):
    """A turn within a millisecond of ten seconds: the driver is of the velocity level alone, so
    the angle at the end is that of the function only if steps have seen it.
    Tolerance: rtol of the largest rates, some 2e3 rad/s, for half a second."""
    compiled = dap.compile(turntable(**function))
    result = dap.simulate(compiled, t_end=10.0, dt=1.0, integrator=integrator,
                          rtol=1e-8, atol=1e-8)  # fmt: skip
    turned = compiled.evaluator.function_values(10.0)[0, 0]
    assert turned == pytest.approx(function.get("f_end", 1.0), abs=1e-12)
    assert angle(result) == pytest.approx(turned, abs=1e-5)
    assert any("aliasing" in note and not Note(note).is_warning for note in result.notes)


def test_events_are_found_beside_breaks():
    """The middle of a transition is half way, by symmetry; what follows is as without an event."""
    scene = turntable(type="b", x_start=4.0, x_end=4.001)
    half = dap.Event(lambda t, state: -2.0 * np.arctan2(state.u[6], state.u[3]) - 0.5, name="half")
    result = dap.simulate(scene, t_end=10.0, dt=1.0, events=[half])
    (event,) = result.events
    assert event.t == pytest.approx(4.0005, abs=1e-9)
    assert angle(result) == pytest.approx(1.0, abs=1e-6)
    np.testing.assert_allclose(result.t, np.arange(11.0), rtol=1e-15)


@pytest.mark.parametrize("step", [0.3, 0.25])
def test_fixed_steps_stay_on_their_grid(step):
    """With a transition longer than the steps; reports at all times, the last one at t_end."""
    scene = turntable(type="b", x_start=1.0, x_end=7.0)
    result = dap.simulate(scene, t_end=9.0, dt=1.0, integrator="rk4", step=step)
    np.testing.assert_allclose(result.t, np.arange(10.0), rtol=1e-15)
    assert angle(result) == pytest.approx(1.0, abs=1e-3)  # of order step^4 of the integral
    assert not any("steps of" in note for note in result.notes)


def test_what_fixed_steps_cannot_resolve_is_noted():
    scene = turntable(type="harmonic", frequency=1e3, amplitude=1e-3)
    result = dap.simulate(scene, t_end=0.1, integrator="rk4", step=0.01)
    (note,) = [n for n in result.notes if "functions.f" in n]
    assert "less than 4 steps of 0.01 s" in note
    assert "at most 0.00031 s" in note  # a twentieth of 2 pi / frequency
    assert Note(note).is_warning


@long_in_plain_python
def test_a_change_within_roundings_of_the_run_is_noted():
    result = dap.simulate(turntable(type="b", x_start=1.0, x_end=1.0 + 1e-10), t_end=10.0)
    (note,) = [n for n in result.notes if "functions.f" in n]
    assert "too little for the steps of a run of 10 s" in note
    assert Note(note).is_warning
    assert angle(result) == pytest.approx(1.0, abs=5e-6)  # eps / 1e-10, twice


@pytest.mark.parametrize("integrator", ["dop853", "adams"])
@pytest.mark.parametrize("rtol", [1e-6, pytest.param(1e-9, marks=long_in_plain_python)])
def test_what_happens_within_a_microsecond_leaves_no_rate_behind(integrator, rtol):
    """The driver's acceleration jumps by 6e12 rad/s^2; at its end the body stands still again.
    The last instant before it lets go is a rounding of time early: a rate of 5e-3 rad/s."""
    scene = turntable(type="step", x_start=5.0123, x_end=5.012301)
    result = dap.simulate(
        scene, t_end=10.0, integrator=integrator, rtol=rtol, atol=rtol / 100.0, estimate_error=True
    )
    assert result.status == "done"
    assert angle(result) == pytest.approx(1.0, abs=10.0 * rtol)
    assert abs(angle(result) - 1.0) <= 10.0 * np.max(result.error.p[-1]) + 1e-9


def test_slow_functions_are_not_spoken_of():
    for function in (
        dict(type="harmonic", frequency=2.0),
        dict(type="a", coeff=(1.0, 2.0, 3.0)),
        dict(type="b", x_start=1.0, x_end=3.0),
    ):
        result = dap.simulate(turntable(**function), t_end=4.0)
        assert not any("functions.f" in note for note in result.notes)


@pytest.mark.parametrize(
    ("fields", "breaks"),
    [
        (dict(type="b", x_start=1.0, x_end=2.0), [1.0, 2.0]),
        (dict(type="d", x_start=1.0, x_end=20.0), [1.0]),
        (dict(type="a", coeff=(0.0, 1.0, 0.0)), []),
        (dict(type="spline", x=[-1, 9], y=[0, 1]), [9.0]),
        (dict(type="spline", x=np.linspace(0, 20, 401), y=np.linspace(0, 1, 401)), []),
    ],
)
def test_breaks_within_the_run(fields, breaks):
    pace = dap.compile(turntable(**fields)).breakpoints(10.0)
    assert [t for t, anew in pace.stops if anew] == breaks


def test_a_smooth_spline_of_many_points_does_not_shorten_steps():
    """Of a table of a sine the ends alone are breaks: it bends everywhere."""
    x = np.linspace(-1.0, 11.0, 1201)
    scene = turntable(type="spline", x=x, y=np.sin(x))
    stops = dap.compile(scene).breakpoints(10.0).stops
    assert len(stops) <= 20, "near the zeros of the sine alone, where three points are in line"


OWN = """\
from dap3d_core.interface import Function, hookimpl
interface_version = 1
class Ramp(Function):
    "A ramp."
    keyword = "ramp"
    def breaks(self):
        return {breaks}
    def value(x):
        return x, 1.0, 0.0, 0.0
@hookimpl
def dap3d_functions():
    return [Ramp]
"""


@pytest.mark.parametrize(
    ("breaks", "words"), [("1 / 0", "ZeroDivisionError"), ("['soon']", "ValueError"), ("", "")]
)
def test_breaks_of_own_types(tmp_path, breaks, words):
    """One that fails is a fault of the type; none at all is none."""
    (tmp_path / "plugin.py").write_text(OWN.format(breaks=breaks or "()"))
    turntable(type="ramp").save(tmp_path / "scene.toml")
    compiled = dap.compile(tmp_path, allow_code=True)
    if words:
        with pytest.raises(PluginError, match=rf"plugin\.py.*Ramp\.breaks failed: {words}"):
            compiled.breakpoints(1.0)
    else:
        assert compiled.breakpoints(1.0).stops == []
