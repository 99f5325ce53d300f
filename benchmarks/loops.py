"""Scenes with many loops, of any size, for the benchmarks; made through the public API."""

import dap3d_core as dap

#: A uniform rod of 1 m and 1 kg, by the axis that it lies along; a little inertia about that axis.
INERTIA = {"x": (0.001, 1 / 12, 1 / 12), "y": (1 / 12, 0.001, 1 / 12), "z": (1 / 12, 1 / 12, 0.001)}
UNIT = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}


def fourbars(count, couplers="rev"):
    """A02: a row of four-bars in the plane x-y, neighbours share a crank; all joints revolutes.

    3 rows a loop are redundant; models/benchmarks/A02-2 explains it. None is with couplers that
    hang on spherical joints ("sph").
    """
    scene = dap.Scene(name=f"A02-{count}")
    joints = []
    for k in range(count + 1):
        crank = f"crank{k}"
        scene.add_body(crank, mass=1.0, Jp=INERTIA["y"], r=(float(k), 0.5, 0.0),
                       r_dot=(0.5, 0.0, 0.0), w=(0.0, 0.0, -1.0))  # fmt: skip
        scene.add_point(f"A{k}", crank, (0.0, -0.5, 0.0))
        scene.add_point(f"B{k}", crank, (0.0, 0.5, 0.0))
        pivot = scene.add_point(f"O{k}", "ground", (float(k), 0.0, 0.0))
        joints.append((crank, f"A{k}", "ground", pivot))
        if k:
            coupler = f"coupler{k}"
            scene.add_body(coupler, mass=1.0, Jp=INERTIA["x"], r=(k - 0.5, 1.0, 0.0),
                           r_dot=(1.0, 0.0, 0.0))  # fmt: skip
            for side, x in ((k - 1, -0.5), (k, 0.5)):
                end = scene.add_point(f"C{k}_{side}", coupler, (x, 0.0, 0.0))
                joints.append((coupler, end, f"crank{side}", f"B{side}"))
    for k, (i, P_i, j, P_j) in enumerate(joints):
        if i.startswith("coupler") and couplers == "sph":
            scene.add_joint("sph", f"J{k}", P_i=P_i, P_j=P_j)
        else:
            scene.add_joint("rev", f"J{k}", P_i=P_i, P_j=P_j, a_i=f"{i}.z", a_j=f"{j}.z")
    scene.add_force("weight", "gravity", wgt=(0.0, -1.0, 0.0))
    return scene


class _Frame:
    """Rods between knots; the rods of a knot are joined one to the next by spherical joints."""

    def __init__(self, name):
        self.scene = dap.Scene(name=name)
        self.last = {}
        self.rods = 0

    def hang(self, knot, place):
        """Fix a knot to ground."""
        name = "_".join(map(str, knot))
        self.last[knot] = self.scene.add_point(f"G{name}", "ground", place)

    def add(self, begin, end, place, axis):
        """A rod of 1 m that begins at a place and goes along an axis to its other knot."""
        name = f"rod{self.rods}"
        self.rods += 1
        unit = UNIT[axis]
        middle = tuple(p + 0.5 * u for p, u in zip(place, unit, strict=True))
        self.scene.add_body(name, mass=1.0, Jp=INERTIA[axis], r=middle)
        for knot, half in ((begin, -0.5), (end, 0.5)):
            point = self.scene.add_point(
                f"{name}{'a' if half < 0 else 'b'}", name, tuple(half * u for u in unit)
            )
            if knot in self.last:
                self.scene.add_joint("sph", f"J{name}{'a' if half < 0 else 'b'}",
                                     P_i=point, P_j=self.last[knot])  # fmt: skip
            self.last[knot] = point

    def done(self):
        """The scene, with gravity along -z."""
        self.scene.add_force("weight", "gravity")
        return self.scene


def net(size):
    """A net of size x size knots, rods of 1 m between neighbours, flat in the plane x-y.

    Each knot of its first line hangs by one rod more from ground: 2 size^2 - size rods. Bars of a
    straight line with a free end are never redundant, so its rows are independent.
    """
    frame = _Frame(f"net of {size} x {size} knots")
    for i in range(size):
        frame.hang((i, -1), (float(i), -1.0, 0.0))
    for i in range(size):
        for j in range(size):
            frame.add((i, j - 1), (i, j), (float(i), j - 1.0, 0.0), "y")
            if i + 1 < size:
                frame.add((i, j), (i + 1, j), (float(i), float(j), 0.0), "x")
    return frame.done()


def ladder(count):
    """Two chains of rods along +x from ground, 1 m apart, and a rung at each of their knots."""
    frame = _Frame(f"ladder of {count} rungs")
    for side in range(2):
        frame.hang((side, -1), (-1.0, float(side), 0.0))
    for k in range(count):
        for side in range(2):
            frame.add((side, k - 1), (side, k), (k - 1.0, float(side), 0.0), "x")
        frame.add((0, k), (1, k), (float(k), 0.0, 0.0), "y")
    return frame.done()
