"""Random scenes that touch early: few things, each of many kinds, on a slope that may be level.

They end after a third of a second, in which each has touched, slid, stuck, rocked or bounced, and
have few structures, so that their code comes from the cache."""

import numpy as np

import dap3d_core as dap

#: Sizes of boxes, m; radius of what is round; distance between things that do not meet.
SIZE, RADIUS, APART = np.array([0.4, 0.3, 0.1]), 0.1, 0.8


def settings_of(number):
    """Settings of a run that differ from scene to scene."""
    rng = np.random.default_rng([number, 1])
    integrator = str(rng.choice(["dop853", "dopri5", "radau", "auto"], p=[0.6, 0.1, 0.15, 0.15]))
    exact = rng.random() < 0.7
    given = {"rtol": 1e-10, "atol": 1e-12} if exact else {"rtol": 1e-8, "atol": 1e-10}
    joint = integrator in ("dop853", "dopri5") and rng.random() < 0.3
    return {"integrator": integrator, "method": "joint" if joint else "auto", **given}


class Varied:
    """A scene in the making: its slope, and what draws its numbers."""

    def __init__(self, number):
        self.rng = np.random.default_rng(number)
        self.scene = dap.Scene(name=f"varied {number}")
        self.scene.add_force("weight", "g")
        a = float(self.rng.choice([0.0, 0.0, 0.2, 0.5]))
        self.R = np.array([[np.cos(a), 0, -np.sin(a)], [0, 1, 0], [np.sin(a), 0, np.cos(a)]])
        self.p = np.array([np.cos(a / 2), 0, -np.sin(a / 2), 0])
        self.scene.add_vector("n", "ground", self.R[:, 2])

    def one_of(self, *numbers):
        return float(self.rng.choice(numbers))

    def law(self):
        mu = self.one_of(0.0, 0.1, 0.4, 1.0)
        given = {"mu": mu, "mu_s": mu * self.one_of(1.0, 1.3), "e": self.one_of(0, 0, 0.3, 0.8, 1)}
        if given["e"] and self.rng.random() < 0.2:
            given["law"] = "newton"
        return given

    def height(self):
        return self.one_of(0.0, 0.0, 0.002, 0.02)

    def body(self, name, at, *, flat, Jp):
        """A body at a place of the slope: flat on it or turned, at rest or moving."""
        v = self.one_of(0.0, 0.3, 1.0) * self.rng.normal(size=3)
        w = self.one_of(0.0, 1.0, 5.0) * self.rng.normal(size=3)
        p = self.p if flat else self.rng.normal(size=4)
        if flat:
            v[2], w[:2] = 0.0, 0.0
        self.scene.add_body(name, mass=float(self.rng.uniform(0.2, 3.0)), Jp=Jp, r=self.R @ at,
                            p=p / np.linalg.norm(p), r_dot=self.R @ v, w=self.R @ w)  # fmt: skip

    def ball(self, k, at):
        at[2] = RADIUS + self.height()
        self.body(f"b{k}", at, flat=False, Jp=[0.004] * 3)
        self.scene.add_contact("ball_plane", f"c{k}", P_i=f"b{k}.O", radius=RADIUS, a_j="n",
                               **self.law())  # fmt: skip

    def box(self, k, at):
        flat = self.rng.random() < 0.5
        at[2] = 0.05 + self.height() if flat else 0.26
        self.body(f"b{k}", at, flat=flat, Jp=[0.01, 0.015, 0.02])
        self.scene.add_contact("box_plane", f"c{k}", P_i=f"b{k}.O", size=SIZE.tolist(), a_j="n",
                               **self.law())  # fmt: skip

    def capsule(self, k, at):
        flat = self.rng.random() < 0.5
        at[2] = 0.05 + self.height() if flat else 0.25
        self.body(f"b{k}", at, flat=flat, Jp=[0.002, 0.01, 0.01])
        for end, x in (("p", 0.2), ("q", -0.2)):
            self.scene.add_point(f"{end}{k}", f"b{k}", [x, 0.0, 0.0])
        self.scene.add_contact("capsule_plane", f"c{k}", P_i=f"p{k}", Q_i=f"q{k}", radius=0.05,
                               a_j="n", **self.law())  # fmt: skip

    def disk(self, k, at):
        flat = self.rng.random() < 0.3
        at[2] = self.height() if flat else 0.16
        self.body(f"b{k}", at, flat=flat, Jp=[0.003, 0.003, 0.006])
        self.scene.add_contact("disk_plane", f"c{k}", P_i=f"b{k}.O", a_i=f"b{k}.z", radius=0.15,
                               a_j="n", **self.law())  # fmt: skip

    def legs(self, k, at):
        """A body on corners, at rest on them or above."""
        at[2] = 0.15 + self.height()
        self.body(f"b{k}", at, flat=True, Jp=[0.02, 0.025, 0.03])
        law, count = self.law(), int(self.rng.integers(1, 4))
        for i in range(count):
            turn = 2 * np.pi * i / count + 0.3 * self.rng.normal()
            x, y = self.rng.uniform(0.1, 0.3) * np.array([np.cos(turn), np.sin(turn)])
            self.scene.add_point(f"f{k}{i}", f"b{k}", [x, y, -0.15])
            law = law if self.rng.random() < 0.7 else self.law()
            self.scene.add_contact("ball_plane", f"c{k}f{i}", P_i=f"f{k}{i}", a_j="n", **law)

    def ball_on_ball(self, k, at):
        self.ball(k, at)
        above = np.add(at, [0.1 * self.rng.random(), 0.1 * self.rng.random(), 0.0])
        above[2] = at[2] + 2 * RADIUS + self.height()
        self.body(f"a{k}", above, flat=False, Jp=[0.004] * 3)
        self.scene.add_contact("ball_ball", f"d{k}", P_i=f"a{k}.O", P_j=f"b{k}.O",
                               radius_i=RADIUS, radius_j=RADIUS, **self.law())  # fmt: skip

    def ball_on_box(self, k, at):
        at[2] = 0.05 + self.height()
        self.body(f"b{k}", at, flat=True, Jp=[0.01, 0.015, 0.02])
        self.scene.add_contact("box_plane", f"c{k}", P_i=f"b{k}.O", size=SIZE.tolist(), a_j="n",
                               **self.law())  # fmt: skip
        above = np.add(at, [0.25 * self.rng.normal(), 0.0, 0.05 + RADIUS + self.height()])
        self.body(f"a{k}", above, flat=False, Jp=[0.004] * 3)
        self.scene.add_contact("ball_box", f"d{k}", P_i=f"a{k}.O", P_j=f"b{k}.O", radius=RADIUS,
                               size=SIZE.tolist(), **self.law())  # fmt: skip

    def on_a_shaker(self, k, at):
        """A ball or feet on a plate that a driver moves, up and down or along."""
        scene = self.scene
        speed, pull = self.one_of(0.0, 0.0, 0.5), self.one_of(-12.0, -3.0, 0.0, 3.0)
        way = self.R[:, int(self.rng.choice([0, 2]))]
        scene.add_body(f"s{k}", mass=1.0, Jp=[0.1] * 3, r=self.R @ at, r_dot=speed * way)
        scene.add_vector(f"n{k}", f"s{k}", self.R[:, 2])
        scene.add_point(f"g{k}", "ground", self.R @ at)
        scene.add_vector(f"u{k}", "ground", way)
        scene.add_joint("tran", f"way{k}", P_i=f"s{k}.O", P_j=f"g{k}", a_j=f"u{k}")
        scene.add_function("a", f"rises{k}", coeff=[0.0, speed, pull])
        scene.add_joint("drive-tran", f"drive{k}", P_i=f"s{k}.O", P_j=f"g{k}", a_j=f"u{k}",
                        function=f"rises{k}")  # fmt: skip
        self.body(
            f"b{k}", np.add(at, [0.0, 0.0, RADIUS + self.height()]), flat=True, Jp=[0.004] * 3
        )
        scene.add_contact("ball_plane", f"c{k}", P_i=f"b{k}.O", P_j=f"s{k}.O", a_j=f"n{k}",
                          radius=RADIUS, **self.law())  # fmt: skip

    def chain(self, k, at):
        """Two bars on a hinge, from a pin of the ground or thrown; the far end meets the floor."""
        pinned = self.rng.random() < 0.5
        height, half = float(self.rng.choice([0.1, 0.25])), 0.2
        rates = self.one_of(0.0, 3.0) * self.rng.normal(size=2)
        n, x, y = self.R[:, 2], self.R[:, 0], self.R[:, 1]
        start = self.R @ np.add(at, [0.0, 0.0, height + 0.05])
        v = np.zeros(3)
        for i, name in enumerate((f"b{k}", f"a{k}")):
            v = v - rates[i] * half * n  # w x (half x), w = rate y
            scene_r = start + (2 * i + 1) * half * x
            self.scene.add_body(name, mass=0.5, Jp=[0.001, 0.01, 0.01], r=scene_r, p=self.p,
                                r_dot=v, w=rates[i] * y)  # fmt: skip
            v = v - rates[i] * half * n
            self.scene.add_point(f"in{k}{i}", name, [-half, 0.0, 0.0])
            self.scene.add_point(f"out{k}{i}", name, [half, 0.0, 0.0])
        kind = str(self.rng.choice(["rev", "sph"]))
        axes = {"a_i": f"a{k}.y", "a_j": f"b{k}.y"} if kind == "rev" else {}
        limits = {"lower": -0.2, "e": self.one_of(0.0, 0.5)}
        limits = limits if axes and self.rng.random() < 0.4 else {}
        self.scene.add_joint(kind, f"hinge{k}", P_i=f"in{k}1", P_j=f"out{k}0", **axes, **limits)
        if pinned:
            self.scene.add_point(f"pin{k}", "ground", start)
            self.scene.add_joint("sph", f"pin{k}", P_i=f"in{k}0", P_j=f"pin{k}")
        if axes and self.rng.random() < 0.4:
            self.scene.add_force("rot_friction", f"rub{k}", joint=f"hinge{k}",
                                 n_c=self.one_of(0.02, 0.5), n_s=0.5)  # fmt: skip
        ends = [f"out{k}1", f"out{k}0", *([] if pinned else [f"in{k}0"])]
        for i, end in enumerate(ends[: int(self.rng.integers(1, len(ends) + 1))]):
            self.scene.add_contact("ball_plane", f"c{k}e{i}", P_i=end, radius=0.02, a_j="n",
                                   **self.law())  # fmt: skip

    def add_springs(self):
        """Springs between things, or to the ground, with or without a damper."""
        names = list(self.scene.bodies)
        for k in range(int(self.rng.choice([0, 0, 1, 2]))):
            one = str(self.rng.choice(names))
            other = str(self.rng.choice([*names, "ground"]))
            if other == one:
                continue
            if other == "ground":
                r = np.asarray(self.scene.bodies[one].r) + self.rng.uniform(0.2, 0.6, size=3)
                self.scene.add_point(f"eye{k}", "ground", r)
            end = f"eye{k}" if other == "ground" else f"{other}.O"
            self.scene.add_force(
                "ptp", f"spring{k}", P_i=f"{one}.O", P_j=end, k=self.one_of(5.0, 50.0, 200.0),
                c=self.one_of(0.0, 0.0, 1.0), l0=self.one_of(0.0, 0.3),
            )  # fmt: skip


KINDS = (Varied.ball, Varied.box, Varied.capsule, Varied.disk, Varied.legs, Varied.ball_on_ball,
         Varied.ball_on_box, Varied.on_a_shaker, Varied.chain)  # fmt: skip


def varied_scene(number):
    """1 to 3 things of some kinds, with springs."""
    made = Varied(number)
    for k in range(int(made.rng.choice([1, 1, 2, 3]))):
        at = np.array([APART * k, 0.0, 0.0])
        KINDS[int(made.rng.integers(len(KINDS)))](made, k, at)
    made.add_springs()
    return made.scene
