"""A good scene that tests spoil, and what finds its mistakes."""

import pytest

import dap3d_core as dap
from dap3d_core.scene import check

BASE = """\
[scene]
name = "base"
schema = 1

[bodies.crank]
mass = 1.0
Jp = [0.5, 0.5, 0.1]
r = [0.0, 0.0, 1.0]
p = [1.0, 0.0, 0.0, 0.0]
r_dot = [0.0, 0.0, 0.0]
w = [0.0, 0.0, 0.0]
color = "tab:blue"

[bodies.rocker]
mass = 2
Jp = [[0.5, 0.0, 0.0], [0.0, 0.5, 0.1], [0.0, 0.1, 0.5]]

[points.A]
body = "crank"
sPp = [0.0, 0.0, -1.0]

[points.B]
body = "rocker"
sPp = [1, 2, 3]

[points.C]
body = "ground"
sPp = [0.0, 4.0, 0.0]

[vectors.axis]
body = "crank"
sp = [1.0, 0.0, 0.0]

[vectors2.d1]
P_i = "A"
P_j = "C"

[joints.J1]
type = "rev"
P_i = "A"
P_j = "ground.O"
a_i = "axis"
a_j = "ground.x"

[joints.J2]
type = "sph"
P_i = "B"
P_j = "A"

[joints.J3]
type = "rel-rot"
body_i = "crank"
a_j = "ground.x"
function = "motor"

[joints.J4]
type = "sph-sph"
d = "d1"
length = 8.0

[forces.g]
type = "weight"
wgt = [0.0, 0.0, -1.0]

[forces.spring]
type = "ptp"
P_i = "crank.O"
P_j = "rocker.O"
k = 10.0
l0 = 0.5

[functions.motor]
type = "a"
coeff = [0.0, 6.28, 0.0]

[animation]
points = [
    {body = "crank", sPp = [0.0, 0.0, 1.0]},
    {body = "ground", sPp = [0.0, 0.0, 2.0]},
]
limits = [[-1.0, 1.0], [-1.0, 1.0], [0.0, 2.0]]

[simulation]
t_end = 2.0
dt = 0.05
method = "auto"
integrator = "dop853"
rtol = 1e-8
hold = ["crank"]
"""


def mistakes_of(scene, registry, **options):
    """The mistakes that the check finds in a scene."""
    with pytest.raises(dap.SceneError) as caught:
        check(scene, registry, **options)
    return caught.value.mistakes


def scene_of(folder, text):
    """A scene read from a file of this text in a folder."""
    return dap.load(with_scenes(folder, scene=text))


def with_scenes(folder, **texts):
    """The folder, with a file NAME.toml of each text."""
    for name, text in texts.items():
        (folder / f"{name}.toml").write_text(text)
    return folder
