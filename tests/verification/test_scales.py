"""The same mechanism in other units, far away, or with very unequal masses: the same answers."""

import numpy as np
import pytest
from support import redundant

import dap3d_core as dap

#: Gravity in the scene of metres, m/s^2.
GRAVITY = 9.81


def parallelogram(length, time=1.0, at=(0.0, 0.0, 0.0)):
    """A hinged parallelogram of links of one ``length``, whose unit of time is ``time``."""
    half = 0.5 * length
    scene = dap.Scene(name="parallelogram")
    inertia = [length**2 / 600.0, length**2 / 12.0, length**2 / 12.0]
    speed, p = length / time, [np.sqrt(0.5), 0.0, 0.0, np.sqrt(0.5)]
    for name, x in (("left", 0.0), ("right", length)):
        scene.add_body(name, mass=1.0, Jp=inertia, r=np.add(at, [x, half, 0.0]).tolist(), p=p,
                       r_dot=[0.5 * speed, 0.0, 0.0], w=[0.0, 0.0, -1.0 / time])  # fmt: skip
    scene.add_body("coupler", mass=1.0, Jp=inertia, r=np.add(at, [half, length, 0.0]).tolist(),
                   r_dot=[speed, 0.0, 0.0])  # fmt: skip
    for name in ("left", "right", "coupler"):
        for end, x in (("P", -half), ("Q", half)):
            scene.add_point(f"{name}_{end}", body=name, sPp=[x, 0.0, 0.0])
    for name, x in (("left", 0.0), ("right", length)):
        scene.add_point(f"foot_{name}", body="ground", sPp=np.add(at, [x, 0.0, 0.0]).tolist())
        scene.add_joint("rev", f"pin_{name}", P_i=f"{name}_P", P_j=f"foot_{name}", a_i=f"{name}.z",
                        a_j="ground.z")  # fmt: skip
    for name, end in (("left", "P"), ("right", "Q")):
        scene.add_joint("rev", f"top_{name}", P_i=f"{name}_Q", P_j=f"coupler_{end}",
                        a_i=f"{name}.z", a_j="coupler.z")  # fmt: skip
    gravity = GRAVITY * length / time**2
    scene.add_force("weight", "weight", gravity=gravity, wgt=[0.0, -1.0, 0.0])
    return scene


@pytest.fixture(scope="module")
def in_metres():
    return dap.simulate(parallelogram(1.0), t_end=1.0, dt=0.1)


@pytest.mark.parametrize(
    ("length", "time"), [(1e3, 1.0), (1e-3, 1.0), (1e-6, 1e-3), (1e6, 1e3), (1e-9, 1.0)]
)
def test_units_change_neither_verdict_nor_motion(in_metres, length, time):
    """Rank, shared joints, ledger; motion to what the tolerances allow (rtol 1e-8, some 100 steps,
    errors that grow tenfold on the way)."""
    result = dap.simulate(parallelogram(length, time), t_end=time, dt=0.1 * time)
    ours, theirs = (dap.compile(parallelogram(*s)).redundancy() for s in ((length, time), (1.0,)))
    assert (ours.rank.rank, ours.joints) == (theirs.rank.rank, theirs.joints)
    assert not ours.bindings
    assert not ours.contradictions
    assert result.method == in_metres.method
    assert all(entry.ok for entry in result.ledger.values()), result.ledger
    np.testing.assert_allclose(result.r / length, in_metres.r, atol=1e-5)
    np.testing.assert_allclose(result.w * time, in_metres.w, atol=1e-5)


def test_a_scene_of_ordinary_size_keeps_its_tolerances(in_metres):
    assert in_metres.settings["atol"] == 1e-10
    assert dap.simulate(parallelogram(1e3), t_end=0.1).settings["atol"] == {
        "r": 1e-7, "p": 1e-10, "v": 1e-7, "w": 1e-10
    }  # fmt: skip


def test_the_extent_of_a_scene_does_not_depend_on_where_it_stands():
    here, there = (dap.compile(parallelogram(1.0, at=at)).model for at in ((0, 0, 0), (1e6, 0, 0)))
    assert there.extent == pytest.approx(here.extent, rel=1e-9)


def seismometer(amplitude):
    scene = dap.Scene(name="seismometer")
    scene.add_body("m", mass=1.0, Jp=[0.1, 0.1, 0.1], r=[1.0 + amplitude, 0.0, 0.0])
    scene.add_force("ptp", "s", P_i="m.O", P_j="ground.O", k=(2.0 * np.pi) ** 2, l0=1.0)
    return scene


def test_a_motion_below_the_tolerances_is_told_and_resolved_by_others():
    """x - 1 = A cos(2 pi t), A = 1 nm. The spring's length is known to 2e-16 m, some 1e-7 of A,
    which adds up along 20 periods."""
    coarse = dap.simulate(seismometer(1e-9), t_end=2.0)
    assert any("hardly resolved" in note for note in coarse.notes)
    assert not any("hardly resolved" in n for n in dap.simulate(seismometer(0.1), t_end=2.0).notes)
    fine = dap.simulate(seismometer(1e-9), t_end=2.0, rtol=1e-13, atol={"r": 1e-16, "v": 1e-15})
    wanted = 1e-9 * np.cos(2.0 * np.pi * fine.t)
    np.testing.assert_allclose(fine.r[:, 0, 0] - 1.0, wanted, atol=2e-11)


def test_atol_by_quantity_is_the_same_as_one_number(in_metres):
    """A table of equal tolerances gives the same bits as the number; what is left out is usual."""
    scene, each = parallelogram(1.0), dict.fromkeys("rpvw", 1e-7)
    one, four, some = (
        dap.simulate(scene, t_end=0.5, atol=atol) for atol in (1e-7, each, {"w": 1e-9})
    )
    assert np.array_equal(one.u, four.u)
    assert some.settings["atol"] == dict.fromkeys("rpv", 1e-10) | {"w": 1e-9}


def thin_rod(inertia):
    """A rod on a ball joint, let go level, that swings about the vertical as well."""
    scene = dap.Scene(name="rod")
    scene.add_body("rod", mass=1.0, Jp=[inertia, 1.0 / 12.0, 1.0 / 12.0], r=[0.5, 0.0, 0.0],
                   p=[np.sqrt(0.5), np.sqrt(0.5), 0.0, 0.0], r_dot=[0.0, 1.0, -0.5],
                   w=[0.0, 1.0, 2.0])  # fmt: skip
    scene.add_point("end", body="rod", sPp=[-0.5, 0.0, 0.0])
    scene.add_joint("sph", "A", P_i="end", P_j="ground.O")
    scene.add_force("weight", "weight")
    return scene


@pytest.mark.parametrize(("integrator", "factor"), [("dop853", 3), ("adams", 6), ("radau", 6)])
def test_rounding_over_a_small_inertia_does_not_drive_the_steps(integrator, factor):
    """Steps of a rod of 1e-12 kg m^2 about its axis are nearly those of 1e-7, whose motion is the
    same but for that part, 1e-6 of 1/12; the high differences of adams, and the weights of the
    stages of radau where its order is high, have more of the noise.
    Without a remedy they are a thousand times as many."""
    thin, thick = (dap.simulate(thin_rod(J), t_end=2.0, integrator=integrator)
                   for J in (1e-12, 1e-7))  # fmt: skip
    assert thin.stats.steps < factor * thick.stats.steps
    assert thin.ledger["energy"].ok
    np.testing.assert_allclose(thin.r, thick.r, atol=1e-5)


def test_steps_that_have_settled_in_rounding_are_let_go():
    """Two thin rods in a chain: control settles at steps of 5 us without failures that would tell.
    The motion is that of rods with a millionth of their other inertia about their axes."""

    def chain(inertia):
        scene = dap.Scene(name="thin rods")
        for k, (name, place, velocity) in enumerate(
            (("a", [0.5, 0.0, 0.0], [0.0, 1.0, -0.5]), ("b", [1.3, 0.4, 0.0], [-0.4, 2.3, -1.5]))
        ):
            p = [[0.7071067811865476, 0.7071067811865475, 0.0, 0.0],
                 [0.0, 0.8944271909999159, 0.447213595499958, 0.0]][k]  # fmt: skip
            w = [[0.0, 1.0, 2.0], [-0.8, 0.6, 1.0]][k]
            scene.add_body(name, mass=1.0, Jp=[inertia, 1 / 12, 1 / 12], r=place, p=p,
                           r_dot=velocity, w=w)  # fmt: skip
            scene.add_point(f"{name}_P", name, (-0.5, 0.0, 0.0))
            scene.add_point(f"{name}_Q", name, (0.5, 0.0, 0.0))
        scene.add_joint("sph", "A", P_i="a_P", P_j="ground.O")
        scene.add_joint("sph", "B", P_i="b_P", P_j="a_Q")
        scene.add_force("weight")
        return scene

    thin, thick = (dap.simulate(chain(J), t_end=2.0, dt=0.1) for J in (1e-12, 1e-7))
    assert thin.stats.steps < 10 * thick.stats.steps
    np.testing.assert_allclose(thin.r, thick.r, atol=1e-5)


def test_two_bodies_far_from_the_origin():
    """Their relative motion is that near the origin, to what rounding of 1.5e-8 m leaves: each of
    some hundred steps adds k h^2 / m times that to it, and the spring multiplies it tenfold."""

    def scene(x):
        found = dap.Scene(name="pair")
        found.add_body("a", mass=1.0, Jp=[0.1, 0.1, 0.1], r=[x, 0.0, 0.0])
        found.add_body("b", mass=2.0, Jp=[0.1, 0.1, 0.1], r=[x + 1.25, 0.0, 0.0],
                       r_dot=[0.0, 2.0, 0.0])  # fmt: skip
        found.add_force("ptp", "s", P_i="a.O", P_j="b.O", k=100.0, l0=1.0)
        return found

    near, far = (dap.simulate(scene(x), t_end=5.0, dt=0.1) for x in (0.0, 1e8))
    assert far.stats.rhs < 5 * near.stats.rhs
    assert far.ledger["energy"].ok
    assert any("limited by rounding" in note for note in far.notes)
    apart = [result.r[:, 1] - result.r[:, 0] for result in (near, far)]
    np.testing.assert_allclose(apart[0], apart[1], atol=1e-4)


@pytest.mark.parametrize("distance", [1e3, 1e5])
def test_a_ball_bounces_to_rest_far_from_the_origin(distance):
    """On a plane askew, whose gap has the rounding of the position: bounces end above that.

    All bounces of 0.3 m with e = 0.5 last three times the fall; the instant is known as well as
    the time in which the ball falls through that rounding. As near the origin, the steps were
    without an end.
    """
    n, place = np.array([2.0, -1.0, 2.0]) / 3.0, distance * np.array([1.0, -0.3, 0.02])
    scene = dap.Scene(name="a ball far away")
    scene.add_body("ball", mass=2.0, Jp=[0.008] * 3, r=place + 0.4 * n)
    scene.add_force("weight", "g", wgt=(-n).tolist())
    scene.add_point("there", "ground", place)
    scene.add_vector("n", "ground", n)
    scene.add_contact(
        "ball_plane", "floor", P_i="ball.O", radius=0.1, P_j="there", a_j="n", mu=0.3, e=0.5
    )
    result = dap.simulate(scene, t_end=0.8, dt=0.1, rtol=1e-10, integrator="dop853")
    (rests,) = (e.t for e in result.events if e.kind == "rest")
    rounding = 32.0 * np.finfo(float).eps * distance
    assert abs(rests - 3.0 * np.sqrt(2.0 * 0.3 / 9.81)) < np.sqrt(2.0 * rounding / 9.81)
    assert result.stats.steps < 500
    assert np.abs(result.rd[-1]).max() < 1e-9


@pytest.mark.parametrize("integrator", ["dop853", "adams"])
def test_a_light_cart_under_a_heavy_bob_is_not_singular(integrator):
    """The bob on a massless rod under a cart of no mass falls straight down below it: a cart that
    gives way to it along the track keeps its kinetic and potential energy."""
    scene = dap.Scene(name="cart")
    scene.add_body("cart", mass=1e-6, Jp=[1e-6, 1e-6, 1e-6])
    scene.add_body("bob", mass=1.0, Jp=[1.0, 1.0, 1.0], r=[1.0, 0.0, 0.0])
    scene.add_joint("tran", "track", P_i="cart.O", P_j="ground.O", a_j="ground.x")
    scene.add_joint("sph-sph", "pole", P_i="cart.O", P_j="bob.O")
    scene.add_force("weight", "weight")
    result = dap.simulate(scene, t_end=1.0, dt=0.01, integrator=integrator)
    assert result.status == "done"
    assert all(entry.ok for entry in result.ledger.values())


def test_a_rod_held_still_is_right_at_any_height():
    """Neither the zero of the potential nor rounding makes a fault of a scene that cannot move."""
    for z in (0.0, 1.0, 1e3):
        scene = dap.Scene(name="held")
        scene.add_body("rod", mass=1.0, Jp=[0.1, 0.1, 0.05], r=[0.5, 0.0, z])
        scene.add_point("A", body="rod", sPp=[-0.5, 0.0, 0.0])
        scene.add_point("G", body="ground", sPp=[0.0, 0.0, z])
        scene.add_vector("axis", body="rod", sp=[0.0, 1.0, 0.0])
        scene.add_force("weight", "weight")
        scene.add_joint("rev", "hinge", P_i="A", P_j="G", a_i="axis", a_j="ground.y")
        scene.add_joint("rel-rot", "lock", body_i="rod", a_j="ground.y")
        ledger = dap.simulate(scene, t_end=0.2, dt=0.02).ledger
        assert all(entry.ok for entry in ledger.values()), (z, ledger["energy"])


@pytest.mark.parametrize("duration", [0.03, 1e-6])
def test_work_between_two_reports_is_a_scale_of_the_energy(duration):
    """An arm that a driver turns by one radian between two reports, at rest at both."""
    scene = dap.Scene(name="pulse")
    scene.add_body("arm", mass=1.0, Jp=[0.1, 0.1, 0.1])
    scene.add_joint("rev", "pin", P_i="arm.O", P_j="ground.O", a_i="arm.z", a_j="ground.z")
    scene.add_function("step", "move", x_start=0.5123, x_end=0.5123 + duration, f_start=0.0,
                       f_end=-1.0)  # fmt: skip
    scene.add_joint("rel-rot", "motor", body_i="arm", body_j="ground", a_j="ground.z",
                    function="move")  # fmt: skip
    entry = dap.simulate(scene, t_end=1.0, dt=0.1).ledger["energy"]
    assert entry.ok, entry


def test_fixed_steps_that_are_too_long_are_not_called_right():
    """rk4 at 20 steps a period keeps the energy of a swing; at 4 it loses a part of it."""
    scene = seismometer(0.5)
    for step, right in ((0.01, True), (0.25, False)):
        result = dap.simulate(scene, t_end=5.0, dt=0.5, integrator="rk4", step=step)
        assert result.ledger["energy"].ok is right, result.ledger["energy"]


@pytest.mark.parametrize("integrator", ["dop853", "dopri5", "auto"])
def test_an_undamped_oscillation_is_not_stiff(integrator):
    """Two atoms on a spring of 1e6 N/m: nothing in them dies away."""
    scene = dap.Scene(name="molecule")
    for name, x in (("a", 0.0), ("b", 1.01)):
        scene.add_body(name, mass=1.0, Jp=[0.1, 0.1, 0.1], r=[x, 0.0, 0.0])
    scene.add_force("ptp", "bond", P_i="a.O", P_j="b.O", k=1e6, l0=1.0)
    result = dap.simulate(scene, t_end=1.0, dt=0.1, integrator=integrator)
    assert not any("stiff" in note or "radau" in note for note in result.notes), result.notes


@pytest.mark.parametrize(("length", "time"), [(1e-9, 1.0), (1e6, 1e3), (1e-3, 1e-6)])
def test_units_do_not_change_from_when_on_a_state_means_nothing(length, time):
    """Steps that are too long: the same error, as a part of the motion, at the same instant."""

    def rough(length, time):
        scene = parallelogram(length, time)
        return dap.simulate(scene, t_end=2.0 * time, dt=0.1 * time, integrator="rk4",
                            step=0.1 * time, estimate_error=True).error  # fmt: skip

    ours, theirs = rough(length, time), rough(1.0, 1.0)
    assert theirs.meaningless_from > 0.1
    assert ours.meaningless_from == pytest.approx(time * theirs.meaningless_from, rel=1e-9)
    np.testing.assert_allclose(ours.relative, theirs.relative, rtol=1e-3, atol=1e-12)


def test_a_scene_at_rest_never_loses_its_meaning():
    """In nm: speeds are rounding, which is no part of the speed that would move anything."""
    scene = dap.Scene(name="hanging")
    scene.add_body("m", mass=1.0, Jp=[1e-20] * 3, r=[3e-9, 0.0, 0.0])
    scene.add_point("P", "m", [-3e-9, 0.0, 0.0])
    scene.add_point("Q", "m", [0.0, 1e-9, 0.0])
    scene.add_joint("sph", "hook", P_i="P", P_j="ground.O")
    scene.add_force("weight", "weight", gravity=9.81e-9, wgt=[1.0, 0.0, 0.0])
    result = dap.simulate(scene, t_end=1.0, dt=0.1, estimate_error=True)
    assert result.error.meaningless_from is None


def enlarged(scene, length):
    """The same bodies, points and weight, all lengths so many times as large."""
    for body in scene.bodies.values():
        body.r = tuple(length * np.asarray(body.r))
        body.Jp = tuple(length**2 * np.asarray(body.Jp))
    for point in scene.points.values():
        point.sPp = tuple(length * np.asarray(point.sPp))
    for force in scene.forces.values():
        force.fields = {**force.fields, "gravity": length * GRAVITY}
    return scene


@pytest.mark.parametrize("length", [1e-3, 1e3, 1e-6])
@pytest.mark.parametrize("linkage", [redundant.bricard, redundant.bennett])
def test_linkages_of_one_freedom_that_no_count_tells_have_it_in_any_units(linkage, length):
    """Rank, freedom, shared rows, no joint that binds; the motion to what rtol allows."""
    ours, theirs = (dap.compile(enlarged(linkage(), size)) for size in (length, 1.0))
    verdicts = [
        (found.rank.rank, found.rank.dof, found.rank.redundant, found.joints, found.bindings,
         found.contradictions, found.singular)
        for found in (ours.redundancy(), theirs.redundancy())
    ]  # fmt: skip
    assert verdicts[0] == verdicts[1]
    assert verdicts[1][1] == 1
    assert verdicts[1][4:] == ((), (), None)
    small, ordinary = (dap.simulate(each, t_end=0.5, dt=0.1) for each in (ours, theirs))
    assert np.ptp(ordinary.r, axis=0).max() > 0.1
    assert [name for name, entry in small.ledger.items() if entry.ok is False] == []
    np.testing.assert_allclose(small.r / length, ordinary.r, atol=1e-6)
    np.testing.assert_allclose(small.w, ordinary.w, atol=1e-5)


def turning_box(length, time=1.0):
    """A box on four corners that slides and spins until it sticks: its slip turns all the way."""
    scene = dap.Scene(name="box")
    scene.add_body("box", mass=2.0, Jp=[0.008 * length**2] * 3, r=[0.0, 0.0, 0.1 * length],
                   r_dot=[0.7 * length / time, 0.2 * length / time, 0.0],
                   w=[0.0, 0.0, 6.0 / time])  # fmt: skip
    scene.add_force("weight", "gravity", gravity=GRAVITY * length / time**2)
    size = [0.3 * length, 0.3 * length, 0.2 * length]
    scene.add_contact("box_plane", "floor", P_i="box.O", size=size, mu=0.3)
    return scene


def bouncing_ball(length, time=1.0):
    """A ball that bounces to rest, and slides, then rolls."""
    scene = dap.Scene(name="ball")
    scene.add_body("ball", mass=2.0, Jp=[0.008 * length**2] * 3, r=[0.0, 0.0, 0.5 * length],
                   r_dot=[length / time, 0.0, 0.0])  # fmt: skip
    scene.add_force("weight", "gravity", gravity=GRAVITY * length / time**2)
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=0.1 * length, mu=0.3, e=0.5)
    return scene


@pytest.mark.slow
@pytest.mark.parametrize(
    ("length", "time"),
    [(1e-4, 1.0), (1e-6, 1.0), (1e-7, 1.0), (1e-9, 1.0), (1e-6, 1e-3), (1e3, 1.0), (1e6, 1.0)],
)
@pytest.mark.parametrize("make", [turning_box, bouncing_ball])
def test_contacts_of_grains_are_those_of_large_bodies(make, length, time):
    """Slip, bounces and rest do not depend on the units: the same motion and the same events.

    At rtol 1e-10 some 100 steps leave 1e-8; a limit of speed in m/s stops a grain of 0.1 um some
    percent of its way too early."""
    ours, theirs = (
        dap.simulate(make(*s), t_end=s[1], dt=0.1 * s[1], rtol=1e-10)
        for s in ((length, time), (1.0, 1.0))
    )
    assert [e.kind for e in ours.events][:16] == [e.kind for e in theirs.events][:16]
    np.testing.assert_allclose(
        [e.t / time for e in ours.events][:16], [e.t for e in theirs.events][:16], atol=1e-7
    )
    assert all(entry.ok for entry in ours.ledger.values()), ours.ledger
    np.testing.assert_allclose(ours.r / length, theirs.r, atol=1e-8)
    np.testing.assert_allclose(ours.rd * time / length, theirs.rd, atol=1e-8)
    np.testing.assert_allclose(ours.w * time, theirs.w, atol=1e-8)


def stopped_wheel(length):
    """A wheel of that size, which rebounds from its stop, in a hinge that rubs."""
    scene = dap.Scene(name="wheel")
    scene.add_body("wheel", mass=2.0, Jp=[0.5 * length**2] * 3, w=[0.0, 0.0, 2.0])
    axle = {"P_i": "wheel.O", "P_j": "ground.O", "a_i": "wheel.z", "a_j": "ground.z"}
    scene.add_joint("rev", "axle", **axle, upper=0.7, e=0.4)
    scene.add_force("rot_friction", "rub", joint="axle", n_c=0.3 * length**2)
    return scene


@pytest.mark.parametrize("length", [1e-6, 1e6])
def test_limits_of_angles_do_not_depend_on_the_size_of_what_turns(length):
    """The gap is an angle: what counts as a touch, or as rest, is the same in all scenes."""
    ours, theirs = (dap.simulate(stopped_wheel(s), t_end=2.0, dt=0.1) for s in (length, 1.0))
    assert [(e.name, e.kind) for e in ours.events] == [(e.name, e.kind) for e in theirs.events]
    times = ([e.t for e in each.events] for each in (ours, theirs))
    np.testing.assert_allclose(*times, atol=1e-9)
    np.testing.assert_allclose(ours.w, theirs.w, atol=1e-9)


def rubbing_pendulum(length):
    """A pendulum that begins level, on a hinge whose friction holds half of its weight's moment."""
    return pendulum_on("ground", dap.Scene(name="rubbing"), length)


def rubbing_cart(length):
    """The same on a cart that slides until its friction, under their load, holds it."""
    scene = dap.Scene(name="rubbing")
    scene.add_body("cart", mass=2.0, Jp=[0.1 * length**2] * 3, r_dot=[0.8 * length, 0.0, 0.0])
    scene.add_joint("tran", "way", P_i="cart.O", P_j="ground.O", a_j="ground.x")
    scene.add_force("friction", "brake", joint="way", mu=0.35)
    return pendulum_on("cart", scene, length)


def pendulum_on(base, scene, length):
    scene.add_body("rod", mass=1.0, Jp=[0.02 * length**2] * 3, r=[0.4 * length, 0.0, 0.0])
    scene.add_point("pin", "rod", [-0.4 * length, 0.0, 0.0])
    scene.add_joint("rev", "hinge", P_i="pin", P_j=f"{base}.O", a_i="rod.y", a_j=f"{base}.y")
    scene.add_force("rot_friction", "rub", joint="hinge", n_c=2.0 * length**2)
    scene.add_force("weight", "weight", gravity=GRAVITY * length)
    return scene


@pytest.mark.parametrize("length", [1e-9, 1e-6, 1e4])
@pytest.mark.parametrize("make", [rubbing_pendulum, rubbing_cart])
def test_friction_of_hinges_does_not_depend_on_the_size_of_what_turns(make, length):
    """Rows of angles and of lengths stand side by side in the start of contacts: of a mechanism of
    a micrometre those of lengths were taken for dependent, and the hinge stuck for ever, by a
    moment twice its bound, and the cart by friction that never changed. Compared at rtol 1e-10."""
    metres, other = (dap.simulate(make(x), t_end=0.6, dt=0.1, rtol=1e-10) for x in (1.0, length))
    for name in metres.contact_names:
        assert other.contact(name).mode.tolist() == metres.contact(name).mode.tolist()
    assert (metres.contact("rub").mode == 1).all()
    assert [event.kind for event in other.events] == [event.kind for event in metres.events]
    assert other.r / length == pytest.approx(metres.r, abs=1e-9)


class Units:
    """Of length, time and mass, in m, s and kg, and those that follow."""

    def __init__(self, m=1.0, s=1.0, kg=1.0):
        self.m, self.s, self.kg = m, s, kg
        self.speed, self.inertia, self.force = m / s, kg * m**2, kg * m / s**2

    def block(self, name, mass, r, **moving):
        """A scene with a block of 0.1 m and that mass."""
        scene = dap.Scene(name=name)
        scene.add_body("block", mass=mass * self.kg, Jp=[0.01 * self.inertia] * 3,
                       r=(np.array(r) * self.m).tolist(), **moving)  # fmt: skip
        return scene

    def weigh(self, scene):
        scene.add_force("weight", "gravity", gravity=GRAVITY * self.m / self.s**2)


def dragged_block(u):
    """A block that a spring drags along, whose far end a driver moves: it sticks and slips."""
    scene = u.block("dragged", 1.0, [0.0, 0.0, 0.05])
    u.weigh(scene)
    scene.add_contact("ball_plane", "floor", P_i="block.O", radius=0.05 * u.m, mu=0.3, mu_s=0.4)
    scene.add_joint("parallel", "upright", a_i="block.z", a_j="ground.z")
    scene.add_body("end", mass=u.kg, Jp=[0.01 * u.inertia] * 3, r=[0.5 * u.m, 0.0, 0.05 * u.m],
                   r_dot=[0.3 * u.speed, 0.0, 0.0])  # fmt: skip
    scene.add_joint("tran", "rail", P_i="end.O", P_j="ground.O", a_j="ground.x")
    scene.add_function("a", "way", coeff=[0.0, 0.3 * u.speed, 0.0])
    scene.add_joint("drive-tran", "drive", P_i="end.O", P_j="ground.O", a_j="ground.x",
                    function="way")  # fmt: skip
    scene.add_force("ptp", "spring", P_i="block.O", P_j="end.O", k=60.0 * u.force / u.m,
                    l0=0.5 * u.m)  # fmt: skip
    return scene


def twisted_block(u):
    """A block on a hinge that holds it at first: nothing moves, and no force acts."""
    scene = u.block("twisted", 1.0, [0.0, 0.0, 0.0])
    scene.add_joint("rev", "pin", P_i="block.O", P_j="ground.O", a_i="block.z", a_j="ground.z")
    scene.add_function("harmonic", "f", amplitude=0.06 * u.force * u.m, frequency=3.0 / u.s)
    scene.add_force("motor", "twist", joint="pin", torque="f")
    scene.add_force("rot_friction", "rub", joint="pin", n_c=0.02 * u.force * u.m,
                    n_s=0.025 * u.force * u.m)  # fmt: skip
    return scene


def ball_on_hill(u):
    """A ball that rolls down a sphere, slips, and lifts off."""
    scene = u.block("hill", 1.0, [0.12, 0.0, np.sqrt(1.21 - 0.0144)])
    u.weigh(scene)
    scene.add_contact("ball_ball", "hill", P_i="block.O", radius_i=0.1 * u.m, P_j="ground.O",
                      radius_j=u.m, mu=0.3)  # fmt: skip
    return scene


@pytest.mark.parametrize(
    "units", [(1.0, 1e4, 1.0), (1e-4, 1e4, 1e-4), (1e-5, 1e-3, 1e-9), (1e4, 1e3, 1e4)]
)
@pytest.mark.parametrize("make", [dragged_block, twisted_block, ball_on_hill])
def test_slow_motions_and_quick_ones_are_those_of_ordinary_scenes(make, units):
    """Events and states in any units of length, time and mass.

    At rtol 1e-10 some 100 steps leave 1e-8. Limits in m/s, N or rad/s of what moves by
    1e-4 m/s have it slip 1e-4 to 6e-3 of its time late; default tolerances in them lose
    four digits of its speeds."""

    def run(u):
        return dap.simulate(make(u), t_end=1.5 * u.s, dt=0.1 * u.s, rtol=1e-10)

    u = Units(*units)
    ours, theirs = run(u), run(Units())
    assert [(e.kind, e.name) for e in ours.events] == [(e.kind, e.name) for e in theirs.events]
    assert "slip" in {e.kind for e in theirs.events}
    np.testing.assert_allclose(
        [e.t / u.s for e in ours.events], [e.t for e in theirs.events], atol=1e-8
    )
    assert all(entry.ok for entry in ours.ledger.values()), ours.ledger
    np.testing.assert_allclose(ours.r / u.m, theirs.r, atol=1e-8)
    np.testing.assert_allclose(ours.rd / u.speed, theirs.rd, atol=1e-8)
    np.testing.assert_allclose(ours.w * u.s, theirs.w, atol=1e-7)


@pytest.mark.slow
@pytest.mark.parametrize("length", [1e-4, 1e4])
def test_rates_of_a_motion_that_is_given_do_not_depend_on_its_size(length):
    """A rod on a hinge by positions of its middle: what splines make of these is the same.

    They are off by 1e-3; rounding of second derivatives is some 1e-12."""

    def accelerations(m):
        u = Units(m)
        scene = u.block("rod", 1.0, [0.5, 0.0, 0.0])
        scene.add_point("end", "block", [-0.5 * m, 0.0, 0.0])
        scene.add_joint("rev", "pin", P_i="end", P_j="ground.O", a_i="block.y", a_j="ground.y")
        scene.add_function("harmonic", "f", amplitude=0.5, frequency=2.0)
        scene.add_joint("motor", "motor", joint="pin", position="f")
        t = np.linspace(0.0, 2.0, 41)
        angle = 0.4 * np.sin(2.0 * t)
        motion = {"t": t, "block.r.x": 0.5 * m * np.cos(angle),
                  "block.r.z": -0.5 * m * np.sin(angle)}  # fmt: skip
        return dap.inverse(scene, motion).rdd / m

    np.testing.assert_allclose(accelerations(length), accelerations(1.0), atol=1e-10)
