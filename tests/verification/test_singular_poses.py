"""Redundant rows, and motion through singular poses, against closed equations and published digits.
The reference of A02 is its one closed equation, solved to 1e-12; the error e is that of
benchmarks.md, section 0. Between rtol 1e-8 and the end lie ten crossings or so of the pose with all
links in line, and ten seconds that multiply an error by about 100."""

from itertools import product

import numpy as np
import pytest
from support import problems, redundant, singular

import dap3d_core as dap

#: benchmarks.md, A02: good to 1e-11.
TABULATED = {
    (1, 10.0): (0.47838505776097056, 0.8781501787912093, 1.7272640755471536, -0.94095217937151564),
    (2, 1.0): (-0.19502030194943509, -0.98079920566217383, -6.6766780368811581, 1.3275783251604872),
    (2, 10.0): (0.32845811154081538, 0.94451853817860096, 1.4230514702069441, -0.49486884548704296),
    (40, 10.0): (
        0.18051222668672839,
        0.98357274058231157,
        1.1484412774694141,
        -0.21077006677942393,
    ),
}


def tip(result):
    """(nt, 4) x, y, vx, vy of B0: the first body is a crank of 1 m, its centre half way."""
    return np.hstack([2.0 * result.r[:, 0, :2], 2.0 * result.rd[:, 0, :2]])


@pytest.mark.parametrize(("count", "t"), TABULATED)
def test_the_closed_equation_gives_the_published_digits(count, t):
    """So that it can stand for them at other instants: 1e-11, what they are good to."""
    found = redundant.four_bars_tip(count, np.array([t]))[-1]
    assert found == pytest.approx(TABULATED[count, t], abs=2e-11)


@pytest.mark.parametrize("count", [1, 2, pytest.param(40, marks=pytest.mark.slow)])
def test_four_bars_at_the_default_tolerances(count):
    """A02 on spatial revolutes, three redundant rows a loop: e < 1e-6 at the tabulated instants."""
    instants = [t for n, t in TABULATED if n == count]
    results = [dap.simulate(redundant.four_bars(count), t_end=t, dt=t) for t in instants]
    assert {result.method for result in results} == {"lsq"}
    found = np.array([tip(result)[-1] for result in results])
    expected = redundant.four_bars_tip(count, np.array(instants))
    assert redundant.error_of(found, expected) < 1e-6
    assert all(result.ledger["position"].ok for result in results)


@pytest.mark.parametrize(
    ("count", "integrator"),
    [
        *product((1, 2), ("dop853", "dopri5")),
        # of forty loops for releases: above they cross at the default tolerances
        *(
            pytest.param(40, name, marks=[pytest.mark.slow, pytest.mark.long])
            for name in ("dop853", "dopri5")
        ),
    ],
)
def test_four_bars_through_every_crossing(count, integrator):
    """rtol 1e-10: e < 1e-6 over a thousand instants, interpolated ones and some beside the singular
    pose among them; the energy holds to 1e-8 of what is exchanged."""
    result = dap.simulate(
        redundant.four_bars(count), t_end=10.0, dt=0.01, rtol=1e-10, atol=1e-12,
        integrator=integrator,
    )  # fmt: skip
    expected = redundant.four_bars_tip(count, result.t)
    crossings = np.sum(np.diff(np.sign(expected[:, 1])) != 0)
    assert crossings >= 8
    assert redundant.error_of(tip(result)[1:], expected[1:]) < 1e-6
    assert result.ledger["energy"].value < 1e-8


@pytest.mark.parametrize("rtol", [1e-6, 1e-7, 1e-8, 1e-9, 1e-10, 1e-11, 1e-12])
def test_independent_rows_cross_as_well_at_every_tolerance(rtol):
    """The standard formulation, N = 1 made free of redundancy: the error follows the tolerance.
    It is some 100 times the tolerance, and its part of a step's error is at least a hundredth."""
    result = dap.simulate(problems.four_bar(), t_end=10.0, dt=0.5, rtol=rtol, atol=rtol / 100)
    assert result.method == "standard"
    expected = redundant.four_bars_tip(1, result.t)
    assert redundant.error_of(tip(result)[1:], expected[1:]) < max(500.0 * rtol, 1e-9)


@pytest.mark.parametrize("penalty", [1e7, 1e9])
def test_penalty_crosses_with_the_error_of_its_springs(penalty):
    """N = 1 for one second, one crossing: the error is that of 1 / alpha against accelerations of
    some hundred m/s^2 over the second: below 1e3 / alpha."""
    scene = redundant.four_bars(1)
    scene.simulation.alpha = penalty
    result = dap.simulate(scene, t_end=1.0, dt=0.1, method="penalty")
    expected = redundant.four_bars_tip(1, result.t)
    assert np.max(np.abs(tip(result) - expected)) < 1e3 / penalty


#: benchmarks.md, A04: third joint point, good to 1e-11.
A04 = {
    0.5: (0.7747178080393, -0.9798150476557, -0.1999061589534),
    1.0: (0.2744813192646, -0.8867079387347, -0.4623300026874),
    2.0: (-0.7781353730333, -0.9803526834433, -0.1972526706172),
}


def test_bricard():
    """A04, 30 rows of rank 29 everywhere: e < 1e-6 at the defaults, and 1e-10 at rtol 1e-11."""
    compiled = dap.compile(redundant.bricard())
    rank = compiled.redundancy().rank
    assert (rank.rows, rank.rank, rank.dof, compiled.method) == (30, 29, 1, "lsq")
    for limit, settings in ((1e-6, {}), (1e-10, {"rtol": 1e-11, "atol": 1e-13})):
        result = dap.simulate(compiled, t_end=2.0, dt=0.5, **settings)
        head = list(result.model.point_names).index("end1")
        found = result.rP[[1, 2, 4], head]
        assert redundant.error_of(found, np.array(list(A04.values()))) < limit
        assert result.energy.total[0] == pytest.approx(-29.43, abs=1e-12)


@pytest.mark.parametrize("rate", [1.0, 2.0, 3.0])
@pytest.mark.parametrize("rtol", [1e-5, 1e-7, 1e-9])
def test_a_driven_parallelogram_turns_through_all_crossings(rtol, rate):
    """No freedom is left, so that projection would hide any error of a step, but not from where it
    was taken: the cranks stay parallel, to rounding over the distance of a report from a crossing
    (1e-16 / 1e-3), or to the error of the interpolation where that is nearer."""
    scene = redundant.four_bars(1)
    scene.add_function("a", "turn", coeff=(0.0, -rate, 0.0))
    scene.add_joint("drive-rot", "motor", body_i="crank0", a_j="ground.z", function="turn")
    result = dap.simulate(scene, t_end=10.0, dt=0.1, rtol=rtol, atol=rtol / 100)
    turned = rate * result.t
    expected = np.column_stack([np.sin(turned), np.cos(turned)])
    pivots = np.array([[0.0, 0.0], [1.0, 0.0]])
    for crank, pivot in zip((0, 1), pivots, strict=True):
        body = result.summary.body_names.index(f"crank{crank}")
        assert 2.0 * (result.r[:, body, :2] - pivot) == pytest.approx(expected, abs=rtol)


@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-9])
def test_the_implicit_integrator_with_redundant_rows(rtol):
    """A04 by radau: e follows rtol, and steps grow with its fifth root as those of order 5 do, from
    some 20 at 1e-6 on; multipliers of rows that depend on others do not settle, and need not."""
    result = dap.simulate(
        redundant.bricard(), t_end=2.0, dt=0.5, integrator="radau", rtol=rtol, atol=rtol / 100
    )
    head = list(result.model.point_names).index("end1")
    found = result.rP[[1, 2, 4], head]
    assert redundant.error_of(found, np.array(list(A04.values()))) < max(10 * rtol, 1e-8)
    assert result.stats.steps < 400


def crossings_of(result):
    return [note for note in result.notes if "radau met a singular pose" in note]


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-6, 1e-8, 1e-10])
@pytest.mark.parametrize("make", [lambda: redundant.four_bars(1), problems.four_bar])
def test_the_implicit_integrator_is_taken_across(make, rtol):
    """A02, N = 1, with and without redundant rows: radau stopped at the first or second crossing.
    At 1e-6 its own steps reach across all of them but one, as they fall.
    Ten seconds multiply an error by about 100, and steps of radau may have 5 times the
    tolerance."""
    result = dap.simulate(
        make(), t_end=10.0, dt=0.5, integrator="radau", rtol=rtol, atol=rtol / 100
    )
    expected = redundant.four_bars_tip(1, result.t)
    assert redundant.error_of(tip(result)[1:], expected[1:]) < 1e3 * rtol
    assert crossings_of(result) or rtol == 1e-6
    assert result.ledger["position"].ok


@pytest.mark.slow
def test_an_event_within_a_crossing_of_the_implicit_integrator():
    """Behind the pose, within the step across: there y is what the closed equation says, to the
    error of the run."""
    event = dap.Event("crank0.r.y", below=-0.0007, action="stop")
    result = dap.simulate(
        redundant.four_bars(1), t_end=2.0, dt=0.1, integrator="radau", rtol=1e-10, atol=1e-12,
        events=[event],
    )  # fmt: skip
    assert crossings_of(result)
    assert result.status == "stopped"
    expected = redundant.four_bars_tip(1, result.t[-1:])[0, 1]
    assert expected == pytest.approx(-0.0014, abs=1e-9)


@pytest.mark.parametrize(
    "settings", [{"project": False, "rtol": 1e-10, "atol": 1e-12}, {"step": 0.01}]
)
def test_where_the_implicit_integrator_cannot_be_taken_across_the_remedy_is_told(settings):
    """Steps are not placed about a pose where projection is off, or they are fixed; at looser
    tolerances one goes across by itself.
    The time of the pose, y = 0, is foretold from the last step to a part of a step (4 m/s, 0.01
    s)."""
    with pytest.raises(dap.SimulationError, match="radau cannot cross the singular pose at") as e:
        dap.simulate(redundant.four_bars(1), t_end=2.0, dt=0.1, integrator="radau", **settings)
    assert "dop853 and auto can" in str(e.value)
    t = float(str(e.value).split("pose at t = ")[1].split()[0])
    assert redundant.four_bars_tip(1, np.array([t]))[0, 1] == pytest.approx(0, abs=1e-2)


def test_door_on_two_hinges():
    """10 rows of rank 5: a pendulum, phi'' = (m g l / (J + m l^2)) sin phi with phi from upright,
    let go level: e < 1e-6 over 5 s; the hinges share the load as the least multipliers do."""
    result = dap.simulate(redundant.hinged_door(), t_end=5.0, dt=0.1)
    m, length, J = 12.0, 0.5, 4.0
    rate = m * redundant.G * length / (J + m * length**2)
    phi = redundant.swing(rate, result.t, (np.pi / 2, 0.0))[0]
    expected = length * np.column_stack([-np.sin(phi), np.cos(phi)])
    assert redundant.error_of(result.r[:, 0, 1:], expected) < 1e-6
    # mirror images about the middle of the door: each hinge carries half of the weight
    force = [result.reaction(name)["i"].force for name in ("H0", "H1")]
    assert force[0][:, 1:] == pytest.approx(force[1][:, 1:], abs=1e-6)


@pytest.mark.parametrize("rtol", [1e-8, 1e-10, 1e-11, 1e-12])
def test_a_dead_centre_that_is_singular_in_two_ways(rtol):
    """The measure falls with the square of the distance: from 1e-11 on the run stopped ahead of it.
    Closed form. Work beside the pose is known to 1e-9 J, by which the energy line at 1e-12 is
    off."""
    result = dap.simulate(
        singular.dead_centre(), t_end=2.0, dt=0.08, integrator="dop853", rtol=rtol, atol=rtol / 100
    )
    angle = redundant.dead_centre_angle(result.t)
    centre = 0.5 * np.transpose([np.cos(angle), np.sin(angle)])
    np.testing.assert_allclose(result.r[:, 0, :2], centre, atol=1e-9)
    assert all(entry.ok for entry in result.ledger.values()) or rtol < 1e-11
    assert result.stats.steps < 150


@pytest.mark.parametrize("rtol", [1e-6, 1e-7, 10**-7.5, 1e-8, 10**-8.5, 1e-9])
def test_the_work_of_a_motion_that_is_prescribed(rtol):
    """Errors of a prescribed motion are projected away however long a step: its stages found other
    branches, and its interpolation work of 2 J, where gravity and the motor do none together."""
    result = dap.simulate(
        redundant.driven_four_bar(), t_end=10.0, dt=0.1, rtol=rtol, atol=rtol / 100
    )
    assert np.abs(result.work).max() < 1e3 * rtol * np.ptp(result.energy.potential)


@pytest.mark.slow
@pytest.mark.parametrize("rtol", [1e-8, 1e-9])
def test_rows_that_depend_on_others_on_the_constraints_alone(rtol):
    """Bennett's linkage with radau: off the constraints its redundant rows hold the motion. It had
    no end at these tolerances; steps of dop853: 155 and 177."""
    result = dap.simulate(
        redundant.bennett(), t_end=2.0, dt=0.1, integrator="radau", rtol=rtol, atol=rtol / 100
    )
    energy = result.energy.total
    assert np.abs(energy - energy[0]).max() < 1e2 * rtol * result.energy.kinetic.max()
    assert result.stats.steps < 1500
