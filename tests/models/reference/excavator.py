"""Reference for the model `excavator`: angles by the law of cosines, forces by moments.
A cylinder and the two arms that it joins are a triangle at the hinge, of which two sides are
constant: l^2 = a^2 + b^2 - 2 a b cos(phi). Its force has the moment about the hinge that everything
outwards of it needs."""

from typing import NamedTuple

import numpy as np
from rigid import Array

GRAVITY = 9.81


class Link(NamedTuple):
    """A link: a complex number is a point of the y-z plane, in axes of a link from its hinge."""

    name: str
    mass: float
    inertia: float
    centre: float
    length: float
    base: complex  # of the cylinder, on the link before
    rod: complex  # on this one
    angle: float  # at the start, against the link before
    start: float
    end: float
    stroke: float


LINKS = (
    Link("boom", 1500.0, 3500.0, 2.5, 5.0, 0.8 - 0.5j, 2.2 + 0j, np.radians(40), 0.0, 3.0, 0.3),
    Link("arm", 700.0, 450.0, 1.25, 2.5, -2.0 + 0.5j, -0.6 + 0.2j, np.radians(-90), 1.0, 4.0, 0.4),
    Link(
        "bucket",
        1200.0,
        250.0,
        0.6,
        1.2,
        -2.0 + 0.35j,
        -0.38 + 0.14j,
        np.radians(-60),
        2.0,
        4.0,
        0.4,
    ),
)


def _step(link: Link, t: float) -> tuple[float, float, float]:
    """Return the stroke of a cylinder and its derivatives."""
    span = link.end - link.start
    u = np.clip((t - link.start) / span, 0.0, 1.0)
    value = u**3 * (10.0 - 15.0 * u + 6.0 * u * u)
    first = 30.0 * u**2 * (1.0 - u) ** 2 / span
    second = 60.0 * u * (1.0 - u) * (1.0 - 2.0 * u) / span**2
    return link.stroke * value, link.stroke * first, link.stroke * second


def _hinge(link: Link, t: float) -> tuple[float, float, float, float, float]:
    """Return a link's angle against the one before, its derivatives, the length, and its slope."""
    a, b = abs(link.base), abs(link.rod)
    offset = np.angle(link.rod) - np.angle(link.base)
    at_start = np.angle(np.exp(1j * (link.angle + offset)))
    stroke, l_1, l_2 = _step(link, t)
    l = np.sqrt(a * a + b * b - 2.0 * a * b * np.cos(at_start)) + stroke
    phi = np.sign(at_start) * np.arccos((a * a + b * b - l * l) / (2.0 * a * b))
    sine = a * b * np.sin(phi)
    first = l * l_1 / sine
    second = (l_1**2 + l * l_2 - a * b * np.cos(phi) * first**2) / sine
    return link.angle + phi - at_start, first, second, l, sine / l


def quantities(t: float) -> dict[str, Array]:
    """Return every quantity that `expected.toml` may name, at `t`."""
    hinges = [_hinge(link, t) for link in LINKS]
    angles, firsts, seconds = (np.cumsum([h[i] for h in hinges]) for i in range(3))
    at, at_2 = 1.5j, 0j
    places, centres, centres_2, found = [], [], [], {}
    for link, angle, first, second in zip(LINKS, angles, firsts, seconds, strict=True):
        along = np.exp(1j * angle)
        along_2 = (1j * second - first**2) * along
        places.append(at)
        centres.append(at + link.centre * along)
        centres_2.append(at_2 + link.centre * along_2)
        at, at_2 = at + link.length * along, at_2 + link.length * along_2
        found[f"r.{link.name}"] = np.array([0.0, centres[-1].real, centres[-1].imag])
        found[f"w.{link.name}"] = np.array([first, 0.0, 0.0])
    for k, (link, (*_, l, slope)) in enumerate(zip(LINKS, hinges, strict=True)):
        moment = 0.0
        for i in range(k, len(LINKS)):
            force = LINKS[i].mass * (centres_2[i] + 1j * GRAVITY)
            moment += (np.conj(centres[i] - places[k]) * force).imag
            moment += LINKS[i].inertia * seconds[i]
        found[f"lambda.{link.name}_cylinder"] = np.array([moment / slope / l])
    return found
