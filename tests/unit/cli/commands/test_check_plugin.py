"""``dap3d check-plugin`` tells the motion of joints, of types from a file as of installed ones."""

import json

import pytest
from click.testing import CliRunner
from support.command_line import dap3d, output_of

from dap3d_joints import gear

SLEEVE = '''
from dap3d_core.interface import Joint, Point, Vector, hookimpl, point, vector
from dap3d_core.kernels import dot, normals, sub

interface_version = 1


class Sleeve(Joint):
    """A pin a_i of body i across a straight sleeve of body j, in which it slides and turns."""

    keyword, rows = "sleeve", 3
    P_i: Point = point(doc="centre of the pin, on body i")
    P_j: Point = point(doc="point of the sleeve, on body j")
    a_i: Vector = vector(doc="axis of the pin, on body i")
    a_j: Vector = vector(doc="axis of the sleeve, on body j")

    def prepare(self, bodies):
        n, m = normals(self.a_j)
        return {"n_j": n, "m_j": m}

    def C(r_P_i, r_P_j, a_i, a_j, n_j, m_j):
        d = sub(r_P_i, r_P_j)
        return dot(d, n_j), dot(d, m_j), dot(a_i, a_j)


@hookimpl
def dap3d_joints():
    return [Sleeve]
'''


def checked(*arguments):
    return output_of("check-plugin", *arguments, columns=120)


@pytest.mark.slow
def test_the_motion_of_a_joint_is_told():
    output = checked("rev", "sph-sph", "--poses", "1")
    assert "motion: 1 rotation about a_j, constant in body j" in output
    assert "rows stay: its 1 row costs less than 5 joint coordinates" in output


def test_the_motion_of_a_type_of_ones_own(tmp_path):
    """Three freedoms by C alone: along the sleeve and about it in body j, about a_i in body i."""
    path = tmp_path / "sleeve.py"
    path.write_text(SLEEVE)
    output = checked(str(path), "--allow-code", "--json", "--poses", "1")
    (sleeve,) = json.loads(output)["types"]
    (motion,) = sleeve["motions"]
    assert motion == {
        "variant": "",
        "words": "1 translation along a_j and 1 rotation about a_j, constant in body j, "
        "and 1 rotation about a_i, constant in body i",
        "parts": [
            {"kind": "translation", "constant_in": "j", "name": "a_j"},
            {"kind": "rotation", "constant_in": "j", "name": "a_j"},
            {"kind": "rotation", "constant_in": "i", "name": "a_i"},
        ],
    }


@pytest.mark.slow
def test_the_file_of_an_installed_package_is_its_module():
    """Also one that imports from its package; what is installed needs no permission to run."""
    path = gear.__file__
    output = checked(path, "--json", "--poses", "1")
    assert json.loads(output) == json.loads(checked(gear.__name__, "--json", "--poses", "1"))


@pytest.mark.slow
def test_a_file_of_the_same_name_elsewhere_is_no_part_of_the_package(tmp_path):
    path = tmp_path / "gear.py"
    path.write_text(SLEEVE)
    done = CliRunner().invoke(dap3d, ["check-plugin", str(path)])
    assert done.exit_code == 2
    assert "is not run unless it is allowed" in done.output
    checked(str(path), "--allow-code", "--poses", "1")
