"""What models of other programs mean: gears, followers, starts, limits, inertias, names."""

import numpy as np
import pytest
from support.internals import rotation
from support.process import REPOSITORY

import dap3d_core as dap


def imported(tmp_path, text, suffix, **options):
    path = tmp_path / f"model.{suffix}"
    path.write_text(text)
    return dap.import_model(path, **options)


def texts(remarks):
    return " | ".join(one.text for one in remarks)


def angle_about(scene, name, axis):
    """The angle of a body, drawn without a rotation, about an axis."""
    A = rotation(np.array(scene.bodies[name].p))
    skew = np.array([A[2, 1] - A[1, 2], A[0, 2] - A[2, 0], A[1, 0] - A[0, 1]]) / 2.0
    return np.arctan2(skew @ axis, (np.trace(A) - 1.0) / 2.0)


# --------------------------------------------------------------------------- gearboxes of SDF

WHEEL = """<link name="{0}"><pose>{1} 0 0 {2} 0 0</pose><inertial><mass>1</mass><inertia>
  <ixx>.1</ixx><iyy>.15</iyy><izz>.2</izz></inertia></inertial></link>"""
HINGE = """<joint name="{0}" type="revolute"><parent>{1}</parent><child>{2}</child>
  <axis><xyz>{3}</xyz></axis></joint>"""
GEARBOX = """<joint name="gb" type="gearbox"><parent>{parent}</parent><child>{child}</child>
  {ratio}<gearbox_reference_body>{reference}</gearbox_reference_body>
  <axis><xyz{expressed}>{axis}</xyz></axis><axis2><xyz{expressed}>{axis2}</xyz></axis2></joint>"""


def gears(*, ends=("g1", "g2"), ratio=2.5, axis="0 0 1", axis2="0 0 1", hinges=(), lying=0.0,
          reference="base", expressed=""):  # fmt: skip
    """Two wheels on a base, coupled by a gearbox."""
    hinges = hinges or (("base", "g1", "0 0 1"), ("base", "g2", "0 0 1"))
    parts = [
        WHEEL.format("base", 0, 0),
        WHEEL.format("g1", 0.2, lying),
        WHEEL.format("g2", -0.2, 0),
    ]
    parts.append('<joint name="w" type="fixed"><parent>world</parent><child>base</child></joint>')
    parts += [HINGE.format(f"j{k}", *hinge) for k, hinge in enumerate(hinges, 1)]
    given = "" if ratio is None else f"<gearbox_ratio>{ratio}</gearbox_ratio>"
    box = GEARBOX.format(parent=ends[0], child=ends[1], ratio=given, axis=axis, axis2=axis2,
                         reference=reference, expressed=expressed)  # fmt: skip
    return f'<sdf version="1.9"><model name="m">{"".join(parts)}{box}</model></sdf>'


@pytest.mark.parametrize(
    ("options", "ratio"),
    [
        ({}, -2.5),
        ({"ratio": -3.0}, 3.0),
        ({"ratio": 0.25}, -0.25),
        ({"ratio": None}, -1.0),  # the default of the format
        ({"axis2": "0 0 -1"}, 2.5),
        ({"axis": "0 0 -1"}, 2.5),
        ({"axis": "0 0 -2", "axis2": "0 0 -0.5"}, -2.5),
        ({"ends": ("g2", "g1")}, -1.0 / 2.5),
        ({"ends": ("g2", "g1"), "axis": "0 0 -1"}, 1.0 / 2.5),
        # hinges of any sense: the axes of the gearbox count
        ({"hinges": (("base", "g1", "0 0 -1"), ("g2", "base", "0 0 1"))}, -2.5),
        # a reference body that is fixed to what the hinges name
        ({"hinges": (("world", "g1", "0 0 1"), ("base", "g2", "0 0 1"))}, -2.5),
        ({"reference": "world"}, -2.5),
        # the child is turned by half a turn, and the axes of the gearbox are in its frame
        ({"ends": ("g2", "g1"), "lying": np.pi}, -1.0 / 2.5),
        (
            {"ends": ("g2", "g1"), "lying": np.pi, "expressed": ' expressed_in="__model__"'},
            -1 / 2.5,
        ),
    ],
)
def test_a_gearbox_turns_its_child_by_minus_its_ratio(tmp_path, options, ratio):
    """theta_2 = -ratio theta_1, of the child about axis2 and of the parent about axis.

    Joint element of SDF 1.5 to 1.12, gearbox_ratio and gearbox_reference_body; here as w_g2 / w_g1
    about z. The row is of the velocity level: exact but for rounding and drift of rates, 1e-9.
    """
    scene, report = imported(tmp_path, gears(**options), "sdf")
    assert not report.left_out
    scene.add_force("n", "t", body_i="g1", n=(0.0, 0.0, 1.0))
    result = dap.simulate(scene, t_end=0.5, dt=0.25)
    names = list(scene.bodies)
    w = [result.w[-1, names.index(name), 2] for name in ("g1", "g2")]
    assert abs(w[0]) > 0.05
    assert w[1] / w[0] == pytest.approx(ratio, rel=1e-9)
    # and where it starts
    scene, _ = imported(tmp_path, gears(**options), "sdf", positions={"j1": 0.3})
    starts = [angle_about(scene, name, (0.0, 0.0, 1.0)) for name in ("g1", "g2")]
    if not options.get("lying"):
        np.testing.assert_allclose(starts[1], ratio * starts[0], rtol=1e-14)


@pytest.mark.parametrize(
    ("options", "said"),
    [
        ({"axis": "0 1 0"}, "its <axis> is not parallel to that of joint j1"),
        ({"reference": "g1"}, "no revolute joint holds g1 on g1"),
        ({"reference": "nothing"}, "there is no link or frame nothing"),
        ({"ends": ("g1", "g1")}, "its parent is its child"),
    ],
)
def test_a_gearbox_that_couples_nothing_is_refused(tmp_path, options, said):
    with pytest.raises(dap.SceneError, match=said):
        imported(tmp_path, gears(**options), "sdf")


# --------------------------------------------------------------------------- followers

FINGERS = {
    "urdf": """<robot name="f"><link name="base"/>{links}
      {joints}</robot>""",
    "sdf": '<sdf version="1.11"><model name="f">{links}{joints}</model></sdf>',
    "xml": "<mujoco><worldbody>{links}</worldbody><equality>{joints}</equality></mujoco>",
}
#: a follows nothing, b follows a by -2 and 0.1, c follows b by 0.5 and -0.3
CHAIN = (("a", None, 1.0, 0.0), ("b", "a", -2.0, 0.1), ("c", "b", 0.5, -0.3))


def chain(suffix, chain=CHAIN, limits="-9 9"):
    """Sliders along y, each of which may follow another."""
    low, high = limits.split()
    links, joints = "", ""
    for name, leader, ratio, offset in chain:
        if suffix == "urdf":
            links += f"""<link name="{name}"><inertial><mass value="1"/>
              <inertia ixx="1" iyy="1" izz="1"/></inertial></link>"""
            mimic = f'<mimic joint="q{leader}" multiplier="{ratio}" offset="{offset}"/>'
            joints += f"""<joint name="q{name}" type="prismatic"><parent link="base"/>
              <child link="{name}"/><axis xyz="0 1 0"/>{mimic if leader else ""}
              <limit lower="{low}" upper="{high}" effort="1" velocity="1"/></joint>"""
        elif suffix == "sdf":
            links += f'<link name="{name}"/>'
            # q = multiplier (q_leader - reference) + offset
            mimic = f"""<mimic joint="q{leader}" axis="axis"><multiplier>{ratio}</multiplier>
              <offset>{offset + 0.25 * ratio}</offset><reference>0.25</reference></mimic>"""
            joints += f"""<joint name="q{name}" type="prismatic"><parent>world</parent>
              <child>{name}</child><axis><xyz>0 1 0</xyz>{mimic if leader else ""}
              <limit><lower>{low}</lower><upper>{high}</upper></limit></axis></joint>"""
        else:
            links += f"""<body name="{name}"><joint name="q{name}" type="slide" axis="0 1 0"
              range="{low} {high}"/><geom size="0.1"/></body>"""
            if leader:
                joints += f"""<joint joint1="q{name}" joint2="q{leader}"
                  polycoef="{offset} {ratio} 0 0 0"/>"""
    return FINGERS[suffix].format(links=links, joints=joints)


@pytest.mark.parametrize("suffix", FINGERS)
@pytest.mark.parametrize(
    ("given", "a"),
    [({}, 0.0), ({"qa": 0.04}, 0.04), ({"qb": 0.5}, -0.2), ({"qc": 0.25}, -0.5),
     ({"qa": 0.04, "qc": -0.29}, 0.04)],
)  # fmt: skip
def test_a_start_moves_all_that_are_coupled(tmp_path, suffix, given, a):
    """q_b = 0.1 - 2 q_a and q_c = 0.5 q_b - 0.3, whichever is given; rates by the ratios."""
    scene, _ = imported(tmp_path, chain(suffix), suffix, positions=given, rates={"qb": 0.6})
    places = [scene.bodies[name].r[1] for name in "abc"]
    b = 0.1 - 2.0 * a
    np.testing.assert_allclose(places, (a, b, 0.5 * b - 0.3), rtol=0, atol=1e-15)
    speeds = [scene.bodies[name].r_dot[1] for name in "abc"]
    np.testing.assert_allclose(speeds, (-0.3, 0.6, 0.3), rtol=1e-15)
    note = dap.simulate(scene, t_end=0.0).notes
    assert not any("initial" in one for one in note)


@pytest.mark.parametrize("suffix", FINGERS)
def test_a_start_that_contradicts_a_coupling_is_refused(tmp_path, suffix):
    with pytest.raises(
        dap.SceneError, match=r"position of qc = 0\.5: it is coupled with qa.*-0\.2"
    ):
        imported(tmp_path, chain(suffix), suffix, positions={"qa": 0.0, "qc": 0.5})
    with pytest.raises(dap.SceneError, match=r"rate of qb = 1: it is coupled with qa.* -2"):
        imported(tmp_path, chain(suffix), suffix, rates={"qa": 1.0, "qb": 1.0})


@pytest.mark.parametrize("suffix", FINGERS)
def test_coupled_joints_keep_to_the_limits_of_all(tmp_path, suffix):
    """q_a = 0.6 would put q_b at -1.1 and q_c at -0.85, beyond -0.5: q_a = 0.25 is the last."""
    scene, report = imported(tmp_path, chain(suffix, limits="-0.5 0.9"), suffix,
                             positions={"qa": 0.6})  # fmt: skip
    places = [scene.bodies[name].r[1] for name in "abc"]
    np.testing.assert_allclose(places, (0.25, -0.4, -0.5), rtol=0, atol=1e-15)
    assert "joint qb starts at -1.1, beyond its limits" in texts(report.translated)


def test_limits_that_leave_coupled_joints_no_room_are_said(tmp_path):
    """q_b = -2 q_a with both in 0 to 0.5: they stand between stops, and are not merged."""
    pair = (("a", None, 1.0, 0.0), ("b", "a", -2.0, 0.0))
    scene, report = imported(tmp_path, chain("urdf", pair, limits="0 0.5"), "urdf")
    assert {"a", "b"} <= scene.bodies.keys()
    assert "limits of qa, qb, which are coupled, leave them no room" in texts(report.translated)


@pytest.mark.parametrize("suffix", FINGERS)
def test_joints_that_are_coupled_with_a_fixed_one_are_fixed(tmp_path, suffix):
    """q_a at 0.3 by equal limits, or by an equality of its own, holds b and c as well."""
    links = (*CHAIN, ("d", None, 1.0, 0.0))
    text = chain(suffix, links)
    for wide, narrow in ((">-9<", ">0.3<"), (">9<", ">0.3<"), ('lower="-9"', 'lower="0.3"'),
                         ('upper="9"', 'upper="0.3"')):  # fmt: skip
        text = text.replace(wide, narrow, 1)
    text = text.replace("<equality>", '<equality><joint joint1="qa" polycoef="0.3 0 0 0 0"/>')
    scene, report = imported(tmp_path, text, suffix)
    assert list(scene.bodies) == ["d"]
    assert "coupling" not in texts(report.left_out)
    with pytest.raises(dap.SceneError, match=r"position of qc = 1: it is coupled with q[ab]"):
        imported(tmp_path, text, suffix, positions={"qc": 1.0} | ({} if suffix == "xml" else
                                                                   {"qa": 0.3}))  # fmt: skip


def test_a_joint_that_follows_a_fixed_one_is_where_that_puts_it(tmp_path):
    """A fixed joint of URDF is at zero: q_b = 0.25."""
    text = chain("urdf", (("a", None, 1.0, 0.0), ("b", "a", -2.0, 0.25), ("c", None, 1.0, 0.0)))
    text = text.replace('name="qa" type="prismatic"', 'name="qa" type="fixed"')
    text = text.replace('<link name="b">', '<link name="b"><visual><geometry><box size="1 1 1"/>'
                        '</geometry></visual>')  # fmt: skip
    scene, _ = imported(tmp_path, text, "urdf")
    assert list(scene.bodies) == ["c"]
    assert scene.shapes["b_box"].fields["at"] == (0.0, 0.25, 0.0)


@pytest.mark.parametrize("ixx", ["0", "1e-20", "0.01"])
def test_coupled_links_may_have_no_inertia(tmp_path, ixx):
    """Points of 1 and 3 kg at 0.5 m and 0.2 m about vertical axes, q_b = -2 q_a, a moment on a."""
    link = """<link name="{0}"><inertial><origin xyz="{1} 0 0"/><mass value="{2}"/>
      <inertia ixx="{3}" iyy="{3}" izz="{3}"/></inertial></link><joint name="q{0}"
      type="continuous"><parent link="base"/><child link="{0}"/><axis xyz="0 0 1"/>{4}</joint>"""
    text = link.format("a", 0.5, 1, ixx, "")
    text += link.format("b", 0.2, 3, ixx, '<mimic joint="qa" multiplier="-2"/>')
    text = f'<robot name="p"><link name="base"/>{text}</robot>'
    scene, _ = imported(tmp_path, text, "urdf", positions={"qa": 0.4})
    scene.add_force("n", "t", body_i="a", n=(0.0, 0.0, 1.5))
    result = dap.simulate(scene, t_end=0.5, dt=0.25)
    inertia = 0.25 + float(ixx) + 4.0 * (3.0 * 0.04 + float(ixx))
    # the wheel between them adds a millionth of the least inertia
    np.testing.assert_allclose(result.wd[:, 0, 2], 1.5 / inertia, rtol=1e-6)
    np.testing.assert_allclose(result.w[:, 1, 2], -2.0 * result.w[:, 0, 2], rtol=1e-9, atol=1e-12)


def test_a_start_is_counted_as_the_file_counts_it(tmp_path):
    """qpos of MJCF: ref is the coordinate of the pose that the file draws, here 30 deg and 0.2."""
    text = """<mujoco><worldbody>
      <body name="a"><joint name="turn" axis="0 0 1" ref="30" range="-60 90"/>
        <geom size="0.1" pos="1 0 0"/></body>
      <body name="b"><joint name="slide" type="slide" axis="0 1 0" ref="0.2" range="-1 1"/>
        <geom size="0.1"/></body></worldbody>
      <equality><joint joint1="slide" joint2="turn" polycoef="0 0.5 0 0 0"/></equality></mujoco>"""
    scene, _ = imported(tmp_path, text, "xml", positions={"turn": 1.0})
    turned = 1.0 - np.pi / 6.0
    assert angle_about(scene, "a", (0.0, 0.0, 1.0)) == pytest.approx(turned, rel=1e-14)
    assert scene.bodies["b"].r[1] == pytest.approx(0.5 * turned, rel=1e-14)
    scene, report = imported(tmp_path, text, "xml", positions={"slide": 3.0})
    assert "joint slide starts at 3, beyond its limits -1 and 1: it is put at" in texts(
        report.translated
    )
    scene, _ = imported(tmp_path, text, "xml")  # where the file draws it
    assert angle_about(scene, "a", (0.0, 0.0, 1.0)) == 0.0


# --------------------------------------------------------------------------- limits


def hinge(suffix, lower, upper, kind="revolute"):
    """One joint about or along z with limits as words of its file."""
    if suffix == "urdf":
        return f"""<robot name="h"><link name="base"/><link name="a"><inertial><mass value="2"/>
          <inertia ixx="1" iyy="1" izz="0.3"/></inertial></link><joint name="q" type="{kind}">
          <parent link="base"/><child link="a"/><axis xyz="0 0 1"/>
          <limit lower="{lower}" upper="{upper}" effort="1" velocity="1"/></joint></robot>"""
    if suffix == "sdf":
        return f"""<sdf version="1.7"><world name="w"><gravity>0 0 0</gravity><model name="h">
          <link name="a"><inertial><mass>2</mass><inertia><izz>0.3</izz></inertia></inertial></link>
          <joint name="q" type="{kind}"><parent>world</parent><child>a</child><axis>
          <xyz>0 0 1</xyz><limit><lower>{lower}</lower><upper>{upper}</upper></limit></axis>
          </joint></model></world></sdf>"""
    type_ = {"revolute": "hinge", "prismatic": "slide"}[kind]
    return f"""<mujoco><option gravity="0 0 0"/><compiler angle="radian"/><worldbody><body name="a">
      <joint name="q" type="{type_}" axis="0 0 1" range="{lower} {upper}"/>
      <inertial pos="0 0 0" mass="2" diaginertia="1 1 0.3"/></body></worldbody></mujoco>"""


@pytest.mark.parametrize("suffix", FINGERS)
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
@pytest.mark.parametrize("words", ["1.79769e+308", "1e16", "inf", "INF", "2147483647", "1e300"])
def test_limits_of_a_program_s_largest_numbers_are_none(tmp_path, suffix, kind, words):
    scene, _ = imported(tmp_path, hinge(suffix, f"-{words}", words, kind), suffix)
    assert not any("stop" in force.type for force in scene.forces.values())
    scene, _ = imported(tmp_path, hinge(suffix, "-0.5", words, kind), suffix)
    assert sum("stop" in force.type for force in scene.forces.values()) == 1


@pytest.mark.parametrize("suffix", FINGERS)
@pytest.mark.parametrize("pair", [("nan", "1"), ("2", "1"), ("inf", "inf"), ("-inf", "-inf")])
def test_limits_that_hold_nothing_are_refused(tmp_path, suffix, pair):
    if suffix == "xml" and pair[0] == pair[1]:
        pytest.skip("MuJoCo makes no limit of equal ones")
    with pytest.raises(dap.SceneError, match=r"should be|above upper|no coordinate"):
        imported(tmp_path, hinge(suffix, *pair), suffix)


@pytest.mark.parametrize("suffix", ["urdf", "sdf"])
@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_a_joint_of_equal_limits_is_fixed_there(tmp_path, suffix, kind):
    text = hinge(suffix, "0.4", "0.4", kind).replace('name="base"/>', 'name="base"/>')
    other = text.replace("0.4", "-0.4")
    with pytest.raises(dap.SceneError, match="no link of the model moves"):
        imported(tmp_path, text, suffix)
    scene, _ = imported(tmp_path, other, suffix, limits="off", positions={"q": 1.0})
    assert len(scene.bodies) == 1


@pytest.mark.parametrize("limits", ["soft", "hard"])
@pytest.mark.parametrize("suffix", FINGERS)
def test_a_joint_that_starts_beyond_its_limit_is_put_at_it(tmp_path, suffix, limits):
    text = hinge(suffix, "0.25", "1", "prismatic")
    scene, report = imported(tmp_path, text, suffix, limits=limits)
    assert scene.bodies["a"].r[2] == 0.25
    assert "joint q starts at 0, beyond its limits 0.25 and 1: it is put at 0.25" in texts(
        report.translated
    )
    scene, report = imported(tmp_path, text, suffix, limits="off")
    assert scene.bodies["a"].r[2] == 0.0
    assert not any("stop" in force.type for force in scene.forces.values())


@pytest.mark.parametrize(("kind", "inertia"), [("revolute", 0.3), ("prismatic", 2.0)])
def test_a_soft_stop_is_critically_damped(tmp_path, kind, inertia):
    """x = v t exp(-t / T) beyond the limit until the force is zero, at 2 T, at the rate -v exp(-2).

    The deepest point is v T / e. The run holds 1e-10 of its rates; the stop is 1e-12 s early.
    """
    text = hinge("xml", "-0.5", "0.1", kind)
    scene, report = imported(tmp_path, text, "xml", rates={"q": 2.0})
    assert "critically damped" in report.translated[0].text
    T = 2e-3
    assert "a time constant of 2 ms" in report.translated[0].text
    stops = [f for f in scene.forces.values() if "stop" in f.type]
    assert [f.fields["k"] for f in stops] == pytest.approx([inertia / T**2] * 2, rel=1e-14)
    at = 0.1 / 2.0
    result = dap.simulate(scene, t_end=at + T, dt=at + T, rtol=1e-11, atol=1e-13)
    q = result.quantity("q.angle" if kind == "revolute" else "q.length").values.ravel()
    assert q[-1] - 0.1 == pytest.approx(2.0 * T / np.e, rel=1e-7)
    result = dap.simulate(scene, t_end=at + 3.0 * T, dt=at + 3.0 * T, rtol=1e-11, atol=1e-13)
    rate = (result.w if kind == "revolute" else result.rd)[-1, 0, 2]
    assert rate == pytest.approx(-2.0 * np.exp(-2.0), rel=1e-7)


@pytest.mark.parametrize("start", [5.0, -5.5, 9.9])
def test_a_joint_that_starts_beyond_half_a_turn_meets_its_own_stop(tmp_path, start):
    """A limit of 6 rad is 1 rad from a start at 5 rad: it is met after 0.5 s at 2 rad/s."""
    text = hinge("xml", -10.0, start + 1.0)
    scene, _ = imported(tmp_path, text, "xml", positions={"q": start}, rates={"q": 2.0},
                        limits="hard")  # fmt: skip
    (jump,) = [one for one in dap.simulate(scene, t_end=1.0).events if one.kind == "impact"]
    assert jump.t == pytest.approx(0.5, abs=1e-9)


def test_limits_within_half_a_turn_keep_their_digits(tmp_path):
    scene, _ = imported(tmp_path, hinge("xml", 0.1, 0.4), "xml", positions={"q": 0.3})
    bounds = [scene.forces[f"q_{side}_stop"].fields["theta_stop"] for side in ("min", "max")]
    assert bounds == [0.1, 0.4]


def test_a_spring_is_wound_by_whole_turns(tmp_path):
    """k (q - springref), at 7 rad and -9 rad of a joint that may turn more than once."""
    text = hinge("xml", -20.0, 20.0).replace('name="q"', 'name="q" stiffness="3" springref="-9"')
    scene, _ = imported(tmp_path, text, "xml", positions={"q": 7.0})
    result = dap.simulate(scene, t_end=0.0)
    assert result.wd[0, 0, 2] == pytest.approx(-3.0 * 16.0 / 0.3, rel=1e-13)


@pytest.mark.parametrize("kind", ["revolute", "prismatic"])
def test_a_hard_stop_ends_the_rate_at_once(tmp_path, kind):
    """At 0.1 / 2 = 0.05 s, to the rounding of the instant; it stays there."""
    scene, report = imported(tmp_path, hinge("xml", "-0.5", "0.1", kind), "xml",
                             rates={"q": 2.0}, limits="hard")  # fmt: skip
    assert "ends at once" in report.translated[0].text
    result = dap.simulate(scene, t_end=0.2, dt=0.1)
    q = result.quantity("q.angle" if kind == "revolute" else "q.length").values.ravel()
    np.testing.assert_allclose(q[1:], 0.1, rtol=0, atol=1e-9)
    assert abs((result.w if kind == "revolute" else result.rd)[-1, 0, 2]) < 1e-14
    (jump,) = [one for one in result.events if one.kind == "impact"]
    assert jump.t == pytest.approx(0.05, abs=1e-12)


def test_stops_see_the_inertia_of_all_that_moves(tmp_path):
    """Of two sliders of 1 and 3 kg in a row: the force on the second moves 3 kg, and with it 1 kg
    the other way while both are free: 1 / (1 / 1 + 1 / 3); of the first 1 + 3 - 3 = 1 kg. Coupled
    sliders of m and ratio 2 see the whole: m (1 + 4), and that over 4."""
    text = """<mujoco><option gravity="0 0 0"/><worldbody><body name="a">
      <joint name="p" type="slide" axis="1 0 0" range="-1 1"/>
      <inertial pos="0 0 0" mass="1" diaginertia="1 1 1"/><body name="b">
      <joint name="q" type="slide" axis="1 0 0" range="-1 1"/>
      <inertial pos="0 0 0" mass="3" diaginertia="1 1 1"/></body></body></worldbody>{}</mujoco>"""
    scene, _ = imported(tmp_path, text.format(""), "xml")
    seen = [scene.forces[f"{name}_min_stop"].fields["m_c"] for name in "pq"]
    np.testing.assert_allclose(seen, (1.0, 0.75), rtol=1e-14)
    held = '<equality><joint joint1="q" joint2="p" polycoef="0 2 0 0 0"/></equality>'
    scene, _ = imported(tmp_path, text.format(held), "xml")
    seen = [scene.forces[f"{name}_min_stop"].fields["m_c"] for name in "pq"]
    whole = 1.0 + 3.0 * 9.0  # q_b = q_p + q_q = 3 q_p
    np.testing.assert_allclose(seen, (whole, whole / 4.0), rtol=1e-13)


def test_stops_of_a_loop_see_what_the_loop_moves(tmp_path):
    """A parallelogram of massless-free bars: both cranks see (I + m a^2) twice and the coupler."""
    bar = '<inertial pos="0 0 0" mass="0.5" diaginertia="0.1 0.2 0.15"/>'
    text = f"""<mujoco><option gravity="0 0 0"/><worldbody>
      <body name="left"><joint name="l" axis="0 1 0" range="-40 40"/>{bar}
        <body name="coupler" pos="0 0 -1"><joint name="p" axis="0 1 0"/>
          <inertial pos="1 0 0" mass="2" diaginertia="0.1 0.7 0.7"/></body></body>
      <body name="right" pos="2 0 0"><joint name="r" axis="0 1 0" range="-40 40"/>{bar}</body>
      </worldbody><equality><connect body1="right" body2="coupler" anchor="0 0 -1"/></equality>
      </mujoco>"""
    scene, _ = imported(tmp_path, text, "xml")
    seen = [scene.forces[f"{name}_min_stop"].fields["J_c"] for name in "lr"]
    np.testing.assert_allclose(seen, 2.0 * 0.2 + 2.0 * 1.0, rtol=1e-12)


@pytest.mark.parametrize("slide", ["slide0", "slide3"])
def test_stops_of_a_platform_see_the_mass_that_a_force_moves(slide):
    """By the accelerations of the scene itself, of six loops, with and without 1 N on a slide.

    The leg's foot lies on the axis, along which its end slides: to rounding of sums, 1e-12.
    """
    accelerations = []
    for force in (0.0, 1.0):
        scene, _ = dap.import_model(REPOSITORY / "models" / "robots" / "stewart.xml", shapes=False)
        slider, stop = scene.joints[slide].fields, scene.forces[f"{slide}_min_stop"].fields
        ends = {key: slider[key] for key in ("P_i", "P_j", "a_j")}
        scene.add_force("tran_sda", "push", f_a=force, **ends)
        result = dap.simulate(scene, t_end=0.0)
        inner, foot = slider["P_i"].removesuffix(".O"), scene.points[slider["P_j"]]
        i, j = (list(scene.bodies).index(name) for name in (inner, foot.body))
        A = rotation(result.p[0, j])
        assert slider["a_j"] == f"{foot.body}.x"
        apart = result.rdd[0, i] - result.rdd[0, j] - np.cross(result.wd[0, j], A @ foot.sPp)
        accelerations.append(A[:, 0] @ apart)
    seen = 1.0 / (accelerations[1] - accelerations[0])
    assert stop["m_c"] == pytest.approx(seen, rel=1e-12)


# --------------------------------------------------------------------------- inertias of zero

POINT = """<link name="{0}"><inertial><origin xyz="{1}"/><mass value="{2}"/>
  <inertia ixx="{3}" iyy="{3}" izz="{3}"/></inertial></link>
  <joint name="q{0}" type="continuous"><parent link="{4}"/><child link="{0}"/>
  <origin xyz="{5}"/><axis xyz="0 1 0"/></joint>"""


@pytest.mark.parametrize("tiny", [0.0, 1e-30])
@pytest.mark.parametrize("last", [1e-3, 1e3])
def test_a_double_pendulum_of_points_moves_as_its_closed_form(tmp_path, tiny, last):
    """Lagrange's equations of two points of 1 and ``last`` kg at 0.7 and 0.4 m.

    Stand-ins are 1e-11 of what the joints carry, a tip of 1e-15 kg m^2 hangs at the second.
    """
    l1, l2, m1, m2, g = 0.7, 0.4, 1.0, last, 9.81
    tip = POINT.format("tip", "0 0 0", 1e-6 * last, 1e-15, "b", f"0 0 {-l2}")
    text = POINT.format("a", f"0 0 {-l1}", m1, tiny, "base", "0 0 1")
    text += POINT.format("b", f"0 0 {-l2}", m2, tiny, "a", f"0 0 {-l1}") + tip
    q, rates = np.array([0.7, -1.1]), np.array([0.3, -2.0])
    scene, report = imported(
        tmp_path, f'<robot name="p"><link name="base"/>{text}</robot>', "urdf",
        positions={"qa": q[0], "qb": q[1]}, rates={"qa": rates[0], "qb": rates[1], "qtip": 1.7},
    )  # fmt: skip
    assert "method joint" in texts(report.translated)
    m2 += 1e-6 * last  # the tip hangs at the second point
    t1, t2 = q[0], q.sum()
    w1, w2 = rates[0], rates.sum()
    M = [[(m1 + m2) * l1**2, m2 * l1 * l2 * np.cos(t1 - t2)],
         [m2 * l1 * l2 * np.cos(t1 - t2), m2 * l2**2]]  # fmt: skip
    s = m2 * l1 * l2 * np.sin(t1 - t2)
    right = [-s * w2**2 - (m1 + m2) * g * l1 * np.sin(t1), s * w1**2 - m2 * g * l2 * np.sin(t2)]
    expected = np.linalg.solve(M, right)
    result = dap.simulate(scene, t_end=0.2, dt=0.1)
    assert result.method == "joint"
    names = list(scene.bodies)
    found = [result.wd[0, names.index(name), 1] for name in "ab"]
    np.testing.assert_allclose(found, expected, rtol=1e-8)
    assert result.ledger["energy"].ok


def test_a_limit_of_urdf_without_bounds_is_none_and_says_so(tmp_path):
    text = hinge("urdf", "-1", "1").replace('lower="-1" upper="1" ', "")
    scene, report = imported(tmp_path, text, "urdf")
    assert [force for force in scene.forces if force != "gravity"] == []
    [said] = [one for one in report.translated if "<limit> without lower and upper" in one.text]
    assert said.motion


# --------------------------------------------------------------------------- files and names


@pytest.mark.parametrize("suffix", FINGERS)
def test_comments_may_hold_two_dashes(tmp_path, suffix):
    """As tinyxml2 reads them, which Gazebo, MuJoCo and urdfdom use; lines keep their numbers."""
    text = hinge(suffix, "-1", "1")
    comments = "<!-- gz topic --help\n --><!----><!-- a -- b --->\n<!-- <joint/> -- -->"
    root, _, rest = text.partition(">")
    scene, _ = imported(tmp_path, f"{root}>{comments}{rest}", suffix)
    assert list(scene.bodies) == ["a"]
    with pytest.raises(dap.SceneError, match=r":6: is not well-formed XML: mismatched tag"):
        imported(tmp_path, f"{root}>{comments}\n\n\n</wrong>", suffix)
    with pytest.raises(dap.SceneError, match="document type"):
        imported(tmp_path, f"<!DOCTYPE a><!-- -- -->{text}", suffix)


@pytest.mark.parametrize("before", ["\n", "<!-- by -->\n", "\n<!-- a -- b -->  <!-- c -->"])
def test_a_declaration_may_come_after_blanks_and_comments(tmp_path, before):
    text = hinge("urdf", "-1", "1")
    late = f'{before}<?xml version="1.0"?>'
    scene, _ = imported(tmp_path, f"{late}{text}", "urdf")
    assert list(scene.bodies) == ["a"]
    line = before.count("\n") + 2
    with pytest.raises(dap.SceneError, match=rf":{line}: is not well-formed XML: mismatched tag"):
        imported(tmp_path, f"{late}\n<robot></wrong>", "urdf")
    with pytest.raises(dap.SceneError, match="XML or text declaration not at start of entity"):
        imported(tmp_path, f"<robot>{late}</robot>", "urdf")


NESTED = """<sdf version="1.9"><model name="outer">
  <link name="base"/><joint name="w" type="fixed"><parent>world</parent><child>base</child></joint>
  <model name="inner" {canonical}><pose>0 0 1 0 0 0</pose>
    <link name="a"/><link name="b"><pose>0.5 0 0 0 0 0</pose></link>
    <joint name="ab" type="fixed"><parent>a</parent><child>b</child></joint>
    <model name="deep"><pose>0 0 2 0 0 0</pose><link name="c"/></model>
    {static}</model>
  <joint name="j" type="revolute"><parent>base</parent><child>{child}</child>
    <axis><xyz>0 1 0</xyz></axis></joint>
  <joint name="k" type="revolute"><parent>{parent}</parent><child>inner::deep</child>
    <axis><xyz>0 1 0</xyz></axis></joint></model></sdf>"""


def test_a_joint_may_name_a_nested_model(tmp_path):
    """Its frame is that of the model, its link the canonical one: the first by default."""
    joined = {"canonical": "", "static": "", "child": "inner", "parent": "inner"}
    scene, _ = imported(tmp_path, NESTED.format(**joined), "sdf", positions={"j": np.pi / 2})
    assert list(scene.bodies) == ["inner::a", "inner::deep::c"]
    # the model frame lies at (0, 0, 1), about which all turns, and the deep model at (0, 0, 3)
    np.testing.assert_allclose(scene.bodies["inner::a"].r, (0.0, 0.0, 0.75), atol=1e-15)
    np.testing.assert_allclose(scene.bodies["inner::deep::c"].r, (2.0, 0.0, 1.0), atol=1e-15)
    joined |= {"canonical": 'canonical_link="b"'}
    text = NESTED.format(**joined).replace('<joint name="ab" type="fixed">', '<joint name="ab" '
                                           'type="revolute">')  # fmt: skip
    text = text.replace("<child>b</child>", "<child>b</child><axis><xyz>0 1 0</xyz></axis>")
    scene, _ = imported(tmp_path, text.replace("<parent>a</parent>", "<parent>world</parent>"),
                        "sdf", positions={"j": np.pi / 2})  # fmt: skip
    assert scene.joints["j"].fields["P_i"] in ("inner::b.O", "j_i")


def test_links_in_nested_models_of_a_static_one_stand_still(tmp_path):
    text = """<sdf version="1.9"><world name="w"><model name="wall"><static>true</static>
      <link name="a"/><model name="in"><link name="b"/></model></model>
      <model name="ball"><link name="c"/></model></world></sdf>"""
    scene, _ = imported(tmp_path, text, "sdf")
    assert list(scene.bodies) == ["ball::c"]


def test_joints_and_frames_of_a_world_are_read(tmp_path):
    text = """<sdf version="1.12"><world name="w"><frame name="f"><pose>0 0 1 0 0 0</pose></frame>
      <model name="m"><pose relative_to="f">1 0 0 0 0 0</pose><link name="a"/></model>
      <joint name="j" type="revolute"><parent>world</parent><child>m</child>
      <axis><xyz>0 1 0</xyz></axis></joint></world></sdf>"""
    scene, _ = imported(tmp_path, text, "sdf")
    assert scene.joints["j"].type == "rev"
    assert scene.bodies["m::a"].r == (1.0, 0.0, 1.0)


XACRO = """<robot name="g" xmlns:xacro="http://www.ros.org/wiki/xacro">
<xacro:arg name="L"{}/><xacro:arg name="unused" default="1"/>
<link name="base"/><link name="l"><inertial><origin xyz="$(arg L) 0 0"/><mass value="1"/>
<inertia ixx="0.01" iyy="0.01" izz="0.01"/></inertial></link>
<joint name="j" type="continuous"><parent link="base"/><child link="l"/><axis xyz="0 1 0"/></joint>
</robot>"""


def test_arguments_of_a_xacro_file(tmp_path):
    """Given, by default, missing, and unknown ones."""
    pytest.importorskip("xacrodoc")
    lengths = [
        ("", {"L": 2}, 2.0),
        (' default="0.5"', {"L": "0.7"}, 0.7),
        (' default="0.5"', {}, 0.5),
    ]
    for default, arguments, length in lengths:
        scene, _ = imported(tmp_path, XACRO.format(default), "urdf.xacro", allow_code=True,
                            arguments=arguments)  # fmt: skip
        assert scene.bodies["l"].r[0] == length
    with pytest.raises(
        dap.SceneError, match=r":2: the argument L has no default\n.*--arg L:=VALUE"
    ):
        imported(tmp_path, XACRO.format(""), "xacro", allow_code=True)
    with pytest.raises(dap.SceneError, match=r"has no argument 'K'; it has L, unused"):
        imported(tmp_path, XACRO.format(""), "xacro", allow_code=True, arguments={"L": 1, "K": 2})


def test_a_file_without_macros_has_no_arguments(tmp_path):
    with pytest.raises(dap.SceneError, match="takes no argument 'L'"):
        imported(tmp_path, hinge("urdf", "-1", "1"), "urdf", arguments={"L": 1})


def test_what_changes_the_motion_comes_first(tmp_path):
    text = hinge("urdf", "-1", "1").replace(
        "<inertial>", "<visual/><collision><geometry><box size='1 1 1'/></geometry>"
        "<contact_coefficients mu='1'/></collision><inertial>"
    ).replace("<limit", "<calibration rising='0'/><limit")  # fmt: skip
    _, report = imported(tmp_path, text, "urdf")
    for listed in (report.translated, report.left_out):
        moves = [one.motion for one in listed]
        assert moves == sorted(moves, reverse=True)
        assert moves[0]
    assert "contact" in report.left_out[0].text
    assert not report.left_out[-1].motion


# --------------------------------------------------------------------------- contacts

LEGS = """<mujoco><worldbody><geom type="plane" size="1 1 1"/><body pos="0 0 .1"><freejoint/>
  <inertial mass=".01" pos="0 0 0" diaginertia="1e-5 1e-5 1e-5"/>{}</body></worldbody></mujoco>"""
LEG = """<body euler="0 0 {}"><inertial mass=".001" pos="0 0 0" diaginertia="1e-6 1e-6 1e-6"/>
  <body pos=".05 0 0"><joint axis="0 1 0" armature="1"/>
  <inertial mass=".001" pos=".05 0 -.04" diaginertia="1e-6 1e-6 1e-6"/>
  <geom type="sphere" size=".02" pos=".1 0 -.08000001"/></body></body>"""


def test_feet_of_light_links_with_heavy_rotors_stick(tmp_path):
    """A rotor of 1e6 times the moment of its leg gives no foot away: nothing accelerates.

    By statics each leg carries N = W / 4, and N d = T d + m g d / 2 about its hip, d = 0.1 m; the
    overlap of 1e-8 m at the start, without which gaps are rounding, turns legs by 1e-7.
    """
    text = LEGS.format("".join(LEG.format(angle) for angle in (0, 90, 180, 270)))
    scene, _ = imported(tmp_path, text, "xml", contacts=True)
    h = 1e-6
    found = dap.simulate(scene, t_end=h, dt=h, contact_step=h, contact="stepping")
    g, push = 9.81, 0.018 * 9.81 / 4.0
    assert np.abs(found.w[-1]).max() / h < 1e-9  # 1.2e-3 rad/s^2 by the legs' own masses
    assert np.abs(found.rd[-1]).max() / h < 1e-9 * g
    force = found.contacts.force
    assert np.allclose(force[:, 2], push, rtol=1e-6)
    assert np.allclose(np.hypot(*force[:, :2].T), push - 0.001 * g / 2.0, rtol=1e-6)
