"""Whole scenes at random, assembled by construction: poses first, then points and axes that meet.
A scene is drawn as the text of its file; events, which a file has no place for, stand in comments
at its top (``events_of``)."""

import json
import math

import numpy as np
from hypothesis import strategies as st
from support.rotations import rotation

import dap3d_core as dap

EVENT = "# event: "
METHODS = ("auto", "auto", "standard", "penalty", "lsq", "unconstrained")
INTEGRATORS = ("dop853", "dopri5", "adams", "rk4", "radau", "auto")
#: Types whose joints rub, and whether friction needs a radius there.
RUBS = {"sph": True, "rev": True, "cyl": True, "tran": False, "disk": False}
Z = np.array([0.0, 0.0, 1.0])

small = st.integers(-2000, 2000).map(lambda n: n / 1000.0)
size = st.integers(-2, 2).map(lambda n: 10.0**n)
part = st.integers(1, 20).map(lambda n: n / 20.0)


def vectors(numbers=small):
    return st.tuples(numbers, numbers, numbers).map(np.array)


@st.composite
def directions(draw):
    """A unit vector."""
    a, b = draw(st.integers(0, 62)) / 10.0, draw(st.integers(-10, 10)) / 10.0
    flat = math.sqrt(1.0 - b * b)
    return np.array([flat * math.cos(a), flat * math.sin(a), b])


@st.composite
def quaternions(draw):
    axis, half = draw(directions()), draw(st.integers(-31, 31)) / 20.0
    p = np.array([math.cos(half), *(math.sin(half) * axis)])
    return p / np.linalg.norm(p)


def across(u):
    """A unit vector normal to another."""
    other = np.eye(3)[int(np.argmin(np.abs(u)))]
    n = np.cross(u, other)
    return n / np.linalg.norm(n)


class Maker:
    """Adds bodies and what fits between them to a scene."""

    def __init__(self, draw):
        self.draw, self.scene = draw, dap.Scene(name="random")
        self.pose = {"ground": (np.zeros(3), np.eye(3))}
        self.count = 0

    # ---------------------------------------------------------------- bodies, points, vectors

    def body(self):
        draw, name = self.draw, f"b{len(self.pose)}"
        mass, r, p = draw(size), draw(vectors()), draw(quaternions())
        a, b, c = (mass * draw(part) for _ in range(3))
        Jp = np.diag([b + c, a + c, a + b])  # no sum of two is below the third
        A = rotation(p)
        if draw(st.booleans()):
            turn = rotation(draw(quaternions()))
            Jp = turn @ Jp @ turn.T
            Jp = 0.5 * (Jp + Jp.T)
        moves = {}
        if draw(st.booleans()):
            moves = {"r_dot": draw(vectors()), "w": draw(vectors())}
        self.scene.add_body(name, mass=mass, Jp=Jp, r=r, p=p, **moves)
        self.pose[name] = (r, A)
        return name

    def name(self, letter):
        self.count += 1
        return f"{letter}{self.count}"

    def point(self, body, at):
        r, A = self.pose[body]
        return self.scene.add_point(self.name("P"), body, A.T @ (at - r))

    def vector(self, body, along):
        return self.scene.add_vector(self.name("v"), body, self.pose[body][1].T @ along)

    def between(self, i, j, tail, head):
        """Two points on bodies i and j, as a vector of its own or by their names."""
        P_i, P_j = self.point(i, tail), self.point(j, head)
        if self.draw(st.booleans()):
            return {"d": self.scene.add_vector2(self.name("d"), P_i, P_j)}
        return {"P_i": P_i, "P_j": P_j}

    # ---------------------------------------------------------------- functions

    def function(self, types=("a", "b", "c", "d", "harmonic", "spline", "step")):
        """A function, and its value at 0."""
        draw, type_, value = self.draw, self.draw(st.sampled_from(types)), self.draw(small)
        name, end, height = self.name("f"), self.draw(part), self.draw(small)
        if type_ == "a":
            fields = {"coeff": (value, height, self.draw(small))}
        elif type_ == "harmonic":
            fields = {"amplitude": height, "frequency": 10.0 * end, "offset": value}
        elif type_ == "spline":
            steps = [draw(part) for _ in range(draw(st.integers(1, 4)))]
            y = [value, *(draw(small) for _ in steps)]
            fields = {"x": (0.0, *np.cumsum(steps)), "y": y}
        elif type_ == "d":
            fields = {"x_end": end, "f_start": value, "fp_end": height}
        elif type_ == "c":  # its top in the middle, between its ends' range and twice beyond
            fields = {"x_end": end, "f_start": value, "f_end": value, "x_max": end / 2}
            fields["f_max"] = value + height
        else:
            fields = {"x_end": end, "f_start": value, "f_end": height}
        return self.scene.add_function(type_, name, **fields), value

    def maybe(self, types=("a", "b", "c", "d", "harmonic", "spline", "step")):
        """A function or none, as fields, and its value at 0."""
        if self.draw(st.booleans()):
            return {}, 0.0
        name, value = self.function(types)
        return {"function": name}, value

    # ---------------------------------------------------------------- joints

    def joint(self, i, j):
        """A joint of any type between body i and body j, which may be ground, that is assembled."""
        kinds = [self.pins, self.slides, self.links, self.drivers]
        if j == "ground":
            kinds += [self.grounded]
        self.draw(st.sampled_from(kinds))(i, j)

    def pins(self, i, j):
        draw, at, u = self.draw, self.draw(vectors()), self.draw(directions())
        type_ = draw(st.sampled_from(("sph", "rev", "univ")))
        ends = {"P_i": self.point(i, at), "P_j": self.point(j, at)}
        if type_ == "rev":
            ends |= {"a_i": self.vector(i, u), "a_j": self.vector(j, u)}
        elif type_ == "univ":
            ends |= {"a_i": self.vector(i, u), "n_j": self.vector(j, across(u))}
        name = self.scene.add_joint(type_, **ends)
        if type_ == "rev" and draw(st.booleans()):
            driver = draw(st.sampled_from(("drive-rot", "rel-rot")))
            fields = {"body_i": i, "body_j": j, "a_j": ends["a_j"]}
            self.scene.add_joint(driver, **fields, **self.maybe()[0])
        self.rub(type_, name)

    def slides(self, i, j):
        draw, u = self.draw, self.draw(directions())
        type_ = draw(st.sampled_from(("cyl", "tran")))
        tail = draw(vectors())
        ends = self.between(i, j, tail, tail + (0.1 + draw(part)) * u)
        a_j = self.vector(j, u)
        if type_ == "tran":
            A_c = self.pose[i][1].T @ self.pose[j][1]
            name = self.scene.add_joint("tran", a_j=a_j, A_c=A_c, **ends)
        else:
            name = self.scene.add_joint("cyl", a_i=self.vector(i, u), a_j=a_j, **ends)
        if draw(st.booleans()):
            driver = draw(st.sampled_from(("drive-tran", "rel-tran")))
            fields = {"body_i": i, "body_j": j, "a_j": a_j}
            self.scene.add_joint(driver, **fields, **self.maybe()[0])
        self.rub(type_, name)

    def links(self, i, j):
        tail, length = self.draw(vectors()), 0.1 + self.draw(part)
        ends = self.between(i, j, tail, tail + length * self.draw(directions()))
        fields = {"length": length} if self.draw(st.booleans()) else {}
        self.scene.add_joint("sph-sph", **ends, **fields)

    def drivers(self, i, j):
        type_ = self.draw(st.sampled_from(("drive-rot", "drive-tran", "rel-rot", "rel-tran")))
        a_j = self.vector(j, self.draw(directions()))
        self.scene.add_joint(type_, body_i=i, body_j=j, a_j=a_j, **self.maybe()[0])

    def grounded(self, i, _):
        draw, (r, A) = self.draw, self.pose[i]
        type_ = draw(st.sampled_from(("fix", "rP", "disk")))
        sine = math.hypot(A[0, 1], A[1, 1])
        if type_ == "disk" and r[2] > 0.1 and sine > 0.1:
            slip = draw(st.sampled_from(("z", "nz", "tz", "xyz")))
            name = self.scene.add_joint("disk", body_i=i, slip=slip, radius=r[2] / sine)
            if slip != "xyz":
                self.rub("disk", name)
        elif type_ == "rP":
            at, u, (fields, start) = draw(vectors()), draw(directions()), self.maybe()
            fields |= {"P_i": self.point(i, at), "length": at @ u - start}
            self.scene.add_joint("rP", a_j=self.vector("ground", u), **fields)
        else:
            self.scene.add_joint("fix", body_i=i)

    def rub(self, type_, joint):
        if self.draw(st.integers(0, 3)) == 0:
            fields = {"radius": 0.05} if RUBS.get(type_) else {}
            if type_ in RUBS:
                fields |= {"v_tol": 1e-3} if self.draw(st.booleans()) else {}  # else it sticks
                self.scene.add_force("friction", joint=joint, mu=self.draw(part), **fields)

    # ---------------------------------------------------------------- forces

    def force(self, i, j):
        draw = self.draw
        type_ = draw(st.sampled_from(("weight", "ptp", "rot_sda", "f", "fp", "n", "np")))
        name = self.name("F")
        if type_ == "weight":
            fields = {"gravity": 9.81} if draw(st.booleans()) else {"wgt": draw(vectors())}
        elif type_ == "ptp":
            tail = draw(vectors())
            fields = self.between(i, j, tail, tail + (0.1 + draw(part)) * draw(directions()))
            fields |= {"k": 100.0 * draw(part), "c": draw(part), "l0": draw(part)}
            fields |= self.maybe(("a", "spline"))[0]
        elif type_ == "rot_sda":
            u = draw(directions())
            axis = self.vector(draw(st.sampled_from((i, j))), u)
            v = {"v_i": self.vector(i, across(u)), "v_j": self.vector(j, across(u))}
            fields = {"axis": axis, "k": 10.0 * draw(part), "c": draw(part), **v}
            fields |= {"turns": draw(st.booleans()), "theta_0": draw(small)}
            fields |= self.maybe(("a", "spline"))[0]
        else:
            fields = {"body_i": i, type_: draw(vectors())}
            if type_ in ("f", "fp") and draw(st.booleans()):
                fields["P_i"] = self.point(i, draw(vectors()))
        self.scene.add_force(type_, name, **fields)

    # ---------------------------------------------------------------- settings

    def settings(self):
        draw, simulation = self.draw, self.scene.simulation
        simulation.t_end = draw(st.sampled_from((0.0, 0.01, 0.1, 0.3)))
        if simulation.t_end and draw(st.booleans()):
            simulation.dt = simulation.t_end / draw(st.sampled_from((1, 3, 7.3, 40)))
        simulation.method = draw(st.sampled_from(METHODS))
        simulation.integrator = draw(st.sampled_from(INTEGRATORS))
        simulation.rtol = 10.0 ** draw(st.integers(-12, -2))
        simulation.atol = draw(st.sampled_from((0.0, 1e-12, 1e-8, 1e-4)))
        steps = simulation.integrator in ("dop853", "dopri5") and not draw(st.integers(0, 4))
        if simulation.integrator == "rk4" or steps:
            simulation.step = 0.002
        simulation.correct = draw(st.integers(0, 5)) > 0
        simulation.project = draw(st.integers(0, 3)) > 0
        simulation.correct_metric = draw(st.sampled_from(("unit", "mass")))
        if draw(st.integers(0, 5)) == 0:
            simulation.hold = (draw(st.sampled_from(list(self.scene.bodies))),)
        if simulation.method == "penalty":
            simulation.alpha, simulation.Omega = 10.0 ** draw(st.integers(4, 8)), 10.0


@st.composite
def events(draw, scene):
    """Settings of an event, as in ``Event``."""
    owner = draw(st.sampled_from(list(scene.bodies)))
    of = draw(st.sampled_from((f"{owner}.r.z", f"{owner}.w.norm", "energy.kinetic", "work")))
    level = {draw(st.sampled_from(("below", "above", "at"))): draw(small)}
    return {"of": of, **level, "action": draw(st.sampled_from(("stop", "record")))}


@st.composite
def scenes(draw, bodies=6):
    """The text of a scene that is accepted and assembled."""
    maker = Maker(draw)
    for _ in range(draw(st.integers(1, bodies))):
        before, name = list(maker.pose), maker.body()
        if draw(st.integers(0, 5)):
            maker.joint(name, draw(st.sampled_from(before)))
    names = list(maker.scene.bodies)
    pairs = [(i, j) for i in names for j in maker.pose if i != j]
    for _ in range(draw(st.sampled_from((0, 0, 0, 1, 2)))):
        maker.joint(*draw(st.sampled_from(pairs)))
    for _ in range(draw(st.integers(0, 3))):
        maker.force(*draw(st.sampled_from(pairs)))
    maker.settings()
    found = draw(st.lists(events(maker.scene), max_size=2)) if draw(st.booleans()) else []
    lines = [EVENT + json.dumps(event) + "\n" for event in found]
    return "".join(lines) + maker.scene.to_toml()


def events_of(text):
    """The events in the comments at the top of a text."""
    lines = [line for line in text.splitlines() if line.startswith(EVENT)]
    return [dap.Event(**json.loads(line.removeprefix(EVENT))) for line in lines]
