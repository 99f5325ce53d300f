"""A falling stone, as a user's scene file has it."""

SCENE = """\
[scene]
name = "fall"

[bodies.stone]
mass = 2.0
Jp = [0.1, 0.1, 0.1]

[forces.gravity]
type = "weight"

[simulation]
t_end = 0.1
dt = 0.01
"""
