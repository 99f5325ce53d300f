"""Cable of constant or given length over points of bodies."""

from dap3d_core.interface import Joint, function, hookimpl, input_, number, points
from dap3d_core.kernels import by_body, cross, dot, norm2, row, scale, sqrt, sub

interface_version = 1


class Cable(Joint):
    """The length of a massless cable from point to point is constant, or given over time.

    The first and the last of the ``points`` are its ends; over the others it runs without friction,
    as over pulleys of no radius and no mass. They may lie on any bodies, several on one. With d_k
    from point k to the next, l_k its length, u_k = d_k / l_k, and p_k = u_k - u_(k-1) (at the ends
    the one u there is):

        C     = L + f - (l_1 + l_2 + ...)
        J     = [p_k^T, (s_k x p_k)^T], summed over the points on a body,  nu = -f_dot
        gamma = -f_ddot - sum p_k . (w_k x s_k_dot) + sum (|d_k_dot|^2 - (u_k . d_k_dot)^2) / l_k

    L is ``length``; left out it is that of the start, and f is counted from f(0). The multiplier is
    the tension, the same along the cable, positive where it pulls. The cable stays taut: a run in
    which it would have to push says so; what may become slack is the force ``cable``, with k. A
    growing f pays out. An ``input`` is the speed at which a winch pays out, held between settings:
    the row is then one of the velocity level alone, and velocities jump where it is set.
    """

    keyword, rows = "cable", 1
    synonyms = ("rope", "pulley", "winch", "hoist", "tackle")
    unilateral = (0,)
    unilateral_words = "the cable would have to push; a force cable, with k, becomes slack"
    points: tuple = points("n", least=2, doc="ends and pulleys, in order along the cable")
    length: float = number(
        default=None, unit="m", positive=True, doc="length of the cable; left out, as at the start"
    )
    function: str = function(doc="m, by which the cable is longer, as a function of time")
    input: str = input_(instead_of="function", unit="m/s", doc="speed at which cable is paid out")

    def prepare(self, bodies):
        total = length_at_start(self.points, bodies["points"])
        if self.length is not None:
            return {"length": self.length, "counted": 0.0}
        return {"length": total, "counted": 1.0}

    def C(r_points, length, counted, f, f_0):
        return length + (f - counted * f_0) - sum(spans(r_points)[0])

    def J(r_points, s_points, on_points, body_count):
        rows = [(row(p, cross(s, p)),) for p, s in zip(pulls(r_points), s_points, strict=True)]
        return by_body(on_points, rows, body_count)

    def nu(f_dot):
        return -f_dot

    def gamma(r_points, v_points, s_points_dot, w_points, f_ddot):
        return bending(r_points, v_points, s_points_dot, w_points) - f_ddot


class Wound(Cable, input=True):
    """The speed at which cable is paid out is an input."""

    holonomic = False
    drives = True
    C = None

    def nu(input):
        return -input

    def gamma(r_points, v_points, s_points_dot, w_points):
        return bending(r_points, v_points, s_points_dot, w_points)


class Driven(Cable, function=True):
    """The length is driven by a function of time."""

    drives = True


def length_at_start(points, poses):
    """Length of the cable in the poses as given, m.

    Raises:
        ValueError: a point coincides with the next.
    """
    places = [pose.place(point) for point, pose in zip(points, poses, strict=True)]
    squares = [norm2(d) for d in steps(places)]
    if 0.0 in squares:
        k = squares.index(0.0) + 1
        raise ValueError(
            f"points {k} and {k + 1} of the cable coincide, so its direction is undefined there; "
            "give other points"
        )
    return sum(square**0.5 for square in squares)


def steps(r):
    """From each vector to the next."""
    return [sub(r[k + 1], r[k]) for k in range(len(r) - 1)]


def spans(r):
    """Lengths of the spans between points, and unit vectors along them."""
    between = steps(r)
    lengths = [sqrt(norm2(d)) for d in between]
    return lengths, [scale(1.0 / l, d) for l, d in zip(lengths, between, strict=True)]


def pulls(r):
    """The force on each point of a cable with the tension 1."""
    u = spans(r)[1]
    return [u[0], *steps(u), scale(-1.0, u[-1])]


def length_rate(r, v):
    """Rate of the length, m/s."""
    return -sum(dot(p, v_k) for p, v_k in zip(pulls(r), v, strict=True))


def bending(r, v, s_dot, w):
    """The acceleration of a length with its rate, but for the accelerations of bodies."""
    lengths, u = spans(r)
    turning = 0.0
    for k, l in enumerate(lengths):
        d_dot = sub(v[k + 1], v[k])
        along = dot(u[k], d_dot)
        turning = turning + (norm2(d_dot) - along * along) / l
    arms = [dot(p, cross(*x)) for p, *x in zip(pulls(r), w, s_dot, strict=True)]
    return turning - sum(arms)


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Cable]
