"""Fits of scenes to measured data: values, intervals, what cannot be known, what is refused."""

import numpy as np
import pytest
import xarray
from support.bouncing import bouncing
from support.plain import jit_is_on

import dap3d_core as dap
from dap3d_core.result.quantities.measured_data import MeasuredData

#: Each fit is some 30 runs, which take long where nothing is compiled.
compiled = pytest.mark.skipif(not jit_is_on(), reason="many runs without compilation")

K, M, C, REST, START = 40.0, 2.0, 0.8, 1.0, 1.3


def oscillator(**spring):
    """A mass on a spring and a damper along x, without any other force."""
    scene = dap.Scene(name="oscillator")
    scene.add_body("mass", mass=M, Jp=(0.1, 0.1, 0.1), r=(START, 0.0, 0.0))
    fields = {"k": K, "c": 0.0, "l0": REST} | spring
    scene.add_force("ptp", "spring", P_i="mass.O", P_j="ground.O", **fields)
    return scene


def swing(t, k=K, m=M, c=0.0):
    """x of the oscillator, in closed form."""
    decay = c / (2.0 * m)
    omega = np.sqrt(k / m - decay**2)
    wave = np.cos(omega * t) + decay / omega * np.sin(omega * t)
    return REST + (START - REST) * np.exp(-decay * t) * wave


def falling():
    scene = dap.Scene(name="falling")
    scene.add_body("stone", mass=1.0, Jp=(0.1, 0.1, 0.1))
    scene.add_force("weight", "gravity", gravity=9.0)
    return scene


FALL = {"bodies.stone.r.z": 0.5, "bodies.stone.r_dot.z": 1.0, "forces.gravity.gravity": 8.0}


@compiled
def test_bodies2_gives_back_stiffness_and_damping():
    """From noisy positions of both bodies; the truth lies within the intervals, which are small."""
    scene = dap.load("bodies2")
    true = dap.simulate(scene, t_end=2.0, dt=0.02)
    rng = np.random.default_rng(7)
    names = ("lower.r.z", "upper.r.x", "lower.r.y")
    data = {"t": true.t} | {
        name: true.quantity(name).values + 2e-3 * rng.standard_normal(len(true.t)) for name in names
    }
    given = {"forces.spring1.k": (80.0, 10.0, 300.0), "forces.spring2.c": 1.0}
    fit = dap.fit(scene, given, data)
    assert fit.status == "converged"
    for name, truth in (("forces.spring1.k", 100.0), ("forces.spring2.c", 2.0)):
        low, high = fit.interval[name]
        assert low < truth < high
        assert high - low < 0.03 * truth
        assert low < fit.values[name] < high
    assert fit.scene.forces["spring1"].fields["k"] == fit.values["forces.spring1.k"]
    assert scene.forces["spring1"].fields["k"] == 100.0
    assert fit.scene.simulation == scene.simulation
    assert fit.degrees == 3 * len(true.t) - 2
    residual = np.concatenate(list(fit.residuals.values()))
    assert 2.0 * fit.cost == pytest.approx(np.sum(residual**2), rel=1e-9)
    assert np.std(residual) == pytest.approx(2e-3, rel=0.1)  # 303 numbers: 4 % is one deviation
    assert "forces.spring1.k" in str(fit)
    assert "converged" in repr(fit)


@compiled
def test_exact_data_give_the_numbers_back():
    """To the tolerance of the integration, 1e-8, from a start that is some tenths away."""
    t = np.linspace(0.0, 3.0, 61)
    fit = dap.fit(
        oscillator(),
        {"forces.spring.k": 30.0, "forces.spring.c": 0.5},
        {"t": t, "mass.r.x": swing(t, c=C)},
    )
    assert fit.values["forces.spring.k"] == pytest.approx(K, rel=1e-7)
    assert fit.values["forces.spring.c"] == pytest.approx(C, rel=1e-6)
    assert fit.notes == ()
    assert np.abs(fit.residuals["mass.r.x"]).max() < 1e-8


@compiled
@pytest.mark.slow
def test_intervals_hold_the_truth_as_often_as_they_say():
    """30 data sets of 12 numbers: 95 % is 28.5, and 25 or more but once in 300 times.
    With so few numbers Student's t matters: normal quantiles would give 92.5 %."""
    t = np.linspace(0.2, 3.0, 12)
    scene, inside = oscillator(c=C), {"forces.spring.k": 0, "forces.spring.c": 0}
    for seed in range(30):
        noise = 0.02 * np.random.default_rng(seed).standard_normal(len(t))
        fit = dap.fit(scene, list(inside), {"t": t, "mass.r.x": swing(t, c=C) + noise})
        for name, truth in zip(inside, (K, C), strict=True):
            low, high = fit.interval[name]
            inside[name] += low < truth < high
    assert min(inside.values()) >= 25, inside
    assert sum(inside.values()) < 60, inside


def linear_fit(t, z, sigma=None):
    """Start, speed and gravity by linear least squares: values and covariance."""
    design = np.stack([np.ones_like(t), t, -(t**2) / 2.0], axis=1)
    weight = 1.0 if sigma is None else 1.0 / sigma
    values, *_ = np.linalg.lstsq(design * weight, z * weight, rcond=None)
    rest = (z - design @ values) * weight
    variance = rest @ rest / (len(t) - 3) if sigma is None else 1.0
    return values, np.linalg.inv(design.T @ design * weight**2) * variance, rest


@compiled
@pytest.mark.parametrize("sigma", [None, 0.02], ids=["unknown", "known"])
def test_free_fall_is_linear_least_squares(sigma):
    """Values, covariance, correlation, chi-square and intervals are those of the linear problem."""
    from scipy.stats import norm
    from scipy.stats import t as student

    t = np.linspace(0.0, 2.0, 21)
    noise = 0.01 * np.random.default_rng(3).standard_normal(len(t))
    z = 1.0 + 3.0 * t - 9.81 / 2.0 * t**2 + noise
    fit = dap.fit(falling(), FALL, {"t": t, "stone.r.z": z}, sigma=sigma)
    values, covariance, rest = linear_fit(t, z, sigma)
    assert list(fit.values) == list(FALL)
    assert list(fit.values.values()) == pytest.approx(values, rel=1e-7)
    # exact derivatives of runs whose error is none: parabolas
    assert fit.covariance == pytest.approx(covariance, rel=1e-7)
    deviation = np.sqrt(np.diag(covariance))
    assert fit.correlation == pytest.approx(covariance / np.outer(deviation, deviation), abs=1e-7)
    quantile = student.ppf(0.975, 18) if sigma is None else norm.ppf(0.975)
    for (low, high), value, s in zip(fit.interval.values(), values, deviation, strict=True):
        assert (low, high) == pytest.approx((value - quantile * s, value + quantile * s), rel=1e-7)
    assert fit.cost == pytest.approx(rest @ rest / 2.0, rel=1e-7)
    if sigma is None:
        assert fit.chi_square is None
    else:
        assert fit.chi_square == pytest.approx(rest @ rest / 18, rel=1e-7)
        assert "chi-square" in str(fit)


@pytest.mark.slow
@compiled
def test_stiffness_and_mass_of_an_oscillator_cannot_be_told_apart():
    """Its motion depends on k/m alone: a note says so; neither has an interval."""
    t = np.linspace(0.0, 10.0, 101)
    noise = 1e-3 * np.random.default_rng(1).standard_normal(len(t))
    given = {"forces.spring.k": 41.0, "bodies.mass.mass": 1.9}
    fit = dap.fit(oscillator(), given, {"t": t, "mass.r.x": swing(t) + noise})
    assert any(
        "forces.spring.k and bodies.mass.mass cannot be told apart by these data: only "
        "forces.spring.k / bodies.mass.mass is determined" in note
        for note in fit.notes
    )
    assert set(fit.interval.values()) == {(-np.inf, np.inf)}
    assert np.isinf(np.diag(fit.covariance)).all()
    assert "not determined" in str(fit)
    k, m = fit.values.values()
    assert k / m == pytest.approx(K / M, rel=1e-3)
    assert fit.degrees == len(t) - 1
    # nothing leads them away along what the data do not determine
    assert 20.0 < k < 60.0
    # with a known mass the stiffness is determined, to the same
    alone = dap.fit(oscillator(), {"forces.spring.k": 41.0}, {"t": t, "mass.r.x": swing(t) + noise})
    assert alone.values["forces.spring.k"] == pytest.approx(k / m * M, rel=1e-6)
    low, high = alone.interval["forces.spring.k"]
    assert low < K < high


@pytest.mark.slow
@compiled
def test_what_is_determined_keeps_its_interval_beside_what_is_not():
    """The free length is known whether or not k and m can be told apart; inertia is idle."""
    t = np.linspace(0.0, 5.0, 51)
    noise = 1e-3 * np.random.default_rng(2).standard_normal(len(t))
    data = {"t": t, "mass.r.x": swing(t) + noise}
    given = ["forces.spring.l0", "forces.spring.k", "bodies.mass.mass", "bodies.mass.Jp.2"]
    fit = dap.fit(oscillator(), given, data)
    fewer = dap.fit(oscillator(), given[:2], data)
    assert fit.interval["forces.spring.l0"] == pytest.approx(
        fewer.interval["forces.spring.l0"], rel=1e-6
    )
    assert "bodies.mass.Jp.2 has no effect on these data" in fit.notes
    assert fit.values["bodies.mass.Jp.2"] == 0.1
    for name in given[1:]:
        assert fit.interval[name] == (-np.inf, np.inf)
    assert np.isnan(fit.correlation[0, 1])


@pytest.mark.slow
@compiled
def test_bounds_are_kept_and_noted():
    """The truth lies beyond a bound: the fit stands there and says so, others have intervals."""
    t = np.linspace(0.0, 2.0, 41)
    data = {"t": t, "mass.r.x": swing(t, c=C)}
    given = {"forces.spring.k": (35.0, 20.0, 39.0), "forces.spring.c": (0.0, 0.0, 5.0)}
    fit = dap.fit(oscillator(), given, data)
    assert fit.values["forces.spring.k"] == 39.0
    assert np.isnan(fit.interval["forces.spring.k"]).all()
    assert "at its bound" in str(fit)
    assert any("forces.spring.k is at its upper bound, 39" in note for note in fit.notes)
    assert np.isfinite(fit.interval["forces.spring.c"]).all()
    # nor does a run leave the bounds for the derivatives: here the truth is a bound itself
    undamped = dap.fit(oscillator(), given | {"forces.spring.k": 39.0},
                       {"t": t, "mass.r.x": swing(t)})  # fmt: skip
    assert undamped.values["forces.spring.k"] == pytest.approx(K, rel=1e-7)
    assert 0.0 <= undamped.values["forces.spring.c"] < 1e-7


@pytest.mark.slow
@compiled
def test_a_fit_that_explains_little_says_so():
    """From a frequency that is too high by a third the search ends in another valley."""
    t = np.linspace(0.0, 5.0, 101)
    data = {"t": t, "mass.r.x": swing(t)}
    wrong = dap.fit(oscillator(), {"forces.spring.k": 70.0}, data)
    assert "less than half of the variation of mass.r.x is explained" in wrong.notes[0]
    wrong = dap.fit(oscillator(), {"forces.spring.k": 70.0}, data, sigma=0.1)
    assert "residuals are larger than sigma" in wrong.notes[0]
    assert dap.fit(oscillator(), {"forces.spring.k": 44.0}, data, sigma=0.1).notes == ()


@compiled
def test_points_that_fail_shorten_the_way():
    """From a mass ten times too large the first step leads to none at all, which no run has."""
    scene = falling()
    scene.add_force("f", "thrust", body_i="stone", f=(20.0, 0.0, 0.0))
    t = np.linspace(0.0, 1.0, 11)
    data = {"t": t, "stone.r.x": 20.0 / 1.5 * t**2 / 2.0}
    seen = []
    fit = dap.fit(scene, {"bodies.stone.mass": 15.0}, data, progress=lambda *at: seen.append(at))
    assert fit.values["bodies.stone.mass"] == pytest.approx(1.5, rel=1e-7)
    assert [number for number, _ in seen] == list(range(1, fit.iterations + 1))
    assert (np.diff([cost for _, cost in seen]) <= 0.0).all()


@pytest.mark.slow
@compiled
def test_a_ball_that_bounces():
    """Restitution and height from where it is, in closed form: derivatives through the bounce."""
    t, e, z0, g = np.linspace(0.1, 0.8, 8), 0.7, 1.2, 9.81
    first = np.sqrt(2.0 * z0 / g)
    after = e * g * first * (t - first) - 0.5 * g * (t - first) ** 2
    data = {"t": t, "ball.r.z": np.where(t < first, z0 - 0.5 * g * t * t, after)}
    given = {"forces.floor.e": 0.8, "bodies.ball.r.z": 1.25}
    fit = dap.fit(bouncing(), given, data, outputs=["ball.r.z"], dt=0.1)
    assert list(fit.values.values()) == pytest.approx([e, z0], rel=1e-7)
    assert fit.runs < 15


def test_a_start_that_fails_is_an_error():
    """With the values, and what the run says."""
    data = {"t": [0.0, 1.0], "stone.r.z": [0.0, 1.0]}
    with pytest.raises(dap.SimulationError, match=r"start of the fit, bodies\.stone\.mass = -1, f"):
        dap.fit(falling(), {"bodies.stone.mass": -1.0}, data)


@compiled
def test_times_may_be_any():
    """In any order, twice the same, with gaps, without a common step: then a spline is noted."""
    rng = np.random.default_rng(5)
    t = rng.uniform(0.0, 3.0, 40)
    t[7] = t[20]
    data = {"t": t, "mass.r.x": swing(t, c=C), "x": REST + swing(t, c=C) - REST}
    data["mass.r.x"][::3] = np.nan
    data["mass.r.y"] = np.full(40, np.nan)
    fit = dap.fit(
        oscillator(c=C),
        ["forces.spring.k"],
        data,
        outputs={"x": "mass.r.x", "mass.r.x": "mass.r.x", "mass.r.y": "mass.r.y"},
    )
    assert fit.values["forces.spring.k"] == pytest.approx(K, rel=1e-7)
    assert any("spline" in note for note in fit.notes)
    assert np.isnan(fit.residuals["mass.r.x"][::3]).all()
    assert np.isfinite(fit.fitted["mass.r.x"]).all()
    assert fit.degrees == 40 + 26 - 1
    regular = np.array([0.1, 0.3, 0.35, 0.05])
    fit = dap.fit(oscillator(c=C), ["forces.spring.k"], {"t": regular, "mass.r.x": swing(regular)})
    assert not any("spline" in note for note in fit.notes)


@compiled
def test_data_in_files_and_datasets(tmp_path):
    """A CSV file as ``dap3d post`` writes it, with gaps, and an xarray.Dataset: the same data."""
    t = np.linspace(0.0, 1.0, 11)
    x = swing(t) + 1e-3
    x[4] = np.nan
    lines = ["# taken on a Monday", "t [s],mass.r.x [m],note"]
    lines += [
        f"{a!r},{'' if np.isnan(b) else repr(b)},"
        for a, b in zip(t.tolist(), x.tolist(), strict=True)
    ]
    path = tmp_path / "data.csv"
    path.write_text("\n".join(lines) + "\n")
    known = {"mass.r.x": ("time", x)}
    found = [
        dap.fit(oscillator(), ["forces.spring.k"], data, outputs=["mass.r.x"]).values
        for data in (path, str(path), {"t": t, "mass.r.x": x, "more": "text"},
                     xarray.Dataset(known, {"time": t}))
    ]  # fmt: skip
    assert found == [found[0]] * 4


def mistakes_of(*arguments, **settings):
    with pytest.raises(dap.SceneError) as caught:
        dap.fit(*arguments, **settings)
    return str(caught.value)


def test_all_mistakes_are_reported_at_once():
    """Names with the nearest, data, bounds, settings: one error."""
    data = {"t": [0.0, -1.0], "mass.r.q": [0.0, 1.0], "mass.r": ["a", "b"], "mass.r.y": [1.0]}
    given = {"bodies.mass.mas": 1.0, "forces.spring.k": (50.0, 0.0, 40.0)}
    text = mistakes_of(oscillator(), given, data, rtol=-1.0)
    for part in (
        "bodies.mass.mas",
        "did you mean 'bodies.mass.mass'?",
        "parameters.forces.spring.k = 50.0: the start lies outside of its bounds, 0 to 40",
        "measured.t = -1.0: a run begins at t = 0",
        'measured.mass.r = "a": should be numbers',
        "measured.mass.r.y: 1 values for 2 times",
        "mass.r.q",
        "rtol = -1.0",
    ):
        assert part in text, part


T = [0.0, 1.0]


@pytest.mark.parametrize(
    ("given", "data", "settings", "words"),
    [
        ({}, {"t": T, "mass.r.x": T}, {}, "at least one parameter"),
        (3, {"t": T, "mass.r.x": T}, {}, "parameters are"),
        ({"forces.spring.k": (1, 2)}, {"t": T, "mass.r.x": T}, {}, "(start, low, high)"),
        ({"forces.spring.k": "4"}, {"t": T, "mass.r.x": T}, {}, "should be numbers"),
        ({"forces.spring.k": (1, 3, 2)}, {"t": T, "mass.r.x": T}, {}, "is not below"),
        ({"forces.spring.k": np.nan}, {"t": T, "mass.r.x": T}, {}, "a start is finite"),
        ({"forces.spring.k": dap.Parameter(1.0, scale=0.0)}, {"t": T, "mass.r.x": T}, {},
         "a scale is above 0"),
        (["simulation.rtol"], {"t": T, "mass.r.x": T}, {}, "a setting of the run"),
        (["forces.spring.k"], {"t": T}, {}, "no quantity besides the time"),
        (["forces.spring.k"], {"mass.r.x": T}, {}, "times of the measurements are missing"),
        (["forces.spring.k"], {"t": [], "mass.r.x": []}, {}, "no measurements"),
        (["forces.spring.k"], {"t": T, "mass.r.x": [np.nan] * 2}, {}, "nothing that was measured"),
        (["forces.spring.k"], {"t": T, "mass.r.x": [np.inf] * 2}, {}, "not finite"),
        (["forces.spring.k"], {"t": T, "mass.r": [T, T]}, {}, "one number for each time"),
        (["forces.spring.k"], {"t": T, "mass.r": T}, {}, "did you mean 'mass.r.x'?"),
        (["forces.spring.k"], [T, T], {}, "measured data are a mapping"),
        (["forces.spring.k"], "none.csv", {}, "cannot be read"),
        (["forces.spring.k"], {"t": T, "mass.r.x": T}, {"t_end": 0.5}, "ends before the last"),
        (["forces.spring.k"], {"t": T, "mass.r.x": T}, {"sigma": 0.0}, "above 0"),
        (["forces.spring.k"], {"t": T, "mass.r.x": T}, {"sigma": {"mass.r.z": 1.0}},
         "none of the measured"),
        (["forces.spring.k"], {"t": T, "mass.r.x": T}, {"sigma": [1.0] * 3}, "each of the 2"),
        (["forces.spring.k"], {"t": T, "mass.r.x": T}, {"outputs": ["mass.r.y"]}, "no such column"),
        (["forces.spring.k"], {"t": T, "mass.r.x": T}, {"outputs": 3}, "outputs are names"),
        (["forces.spring.k"], {"t": T, "mass.r.x": T, "mass.rd.x": T}, {}, "give sigma"),
        (["forces.spring.k", "forces.spring.c", "forces.spring.l0"], {"t": T, "mass.r.x": T}, {},
         "2 measured numbers cannot determine 3 parameters"),
    ],
)  # fmt: skip
def test_what_is_refused(given, data, settings, words):
    assert words in mistakes_of(oscillator(), given, data, **settings)


@pytest.mark.parametrize(
    ("header", "words"),
    [
        ("t [s],mass.r.x [mm]", "the file has it in mm, and it is in m: convert the column"),
        ("t [ms],mass.r.x", "times are in s, and not in ms"),
        ("t;mass.r.x", "data.csv:1: measured: columns are between commas, not ';'"),
        ("t,height", "give outputs={COLUMN: QUANTITY}"),
        ("t [s],mass.rd.x [m/s²]", "in m/s², and it is in m/s: convert"),
        ("t,mass.rdd.x [m / s²]", ""),
        ("t,mass.w.z [deg/s]", "in deg/s, and it is in rad/s: convert"),
    ],
)
def test_columns_of_a_file_in_other_units_are_refused(tmp_path, header, words):
    """All spellings of the quantity's own unit are taken."""
    path = tmp_path / "data.csv"
    path.write_text(f"{header}\n0.0,0.1\n0.5,0.2\n")
    if words:
        assert words in mistakes_of(oscillator(), ["forces.spring.k"], path)
    else:
        dap.fit(oscillator(), ["forces.spring.k"], path)


def test_mistakes_of_a_file_have_their_lines(tmp_path):
    path = tmp_path / "data.csv"
    path.write_text("t,mass.r.x\n0,1\n1,one\n2\n")
    text = mistakes_of(oscillator(), ["forces.spring.k"], path)
    assert f'{path}:3: measured.mass.r.x = "one": should be a number' in text
    assert f"{path}:4: measured: 1 columns, the header has 2" in text
    path.write_text("")
    assert "the file is empty" in mistakes_of(oscillator(), ["forces.spring.k"], path)


@pytest.mark.slow
@compiled
def test_a_fit_is_drawn(tmp_path):
    """Two panels for each output; a file without a display; an unknown output is an error."""
    import matplotlib

    matplotlib.use("Agg")
    from matplotlib import pyplot

    from dap3d_core.plot import save_plot

    t = np.linspace(0.0, 1.0, 21)
    data = {"t": t, "mass.r.x": swing(t), "mass.rd.x": np.gradient(swing(t), t)}
    data["mass.r.y"] = np.full(21, np.nan)  # not measured after all
    sigma = {"mass.r.x": 0.01, "mass.rd.x": 0.05, "mass.r.y": 1.0}
    fit = dap.fit(oscillator(), ["forces.spring.k"], data, sigma=sigma)
    ax = dap.plot(fit)
    assert len(ax.figure.axes) == 6
    points, curve = ax.lines
    assert points.get_ydata() == pytest.approx(data["mass.r.x"])
    every = (len(curve.get_xdata()) - 1) // (len(fit.result.t) - 1)  # smooth between instants
    assert every > 1
    assert curve.get_xdata()[::every] == pytest.approx(fit.result.t)
    # a cubic is off by h^4 / 384 of the fourth derivative, a straight line by h^2 / 8 of the second
    between = swing(curve.get_xdata(), k=fit.values["forces.spring.k"])
    assert curve.get_ydata() == pytest.approx(between, abs=1e-5)
    assert [a.get_ylabel() for a in ax.figure.axes][1] == "residual\n[m]"
    assert len(dap.plot(fit, "mass.rd.x").figure.axes) == 2
    pyplot.close("all")
    assert save_plot(fit, [], tmp_path / "fit.png").stat().st_size > 5000
    with pytest.raises(KeyError, match=r"mass\.r\.x"):
        dap.plot(fit, "mass.r.z")
    with pytest.raises(ValueError, match="x axis of its own"):
        dap.plot(fit, x="t")


def test_a_radian_is_a_number():
    """So that speeds of turning in 1/s are those in rad/s."""
    data = MeasuredData(np.zeros(1), {}, {}, {}, {"w": "1/s", "n": "rpm"})
    assert data.unlike("w", "rad/s") == ""
    assert "in rpm, and it is in rad/s" in data.unlike("n", "rad/s")
