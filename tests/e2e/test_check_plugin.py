"""``dap3d check-plugin`` as a user meets it."""

import json

import pytest

SPRING = '''
from dap3d_core.interface import Force, Vector2, hookimpl, number, vector2
from dap3d_core.kernels import cross, dot, neg, scale

interface_version = 1


class Rubber(Force):
    """A force k d |d|^2 that pulls."""

    keyword = "rubber"
    d: Vector2 = vector2(doc="from end to end")
    k: float = number(unit="N/m^3", doc="stiffness")

    def wrench(d, k, s_P_i, s_P_j):
        F = scale(k * dot(d, d), d)
        return (F, cross(s_P_i, F)), (neg(F), neg(cross(s_P_j, F)))

    def energy(d, k):
        return 0.25 * k * dot(d, d) * dot(d, d)


@hookimpl
def dap3d_forces():
    return [Rubber]
'''


@pytest.mark.slow
def test_a_standard_type_passes(dap3d):
    done = dap3d.succeed("check-plugin", "sph", COLUMNS=60)
    assert max(map(len, done.stdout.splitlines())) <= 60
    assert "1 type checked: nothing is wrong" in done.stdout
    assert dap3d("check-plugin", "a", "-q").stdout == ""


@pytest.mark.slow
def test_a_file_of_ones_own(dap3d, refuse):
    """Not run without leave; an error is told with body and axis, in words and in JSON."""
    path = dap3d.folder / "rubber.py"
    path.write_text(SPRING)
    assert "give --allow-code" in refuse("check-plugin", "rubber.py")
    path.write_text(SPRING.replace("0.25 * k", "0.5 * k"))
    done = dap3d("check-plugin", "rubber.py", "--allow-code", "--quiet")
    assert done.returncode == 1
    said = " ".join(done.stdout.split())
    assert "the force on body i along x and the energy disagree by" in said
    assert "wrong formulas in 1 of 1 type" in said
    done = dap3d("check-plugin", "rubber.py", "--allow-code", "--json", "--seed", 3, "--poses", 2)
    assert done.returncode == 1
    found = json.loads(done.stdout)
    assert (found["ok"], found["seed"], found["poses"]) == (False, 3, 2)
    (rubber,) = found["types"]
    states = {o["check"]: o["state"] for o in rubber["outcomes"]}
    assert states == {"energy": "failed", "frame": "ok", "action and reaction": "ok",
                      "branches": "ok", "rest": "ok", "purity": "ok", "plain": "ok",
                      "compiled": "ok"}  # fmt: skip
    (energy,) = (o for o in rubber["outcomes"] if o["check"] == "energy")
    assert energy["findings"][0]["pose"]["seed"] == 3


def test_a_type_that_cannot_be_loaded_is_wrong(dap3d):
    """The reason is the finding."""
    (dap3d.folder / "rubber.py").write_text(SPRING.replace("dot(d, d), d)", "dot(d, e), d)"))
    done = dap3d("check-plugin", "rubber.py", "--allow-code")
    assert done.returncode == 1
    said = " ".join(done.stdout.split())
    assert "NameError" in said
    line = next(k for k, x in enumerate(SPRING.splitlines(), 1) if "dot(d, d), d)" in x)
    assert f"rubber.py:{line}]" in said.replace(" ", "")  # a long path is broken over lines
    assert "1 of 1 type cannot be loaded" in said
    assert "wrong formulas" not in said


@pytest.mark.slow
def test_all_types_of_a_distribution_pass(dap3d):
    """By its name; those of one module by its name. contract/test_types.py checks the standard."""
    same = json.loads(dap3d("check-plugin", "dap3d-example", "--json", "--poses", 1).stdout)
    assert same["ok"]
    assert {t["keyword"] for t in same["types"]} >= {"cylinder", "tyre", "cycloid"}
    module = dap3d("check-plugin", "dap3d_joints.revolute", "--json", "--poses", 1)
    assert [t["keyword"] for t in json.loads(module.stdout)["types"]] == ["rev"]
