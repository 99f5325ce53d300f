"""Elastic belt over two or more pulleys."""

from collections.abc import Mapping
from typing import ClassVar

from dap3d_core.interface import (
    Force,
    Vector,
    choice,
    hookimpl,
    joint_fields,
    number,
    numbers,
    points,
    vector,
)
from dap3d_core.kernels import add, by_body, cross, maximum, scale, sub, where
from dap3d_joints.belt import runs, signed_radii, speeds

interface_version = 1


class Belt(Force):
    """A massless, elastic belt over pulleys, without slip: a tension of its own in each span.

    The ``points`` are the centres of the pulleys, in the order in which the belt runs around them
    counterclockwise, seen against ``axis_i``, and closes on the first. A negative radius is that of
    a pulley outside of the loop, on the back of the belt, which turns in the other direction. Span
    k runs from pulley k to the next. With rho_k the radii, d between the centres, normal to the
    axis, l its length, u = d / l and m = axis x u, it touches both pulleys in the direction n:

        sin b = (rho_k - rho_(k+1)) / l,  n = sin b u - cos b m
        P_k = r_k + rho_k n,  P_(k+1) = r_(k+1) + rho_(k+1) n,  e along P_(k+1) - P_k
        x_dot = e . (v_P(k+1) - v_P_k),  T = max(0, pretension + k x + c x_dot)
        force T e at P_k on pulley k, -T e at P_(k+1) on the next
        energy = sum of max(0, pretension + k x)^2 / (2 k)

    v_P_k is the velocity of the point of the pulley there. The elongations x of the spans since the
    start are states. The forces load the bearings: with the axis fixed, the moment on a pulley is
    rho (T_out - T_in), where T_out is the tension of the span that begins there. With ``crossed``
    the belt of two pulleys crosses itself, as with a negative second radius. Of
    no stretch: joint ``belt``.
    """

    keyword = "belt"
    synonyms = ("pulley", "timing-belt", "chain")
    states: ClassVar = {"x": "n"}
    example: ClassVar[Mapping[str, str]] = {"radii": "[0.1, 0.3]", "k": "1e4"}
    joints: tuple = joint_fields(points="P", axis_i="a", doc="hinges of the pulleys, in order")
    points: tuple = points("n", least=2, doc="centres of the pulleys, in order along the belt")
    radii: tuple = numbers("n", unit="m", doc="radii; negative of a pulley on the belt's back")
    axis_i: Vector = vector(doc="direction of the axes of all pulleys, on any body")
    k: float = number(unit="N/m", minimum=0.0, doc="stiffness of each span")
    c: float = number(default=0.0, unit="N s/m", minimum=0.0, doc="damping of each span")
    pretension: float = number(default=0.0, unit="N", minimum=0.0, doc="tension where x = 0")
    crossed: bool = choice((False, True), False, doc="the belt of two pulleys crosses itself")

    def prepare(self, bodies):
        return {"rho": signed_radii(self, bodies)}

    def wrench(r_points, s_points, v_points, w_points, on_points, body_count, rho, axis_i, k, c,
               pretension, x):  # fmt: skip
        spans = runs(r_points, rho, axis_i)
        T = [maximum(p, 0.0) for p in pulls(spans, v_points, w_points, rho, k, c, pretension, x)]
        along = [scale(T_k, span[2]) for T_k, span in zip(T, spans, strict=True)]
        about = [scale(T_k, span[4]) for T_k, span in zip(T, spans, strict=True)]
        parts = []
        for b, s in enumerate(s_points):  # the span that begins on the pulley, less that which ends
            F = sub(along[b], along[b - 1])
            parts.append((F, add(cross(s, F), scale(rho[b], sub(about[b], about[b - 1])))))
        return by_body(on_points, parts, body_count)

    def tension(r_points, v_points, w_points, rho, axis_i, k, c, pretension, x):
        spans = runs(r_points, rho, axis_i)
        return tuple(
            maximum(pull, 0.0)
            for pull in pulls(spans, v_points, w_points, rho, k, c, pretension, x)
        )

    def energy(k, pretension, x):
        return sum(stored(k, pretension, x_k) for x_k in x)

    def rate(r_points, v_points, w_points, rho, axis_i):
        return (speeds(runs(r_points, rho, axis_i), v_points, w_points, rho),)

    def switch(r_points, v_points, w_points, rho, axis_i, k, c, pretension, x):
        return pulls(runs(r_points, rho, axis_i), v_points, w_points, rho, k, c, pretension, x)


def pulls(spans, v, w, rho, k, c, pretension, x):
    """The tension of each span, N; negative where it is slack."""
    rates = speeds(spans, v, w, rho)
    return tuple(pretension + k * x_k + c * rate for x_k, rate in zip(x, rates, strict=True))


def stored(k, pretension, x):
    """Energy of a span, J: what it does until it is slack; without k it does not become slack."""
    T = maximum(pretension + k * x, 0.0)
    return where(k > 0.0, 0.5 * T * T / where(k > 0.0, k, 1.0), pretension * x)


@hookimpl
def dap3d_forces():
    """The force types of this module."""
    return [Belt]
