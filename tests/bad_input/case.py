"""A bad input: where it goes wrong, what must come of it; and the good scenes that are spoiled."""

from typing import NamedTuple

ROD = """\
[bodies.rod]
mass = 1.0
Jp = [0.1, 0.1, 0.05]
r = [0.5, 0.0, 0.0]
p = [1.0, 0.0, 0.0, 0.0]

[points.A]
body = "rod"
sPp = [-0.5, 0.0, 0.0]

[vectors.axis]
body = "rod"
sp = [0.0, 1.0, 0.0]

[simulation]
t_end = 0.2
dt = 0.02

[forces.g]
type = "weight"
"""
#: A rod on a hinge, under its weight.
PENDULUM = f"""{ROD}
[joints.hinge]
type = "rev"
P_i = "A"
P_j = "ground.O"
a_i = "axis"
a_j = "ground.y"
"""
#: Two bodies that nothing connects.
PAIR = """\
[bodies.a]
mass = 1.0
Jp = [0.1, 0.1, 0.05]

[bodies.b]
mass = 1.0
Jp = [0.1, 0.1, 0.05]
r = [1.0, 0.0, 0.0]

[simulation]
t_end = 0.2
dt = 0.02

[forces.g]
type = "weight"
"""
#: A disk that stands on the ground.
DISK = """\
[bodies.disk]
mass = 1.0
Jp = [0.05, 0.1, 0.05]
r = [0.0, 0.0, 0.5]

[joints.contact]
type = "disk"
body_i = "disk"
radius = 0.5

[simulation]
t_end = 0.2
dt = 0.02

[forces.g]
type = "weight"
"""


class Case(NamedTuple):
    """A bad input.

    Attributes:
        title: the mistake in short.
        text: the scene.
        comes: the required outcome: "refused" (a mistake of the scene), "failed" (no motion),
            "noted" (a warning), "told" (for information), "allowed" (nothing is said).
        words: what must be said.
        key: of the mistake; with "failed" not used.
        line: words of the line of the file that is named.
    """

    title: str
    text: str
    comes: str
    words: tuple[str, ...] = ()
    key: str = ""
    line: str = ""

    @property
    def name(self):
        """The title and what tells its cases apart."""
        return f"{self.title}: {self.key or ' '.join(self.words) or self.comes}"[:100]


def changed(text, *replaced, add=""):
    """A scene with some words replaced and some added at its end."""
    for old, new in replaced:
        assert text.count(old) == 1, (old, text.count(old))
        text = text.replace(old, new)
    return f"{text}\n{add}"


def refused(title, text, key, *words, line):
    """A case that is refused with the mistake of a key, on a line."""
    return Case(title, text, "refused", words, key, line)


def driven(function, driver='type = "rel-rot"\na_j = "ground.y"', **settings):
    """The pendulum with a driver and its function; settings of the run besides."""
    more = "".join(f"{name} = {value}\n" for name, value in settings.items())
    return changed(
        PENDULUM,
        ("dt = 0.02\n", f"dt = 0.02\n{more}"),
        add=f'[joints.driver]\n{driver}\nbody_i = "rod"\nfunction = "f"\n\n'
        f"[functions.f]\n{function}\n",
    )


def joined(joint, *replaced, add=""):
    """The pair of bodies with a joint."""
    return changed(PAIR, *replaced, add=f"[joints.J]\n{joint}\n{add}")


def pushed(force, *replaced, base=PENDULUM, add=""):
    """A scene with one force more."""
    return changed(base, *replaced, add=f"[forces.F]\n{force}\n{add}")
