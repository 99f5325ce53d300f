"""Thin rigid disk that rolls or slides on the ground plane z = 0."""

from dap3d_core.interface import Body, Contact, Joint, body, choice, hookimpl, number
from dap3d_core.kernels import add, cross, dot, row, scale, sqrt, sub, tanh, where
from dap3d_joints.coulomb import against

interface_version = 1

X, Y, Z = (1.0, 0.0, 0.0), (0.0, 1.0, 0.0), (0.0, 0.0, 1.0)


class Disk(Joint):
    """A disk of radius R, its axis the eta axis of body i, on the plane z = 0 (manual: ``disk``).

    With k = z, c = k . eta and sigma = sqrt(1 - c^2), the sine of the angle between disk
    and ground, the body origin being the disk's centre:

        t = (k x eta) / sigma     longitudinal, along the track
        n = (eta - c k) / sigma   lateral
        s = R (c n - sigma k)     from the centre to the point of contact
        v_c = r_dot + w x s       velocity of the material point there

    slip names the rows: ``z``; ``nz``: z, n (no lateral slip); ``tz``: z, t (no longitudinal slip);
    ``xyz``: x, y, z (no slip). Row z is the contact, also at position level; the rows u = x, y, t
    and n say u . v_c = 0 and are of the velocity level alone:

        C     = r_z - R sigma
        J     = [u^T, (s x u)^T], for row z u = k
        gamma = -u . (w x s_dot) - u_dot . v_c

    lambda of row z is the load that the ground carries; where it is negative the ground pulls: a
    real disk would lift off, as the contact ``disk_plane`` does, and the run gets a note. Friction
    acts along the free directions of v_c, mu max(lambda_z, 0).
    """

    keyword, rows, holonomic = "disk", 3, (False, False, True)
    ground_axes = "z"
    synonyms = ("wheel", "rolling")
    symbol = "wheel"
    switch_words = (
        "the disk lies down (sine of the angle between disk and ground below its `lying`), "
        "so its point of contact is undefined"
    )
    unilateral = (2,)
    unilateral_words = "the ground pulls the disk down, which would lift off"
    body_i: Body = body(doc="the disk; its origin is the centre, its y axis the disk's axis")
    slip: str = choice(
        ("z", "nz", "tz", "xyz"),
        default="xyz",
        aliases={"zn": "nz", "zt": "tz"},
        doc="directions without slip",
    )
    radius: float = number(default=1.0, unit="m", positive=True, doc="radius of the disk")
    lying: float = number(
        default=0.02,
        positive=True,
        doc="sine of the angle between disk and ground below which it lies; the run ends there",
    )

    def prepare(self, bodies):
        import warnings

        Jp = bodies["i"].Jp
        across, name = max((Jp[0][0], "x"), (Jp[2][2], "z"))
        if across > 1.001 * Jp[1][1]:
            warnings.warn(
                "the axis of the disk is the y axis of its body, and its inertia about "
                f"{name}, {across:g}, is larger than about y, {Jp[1][1]:g}; a flat disk has its "
                "largest inertia about its axis",
                stacklevel=2,
            )
        return {}

    def C(r_i, A_i, radius):
        return r_i[2] - radius * axis(A_i)[1]

    def J(A_i, radius):
        _, _, s = contact(A_i, radius)
        return row(X, cross(s, X)), row(Y, cross(s, Y)), row(Z, cross(s, Z))

    def gamma(A_i, w_i, radius):
        _, s_dot = contact_rate(A_i, w_i, radius)
        return sub((0.0, 0.0, 0.0), cross(w_i, s_dot))

    def switch(A_i, lying):
        return axis(A_i)[1] - lying


class Sliding(Disk, slip="z"):
    """The disk touches the ground and slides freely: row z."""

    rows, holonomic, unilateral = 1, True, (0,)

    def J(A_i, radius):
        _, _, s = contact(A_i, radius)
        return row(Z, cross(s, Z))

    def gamma(A_i, w_i, radius):
        _, s_dot = contact_rate(A_i, w_i, radius)
        return -dot(Z, cross(w_i, s_dot))

    def friction(lam, mu, v_tol, A_i, v_i, w_i, radius):
        _, _, s = contact(A_i, radius)
        v = add(v_i, cross(w_i, s))
        F = against((v[0], v[1], 0.0), mu * pressed(lam[0]), v_tol)
        return ((F, cross(s, F)),)


class NoLateralSlip(Disk, slip="nz"):
    """The disk slides along its track alone: rows z and n."""

    rows, holonomic, unilateral = 2, (True, False), (0,)

    def J(A_i, radius):
        _, n, s = contact(A_i, radius)
        return row(Z, cross(s, Z)), row(n, cross(s, n))

    def gamma(A_i, v_i, w_i, radius):
        t, n, s = contact(A_i, radius)
        turn, s_dot = contact_rate(A_i, w_i, radius)
        a = cross(w_i, s_dot)  # n_dot = turn t
        return -a[2], -dot(n, a) - turn * dot(t, add(v_i, cross(w_i, s)))

    def friction(lam, mu, v_tol, A_i, v_i, w_i, radius):
        t, _, s = contact(A_i, radius)
        v = dot(t, add(v_i, cross(w_i, s)))
        F = scale(-mu * pressed(lam[0]) * tanh(v / v_tol), t)
        return ((F, cross(s, F)),)


class NoLongitudinalSlip(Disk, slip="tz"):
    """The disk rolls along its track and slides across it: rows z and t."""

    rows, holonomic, unilateral = 2, (True, False), (0,)

    def J(A_i, radius):
        t, _, s = contact(A_i, radius)
        return row(Z, cross(s, Z)), row(t, cross(s, t))

    def gamma(A_i, v_i, w_i, radius):
        t, n, s = contact(A_i, radius)
        turn, s_dot = contact_rate(A_i, w_i, radius)
        a = cross(w_i, s_dot)  # t_dot = -turn n
        return -a[2], -dot(t, a) + turn * dot(n, add(v_i, cross(w_i, s)))

    def friction(lam, mu, v_tol, A_i, v_i, w_i, radius):
        _, n, s = contact(A_i, radius)
        v = dot(n, add(v_i, cross(w_i, s)))
        F = scale(-mu * pressed(lam[0]) * tanh(v / v_tol), n)
        return ((F, cross(s, F)),)


class SlidingFriction(Contact, of=Sliding):
    """Friction that sticks, in the plane."""

    keyword, load = "friction", (0,)

    def at(r_i, A_i, radius):
        return add(r_i, contact(A_i, radius)[2])

    def normal():
        return Z


class TrackFriction(Contact, of=NoLateralSlip):
    """Friction that sticks, along the track."""

    keyword, load = "friction", (0,)

    def at(r_i, A_i, radius):
        return add(r_i, contact(A_i, radius)[2])

    def along(A_i, radius):
        return contact(A_i, radius)[0]


class LateralFriction(Contact, of=NoLongitudinalSlip):
    """Friction that sticks, across the track."""

    keyword, load = "friction", (0,)

    def at(r_i, A_i, radius):
        return add(r_i, contact(A_i, radius)[2])

    def along(A_i, radius):
        return contact(A_i, radius)[1]


def axis(A):
    """The disk's axis eta, and sigma."""
    eta = (A[0][1], A[1][1], A[2][1])
    return eta, sqrt(eta[0] * eta[0] + eta[1] * eta[1])


def contact(A, radius):
    """t, n and s."""
    eta, sigma = axis(A)
    level = where(sigma > 0.0, sigma, 1.0)  # lying flat it ends the run, with finite numbers
    n = (eta[0] / level, eta[1] / level, 0.0)
    c = radius * eta[2]
    return (-n[1], n[0], 0.0), n, (c * n[0], c * n[1], -radius * sigma)


def contact_rate(A, w, radius):
    """The rate of turn of t and n about k, and s_dot."""
    eta, sigma = axis(A)
    t, n, _ = contact(A, radius)
    eta_dot = cross(w, eta)
    up = where(sigma > 0.0, sigma, 1.0)
    turn, c, c_dot = dot(t, eta_dot) / up, eta[2], eta_dot[2]
    level = add(scale(c_dot, n), scale(c * turn, t))
    return turn, scale(radius, add(level, (0.0, 0.0, c * c_dot / up)))


def pressed(load):
    """The load between disk and ground; none where the ground would have to pull."""
    return where(load > 0.0, load, 0.0)


@hookimpl
def dap3d_joints():
    """The joint types of this module."""
    return [Disk]
