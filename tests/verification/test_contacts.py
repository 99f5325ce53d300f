"""Contacts against closed forms: instants to 1e-9 s and states to 1e-9 at rtol 1e-12.

What is found lies some decades nearer (1e-13 typically); rounding of instants, of forces of 1e1 N
and the height of the last bounces (1e-13 m) bound it from below.
"""

import itertools

import numpy as np
import pytest

import dap3d_core as dap

G = 9.81
TOLERANCE = 1e-9
#: Of a slope, rad.
ANGLE = 0.4
INTEGRATORS = ("dop853", "adams", "dopri5", "radau")
TIGHT = {"rtol": 1e-12, "atol": 1e-14}


def times(result, kind, name=""):
    """Instants of events of a kind."""
    return [e.t for e in result.events if e.kind == kind and e.name.startswith(name)]


def ball(radius=0.1, height=0.0, v=0.0, **contact):
    """A solid ball above a floor."""
    scene = dap.Scene(name="ball")
    r = [0.0, 0.0, radius + height]
    Jp = [0.4 * 2.0 * radius**2] * 3
    scene.add_body("ball", mass=2.0, Jp=Jp, r=r, r_dot=[v, 0.0, 0.0])
    scene.add_force("weight", "g")
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=radius, **contact)
    return scene


def slope(part):
    """A box on four corners, in this part of its cone."""
    h, c, s = 0.05, np.cos(ANGLE), np.sin(ANGLE)
    scene = dap.Scene(name="slope")
    scene.add_vector("n", "ground", [-s, 0.0, c])
    p = [np.cos(ANGLE / 2.0), 0.0, -np.sin(ANGLE / 2.0), 0.0]
    scene.add_body("box", mass=1.0, Jp=[0.002, 0.003, 0.004], r=[-s * h, 0.0, c * h], p=p)
    scene.add_force("weight", "g")
    fields = {"size": [0.3, 0.2, 2.0 * h], "a_j": "n", "mu": np.tan(ANGLE) / part}
    scene.add_contact("box_plane", "floor", P_i="box.O", **fields)
    return scene


def spring_block(x, mu, k):
    """A block of 1 kg on a floor, pulled by a spring to x = 0 at the height of its centre."""
    scene = dap.Scene(name="block on a spring")
    scene.add_body("block", mass=1.0, Jp=[0.01] * 3, r=[x, 0.0, 0.05])
    scene.add_force("weight", "g")
    scene.add_point("A", "ground", [-1.0, 0.0, 0.05])
    scene.add_force("ptp", "spring", P_i="block.O", P_j="A", k=k, l0=1.0)
    scene.add_contact("box_plane", "floor", body_i="block", size=[0.1, 0.1, 0.1], mu=mu)
    return scene


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_ball_bounces_to_rest_at_the_end_of_the_series(integrator):
    e, h = 0.8, 1.0
    result = dap.simulate(ball(height=h, e=e), t_end=6.0, dt=0.5, integrator=integrator, **TIGHT)
    first = np.sqrt(2.0 * h / G)
    assert times(result, "impact")[0] == pytest.approx(first, abs=TOLERANCE)
    second = first * (1.0 + 2.0 * e)
    assert times(result, "impact")[1] == pytest.approx(second, abs=TOLERANCE)
    assert times(result, "rest") == pytest.approx([first * (1.0 + e) / (1.0 - e)], abs=TOLERANCE)
    assert result.r[-1, 0] == pytest.approx([0.0, 0.0, 0.1], abs=1e-12)
    assert np.max(np.abs(result.rd[-1])) < 1e-12
    assert result.contact("floor").mode[-1] == 1
    assert result.ledger["energy"].value < TOLERANCE


@pytest.mark.parametrize(("e", "g", "radius"), [(0.5, 1.0, 3.0), (0.1, 0.05, 0.2)])
def test_bounces_below_the_rounding_of_a_step_are_not_missed(e, g, radius):
    """Steps of adams that an impact has cut grow from lengths in which no digit of the gap changes.

    A ball that falls by h: its series ends at sqrt(2 h / g) (1 + e) / (1 - e), after impacts whose
    work is e^2 of that before.
    """
    h, scene = 1e-3, dap.Scene(name="slow ball")
    scene.add_body("ball", mass=1.0, Jp=[0.1] * 3, r=[0.0, 0.0, radius + h])
    scene.add_force("weight", "gravity", gravity=g)
    scene.add_contact("ball_plane", "floor", P_i="ball.O", radius=radius, e=e)
    ends = np.sqrt(2.0 * h / g) * (1.0 + e) / (1.0 - e)
    result = dap.simulate(scene, t_end=2.0 * ends, dt=ends, integrator="adams")
    (rest,) = (event for event in result.events if event.kind == "rest")
    assert rest.t == pytest.approx(ends, abs=1e-7)
    work = np.array([event.work for event in result.events if event.kind == "impact"])
    work = work[work < -1e-10]  # where m g times the rounding of the radius, 4e-16 J, is little
    assert len(work) > 2
    assert work[1:] / work[:-1] == pytest.approx(e**2, rel=1e-4)
    assert result.r[-1, 0, 2] == pytest.approx(radius, abs=1e-12)


@pytest.mark.parametrize("integrator", INTEGRATORS)
@pytest.mark.parametrize("part", [0.1, 0.3])
@pytest.mark.parametrize(("push", "rise"), [(0.01, 1.0), (0.1, 30.0)])
def test_a_dip_within_the_step_that_leaves_a_contact_is_an_impact(integrator, part, push, rise):
    """z = v t - push t^2 / 2 + rise t^3 / 6: it leaves, dips for a hundredth of a step, and rises.

    Rounding of lengths, 1e-14 m, over its speed bounds the instant.
    """
    v = part * 3.0 * push**2 / (8.0 * rise)
    scene = dap.Scene(name="dip")
    scene.add_body("point", mass=1.0, Jp=[0.01] * 3, r_dot=[0.0, 0.0, v])
    scene.add_function("a", "f", coeff=[-push, rise, 0.0])
    scene.add_force("f", "pull", body_i="point", f=[0.0, 0.0, 1.0], function="f")
    scene.add_contact("ball_plane", "floor", P_i="point.O", e=0.5)
    result = dap.simulate(scene, t_end=5.0 * push / rise, dt=push / rise / 100.0,
                          integrator=integrator, contact="events")  # fmt: skip
    first = min(np.roots([rise / 6.0, -push / 2.0, v]))
    assert times(result, "impact")[0] == pytest.approx(first, abs=1e-14 / v)
    assert result.contact("floor").gap.min() > -1e-12


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_ball_slides_then_rolls_with_five_sevenths_of_its_speed(integrator):
    v, mu = 3.0, 0.3
    result = dap.simulate(ball(v=v, mu=mu), t_end=2.0, dt=0.1, integrator=integrator, **TIGHT)
    t = 2.0 / 7.0 * v / (mu * G)
    assert times(result, "stick") == pytest.approx([t], abs=TOLERANCE)
    assert result.rd[-1, 0, 0] == pytest.approx(5.0 / 7.0 * v, abs=TOLERANCE)
    x = v * t - 0.5 * mu * G * t**2 + 5.0 / 7.0 * v * (2.0 - t)
    assert result.r[-1, 0, 0] == pytest.approx(x, abs=TOLERANCE)
    contact = result.contact("floor")
    assert contact.normal_force == pytest.approx(2.0 * G, abs=TOLERANCE)
    slides = result.t < t
    assert contact.friction[slides, 0] == pytest.approx(-mu * 2.0 * G, abs=TOLERANCE)
    assert contact.friction[~slides, 0] == pytest.approx(0.0, abs=TOLERANCE)
    assert contact.slip[slides, 0] == pytest.approx(v - 3.5 * mu * G * result.t[slides], abs=1e-9)
    assert result.ledger["energy"].value < TOLERANCE


def test_a_ball_rolls_on_a_plate_that_slides():
    """What falls beside what falls: no acceleration but what contacts add says what is rounding."""
    scene, m, M, mu, v = ball(height=0.1, v=1.0), 2.0, 4.0, 0.2, 1.0
    del scene.contacts["floor"]
    scene.add_body("plate", mass=M, Jp=[1e9] * 3, r=[0.0, 0.0, 0.05], r_dot=[v, 0.0, 0.0])
    scene.add_contact("ball_plane", "floor", P_i="plate.O", radius=0.05, mu=mu)
    scene.add_contact("ball_box", "on", P_i="ball.O", P_j="plate.O", radius=0.1, size=(2, 2, 0.1),
                      mu=0.5)  # fmt: skip
    result = dap.simulate(scene, t_end=0.2, dt=0.1, integrator="dop853", **TIGHT)
    a = mu * (M + m) * G / (M + m * 2.0 / 7.0)
    speeds = dict(zip(scene.bodies, result.rd[-1, :, 0], strict=True))
    assert speeds["plate"] == pytest.approx(v - 0.2 * a, abs=1e-8)  # it turns by 1e-9 rad
    assert speeds["ball"] == pytest.approx(v - 0.2 * a * 2.0 / 7.0, abs=1e-8)
    assert np.all(result.contact("on").mode == 2)


@pytest.mark.slow
@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_coulomb_oscillator_stops_where_its_spring_no_longer_overcomes_friction(integrator):
    mu, k, x = 0.2, 100.0, 0.1
    result = dap.simulate(
        spring_block(x, mu, k), t_end=3.0, dt=0.25, integrator=integrator, **TIGHT
    )
    limit, swings = mu * G / k, 0
    while abs(x) > limit:
        x, swings = -(x - 2.0 * limit * np.sign(x)), swings + 1
    assert times(result, "stick", "floor")[-1] == pytest.approx(
        swings * np.pi / np.sqrt(k), abs=TOLERANCE
    )
    assert result.r[-1, 0, 0] == pytest.approx(x, abs=TOLERANCE)
    assert np.max(np.abs(result.rd[-1])) < 1e-15
    assert result.ledger["energy"].value < TOLERANCE


@pytest.mark.parametrize("part", [0.99, 1.01])
def test_a_block_near_its_stick_limit_stays_or_moves(part):
    mu, k = 0.4, 100.0
    limit = mu * G / k
    result = dap.simulate(spring_block(part * limit, mu, k), t_end=10.0, dt=1.0, **TIGHT)
    moved = 0.0 if part < 1.0 else -2.0 * limit * (part - 1.0)
    assert result.r[-1, 0, 0] - part * limit == pytest.approx(moved, abs=1e-12)
    assert np.max(np.abs(result.rd[-1])) < 1e-15


@pytest.mark.parametrize("part", [0.95, 0.999])
def test_a_box_on_four_corners_does_not_creep_on_a_slope(part):
    result = dap.simulate(slope(part), t_end=1000.0, dt=100.0)
    assert np.max(np.abs(result.r - result.r[0])) < 1e-14
    assert np.max(np.abs(result.p - result.p[0])) < 1e-14
    contact = result.contact("floor")
    friction = np.linalg.norm(contact.friction, axis=2)
    mu = np.tan(ANGLE) / part
    assert np.all(friction <= mu * contact.normal_force + 1e-9)  # each corner, in its cone
    assert contact.normal_force.sum(axis=1) == pytest.approx(np.cos(ANGLE) * G, rel=1e-9)


@pytest.mark.parametrize("integrator", INTEGRATORS)
def test_a_ladder_leaves_its_wall_at_two_thirds_of_its_height(integrator):
    length, mass, angle = 2.0, 3.0, 1.0
    J = mass * length**2 / 12.0
    scene = dap.Scene(name="ladder")
    half = 0.5 * length
    p = [np.cos(angle / 2.0), 0.0, np.sin(angle / 2.0), 0.0]
    r = [half * np.cos(angle), 0.0, half * np.sin(angle)]
    scene.add_body("ladder", mass=mass, Jp=[0.01 * J, J, J], r=r, p=p)
    scene.add_point("foot", "ladder", [half, 0.0, 0.0])
    scene.add_point("top", "ladder", [-half, 0.0, 0.0])
    scene.add_force("weight", "g")
    scene.add_contact("ball_plane", "floor", P_i="foot")
    scene.add_contact("ball_plane", "wall", P_i="top", a_j="ground.x")
    result = dap.simulate(scene, t_end=0.7, dt=0.05, integrator=integrator, **TIGHT)
    lift = next(e for e in result.events if e.kind == "lift")
    assert lift.name == "wall"
    assert lift.u[2] / half == pytest.approx(2.0 / 3.0 * np.sin(angle), abs=TOLERANCE)


@pytest.mark.parametrize("gap", [0.0, 0.01])
def test_newtons_cradle_passes_the_speed_on_to_the_last_ball(gap):
    radius = 0.05
    scene = dap.Scene(name="cradle")
    for k in range(4):
        x = k * (2.0 * radius + gap) - (0.0 if k else 0.1)
        v = [0.0 if k else 2.0, 0.0, 0.0]
        scene.add_body(f"b{k}", mass=1.0, Jp=[0.001] * 3, r=[x, 0.0, 0.0], r_dot=v)
    for k in range(3):
        ends = {"P_i": f"b{k}.O", "P_j": f"b{k + 1}.O"}
        scene.add_contact("ball_ball", f"c{k}", **ends, radius_i=radius, radius_j=radius, e=1.0)
    result = dap.simulate(scene, t_end=0.2, dt=0.05, **TIGHT)
    assert result.rd[-1, :, 0] == pytest.approx([0.0, 0.0, 0.0, 2.0], abs=1e-12)
    assert len(times(result, "impact")) == 3


def test_a_ball_leaves_a_sphere_at_two_thirds_of_the_height():
    """Without friction it slides off where cos = 2/3 (1 + v0^2 / (2 g R)), R to its centre."""
    big, small, v = 1.0, 0.1, 0.2
    scene = dap.Scene(name="sphere")
    R = big + small
    r_dot = [v, 0.0, 0.0]
    scene.add_body("ball", mass=1.0, Jp=[0.004] * 3, r=[0.0, 0.0, R], r_dot=r_dot)
    scene.add_force("weight", "g")
    ends = {"P_i": "ball.O", "P_j": "ground.O", "radius_i": small, "radius_j": big}
    scene.add_contact("ball_ball", "top", **ends)
    result = dap.simulate(scene, t_end=1.5, dt=0.1, **TIGHT)
    lift = next(e for e in result.events if e.kind == "lift")
    cosine = 2.0 / 3.0 * (1.0 + v**2 / (2.0 * G * R))
    assert lift.u[2] / R == pytest.approx(cosine, abs=TOLERANCE)


def test_a_ball_bounces_obliquely_by_poissons_law():
    """Friction that reaches its cone in both phases: mu (1 + e) v_n; else rolling at once."""
    v, h, e, mu = 2.0, 0.5, 0.5, 0.1
    result = dap.simulate(ball(height=h, v=v, e=e, mu=mu), t_end=0.4, dt=0.01, **TIGHT)
    impact = next(e for e in result.events if e.kind == "impact")
    normal = np.sqrt(2.0 * G * h)
    after = np.array(impact.u_after)
    assert after[9] == pytest.approx(e * normal, abs=TOLERANCE)
    assert after[7] == pytest.approx(v - mu * (1.0 + e) * normal, abs=TOLERANCE)
    assert after[11] == pytest.approx(2.5 * mu * (1.0 + e) * normal / 0.1, rel=TOLERANCE)
    assert impact.work < 0.0
    assert result.ledger["energy"].value < TOLERANCE


@pytest.mark.parametrize("method", ["lsq", "joint"])
@pytest.mark.parametrize(("e", "mu"), [(0.0, 0.0), (0.5, 0.0), (0.5, 0.1)])
def test_the_work_of_an_impact_has_that_of_what_drives_the_plate(e, mu, method):
    """The motor takes the ball's impulse P: it does P v, the contact loses what a fixed one does.

    P = m (1 + e) v_n along the normal and -mu of that across it, while the ball slides.
    """
    v, at, m, r = 2.0, np.array([0.3, 0.0, 0.4]), 2.0, 0.1
    scene = ball(height=0.2, v=v, e=e, mu=mu, P_j="plate.O", a_j="plate.z")
    scene.add_body("plate", mass=3.0, Jp=[1.0] * 3, r_dot=at)
    scene.add_vector("up", "ground", [0.6, 0.0, 0.8])
    scene.add_function("a", "rises", coeff=[0.0, 0.5, 0.0])
    along = {"P_i": "plate.O", "P_j": "ground.O", "a_j": "up"}
    scene.add_joint("tran", "rail", **along)
    scene.add_joint("drive-tran", "motor", **along, function="rises")
    result = dap.simulate(scene, t_end=0.25, dt=0.05, method=method, **TIGHT)
    impact = next(e for e in result.events if e.kind == "impact")
    normal = np.sqrt(at[2] ** 2 + 2.0 * G * 0.2)
    P = m * (1.0 + e) * normal
    change = (np.array(impact.u_after) - np.array(impact.u))[14:17]
    assert change == pytest.approx([-mu * P / m, 0.0, P / m], abs=TOLERANCE)
    slip = v - at[0] - 0.5 * mu * P * (1.0 / m + r**2 / (0.4 * m * r**2))
    lost = 0.5 * m * (1.0 - e**2) * normal**2 + mu * P * slip
    by_motor = P * at[2] - mu * P * at[0]
    assert impact.work == pytest.approx(by_motor - lost, abs=TOLERANCE)
    assert result.ledger["energy"].value < TOLERANCE


@pytest.mark.slow  # its corners solve their friction in a hundred passes each
def test_a_block_slips_where_its_load_passes_what_holds_and_is_then_slowed_by_less():
    """Load c t: it slips at mu_s m g / c, with acceleration (c t - mu m g) / m from then on."""
    mu, mu_s, c = 0.2, 0.3, 5.0
    scene = dap.Scene(name="pulled")
    scene.add_body("block", mass=1.0, Jp=[0.01] * 3, r=[0.0, 0.0, 0.05])
    scene.add_force("weight", "g")
    scene.add_function("a", "rises", coeff=[0.0, c, 0.0])
    scene.add_force("f", "pull", body_i="block", f=[1.0, 0.0, 0.0], function="rises")
    size = [0.3, 0.3, 0.1]
    scene.add_contact("box_plane", "floor", P_i="block.O", size=size, mu=mu, mu_s=mu_s)
    result = dap.simulate(scene, t_end=1.5, dt=0.05, **TIGHT)
    start = mu_s * G / c
    assert set(np.round(times(result, "slip", "floor"), 9)) == {round(start, 9)}
    t = result.t[result.t > start]
    v = 0.5 * c * (t**2 - start**2) - mu * G * (t - start)
    assert result.rd[result.t > start, 0, 0] == pytest.approx(v, abs=TOLERANCE)
    assert np.max(np.abs(result.rd[result.t < start])) < 1e-15
    assert result.ledger["energy"].value < TOLERANCE


def test_a_hinged_rod_rebounds_from_the_floor_with_its_hinge_held():
    """It falls from the horizontal: w^2 = 3 g sin a / L on the floor, and -e w behind it."""
    length, mass, e, height = 1.0, 2.0, 0.5, 0.5
    J = mass * length**2 / 12.0
    scene = dap.Scene(name="rod")
    scene.add_body("rod", mass=mass, Jp=[0.001, J, J], r=[0.5 * length, 0.0, height])
    scene.add_point("end", "rod", [-0.5 * length, 0.0, 0.0])
    scene.add_point("tip", "rod", [0.5 * length, 0.0, 0.0])
    scene.add_point("hinge", "ground", [0.0, 0.0, height])
    scene.add_joint("rev", "J1", P_i="end", P_j="hinge", a_i="rod.y", a_j="ground.y")
    scene.add_force("weight", "g")
    scene.add_contact("ball_plane", "floor", P_i="tip", e=e)
    result = dap.simulate(scene, t_end=0.7, dt=0.05, **TIGHT)
    impact = next(e for e in result.events if e.kind == "impact")
    w = np.sqrt(3.0 * G * height / length**2)
    assert impact.u[11] == pytest.approx(w, abs=TOLERANCE)
    assert impact.u_after[11] == pytest.approx(-e * w, abs=TOLERANCE)
    assert impact.work == pytest.approx(-mass * length**2 / 6.0 * w**2 * (1 - e**2), abs=1e-9)
    assert result.ledger["energy"].value < TOLERANCE


@pytest.mark.parametrize(("mu", "lean"), [(1.0, 1.0), (2.5, 1.0), (1.6, 1.1)])
def test_slip_that_presses_a_rod_into_the_floor_is_stopped_by_an_impulse(mu, lean):
    """Painleve: of a rod whose end leads as it slides, m = L = 1, N W_NN = g + mu N W_NT.
    Where that has no N the impulse that stops its end is in the cone, and does the work -v p_T / 2.
    """
    v, arm = 1.0, 0.5 * np.array([np.cos(lean), -np.sin(lean)])
    scene = dap.Scene(name="chalk")
    p, r = [np.cos(lean / 2), 0.0, np.sin(lean / 2), 0.0], [0.0, 0.0, -arm[1]]
    scene.add_body("rod", mass=1.0, Jp=[1e-3, 1 / 12, 1 / 12], r=r, p=p, r_dot=[v, 0.0, 0.0])
    scene.add_point("end", "rod", [0.5, 0.0, 0.0])
    scene.add_force("weight", "g")
    scene.add_contact("ball_plane", "floor", P_i="end", mu=mu)
    result = dap.simulate(scene, t_end=0.02, dt=0.01, **TIGHT)
    rows = np.array([[0.0, 1.0, -arm[0]], [1.0, 0.0, arm[1]]])
    W = rows @ np.diag([1.0, 1.0, 12.0]) @ rows.T
    impacts = [event for event in result.events if event.kind == "impact"]
    if mu * W[0, 1] < W[0, 0]:
        assert not impacts
        return
    impulse = np.linalg.solve(W, [0.0, -v])
    assert -impulse[1] < mu * impulse[0]
    assert impacts[0].work == pytest.approx(0.5 * v * impulse[1], rel=1e-12)
    assert impacts[0].u_after[7:13] == pytest.approx(
        [v + impulse[1], 0.0, impulse[0], 0.0, 12.0 * (rows[:, 2] @ impulse), 0.0], abs=1e-12
    )
    assert abs(result.ledger["energy"].value) < TOLERANCE


def test_at_usual_tolerances_instants_and_states_are_right_to_a_millionth():
    v, mu = 3.0, 0.3
    result = dap.simulate(ball(v=v, mu=mu), t_end=2.0, dt=0.1)
    assert times(result, "stick") == pytest.approx([2.0 / 7.0 * v / (mu * G)], abs=1e-6)
    assert result.rd[-1, 0, 0] == pytest.approx(5.0 / 7.0 * v, abs=1e-6)


@pytest.mark.slow
@pytest.mark.parametrize(("mu", "part", "dof"), [(0.5, 5.0 / 7.0, 3), (0.0, 1.0, 5)])
def test_a_ball_in_a_bowl_swings_as_it_rolls_or_slides(mu, part, dof):
    """Linearised in the mode of a run: w^2 = 5/7 g / (R - r) of a ball that rolls."""
    big, small = 1.0, 0.1
    scene = dap.Scene(name="bowl")
    Jp = [0.4 * 2.0 * small**2] * 3
    scene.add_body("ball", mass=2.0, Jp=Jp, r=[0.0, 0.0, small - big])
    scene.add_force("weight", "g")
    ends = {"P_i": "ball.O", "P_j": "ground.O", "radius_i": small, "radius_j": big}
    scene.add_contact("ball_ball", "bowl", **ends, inside=True, mu=mu)
    result = dap.simulate(scene, t_end=0.1, dt=0.05)
    found = dap.linearize(scene, at=result, t=0.1, outputs=["ball.r.x"])
    w = np.sqrt(part * G / (big - small))
    rates = np.sort(np.abs(found.eigenvalues.imag))
    assert rates == pytest.approx([0.0] * (len(rates) - 4) + [w] * 4, abs=TOLERANCE)
    assert (found.dof, found.element_states, found.is_steady) == (dof, (), True)
    assert found.stable


@pytest.mark.slow
def test_feet_that_slide_fast_lift_and_land_without_endless_steps():
    """Three legs on hinges fall over as they slide; energy closes to the tolerance of 1e-10.
    Early stages of a step err by the curvature of what slides, 4e-15 m: cut there, steps of 1e-9 s
    opened and closed the same foot for ever (thousands of calls for some 30)."""
    scene, v = dap.Scene(name="legs"), (-0.82, 0.66, 0.0)
    scene.add_body("trunk", mass=10.0, Jp=(0.2, 0.6, 0.7), r=(0, 0, 0.3), r_dot=v)
    scene.add_force("weight", "gravity")
    for k, (x, y, lean) in enumerate([(0.25, 0.15, -0.07), (-0.25, -0.15, 0), (0.25, -0.15, 0)]):
        place = (x - 0.15 * np.sin(lean), y, 0.3 - 0.15 * np.cos(lean))
        turned = (np.cos(0.5 * lean), 0, np.sin(0.5 * lean), 0)
        scene.add_body(f"leg{k}", mass=1.0, Jp=(0.01, 0.01, 1e-3), r=place, p=turned, r_dot=v)
        scene.add_point(f"socket{k}", "trunk", (x, y, 0))
        scene.add_point(f"top{k}", f"leg{k}", (0, 0, 0.15))
        scene.add_point(f"foot{k}", f"leg{k}", (0, 0, -0.15))
        scene.add_joint("rev", f"hip{k}", P_i=f"top{k}", P_j=f"socket{k}", a_i=f"leg{k}.y",
                        a_j="trunk.y")  # fmt: skip
        scene.add_contact("ball_plane", f"floor{k}", P_i=f"foot{k}", mu=0.6)
    calls = itertools.count()

    def watch(_):
        assert next(calls) < 500

    result = dap.simulate(scene, t_end=0.5, dt=0.05, rtol=1e-10, atol=1e-12, watch=watch)
    assert result.status == "done"
    assert {"lift", "touch", "slip"} <= {event.kind for event in result.events}
    assert result.ledger["energy"].value < 1e-10


def gripper(pads, mass=0.5):
    """A box on the floor, two fingers with pads at (y, z), on a hoist that moves from 0.3 s."""
    scene = dap.Scene(name="gripper")
    scene.add_body("box", mass=mass, Jp=[1e-3] * 3, r=[0.0, 0.0, 0.05])
    scene.add_body("palm", mass=2.0, Jp=[0.01] * 3, r=[0.0, 0.0, 0.3])
    scene.add_joint("tran", "lift", P_i="palm.O", P_j="ground.O", a_j="ground.z")
    scene.add_function("step", "rise", x_start=0.3, x_end=1.3, f_start=0.0, f_end=0.2)
    scene.add_joint("motor", "hoist", joint="lift", position="rise")
    scene.add_contact("box_plane", "floor", P_i="box.O", size=[0.1] * 3, mu=0.5)
    for name, side in (("left", -1.0), ("right", 1.0)):
        scene.add_body(name, mass=0.2, Jp=[1e-4] * 3, r=[side * 0.08, 0.0, 0.05])
        scene.add_point(f"{name}_rail", name, [0.0, 0.0, 0.25])
        scene.add_joint("tran", f"{name}_slide", P_i=f"{name}_rail", P_j="palm.O", a_j="palm.x")
        scene.add_force("tran_sda", joint=f"{name}_slide", f_a=-side * 10.0, c=5.0)
        for k, place in enumerate(pads):
            scene.add_point(f"{name}_tip{k}", name, [-side * 0.02, *place])
            grip = {"P_i": f"{name}_tip{k}", "radius": 0.01, "P_j": "box.O", "size": [0.1] * 3}
            scene.add_contact("ball_box", f"{name}_grip{k}", **grip, mu=0.8)
    scene.add_force("weight", "g")
    return scene


@pytest.mark.parametrize("integrator", ["dop853", "adams"])
def test_a_gripper_of_three_pads_a_finger_lifts_what_stands(integrator):
    """None slips, and together they carry; how left and right share that is a choice."""
    scene = gripper([(-0.02, -0.02), (0.02, -0.02), (0.0, 0.03)])
    result = dap.simulate(scene, t_end=1.0, dt=0.05, integrator=integrator)
    u = np.clip(result.t - 0.3, 0.0, 1.0)
    assert abs(result.r[:, 0, 2] - 0.05 - 0.2 * (3.0 * u**2 - 2.0 * u**3)).max() < TOLERANCE
    grips = [result.contact(f"{side}_grip{k}") for side in ("left", "right") for k in range(3)]
    carried = sum(grip.friction[7:, 2] for grip in grips)
    assert abs(carried + 0.5 * (G + 0.2 * (6.0 - 12.0 * u[7:]))).max() < TOLERANCE
    assert max(abs(grip.slip).max() for grip in grips) < TOLERANCE
    assert {event.kind for event in result.events} == {"touch", "lift"}


@pytest.mark.slow
@pytest.mark.parametrize("mass", [1.46, 1.7])
def test_a_gripper_slips_on_what_is_too_heavy_for_the_hoist(mass):
    """Pads of 2 x 10 N, mu = 0.8, lift 1.46 kg slower than 1.2 m/s^2, and leave 1.7 kg standing."""
    scene = gripper([(-0.02, -0.02), (0.02, -0.02), (0.0, 0.03)], mass)
    result = dap.simulate(scene, t_end=0.34, dt=0.01)
    u, a = np.clip(result.t - 0.3, 0.0, None), max(16.0 / mass - G, 0.0)
    assert abs(result.r[:, 0, 2] - 0.05 - 0.5 * a * u**2).max() < TOLERANCE
    slips = [event for event in result.events if event.kind == "slip"]
    assert slips[0].t == pytest.approx(0.3, abs=1e-8)
    assert not any("floor" in event.name for event in slips)
    pads = [result.contact(f"{side}_grip{k}") for side in ("left", "right") for k in range(3)]
    assert sum(pad.friction[-1, 2] for pad in pads) == pytest.approx(-16.0)


@pytest.mark.parametrize("method", ["lsq", "joint"])
def test_a_gripper_lifts_what_it_holds_and_what_stands(method):
    """Joints hold what the grips would, until the hoist begins to move: the box leaves the floor.

    With the fingers at rest the friction of the grips is a choice, beside that of the floor.
    """
    result = dap.simulate(gripper([(0.0, 0.0)]), t_end=1.0, dt=0.05, method=method)
    u = np.clip(result.t - 0.3, 0.0, 1.0)
    rise = 0.2 * (3.0 * u**2 - 2.0 * u**3)
    assert abs(result.r[:, 0, 2] - 0.05 - rise).max() < TOLERANCE
    assert [e.t for e in result.events if e.kind == "lift"] == pytest.approx([0.3] * 4, abs=1e-8)
    assert not times(result, "slip")
    carried = result.contact("left_grip0")
    held = 0.25 * (G + 0.2 * (6.0 - 12.0 * u))
    assert abs(carried.friction[7:, 2] + held[7:]).max() < TOLERANCE
    assert (carried.mode == 2).all()
    assert abs(carried.slip).max() < TOLERANCE


def test_a_motor_begins_to_turn_a_hinge_that_friction_holds():
    scene = dap.Scene(name="hinge")
    scene.add_body("wheel", mass=2.0, Jp=[0.5, 0.5, 0.3])
    axle = {"P_i": "wheel.O", "P_j": "ground.O", "a_i": "wheel.z", "a_j": "ground.z"}
    scene.add_joint("rev", "axle", **axle)
    scene.add_function("step", "turns", x_start=0.3, x_end=1.3, f_start=0.0, f_end=1.0)
    scene.add_joint("motor", "motor", joint="axle", position="turns")
    scene.add_force("rot_friction", "rub", joint="axle", n_c=0.4)
    result = dap.simulate(scene, t_end=1.2, dt=0.1)
    assert times(result, "slip") == pytest.approx([0.3], abs=1e-8)
    u = result.t[4:] - 0.3
    moment = result.reaction("motor")["i"].moment[4:, 2]
    assert abs(moment - 0.4 - 0.3 * (6.0 - 12.0 * u)).max() < TOLERANCE
