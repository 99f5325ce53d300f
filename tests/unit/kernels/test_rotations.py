"""Kernel functions of rotations, against SciPy; the scalar ones that plain Python has."""

import cmath
import math

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from dap3d_core import kernels

RNG = np.random.default_rng(11)
ROTATIONS = [
    *(Rotation.random(random_state=int(k)) for k in RNG.integers(0, 2**31, 8)),
    *(Rotation.from_rotvec(size * np.array([0.48, -0.6, 0.64]))
      for size in (0.0, 1e-300, 1e-9, 1e-3, 0.0199, 0.0201, 1.0, 3.1, math.pi - 1e-9)),
    *(Rotation.from_rotvec(math.pi * axis) for axis in np.eye(3)),
]  # fmt: skip


def parameters(rotation):
    """Euler parameters of a rotation of SciPy."""
    x, y, z, w = rotation.as_quat()
    return (w, x, y, z)


@pytest.mark.parametrize("rotation", ROTATIONS)
def test_rotation_vectors_and_back(rotation):
    """Of Euler parameters and of the matrix; half a turn has two vectors."""
    wanted, matrix = rotation.as_rotvec(), tuple(map(tuple, rotation.as_matrix()))
    for given in (parameters(rotation), tuple(-x for x in parameters(rotation)), matrix):
        found = np.array(kernels.rotation_vector(given))
        if np.linalg.norm(wanted) > 3.14159265:
            found *= np.sign(found @ wanted)
        np.testing.assert_allclose(found, wanted, atol=1e-15 if len(given) == 4 else 4e-15)
    back = kernels.rotation_matrix(tuple(wanted))
    np.testing.assert_allclose(back, matrix, atol=2e-15)
    p = np.array(kernels.euler_parameters(matrix))
    np.testing.assert_allclose(p * np.sign(p @ parameters(rotation)), parameters(rotation),
                               atol=2e-15)  # fmt: skip


def test_products():
    """Matrices and Euler parameters multiply in the same order."""
    a, b = ROTATIONS[:2]
    A, B = (tuple(map(tuple, r.as_matrix())) for r in (a, b))
    np.testing.assert_allclose(kernels.matmul(A, B), (a * b).as_matrix(), atol=1e-15)
    np.testing.assert_array_equal(kernels.transpose(A), np.transpose(A))
    product = kernels.quaternion_product(parameters(a), parameters(b))
    found = Rotation.from_quat([*product[1:], product[0]])
    np.testing.assert_allclose(found.as_matrix(), (a * b).as_matrix(), atol=1e-15)
    one = kernels.quaternion_product(parameters(a), kernels.conjugate(parameters(a)))
    np.testing.assert_allclose(one, (1.0, 0.0, 0.0, 0.0), atol=1e-15)


def test_products_of_matrices_of_any_size():
    """No row or column is left out; sizes that do not match are refused."""
    A, B = RNG.normal(size=(2, 3)), RNG.normal(size=(3, 4))
    given = tuple(map(tuple, A)), tuple(map(tuple, B))
    np.testing.assert_allclose(kernels.matmul(*given), A @ B, atol=1e-15)
    np.testing.assert_array_equal(kernels.transpose(given[0]), A.T)
    with pytest.raises(ValueError, match="zip"):
        kernels.matmul(given[0], given[0])


@pytest.mark.parametrize("size", [0.0, 1e-8, 0.0199, 0.0201, 2.0])
def test_their_derivatives_by_complex_steps(size):
    """At rest, on both sides of the limit of the series, and beyond, against differences."""
    axis = np.array([0.48, -0.6, 0.64])
    phi, way = size * axis, np.array([0.3, 0.2, -0.5])

    def at(step):
        return np.array(kernels.rotation_matrix(tuple(phi + step * way)))

    slope = at(1e-30j).imag / 1e-30
    h = 1e-5
    differences = (8 * (at(h) - at(-h)) - (at(2 * h) - at(-2 * h))) / (12 * h)
    np.testing.assert_allclose(slope, differences, atol=1e-10)  # rounding 1e-16 / h
    vector = kernels.rotation_vector(kernels.rotation_matrix(tuple(phi + 1e-30j * way)))
    np.testing.assert_allclose(np.imag(vector) / 1e-30, way, atol=1e-12)


@pytest.mark.parametrize("name", ["tan", "atan", "sinh", "cosh"])
def test_scalar_functions(name):
    """Numbers and complex numbers as in Python; infinite where they overflow."""
    function = getattr(kernels, name)
    for x in (-2.0, 0.0, 0.7):
        assert function(x) == getattr(math, name)(x)
        z = complex(x, 0.3)
        assert function(z) == getattr(cmath, name)(z)
    if name.endswith("h"):
        assert function(-1e3) == {"sinh": -math.inf, "cosh": math.inf}[name]


def test_sign_and_remainder():
    assert [kernels.sign(x) for x in (-3.0, -0.0, 0.0, 2.0, math.nan)] == [-1, 0, 0, 1, 0]
    for x in (-7.3, -2.0, 0.0, 5.9):
        for y in (-2.5, 0.7):
            assert kernels.mod(x, y) == pytest.approx(x % y, abs=1e-15)
