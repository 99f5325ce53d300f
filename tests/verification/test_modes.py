"""Eigenvalues of linearised scenes against closed forms, to 1e-10 of each.
Expected values come from formulas of textbooks or from matrices of minimal coordinates, none of
which this code has."""

import numpy as np
import pytest
from scipy.linalg import eigvals
from support.rotations import rotation

import dap3d_core as dap

G = 9.81
ROD = [1 / 12, 1 / 12, 1e-3]
RTOL = 1e-10


def magnitudes(lin, count):
    """The ``count`` largest magnitudes of eigenvalues, ascending."""
    return np.sort(np.abs(lin.eigenvalues))[-count:]


def hinge(scene, name, P_i, P_j):
    body = [P.partition(".")[0] for P in (P_i, P_j)]
    owner = [scene.points[P].body if P in scene.points else b
             for P, b in zip((P_i, P_j), body, strict=True)]  # fmt: skip
    axes = dict(zip(("a_i", "a_j"), (f"{b}.y" for b in owner), strict=True))
    scene.add_joint("rev", name, P_i=P_i, P_j=P_j, **axes)


def rods(count, name="rods"):
    """A chain of uniform rods of 1 m and 1 kg that hangs on hinges about y."""
    scene = dap.Scene(name=name)
    for k in range(count):
        scene.add_body(f"b{k}", mass=1.0, Jp=np.diag(ROD), r=[0, 0, -k - 0.5])
        scene.add_point(f"top{k}", f"b{k}", [0, 0, 0.5])
        scene.add_point(f"end{k}", f"b{k}", [0, 0, -0.5])
        hinge(scene, f"J{k}", f"top{k}", f"end{k - 1}" if k else "ground.O")
    scene.add_force("weight", "gravity")
    return scene


def test_compound_pendulum():
    """omega^2 = m g d / (J + m d^2) = 14.715 of a rod: the reaction's stiffness is all of it."""
    lin = dap.linearize(rods(1))
    np.testing.assert_allclose(lin.eigenvalues, [1j * 14.715**0.5, -1j * 14.715**0.5], rtol=RTOL)
    assert lin.stable
    assert lin.dof == 1


def test_weights_that_springs_carry():
    """Where loads balance but for rounding, at rest, it is an equilibrium: f alone is no scale.
    A ball under two springs of 40 N/m and 1 m, drawn out by m g / k each: up and down
    sqrt(k_sum / m), sideways sqrt(g / length) of the drawn length, as a pendulum."""
    scene = dap.Scene(name="balance")
    scene.add_body("ball", mass=2.0, Jp=[0.06] * 3, r=[0, 0, -1.0 - 2.0 * G / 80.0])
    for name in ("one", "other"):
        scene.add_force("ptp", name, P_i="ball.O", P_j="ground.O", k=40.0, l0=1.0)
    scene.add_force("weight", "gravity")
    found = dap.equilibrium(scene)
    lin = dap.linearize(scene, at=found)
    assert lin.is_steady
    wanted = [(G / (1.0 + 2.0 * G / 80.0)) ** 0.5] * 4 + [40.0**0.5] * 2
    np.testing.assert_allclose(magnitudes(lin, 6), wanted, rtol=1e-7)  # of the pose: 1e-8


def test_parallelogram():
    """Three rods, a closed loop with three redundant rows: omega^2 = 6/5 g / l.
    Lagrange: (2/3 m + m) l^2 phi'' = -(2 m l / 2 + m l) g phi."""
    scene = dap.Scene(name="parallelogram")
    scene.add_body("left", mass=1.0, Jp=np.diag(ROD), r=[0, 0, -0.5])
    scene.add_body("right", mass=1.0, Jp=np.diag(ROD), r=[1, 0, -0.5])
    scene.add_body("bar", mass=1.0, Jp=np.diag(ROD[::-1]), r=[0.5, 0, -1])
    for body in ("left", "right"):
        scene.add_point(f"{body}-top", body, [0, 0, 0.5])
        scene.add_point(f"{body}-end", body, [0, 0, -0.5])
    scene.add_point("bar-left", "bar", [-0.5, 0, 0])
    scene.add_point("bar-right", "bar", [0.5, 0, 0])
    scene.add_point("pivot", "ground", [1, 0, 0])
    pairs = {"A": ("left-top", "ground.O"), "B": ("right-top", "pivot"),
             "C": ("left-end", "bar-left"), "D": ("right-end", "bar-right")}  # fmt: skip
    for name, (P_i, P_j) in pairs.items():
        hinge(scene, name, P_i, P_j)
    scene.add_force("weight", "gravity")
    lin = dap.linearize(scene)
    assert lin.dof == 1
    np.testing.assert_allclose(np.abs(lin.eigenvalues), 3.4310348293189912, rtol=RTOL)


def test_double_pendulum_with_springs_and_dampers():
    """Complex eigenvalues of M x'' + C x' + K x = 0 in two angles, three-figure numbers."""
    scene = rods(2)
    k, c = (30.0, 17.0), (0.9, 0.4)
    for n, other in enumerate(("ground", "b0")):
        scene.add_force("rot_sda", f"S{n}", v_i=f"b{n}.x", v_j=f"{other}.x", axis=f"b{n}.y",
                        k=k[n], c=c[n])  # fmt: skip
    M = np.array([[1 / 3 + 1, 1 / 2], [1 / 2, 1 / 3]])
    K = np.array([[k[0] + k[1] + 1.5 * G, -k[1]], [-k[1], k[1] + 0.5 * G]])
    C = np.array([[c[0] + c[1], -c[1]], [-c[1], c[1]]])
    zero, one = np.zeros((2, 2)), np.eye(2)
    expected = eigvals(np.block([[zero, one], [-np.linalg.solve(M, K), -np.linalg.solve(M, C)]]))
    lin = dap.linearize(scene)
    order = np.lexsort((expected.imag, np.abs(expected)))
    own = np.lexsort((lin.eigenvalues.imag, np.abs(lin.eigenvalues)))
    np.testing.assert_allclose(lin.eigenvalues[own], expected[order], rtol=RTOL)
    modes = np.array([-lin.mode_eigenvalues.real, np.abs(lin.mode_eigenvalues)])
    np.testing.assert_allclose(lin.damping, modes[0] / modes[1], rtol=RTOL)
    np.testing.assert_allclose(lin.frequencies, modes[1] / (2 * np.pi), rtol=RTOL)


@pytest.mark.parametrize("count", [3, 12])
def test_chain_of_point_masses(count):
    """A string with equal masses: omega^2 l / g are the zeros of the Laguerre polynomial L_n.
    Each frequency is there in both planes. Masses spin freely: 3 n zero pairs besides."""
    scene = dap.Scene(name="string")
    for k in range(count):
        scene.add_body(f"b{k}", mass=1.0, Jp=0.1 * np.eye(3), r=[0, 0, -k - 1.0])
        scene.add_joint("sph-sph", f"J{k}", P_i=f"b{k}.O", P_j=f"b{k - 1}.O" if k else "ground.O",
                        length=1.0)  # fmt: skip
    scene.add_force("weight", "gravity")
    lin = dap.linearize(scene)
    zeros = np.polynomial.laguerre.lagroots([0] * count + [1])
    expected = np.concatenate([np.zeros(6 * count), np.repeat(np.sqrt(G * zeros), 4)])
    np.testing.assert_allclose(np.abs(lin.eigenvalues), expected, rtol=RTOL)
    assert lin.modes.shape == (6 * count, lin.dof)


def line_of_masses(count):
    """Masses on a rail, springs between them and to both ends."""
    scene = dap.Scene(name="line")
    scene.add_point("end", "ground", [count + 1.0, 0, 0])
    for k in range(count):
        scene.add_body(f"b{k}", mass=1.0, Jp=0.1 * np.eye(3), r=[k + 1.0, 0, 0])
        scene.add_joint("tran", f"J{k}", P_i=f"b{k}.O", P_j="ground.O", a_j="ground.x")
        scene.add_force("ptp", f"S{k}", P_i=f"b{k}.O", P_j=f"b{k - 1}.O" if k else "ground.O",
                        k=100.0, l0=1.0)  # fmt: skip
    scene.add_force("ptp", "S", P_i=f"b{count - 1}.O", P_j="end", k=100.0, l0=1.0)
    return scene


def test_line_of_masses():
    """omega = 2 sqrt(k / m) sin(j pi / (2 (n + 1))), all of them."""
    count = 12
    lin = dap.linearize(line_of_masses(count))
    expected = 20.0 * np.sin(np.arange(1, count + 1) * np.pi / (2 * (count + 1)))
    np.testing.assert_allclose(2 * np.pi * lin.frequencies, expected, rtol=RTOL)


@pytest.mark.slow
def test_thousand_bodies():
    """The lowest ten modes of a line of a thousand masses, from sparse matrices.
    omega_1 is 1/640 of omega_n; of omega^2 that is 2e-6, which leaves 1e-10 of rounding."""
    lin = dap.linearize(line_of_masses(1000))
    expected = 20.0 * np.sin(np.arange(1, 11) * np.pi / 2002)
    np.testing.assert_allclose(2 * np.pi * lin.frequencies, expected, rtol=RTOL)
    assert lin.stable


def test_sparse_modes_are_the_dense_ones(monkeypatch):
    """In a chain with redundant rows and dampers both ways give the same modes."""
    scene = rods(30)
    scene.add_joint("sph", "again", P_i="end0", P_j="top1")  # three rows that repeat
    for k in range(1, 30, 3):
        scene.add_force("rot_sda", f"S{k}", v_i=f"b{k}.x", v_j=f"b{k - 1}.x", axis=f"b{k}.y",
                        k=10.0, c=2.0)  # fmt: skip
    dense = dap.linearize(scene)
    monkeypatch.setattr("dap3d_core.simulation.linearization.linearization.MANY_BODIES", 1)
    sparse = dap.linearize(scene, modes=4)
    assert sparse.eigenvalues == pytest.approx(dense.eigenvalues[:8], rel=RTOL)
    shapes, of_dense = sparse.modes[:, :4], dense.modes[:, :4]
    largest = np.argmax(np.abs(of_dense), axis=0)
    scale = of_dense[largest, range(4)] / shapes[largest, range(4)]
    np.testing.assert_allclose(shapes * scale, of_dense, atol=1e-9)


def disk(R, m, spin):
    A, C = m * R * R / 4, m * R * R / 2
    scene = dap.Scene(name="disk")
    scene.add_body("disk", mass=m, Jp=np.diag([A, C, A]), r=[0, 0, R], w=[0, spin, 0],
                   r_dot=[spin * R, 0, 0])  # fmt: skip
    scene.add_joint("disk", "road", body_i="disk", radius=R)
    scene.add_force("weight", "gravity")
    return scene


@pytest.mark.parametrize("factor", [0.5, 0.999, 1.001, 3.0])
def test_rolling_disk(factor):
    """A disk that rolls upright: stable above omega^2 = g / (3 R) (Neimark and Fufaev, 1972).
    lambda^2 = -C (C + m R^2) omega^2 / (A (A + m R^2)) + m g R / (A + m R^2), with A and C the
    inertias about a diameter and the axle. Of the eight states six have eigenvalue zero: place,
    heading, spin and the speeds of the last two."""
    R, m = 0.3, 2.0
    A, C, rolling = m * R * R / 4, m * R * R / 2, m * R * R
    spin = factor * np.sqrt(G / (3 * R))
    square = -C * (C + rolling) * spin**2 / (A * (A + rolling)) + m * G * R / (A + rolling)
    lin = dap.linearize(disk(R, m, spin))
    assert (lin.coordinate_count, lin.dof) == (5, 3)
    assert np.sum(lin.eigenvalues == 0.0) == 6
    # near the critical speed both terms cancel: their rounding is that of lambda^2
    np.testing.assert_allclose(magnitudes(lin, 2) ** 2, abs(square), rtol=RTOL, atol=1e-12)
    assert lin.stable == (factor > 1.0)
    assert lin.is_steady


def top(spin, tilt=0.0, turn=0.0):
    """A heavy top on its tip; spin about its axis beside the precession ``turn`` about z."""
    scene = dap.Scene(name="top")
    p = np.array([np.cos(tilt / 2), np.sin(tilt / 2), 0, 0])
    axis = rotation(p)[:, 2]
    w = spin * axis + [0, 0, turn]
    inertia = np.diag([0.015, 0.015, 0.01])
    scene.add_body("top", mass=0.5, Jp=inertia, p=p, r=0.1 * axis, w=w,
                   r_dot=np.cross(w, 0.1 * axis))  # fmt: skip
    scene.add_point("tip", "top", [0, 0, -0.1])
    scene.add_joint("sph", "J", P_i="tip", P_j="ground.O")
    scene.add_force("weight", "gravity")
    return scene


#: Inertias of the top about its tip, across and along its axis, and weight times height.
A, C, MGH = 0.015 + 0.5 * 0.1**2, 0.01, 0.5 * G * 0.1


def test_sleeping_top():
    """Nutation and precession of an upright top: A x^2 - C omega x + m g h = 0."""
    roots = np.roots([A, -C * 30.0, MGH])
    lin = dap.linearize(top(30.0))
    np.testing.assert_allclose(magnitudes(lin, 4), np.sort([*roots, *roots]), rtol=RTOL)
    assert lin.stable
    assert not dap.linearize(top(19.0)).stable  # below 2 sqrt(A m g h) / C = 19.81


def test_nutation_of_a_precessing_top():
    """Nutation about steady precession: A x^2 = V''(tilt), V the effective potential.
    V = (p_phi - p_psi cos)^2 / (2 A sin^2) + m g h cos, its second derivative by hand below."""
    tilt, turn = 0.6, 4.0
    c, s = np.cos(tilt), np.sin(tilt)
    spin = (A * turn**2 * c + MGH) / (C * turn)  # steady precession
    lin = dap.linearize(top(spin - turn * c, tilt, turn))
    psi = C * spin
    # V' = p_psi turn s - A turn^2 s c - m g h s with turn = (p_phi - p_psi c) / (A s^2), whose
    # slope is (p_psi s - 2 A turn s c) / (A s^2)
    slope = (psi * s - 2 * A * turn * s * c) / (A * s**2)
    bend = slope * (psi * s - 2 * A * turn * s * c) + psi * turn * c
    bend += -A * turn**2 * (c**2 - s**2) - MGH * c
    np.testing.assert_allclose(magnitudes(lin, 2), np.sqrt(bend / A), rtol=RTOL)
    np.testing.assert_allclose(lin.Omega, [[0, 0, turn]], atol=1e-12)


@pytest.mark.parametrize("axis", [0, 1, 2])
def test_satellite(axis):
    """Spin about a principal axis: lambda^2 = omega^2 (J2 - J1)(J3 - J2) / (J1 J3) for the middle.
    In general -(J_s - J_a)(J_s - J_b) omega^2 / (J_a J_b) about axis s. Position and heading of the
    body are neutral; where the axis points, seen from the body, turns with omega."""
    J, spin = np.array([1.0, 2.0, 3.0]), 5.0
    p = np.array([0.9, 0.1, 0.3, -0.2]) / np.linalg.norm([0.9, 0.1, 0.3, -0.2])
    scene = dap.Scene(name="satellite")
    scene.add_body("b", mass=3.0, Jp=np.diag(J), p=p, r=[1, 2, 3], r_dot=[0.3, 0, -1],
                   w=rotation(p) @ (spin * np.eye(3)[axis]))  # fmt: skip
    a, b = (axis + 1) % 3, (axis + 2) % 3
    square = -(J[axis] - J[a]) * (J[axis] - J[b]) * spin**2 / (J[a] * J[b])
    lin = dap.linearize(scene)
    expected = np.sort([*[abs(square) ** 0.5] * 2, spin, spin])
    np.testing.assert_allclose(magnitudes(lin, 4), expected, rtol=RTOL)
    assert lin.stable == (axis != 1)
    assert np.sum(lin.eigenvalues == 0.0) == 8


def test_spinning_structure():
    """Two masses on a spring that turn about each other: radial x^2 = k / mu + 3 omega^2.
    mu = m / 2 the reduced mass, the orbit as long as the spring's pull holds it. From the central
    force: mu (r'' - h^2 / r^3) = -k (r - l), r'' = -(k / mu + 3 omega^2) dr."""
    m, k, l0, spin = 2.0, 50.0, 1.0, 3.0
    length = k * l0 / (k - 0.5 * m * spin**2)
    scene = dap.Scene(name="dumb-bell")
    for name, side in (("a", -0.5), ("b", 0.5)):
        scene.add_body(name, mass=m, Jp=0.1 * np.eye(3), r=[side * length, 0, 0],
                       r_dot=[0, side * length * spin, 0], w=[0, 0, spin])  # fmt: skip
    scene.add_force("ptp", "spring", P_i="a.O", P_j="b.O", k=k, l0=l0)
    lin = dap.linearize(scene)
    assert lin.is_steady
    assert lin.stable
    np.testing.assert_allclose(lin.Omega[:, 2], spin, rtol=1e-12)
    np.testing.assert_allclose(magnitudes(lin, 2), np.sqrt(2 * k / m + 3 * spin**2), rtol=RTOL)


def test_the_campbell_diagram_of_the_rotor_model():
    """Tilting J_t z.. + (c_r - i W J_p) z. + k_r z = 0, and translation, at each speed W.
    Without its unbalance, with which the state is no steady motion and numbers change by 8e-6."""
    scene = dap.load("rotor")
    scene.parameters["e"] = scene.parameters["acceleration"] = 0.0
    found = dap.modes_over(scene, "parameters.speed", [0.0, 150.0, 400.0])
    half, k, c, m = 0.3, 4e5, 100.0, 20.0
    J_t, J_p, k_r, c_r = 0.5, 0.2, 2 * k * half**2, 2 * c * half**2
    for speed, frequencies in zip(found.values, found.frequencies, strict=True):
        tilting = np.abs(np.roots([J_t, c_r - 1j * speed * J_p, k_r]))
        expected = np.sort([*[np.sqrt(2 * k / m)] * 3, *tilting]) / (2 * np.pi)
        np.testing.assert_allclose(np.sort(frequencies), expected, rtol=RTOL)
