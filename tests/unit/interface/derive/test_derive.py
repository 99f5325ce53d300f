"""Formulas derived from C, C_dot, energy or value are those that are written by hand.
Both are evaluated at random states off the constraints. They differ by rounding alone, 1e-11 of the
largest term: a few hundred operations, and differences of angles near 1. Where there is none by
hand, rates along random motions stand for it (see tests/contract for the tolerance)."""

import inspect
import math
import os
import sys

import numpy as np
import pytest
from support.derived_types import (
    Anisotropic,
    Cam,
    Elastic,
    Rolling,
    Spindle,
    Spooling,
    Unsteady,
    Wave,
    Winding,
    from_C_alone,
)
from support.internals import Evaluator, split
from support.motions import Motion, derivative
from support.own_types import registry_of
from support.plain import in_another_process
from support.process import REPOSITORY, run
from support.rotations import rotation
from support.scenes import scene_for

import dap3d_core as dap
from dap3d_core.interface import (
    Function,
    Joint,
    PluginError,
    Point,
    Vector,
    examine,
    function,
    point,
    vector,
)
from dap3d_core.kernels import acos, asin, dot, exp, floor, log
from dap3d_core.model import build_model
from dap3d_core.scene import check
from dap3d_core.testing import check_type

pytest.importorskip("sympy")

#: Joints whose rows all follow from C, with the variant; the last ones take longer to compile.
BY_HAND = [
    ("rev", {}),
    ("drive-rot", {}),
    *(
        pytest.param(keyword, values, marks=pytest.mark.slow)
        for keyword, values in [
            ("sph", {}),
            ("cyl", {}),
            ("fix", {}),
            ("tran", {}),
            ("univ", {}),
            ("rP", {}),
            ("sph-sph", {}),
            ("drive-tran", {}),
            ("disk", {"slip": "z"}),
        ]
    ),
]


def evaluator_of(type_, seed, values=None, more=()):
    """A scene with one element of a type, its numbers at random."""
    registry = registry_of(type_, *more)
    type_info = registry.get(type_.kind, type_.keyword)
    scene = scene_for(type_info, np.random.default_rng(seed), values=values)
    return Evaluator(build_model(check(scene, registry)), "standard"), type_info


def assert_same_rows(one, other, seed):
    for k in range(3):
        u = Motion(3, np.random.default_rng(seed + k)).u(0.2)
        a, b = one.rows(0.2, u), other.rows(0.2, u)
        for x, y in [(a.dense(), b.dense()), (a.gamma, b.gamma), (a.nu, b.nu), (a.C, b.C)]:
            assert np.max(np.abs(x - y)) <= 1e-11 * (1.0 + np.max(np.abs(y)))


@pytest.mark.parametrize(("keyword", "values"), BY_HAND)
def test_joints_from_C_alone_are_those_by_hand(keyword, values):
    found = dap.load_registry().get("joint", keyword)
    by_hand = next((e.type for conditions, e in found.variants if conditions == values), found.type)
    derived = from_C_alone(by_hand, f"derived-{keyword}")
    one, type_info = evaluator_of(derived, 7)
    assert {"J", "gamma"} <= set(type_info.derived)
    assert ("nu" in type_info.derived) == ("nu" in by_hand.kernels())
    plain = from_C_alone(by_hand, f"plain-{keyword}")
    plain.J, plain.gamma = staticmethod(by_hand.J), staticmethod(by_hand.gamma)
    plain.nu = staticmethod(by_hand.nu) if "nu" in by_hand.kernels() else None
    other, type_info = evaluator_of(plain, 7)
    assert type_info.derived == ()
    assert_same_rows(one, other, 20)


def test_rows_of_the_velocity_level_are_derived_from_C_dot():
    """The rolling disk, z at position level, x and y by the speed of the touching point."""
    registry = registry_of(Rolling)
    assert registry.get("joint", "rolling").derived == ("J", "gamma")
    machines = []
    for keyword in ("rolling", "disk"):
        scene = dap.Scene()
        for name in ("b1", "b2", "b3"):
            scene.add_body(name, mass=1.0, Jp=[0.1, 0.2, 0.3], r=[0.0, 0.0, 1.0])
        scene.add_joint(keyword, "wheel", body_i="b2", radius=0.7)
        machines.append(Evaluator(build_model(check(scene, registry)), "standard"))
    order = [machines[1].rows(0.0, Motion(3, np.random.default_rng(1)).u(0.2))]
    assert order[0].C[2] != 0.0
    assert_same_rows(*machines, 30)


@pytest.mark.parametrize(
    ("type_", "values"), [(Spindle, {}), (Unsteady, {}), (Cam, {"function": True})]
)
def test_rates_along_a_motion_are_the_derived_ones(type_, values):
    """d/dt C = D v - nu and d/dt (D v - nu) = D v_dot - gamma."""
    evaluator, _ = evaluator_of(type_, 5, values)
    motion = Motion(3, np.random.default_rng(40), level=0.5)

    def velocity_form(t):
        rows = evaluator.rows(t, motion.u(t))
        return rows.dense() @ motion.u(t)[-18:] - rows.nu

    t, h = 0.1, 3e-3
    rows = evaluator.rows(t, motion.u(t))
    rate = derivative(lambda t: evaluator.rows(t, motion.u(t)).C, t, h)
    assert rate == pytest.approx(velocity_form(t), rel=1e-8, abs=1e-8)
    rate = derivative(velocity_form, t, h)
    assert rate == pytest.approx(rows.dense() @ motion.v_dot(t) - rows.gamma, rel=1e-8, abs=1e-8)


@pytest.mark.parametrize("type_", [Elastic, Anisotropic])
def test_a_wrench_is_derived_from_the_energy(type_):
    """At rest its power along any motion is -dV/dt."""
    evaluator, type_info = evaluator_of(type_, 6)
    assert type_info.derived == ("wrench",)
    motion, t = Motion(3, np.random.default_rng(50), level=0.5), 0.1
    u = motion.u(t)
    at_rest = np.concatenate([u[:-18], np.zeros(18)])
    v_dot, model = evaluator.report(0.0, at_rest)[:18].reshape(3, 6), evaluator.model
    A = rotation(split(u)[1])
    moment = np.einsum("bij,bj->bi", A @ model.Jp @ A.transpose(0, 2, 1), v_dot[:, 3:])
    power = np.hstack([model.mass[:, None] * v_dot[:, :3], moment]).ravel() @ u[-18:]
    rate = derivative(lambda t: evaluator.report(0.0, motion.u(t))[18:19], t, 3e-3)
    assert power == pytest.approx(-rate[0], rel=1e-8)


class Words(Function):
    """A function of time in all words that sympy has under names of its own."""

    keyword = "words"

    def value(t):
        return exp(-t) * log(t + 2.0) + asin(t / 3.0) * acos(t / 4.0) + t * floor(5.0 * t)


@pytest.mark.parametrize(
    ("type_", "x", "constants", "exact"),
    [
        (Wave, 0.4, (1.3, 2.1), lambda x, a, w: a * np.sin(w * x) / np.sqrt(1.0 + x * x)),
        (Words, 0.41, (), lambda t: (math.exp(-t) * math.log(t + 2.0)
                                     + math.asin(t / 3.0) * math.acos(t / 4.0)
                                     + t * math.floor(5.0 * t))),
    ],
    ids=["wave", "all words"],
)  # fmt: skip
def test_a_function_by_its_value_alone_has_its_derivatives(type_, x, constants, exact):
    """By central differences of order 6: steps of 1e-3, in which 5 t is not a whole number."""
    value, h = examine(type_).kernels["value"], 1e-3
    assert value(x, *constants)[0] == pytest.approx(exact(x, *constants), rel=1e-15)
    for order in (1, 2, 3):
        lower = [value(x + k * h, *constants)[order - 1] for k in (-3, -2, -1, 1, 2, 3)]
        slope = np.array([-1, 9, -45, 45, -9, 1]) @ lower / (60.0 * h)
        assert value(x, *constants)[order] == pytest.approx(slope, rel=1e-10)


# ------------------------------------------------------------------ what cannot be derived


def test_what_cannot_be_derived_is_refused_with_a_remedy():
    """A branch by if, mathematics from elsewhere, a form that is not linear, a row without C,
    a field with the name of a velocity that is needed."""

    class Base(Joint):
        keyword, rows = "wrong", 1
        P_i: Point = point()
        P_j: Point = point()

    class Branch(Base):
        def C(r_P_i):
            return r_P_i[0] if r_P_i[0] > 0.0 else 0.0

    class Elsewhere(Base):
        def C(r_P_i):
            return math.sin(r_P_i[0])

    class Remainder(Base):
        def C(r_P_i):
            return r_P_i[0] % 0.1

    class Quadratic(Base):
        holonomic = False

        def C_dot(v_P_i, v_P_j):
            return v_P_i[0] * v_P_j[0]

    class Nothing(Base):
        holonomic = False

        def C(r_P_i):
            return ()

    class Hidden(Base):
        v_i: Vector = vector()

        def C(r_i, v_i):
            return dot(r_i, r_i) - v_i[0]

    class Third(Base):
        function: str = function()

        def C(r_P_i, f_ddot):
            return r_P_i[0] - f_ddot

    for type_, words in [
        (Branch, "branch by where"),
        (Elsewhere, "from dap3d_core.kernels"),
        (Remainder, r"is written as a - b \* floor\(a / b\)"),
        (Quadratic, "row 1 of C_dot is not linear in the velocities"),
        (Nothing, "does not define C_dot"),
        (Hidden, "gamma needs v_i, the velocity of the body, whose name a field has taken"),
        (Third, "how f_dddot changes is not known"),
    ]:
        with pytest.raises(PluginError, match=words) as caught:
            examine(type_)
        if type_ in (Branch, Elsewhere):
            _, first = inspect.getsourcelines(type_.C)
            assert f" [{__file__}:{first + 1}]; branch by where" in str(caught.value)


# ------------------------------------------------------------------ only where it is needed

SCRIPT = """
import sys
from dap3d_core.interface import examine
from dap3d_core.registry import load_registry
from support.derived_types import Spindle
load_registry().get("joint", "rev")
assert "sympy" not in sys.modules
examine(Spindle)
print("sympy" in sys.modules)
"""


@pytest.mark.slow
@in_another_process
def test_sympy_is_imported_for_the_first_derivation_alone(tmp_path):
    """Types with their own formulas never need it, derived ones not when they are in the cache."""
    here = {"PYTHONPATH": os.pathsep.join([str(REPOSITORY / "tests"), *sys.path])}
    assert run(SCRIPT, tmp_path, **here) == "True"
    assert run(SCRIPT, tmp_path, **here) == "False"


ANEW = """
from dap3d_core.interface import examine
from dap3d_core.kernels.runtime.cache import cache_folder
from support.derived_types import {types}
for type_ in ({types},):
    examine(type_)
texts = [path.read_text() for path in cache_folder().glob("derived-*/*.py")]
print(*(text for text in texts if "spindle" in text))
"""


@pytest.mark.slow
@in_another_process
def test_a_derivation_does_not_depend_on_what_was_before(tmp_path):
    """The same text alone, after others, and with other hashes: so runs repeat to the last bit."""
    here = {"PYTHONPATH": os.pathsep.join([str(REPOSITORY / "tests"), *sys.path])}
    texts = {
        run(ANEW.format(types=types), tmp_path / f"{seed}", PYTHONHASHSEED=seed, **here)
        for seed, types in enumerate(["Spindle", "Unsteady, Rolling, Spindle", "Spindle"])
    }
    assert len(texts) == 1
    assert "def gamma(" in texts.pop()


@pytest.mark.parametrize(
    "type_", [pytest.param(Winding, marks=pytest.mark.slow), Spooling], ids=lambda t: t.keyword
)
def test_an_angle_has_the_rate_of_its_formula(type_):
    """Off the common axis, too, where its rate is not theta_dot = k . (w_j - w_i)."""
    report = check_type(type_)
    assert report.ok, str(report)
    by_name = {outcome.check: outcome for outcome in report.outcomes}
    assert by_name["J" if type_ is Winding else "velocity form"].error < 1e-12
