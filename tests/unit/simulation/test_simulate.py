"""A run: settings, reporting times, progress, interruption, failure, and what is left behind."""

import re

import numpy as np
import pytest
from support import problems
from support.own_types import registry_of
from support.plain import long_in_plain_python

import dap3d_core as dap
from dap3d_core.interface import Body, Force, Function, body, number
from dap3d_core.kernels import scale, sqrt, where
from dap3d_core.simulation import report_times

ZERO = (0.0, 0.0, 0.0)
#: The module; its name in its package is taken by its function.


def mass_point(**fields):
    """One body of 1 kg that nothing holds."""
    scene = dap.Scene(name="point")
    scene.add_body("a", mass=1.0, Jp=(1.0, 1.0, 1.0), **fields)
    return scene


@pytest.fixture
def short_chunks(monkeypatch):
    """As many chunks as there are steps."""
    monkeypatch.setattr("dap3d_core.simulation.run.CHUNK_SECONDS", 1e-9)
    monkeypatch.setattr("dap3d_core.simulation.run.FIRST_CHUNK", 100)


def arrays_of(result):
    """Everything that is stored, as bytes."""
    stored = (result.t, result.u, result.v_dot, result.Lam, result.arrays.work)
    return [np.ascontiguousarray(a).tobytes() for a in (*stored, result.energy.potential)]


# ------------------------------------------------------------------ reporting times


@pytest.mark.parametrize(
    ("t_end", "dt", "times"),
    [
        (1.0, 0.25, [0.0, 0.25, 0.5, 0.75, 1.0]),
        (1.0, 0.3, [0.0, 0.3, 0.6, 0.9, 1.0]),
        (1.0, 1.0, [0.0, 1.0]),
        (0.3, 0.1, [0.0, 0.1, 0.2, 0.3]),
        (0.0, 0.1, [0.0]),
        (0.0, None, [0.0]),
    ],
)
def test_reporting_times_are_multiples_of_dt_and_the_end(t_end, dt, times):
    """Multiples to rounding, the last one exactly t_end, none twice."""
    found = report_times(t_end, dt)
    assert found == pytest.approx(np.array(times), abs=1e-15)
    assert found[-1] == t_end
    assert np.all(np.diff(found) > 0.0)


@pytest.mark.parametrize("dt", [0.1, 0.01, 0.001, 1 / 3, 0.07])
def test_rounding_of_dt_adds_no_instant(dt):
    """t_end made of n times dt, by product or by sum, gives n + 1 times."""
    for n in (1, 3, 7, 10, 1000):
        total = sum([dt] * n)
        assert len(report_times(n * dt, dt)) == len(report_times(total, dt)) == n + 1


def test_without_dt_a_hundred_intervals_are_reported():
    """t_end / 100 where nobody says otherwise."""
    assert report_times(7.0, None) == pytest.approx(np.linspace(0.0, 7.0, 101), rel=1e-15)


def test_a_run_needs_a_final_time():
    """Neither scene nor caller gives one: a SceneError with the remedy."""
    with pytest.raises(dap.SceneError, match=r"t_end.*final time") as caught:
        dap.simulate(mass_point())
    assert "--t-end" in str(caught.value)


def test_the_scene_gives_what_the_caller_leaves_out():
    """t_end, dt and tolerances of the scene are used; what the caller gives goes before them."""
    scene = problems.pendulum()
    scene.simulation.t_end, scene.simulation.dt = 0.2, 0.1
    scene.simulation.rtol, scene.simulation.integrator = 1e-5, "dopri5"
    result = dap.simulate(scene)
    assert result.t.tolist() == [0.0, 0.1, 0.2]
    assert (result.record.settings["rtol"], result.record.integrator) == (1e-5, "dopri5")
    result = dap.simulate(scene, t_end=0.1, dt=0.05, integrator="dop853")
    assert result.t.tolist() == [0.0, 0.05, 0.1]
    assert (result.record.settings["rtol"], result.record.integrator) == (1e-5, "dop853")


def test_no_time_to_pass_solves_once():
    """t_end = 0: one instant, with the accelerations and multipliers of the start, and no step."""
    result = dap.simulate(dap.load("pen2"), t_end=0.0)
    compiled = dap.compile(dap.load("pen2"))
    report = compiled.evaluator.report(0.0, compiled.model.u0)
    assert result.t.tolist() == [0.0]
    assert np.array_equal(result.u[0], compiled.model.u0)
    assert np.array_equal(result.v_dot[0], report[:12])
    assert np.array_equal(result.Lam[0], report[12:20])
    assert (result.status, result.stats.steps) == ("done", 0)


# ------------------------------------------------------------------ settings that make no sense


@pytest.mark.parametrize(
    ("settings", "keys"),
    [
        ({"t_end": -1.0}, ["t_end"]),
        ({"t_end": 1.0, "dt": 2.0}, ["dt"]),
        ({"t_end": 1.0, "dt": 1e-12}, ["dt"]),
        ({"t_end": 1.0, "integrator": "rk4"}, ["step"]),
        ({"t_end": 1.0, "step": 1e-20}, ["step"]),
        ({"t_end": -1.0, "rtol": 2.0, "step": -1.0}, ["t_end", "rtol", "step"]),
    ],
    ids=str,
)
def test_settings_that_make_no_sense_are_all_named(settings, keys):
    """A SceneError with every setting that is wrong, before anything is computed."""
    with pytest.raises(dap.SceneError) as caught:
        dap.simulate(problems.pendulum(), **settings)
    assert [mistake.key for mistake in caught.value.mistakes] == keys


def test_methods_that_do_not_fit_are_refused():
    """unconstrained for a scene with joints; what is not there yet; another one than was compiled
    for. None of them is quietly replaced."""
    scene = problems.pendulum()
    with pytest.raises(
        dap.SimulationError, match=r"does not fit: the scene has joints; use standard"
    ):
        dap.simulate(scene, t_end=1.0, method="unconstrained")
    free = dap.compile(mass_point())
    compiled = dap.compile(scene)
    with pytest.raises(dap.SimulationError, match="does not fit"):
        dap.simulate(compiled, t_end=1.0, method="unconstrained")
    assert dap.simulate(compiled, t_end=0.0, method="standard").method == "standard"
    assert dap.simulate(compiled, t_end=0.0, method="auto").method == "standard"
    assert dap.simulate(free, t_end=0.0, method="auto").method == "unconstrained"


def test_the_method_and_its_reason_are_noted():
    """What was chosen, and why, stands in the result."""
    for scene, method, words in [
        (problems.pendulum(), "auto", "method standard: the scene has joints"),
        (mass_point(), "auto", "method unconstrained: the scene has no joints"),
        (mass_point(), "standard", "method unconstrained: asked for standard, but the scene"),
    ]:
        notes = dap.simulate(scene, t_end=0.0, method=method).notes
        (note,) = (note for note in notes if words in note)
        assert note.is_warning == (method != "auto")  # another one than was asked for


# ------------------------------------------------------------------ equal runs


@long_in_plain_python
@pytest.mark.parametrize("model", ["pen2", "bodies2"])
def test_equal_runs_give_equal_arrays(model):
    """Bit for bit: compiled once, compiled anew, with and without progress."""
    compiled = dap.compile(dap.load(model))
    wanted = arrays_of(dap.simulate(compiled, t_end=0.3, dt=0.01))
    assert arrays_of(dap.simulate(compiled, t_end=0.3, dt=0.01)) == wanted
    seen = []
    again = dap.simulate(dap.load(model), t_end=0.3, dt=0.01, progress=lambda *a: seen.append(a))
    assert arrays_of(again) == wanted
    assert seen


# ------------------------------------------------------------------ progress and interruption


def test_progress_sees_time_pass(short_chunks):
    """Called with times that do not fall, up to t_end, and with t_end each time."""
    seen = []
    dap.simulate(problems.pendulum(), t_end=0.5, progress=lambda t, end: seen.append((t, end)))
    times, ends = np.array(seen).T
    assert np.all(np.diff(times) >= 0.0)
    assert times[-1] == 0.5
    assert set(ends) == {0.5}
    assert len(times) > 3


class Enough(Exception):
    """What a caller's progress raises."""


@pytest.mark.parametrize(
    ("error", "status"), [(Enough, "stopped"), (KeyboardInterrupt, "interrupted")]
)
def test_what_progress_raises_comes_out_with_what_was_computed(error, status, short_chunks):
    """The exception is the caller's own; its ``result`` holds the rows until then, and they are
    those of the whole run bit for bit."""

    def progress(t, t_end):
        if t > 0.4:
            raise error("that will do")

    compiled = dap.compile(problems.pendulum())
    with pytest.raises(error, match="that will do") as caught:
        dap.simulate(compiled, t_end=2.0, dt=0.01, progress=progress)
    part, whole = caught.value.result, dap.simulate(compiled, t_end=2.0, dt=0.01)
    assert part.status == status
    assert 0.39 < part.t[-1] < 2.0
    assert np.array_equal(part.u, whole.u[: len(part.t)])
    assert part.ledger["energy"].ok


# ------------------------------------------------------------------ numbers that are not finite


class Failing(Force):
    """A constant force of 1 N that has no value from t_last on."""

    keyword = "failing"
    body_i: Body = body()
    t_last: float = number()

    def wrench(t, t_last):
        return (where(t < t_last, 1.0, sqrt(-t)), 0.0, 0.0), ZERO


class Push(Force):
    """A force that has no value up to t_first."""

    keyword = "push"
    body_i: Body = body()
    t_first: float = number()

    def wrench(t, t_first):
        return (sqrt(t - t_first), 0.0, 0.0), ZERO


class Odd(Force):
    """Its energy has no value from t_last on; its force always has."""

    keyword = "odd"
    body_i: Body = body()
    t_last: float = number()

    def wrench(mass_i):
        return (mass_i, 0.0, 0.0), ZERO

    def energy(t, t_last):
        return where(t < t_last, t, sqrt(-t))


class Runaway(Force):
    """x'' = 1 + x'^2: the velocity is tan t, infinite at pi / 2."""

    keyword = "runaway"
    body_i: Body = body()

    def wrench(v_i, mass_i):
        return scale(mass_i * (1.0 + v_i[0] * v_i[0]), (1.0, 0.0, 0.0)), ZERO


class Cliff(Function):
    """f = -2 sqrt(x_end - x): its slope is infinite at x_end, and there is nothing beyond."""

    keyword = "cliff"
    x_end: float = number()

    def value(x, x_end):
        y = sqrt(x_end - x)
        return -2.0 * y, 1.0 / y, 0.5 / y**3, 0.75 / y**5


REGISTRY = registry_of(Failing, Push, Odd, Runaway, Cliff)


def stopped(scene, **settings):
    """The error with which a run of two seconds stops."""
    compiled = dap.compile(scene, registry=REGISTRY)
    with pytest.raises(dap.SimulationError) as caught:
        dap.simulate(compiled, **{"t_end": 2.0, "dt": 0.1} | settings)
    return caught.value


@pytest.mark.parametrize(
    "settings",
    [
        {"integrator": "dop853"},
        {"integrator": "dopri5", "rtol": 1e-5},
        {"integrator": "rk4", "step": 0.01},
        {"integrator": "dop853", "step": 0.02, "project": False},
    ],
    ids=["dop853", "dopri5", "rk4", "fixed"],
)
def test_a_force_that_is_nan_after_a_second_stops_the_run_there(settings):
    """The error names force, type and time; its result holds every instant before that second, all
    finite and right (r = F t^2 / 2m, which all methods integrate exactly, to rounding)."""
    scene = mass_point()
    scene.add_force("failing", "engine", body_i="a", t_last=1.0)
    error = stopped(scene, **{"dt": 0.05} | settings)
    words, result = str(error), error.result
    assert "not a number" in words
    assert "force engine (type failing) is not finite" in words
    assert result.status == "stopped"
    assert words in result.notes
    assert 0.9 <= result.t[-1] < 1.0
    assert result.t == pytest.approx(0.05 * np.arange(len(result.t)), abs=1e-15)
    assert all(np.all(np.isfinite(a)) for a in (result.u, result.v_dot, result.arrays.work))
    assert result.r[:, 0, 0] == pytest.approx(0.5 * result.t**2, abs=1e-14)


@pytest.mark.parametrize(
    ("type_", "fields", "words", "t_last"),
    [
        ("push", {"t_first": 0.3}, r"(?s)stopped at t = 0 s.*force f \(type push\) is not", None),
        # the motion goes on without it; the run ends at the first instant that would show a NaN
        ("odd", {"t_last": 1.05}, r"the energy of force f \(type odd\) is not finite", 1.0),
    ],
)
def test_a_force_without_a_value_at_the_start_and_an_energy_later(type_, fields, words, t_last):
    """What was computed is kept, if anything was, and the force named."""
    scene = mass_point()
    scene.add_force(type_, "f", body_i="a", **fields)
    error = stopped(scene)
    assert re.search(words, str(error))
    if t_last is None:
        assert error.result is None
    else:
        assert error.result.t[-1] == pytest.approx(t_last)
        assert np.all(np.isfinite(error.result.energy.potential))


# ------------------------------------------------------------------ constraints and energy


@pytest.mark.parametrize(
    ("model", "wanted"),
    [("pen1", True), ("pen2", True), ("bodies2", False), ("fourbar3", False),
     ("A05", False), ("A04", True), ("A03", False)],
)  # fmt: skip
def test_what_can_do_work_is_known(model, wanted):
    """Dampers (bodies2, A05), a driver (fourbar3) and a torque (A03) can do work; pendulums, one
    with a spinning wheel, and a linkage under gravity keep their energy."""
    assert dap.compile(model, allow_code=True).is_conservative is wanted


# ------------------------------------------------------------------ a compiled model


def test_a_compiled_model_says_what_it_is():
    """explain() counts bodies, joints and rows, names method and kernels, and what was left out."""
    text = dap.compile(dap.load("fourbar3")).explain()
    for words in [
        "3: crank, coupler, follower; 39 states, 18 accelerations",
        "2 rev, 2 sph, 1 rel-rot",
        "17 rows, all independent; 1 degree of freedom",
        "method     standard, because the scene has joints",
        "method joint would take some 0.6",
        "rev (acceleration)",
        "weight: no force of this type, so there is no gravity",
    ]:
        assert words in text
    text = dap.compile(mass_point()).explain()
    for words in ["joints     none", "constraints: the scene has none", "unconstrained"]:
        assert words in text


def test_a_run_that_blows_up_within_a_step_names_the_joint_that_did_it():
    """All is finite at the last state of a link that is drawn through its other end."""
    scene = dap.Scene(name="link through its own point")
    scene.add_body("idle", mass=1.0, Jp=(1.0, 1.0, 1.0))
    scene.add_body("bob", mass=1.0, Jp=(1.0, 1.0, 1.0), r=(0.5, 0.0, 0.0), r_dot=(-1.0, 0.0, 0.0))
    scene.add_joint("sph-sph", P_i="bob.O", P_j="ground.O", length=0.25)
    with pytest.raises(dap.SimulationError, match=r"joint sph-sph1 .*is beyond 1e\+100"):
        dap.simulate(
            scene, t_end=2.0, integrator="rk4", step=0.01, correct=False, project=False
        )  # assembled and projected, the link would be as long as it is


def test_a_step_of_contacts_that_are_not_stepped_is_named():
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 0.1))
    given = {"t_end": 0.01, "dt": 0.01, "contact_step": 1e-3}
    assert (
        "contact_step 0.001 left out: the scene has no contacts"
        in dap.simulate(scene, **given).notes
    )
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1)
    notes = dap.simulate(scene, **given).notes
    assert "contact_step 0.001 left out: contacts are followed by events" in notes


@pytest.mark.parametrize(
    ("asked", "words"),
    [
        ({"integrator": "radau"}, ["integrator radau left out"]),
        ({"integrator": "dop853"}, ["integrator dop853 left out"]),
        ({"step": 2e-3}, ["step 0.002 left out"]),
        ({"atol": 1e-6, "rtol": 1e-7}, ["rtol 1e-07 is the part", "atol 1e-06 left out"]),
        ({"integrator": "adams", "atol": {"r": 1e-6}}, ["adams, atol {'r': 1e-06} left out"]),
        ({"integrator": "moreau", "step": 2e-3}, []),
        ({}, []),
    ],
)
@pytest.mark.parametrize("in_scene", [True, False])
def test_settings_that_stepping_of_contacts_leaves_out_are_named(asked, words, in_scene):
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=1.0, Jp=(0.1, 0.1, 0.1), r=(0.0, 0.0, 0.1))
    scene.add_shape("sphere", body="ball", radius=0.1, collides=True)
    scene.add_shape("plane", body="ground", collides=True)
    if in_scene:
        for name, value in asked.items():
            setattr(scene.simulation, name, value)
    result = dap.simulate(scene, t_end=0.01, dt=0.01, **({} if in_scene else asked))
    found = [note for note in result.notes if "left out" in note or "largest impulse to" in note]
    if in_scene and asked.get("integrator") == "dop853":
        words = []  # that of every scene which names none
    assert len(found) == len(words)
    assert all(word in note for word, note in zip(words, found, strict=True))
