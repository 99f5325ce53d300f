"""Write the scene of the reference problem A02, a row of N four-bars, for any N.

    python tools/scene_of_fourbars.py N > scene.toml

models/benchmarks/A02-N/scene.toml are its output for N = 1, 2 and 40.
"""

import sys

HEAD = """\
# {title}; neighbours share a crank. {rods} uniform rods of 1 m and 1 kg in the plane x-y:
# cranks on the ground at x = 0 ... {n}, upright at the start, and couplers between their tips.
# Written by tools/scene_of_fourbars.py.
#
# All {joints} joints are revolutes about z, as in the original: 5 rows each, 3 too many in a loop.

[scene]
name = "A02-{n}"
description = "{title}, singular whenever its links are in line."
schema = 1

# Inertia: 1/12 across a rod; the small one along it is ours, planar motion does not see it.
# Velocities: every crank turns at -1 rad/s, so its tip moves at 1 m/s along +x.
"""

CRANK = """
[bodies.crank{k}]
mass = 1.0
Jp = [0.08333333333333333, 0.001, 0.08333333333333333]
r = [{x}, 0.5, 0.0]
r_dot = [0.5, 0.0, 0.0]
w = [0.0, 0.0, -1.0]
color = "tab:blue"
"""

COUPLER = """
[bodies.coupler{k}]
mass = 1.0
Jp = [0.001, 0.08333333333333333, 0.08333333333333333]
r = [{x}, 1.0, 0.0]
r_dot = [1.0, 0.0, 0.0]
color = "tab:orange"
"""

POINT = """
[points.{name}]
body = "{body}"
sPp = [{x}, {y}, 0.0]
"""

JOINT = """
[joints.{name}]
type = "rev"
P_i = "{P_i}"
P_j = "{P_j}"
a_i = "{i}.z"
a_j = "{j}.z"
"""

TAIL = """
[forces.gravity]
type = "weight"
wgt = [0.0, -1.0, 0.0]

[animation]
points = []                      # the points above already draw the links
limits = [[-1.5, {right}], [-1.5, 1.5], [-1.0, 1.0]]

[simulation]
t_end = 10.0
dt = 0.05
method = "auto"                  # lsq, since rows are redundant
integrator = "dop853"
correct = true                   # the start satisfies the joints: nothing moves
"""


def joint(name: str, i: str, P_i: str, j: str, P_j: str) -> str:
    """Return a revolute joint about z, between a point of body i and one of body j."""
    return JOINT.format(name=name, P_i=P_i, P_j=P_j, i=i, j=j)


def scene(n: int) -> str:
    """Return the text of the scene of n four-bars, n at least 1."""
    title = f"A row of {n} four-bar" + ("s" if n > 1 else "")
    text = HEAD.format(n=n, title=title, rods=2 * n + 1, joints=3 * n + 1)
    text += CRANK.format(k=0, x="0.0")
    for k in range(1, n + 1):
        text += COUPLER.format(k=k, x=f"{k - 0.5}") + CRANK.format(k=k, x=f"{k}.0")
    for k in range(n + 1):
        if k:
            text += POINT.format(name=f"G{k}", body="ground", x=f"{k}.0", y="0.0")
        text += POINT.format(name=f"A{k}", body=f"crank{k}", x="0.0", y="-0.5")
        text += POINT.format(name=f"B{k}", body=f"crank{k}", x="0.0", y="0.5")
    for k in range(1, n + 1):
        text += POINT.format(name=f"L{k}", body=f"coupler{k}", x="-0.5", y="0.0")
        text += POINT.format(name=f"R{k}", body=f"coupler{k}", x="0.5", y="0.0")
    for k in range(n + 1):
        text += joint(f"A{k}", f"crank{k}", f"A{k}", "ground", f"G{k}" if k else "ground.O")
    for k in range(1, n + 1):
        text += joint(f"L{k}", f"coupler{k}", f"L{k}", f"crank{k - 1}", f"B{k - 1}")
        text += joint(f"R{k}", f"coupler{k}", f"R{k}", f"crank{k}", f"B{k}")
    return text + TAIL.format(right=f"{n + 1}.5")


def main(arguments: list[str]) -> int:
    """Print the scene and return the exit status."""
    if len(arguments) != 1 or not arguments[0].isdecimal() or int(arguments[0]) < 1:
        print("usage: python tools/scene_of_fourbars.py N, N at least 1", file=sys.stderr)
        return 2
    print(scene(int(arguments[0])), end="")
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
