"""Public function ``linearize``, and its result."""

import os
from collections.abc import Sequence
from functools import cached_property
from typing import Any

import numpy as np

from dap3d_core.kernels.array_types import Floats
from dap3d_core.linear.rank import Dependency
from dap3d_core.registry.arguments import checked
from dap3d_core.result import Result, information
from dap3d_core.scene import Scene
from dap3d_core.simulation.compiled_model import CompiledModel
from dap3d_core.simulation.errors import SimulationError
from dap3d_core.simulation.linearization.inputs import inputs_of, output_derivatives
from dap3d_core.simulation.linearization.mode_motion import mode_motion
from dap3d_core.simulation.linearization.operating_point import OperatingPoint, operating_point
from dap3d_core.simulation.linearization.scaled_equations import ScaledEquations
from dap3d_core.simulation.linearization.state_matrices import (
    Complex,
    Eigenvalues,
    eigenvalues_of,
    order_of,
    response,
)
from dap3d_core.simulation.linearization.state_space import DriverRows, StateSpace, state_space
from dap3d_core.simulation.linearization.steady_motion import independent_rows

#: Bodies beyond which only the lowest modes are computed unless more are requested.
MANY_BODIES = 150
#: Modes of such scenes by default.
FEW_MODES = 10
#: A real part below this part of the magnitude, or of the largest terms, is zero but for rounding.
REAL_PART_ROUNDING = 1e-9, 1e-12
#: Eigenvalues within this part of i Omega are drifts of free bodies, seen from axes that turn.
DRIFT = 1e-5
#: sigma as a part of the frequency that the largest terms would give.
SHIFT = 1e-4
#: Eigenvalues below this part of sigma are zeros of rigid motions, which rounding has moved.
ZERO = 1e-3


class Linearization:
    """Linearised equations of motion of a scene about a state.

    States are displacements xi and velocities eta in independent coordinates: orthonormal bases of
    what the constraint rows allow, scaled by masses and inertias; of drivers that are inputs a
    displacement and a rate each; last the states of elements. Everything is computed on first use.

    Attributes:
        t: time, s.
        u: (13 n,) the state.
        body_names: of the n bodies.
        inputs, outputs: names, in the order of the columns of B and the rows of C.
        input_units: SI units of the inputs.
        notes: choices and warnings.
    """

    def __init__(
        self,
        point: OperatingPoint,
        inputs: Sequence[str] = (),
        outputs: Sequence[str] = (),
        modes: int | None = None,
    ) -> None:
        self._point = point
        self.t, self.u, self.body_names = point.t, point.u, point.model.body_names
        self._is_large = point.model.body_count > MANY_BODIES
        self._mode_count = FEW_MODES if modes is None and self._is_large else modes
        self._inputs = inputs_of(point, inputs)
        self.inputs, self.input_units = tuple(inputs), self._inputs.units
        self.outputs = tuple(outputs)
        self.notes = [*point.notes, *self._inputs.notes]
        if self._is_large:
            self.notes.append(
                information(
                    f"{point.model.body_count} bodies: only the {self._mode_count} "
                    "lowest modes are computed, and stability is about them"
                )
            )
        if self.outputs:
            _ = self._outputs  # unknown names are errors here

    # ------------------------------------------------------------------ state space

    @cached_property
    def _space(self) -> StateSpace:
        return self._space_of(self._inputs.rows)

    @cached_property
    def _own_space(self) -> StateSpace:
        """The same without the states of drivers that are inputs."""
        return self._space if self._inputs.rows is None else self._space_of(None)

    def _space_of(self, drivers: DriverRows | None) -> StateSpace:
        point = self._point
        rank = point.rank.rank
        return state_space(point.equations, rank, point.position_rank, drivers)

    @cached_property
    def _outputs(self) -> tuple[Floats, Floats]:
        point, space = self._point, self._space
        with point.placed():
            return output_derivatives(point, space, self._inputs, self.outputs)

    @property
    def A(self) -> Floats:
        """(states, states) state matrix: z_dot = A z + B inputs."""
        return self._space.A

    @property
    def B(self) -> Floats:
        """(states, inputs) input matrix."""
        space, inputs = self._space, self._inputs
        B: Floats = space.force_input @ inputs.wrench + space.driver_input @ inputs.driver
        kept = self._point.kept
        return B + space.own @ inputs.rate[kept] if len(kept) else B

    @property
    def C(self) -> Floats:
        """(outputs, states) output matrix: change of outputs = C z + D inputs."""
        return self._outputs[0] if self.outputs else np.zeros((0, self.state_count))

    @property
    def D(self) -> Floats:
        """(outputs, inputs) feedthrough matrix."""
        return self._outputs[1] if self.outputs else np.zeros((0, len(self.inputs)))

    @checked
    def frequency_response(
        self,
        frequencies: float | Sequence[float] | Floats,
        inputs: Sequence[str] | str | None = None,
        outputs: Sequence[str] | str | None = None,
    ) -> Complex:
        """Response to inputs that oscillate: complex amplitudes of outputs for unit amplitudes.

        ``abs`` is the gain, ``numpy.angle`` by how much the output leads. Of an undamped resonance
        it is infinite. The linearisation is about its state: an oscillation about no equilibrium
        and no steady motion has none.

        Args:
            frequencies: (f,) Hz, as ``frequencies`` of the modes; 0 for a constant input.
            inputs, outputs: as of ``linearize``; by default those of this linearisation.

        Returns:
            (f, outputs, inputs), in units of the outputs over those of the inputs.

        Raises:
            UnknownNameError: an input or output that there is not; names the nearest.
            ValueError: a frequency is negative or not finite, or there are no inputs or outputs.
        """
        of = self
        if inputs is not None or outputs is not None:
            names = (self.inputs if inputs is None else _names(inputs),
                     self.outputs if outputs is None else _names(outputs))  # fmt: skip
            of = Linearization(self._point, *names, self._mode_count)
        for word, there in (("inputs", of.inputs), ("outputs", of.outputs)):
            if not there:
                raise ValueError(f"a response needs {word}: name them here, or to linearize")
        return response(of.A, of.B, of.C, of.D, frequencies)

    @property
    def state_count(self) -> int:
        """Number of states: displacements, velocities, states of elements."""
        return len(self._space.A)

    @property
    def coordinate_count(self) -> int:
        """Number of displacements among the states; they come first."""
        return self._space.coordinate_count

    @property
    def element_states(self) -> tuple[str, ...]:
        """Names of the states of elements, the last among the states: ``spring.z``."""
        names = [label.partition(".")[2] for label in self._point.model.state_labels]
        return tuple(names[k] for k in self._point.kept)

    @property
    def dof(self) -> int:
        """Degrees of freedom: independent velocities."""
        return self._point.rank.dof

    @property
    def basis(self) -> Floats:
        """(12 n, states) displacements, then velocities, of all bodies for unit states.

        Per body (delta r, rotation vector), then (delta r_dot, delta omega), global axes.
        """
        return np.vstack([self._space.displacement, self._space.velocity])

    @property
    def Omega(self) -> Floats:
        """(n, 3) angular velocity of the axes in which the equations are written, rad/s."""
        return self._point.frames.Omega

    @property
    def is_steady(self) -> bool:
        """Whether the state is an equilibrium or a steady motion."""
        return self._point.frames.is_steady

    def to_control(self) -> Any:
        """The same as a ``control.StateSpace`` of python-control (extra ``control``).

        Its names take no dots: ``push.f.x`` is called ``push_f_x`` there.

        Raises:
            ImportError: python-control is not installed.
        """
        try:
            import control
        except ImportError as error:
            raise ImportError("to_control needs python-control: pip install control") from error
        states = [f"xi{k + 1}" for k in range(self.coordinate_count)]
        own = len(self.element_states)
        states += [f"eta{k + 1}" for k in range(self.state_count - len(states) - own)]
        states += [name.replace(".", "_") for name in self.element_states]
        signals = {
            "inputs": [name.replace(".", "_") for name in self.inputs],
            "outputs": [name.replace(".", "_") for name in self.outputs],
        }
        return control.ss(self.A, self.B, self.C, self.D, states=states, **signals)

    # ------------------------------------------------------------------ modes

    @cached_property
    def _spectrum(self) -> Eigenvalues:
        """Eigenvalues, and displacements (6 n, k) in place of eigenvectors."""
        point = self._point
        if self._is_large and self._mode_count is not None:
            dependencies = point.rank.dependencies
            count = min(2 * self._mode_count, 12 * point.model.body_count - 2)
            lowest = lowest_eigenvalues(point.equations, dependencies, count)
            return Eigenvalues(lowest.values, point.equations.U @ lowest.vectors)
        space = self._own_space
        scale = np.ones(len(space.A))
        scale[: space.coordinate_count] = space.size or 1.0
        scale[len(scale) - space.own.shape[1] :] = _balance(space, scale)
        all_of_them = eigenvalues_of(scale[:, None] * space.A / scale, space.size)
        vectors = all_of_them.vectors / scale[:, None]
        return Eigenvalues(all_of_them.values, space.displacement @ vectors)

    @property
    def eigenvalues(self) -> Complex:
        """(k,) eigenvalues, 1/s, by magnitude; of a conjugate pair that with Im > 0 first.

        Those of the scene as it is: drivers that are inputs keep to their functions.
        All of them; of more than 150 bodies those of the lowest modes.
        """
        return self._spectrum.values

    @cached_property
    def _of_modes(self) -> Any:
        """Indices of the eigenvalues that stand for modes."""
        values, vectors = self._spectrum.values, self._spectrum.vectors
        has_shape = np.linalg.norm(vectors, axis=0) > 0.0
        chosen = np.flatnonzero((values.imag >= 0.0) & has_shape)
        return chosen if self._mode_count is None else chosen[: self._mode_count]

    @property
    def mode_eigenvalues(self) -> Complex:
        """(modes,) the eigenvalue of each mode: of a conjugate pair that with Im > 0."""
        return self._spectrum.values[self._of_modes]

    @property
    def frequencies(self) -> Floats:
        """(modes,) natural frequency of each mode, Hz: ``|lambda|`` / (2 pi)."""
        return np.abs(self.mode_eigenvalues) / (2.0 * np.pi)

    @property
    def damping(self) -> Floats:
        """(modes,) damping ratio of each mode: ``-Re lambda / |lambda|``; 0 for lambda = 0."""
        values = self.mode_eigenvalues
        magnitude = np.abs(values)
        ratio: Floats = -values.real / np.where(magnitude > 0.0, magnitude, 1.0)
        return ratio + 0.0

    @cached_property
    def modes(self) -> Complex:
        """(6 n, modes) mode shapes: (delta r, rotation vector) of each body, global axes.

        A conjugate pair is one mode, so is a real eigenvalue. The largest component, rotations
        times the size of the largest part, is one; displacements are Re(shape exp(lambda t)).
        """
        shapes = self._spectrum.vectors[:, self._of_modes]
        length = self._point.model.part_size
        weighted = shapes * np.tile(np.repeat([1.0, length], 3), len(self.body_names))[:, None]
        largest = np.argmax(np.abs(weighted), axis=0)
        peak: Complex = weighted[largest, np.arange(shapes.shape[1])]
        return shapes / peak

    @property
    def M(self) -> Any:
        """(6 n, 6 n) masses and inertias of the bodies, global axes: the metric of mode shapes."""
        return self._point.tangent.M

    @cached_property
    def participation(self) -> Floats:
        """(modes, n) share of each body in the kinetic energy of each mode; each row sums to 1."""
        x = self.modes
        energy = np.real(np.conj(x) * (self.M @ x)).T
        energy = energy.reshape(len(energy), len(self.body_names), 6).sum(axis=2)
        return energy / energy.sum(axis=1, keepdims=True)

    @checked
    def motion(self, mode: int = 0, size: float = 0.1, instants: int = 60) -> Result:
        """The motion of one mode, as a result of one period for ``view``, ``animate``, ``save``.

        Displacements of the state, Re(shape exp(i phase)), without the decay or growth of the mode,
        brought onto the constraints; of a real eigenvalue, to and fro in one second.

        Args:
            mode: index of the mode, from 0.
            size: largest displacement, as a part of the model's extent; rotations up to 0.5 rad.
            instants: number of instants.

        Raises:
            IndexError: there is no such mode.
        """
        return mode_motion(self._point, self.modes, self.mode_eigenvalues, mode, size, instants)

    @property
    def stable(self) -> bool:
        """False if a motion grows: an eigenvalue has a positive real part beyond rounding.

        Undamped oscillations, and neutral motions with eigenvalue zero, count as stable. Where
        only the lowest modes were computed, it is about these.
        """
        values = self.eigenvalues
        for rate in self._point.frames.drift:  # a double eigenvalue, which rounding splits
            values = values[np.abs(np.abs(values.imag) - rate) + np.abs(values.real) > DRIFT * rate]
        own, all_of_them = REAL_PART_ROUNDING
        equations = self._point.equations
        size = max(float(np.sqrt(abs(equations.K).max())), float(abs(equations.C).max()))
        return bool(np.all(values.real <= own * np.abs(values) + all_of_them * size))

    def __repr__(self) -> str:
        n, m = len(self.inputs), len(self.outputs)
        size = f"degrees of freedom {self.dof}, inputs {n}, outputs {m}"
        return f"<Linearization at t = {self.t:g} s: {size}>"


def _balance(space: StateSpace, scale: Floats) -> Floats:
    """Scales of the states of elements, of any unit, by which they couple alike both ways."""
    count = space.own.shape[1]
    A = scale[:, None] * space.A / scale
    rest = len(A) - count
    into, out = np.abs(A[rest:, :rest]).sum(axis=1), np.abs(A[:rest, rest:]).sum(axis=0)
    is_coupled = (into > 0.0) & (out > 0.0)
    balanced = np.sqrt(np.where(is_coupled, out, 1.0) / np.where(is_coupled, into, 1.0))
    return np.where(is_coupled, balanced, 1.0)


@checked
def linearize(
    scene: Scene | str | os.PathLike[str] | CompiledModel,
    at: Any = None,
    t: float = 0.0,
    inputs: Sequence[str] = (),
    outputs: Sequence[str] = (),
    *,
    modes: int | None = None,
    allow_code: bool = False,
) -> Linearization:
    """Linearise the equations of motion of a scene about a state.

    The stiffness of reactions, redundant rows, rolling (rows of the velocity level alone) and
    drivers are included. About a steady motion (a spinning satellite, a rolling wheel) the
    equations are written in axes that turn with it, so that their coefficients are constant.
    Derivatives are exact to rounding (simulation/linearization/tangent.py).

    Args:
        scene: a Scene, what ``load`` takes, or a compiled model.
        at: the state: None for the start of the scene, corrected as a run does; a ``Result``, at
            its instant t; an equilibrium (``.r``, ``.p``), at rest; or u (13 n,).
        t: time, s: of the functions of time and the drivers.
        inputs: ``INPUT``, one of the scene; ``FORCE.FIELD`` for a number of a force element,
            ``FORCE.FIELD.x`` for a component (``motor.n_a``, ``push.f.z``), also of one that the
            rates of its states depend on; ``FORCE`` for a factor on all of its force, 1 at the
            state. ``DRIVER``, a joint with a function of time: an acceleration, in m/s^2 or
            rad/s^2, beside that of the function; the displacement and rate that it adds are states.
        outputs: quantities by name as in results (``body.r.x``, ``P.v``, ``J1.force.z``, ...).
        modes: number of lowest modes to report; by default all, or 10 of a scene of more than 150
            bodies, whose modes come from sparse matrices.
        allow_code: whether the model's own types may be loaded.

    Raises:
        SceneError, PluginError: as ``compile``.
        SimulationError: a state off the constraints or at a switch; no derivative there.
        UnknownNameError: an input or output that there is not; names the nearest.
    """
    if modes is not None and (not isinstance(modes, int) or modes < 1):
        raise ValueError(f"modes must be a whole number above zero, not {modes!r}")
    point = operating_point(scene, at, t, allow_code)
    return Linearization(point, _names(inputs), _names(outputs), modes)


def _names(names: Sequence[str] | str) -> tuple[str, ...]:
    return (names,) if isinstance(names, str) else tuple(names)


def lowest_eigenvalues(
    equations: ScaledEquations, dependencies: Sequence[Dependency], count: int
) -> Eigenvalues:
    """The ``count`` eigenvalues nearest to zero, and displacements x^ (6 n, count) of each.

    Of the sparse equations without independent coordinates: with y = (x^, v^, lambda, z), z of
    elements with states, they are a pencil E y_dot = B y, E singular. Position rows stand as
    D x^ = 0, rows of the velocity level alone as D v^ + G x^ = 0, redundant rows are left out.
    Arnoldi iterations with (B - sigma E)^-1 E (scipy.sparse.linalg.eigs, ARPACK) find the
    eigenvalues nearest to a small real sigma; those at infinity, which the constraints add, become
    zero and stay out of the way.

    Raises:
        SimulationError: the iteration does not converge.
    """
    from scipy.sparse import block_array, block_diag, csc_array, eye_array
    from scipy.sparse.linalg import ArpackNoConvergence, LinearOperator, eigs, splu

    six = equations.K.shape[0]
    chosen = independent_rows(equations.D.shape[0], dependencies)
    position = equations.position_row[chosen]
    D, G, F = equations.D[chosen], equations.G[chosen], equations.F[:, chosen]
    identity = eye_array(six)
    on_x = D.multiply(position[:, None]) + G.multiply(~position[:, None])
    on_v = D.multiply(~position[:, None])
    own = equations.states
    by_rows = own.position[chosen].multiply(position[:, None])
    by_rows = by_rows + own.velocity[chosen].multiply(~position[:, None])
    terms = [[equations.S, identity, None, None],
             [-equations.K, -equations.C, D.T + F, own.force],
             [on_x, on_v, None, by_rows],
             [own.by_displacement, own.by_velocity, None, own.by_states]]  # fmt: skip
    masses = [identity, identity, csc_array((len(chosen), len(chosen)))]
    masses.append(eye_array(own.by_states.shape[0]))
    B, E = block_array(terms).tocsc(), block_diag(masses).tocsc()
    largest = max(np.sqrt(_norm(equations.K)), _norm(equations.C), _norm(equations.S))
    sigma = SHIFT * largest if largest > 0.0 else 1.0
    factors = splu(csc_array(B - sigma * E))
    size = B.shape[0]
    operator = LinearOperator((size, size), lambda z: factors.solve(E @ np.asarray(z).ravel()))
    start = operator @ (operator @ np.random.default_rng(1).standard_normal(size))
    wanted = min(count, size - 2)
    try:
        theta, vectors = eigs(operator, k=wanted, v0=start, maxiter=100 * count, tol=1e-13)
    except ArpackNoConvergence as error:
        theta, vectors = error.eigenvalues, error.eigenvectors
        if len(theta) < wanted:
            raise SimulationError(
                f"of the lowest {wanted} eigenvalues {len(theta)} were found; take fewer modes"
            ) from error
    values = sigma + 1.0 / theta
    values[np.abs(values) < ZERO * sigma] = 0.0
    order = order_of(values)
    return Eigenvalues(values[order], vectors[:six, order])


def _norm(matrix: Any) -> float:
    """The largest sum of magnitudes in a row."""
    sums = np.asarray(abs(matrix).sum(axis=1))
    return float(np.max(sums, initial=0.0))
