"""Results in memory: stored arrays, and all that is computed from them."""

import os
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import attrs
import numpy as np

from dap3d_core.model import Model
from dap3d_core.model.groups import Floats, Integers
from dap3d_core.model.rotations import read_only
from dap3d_core.registry.arguments import checked
from dap3d_core.result.arrays import COLUMNS, POINT, Arrays, ModelSummary, arrays_of, summary_of
from dap3d_core.result.display import ResultDisplay
from dap3d_core.result.errors import ResultError, UnknownNameError, unknown
from dap3d_core.result.event_record import EventRecord
from dap3d_core.result.metadata import RunMetadata, RunStatistics
from dap3d_core.result.note import Note
from dap3d_core.result.post.contact_output import ResultContacts
from dap3d_core.result.post.force_output import (
    ForceOutput,
    Instants,
    Reaction,
    force_output,
    jacobians,
    reactions_of,
)
from dap3d_core.result.post.global_error import ErrorEstimate, sizes_of
from dap3d_core.result.post.ledger import Entry, ledger_of
from dap3d_core.result.post.point_motion import Energy, kinetic_energy
from dap3d_core.result.quantities.catalogue import MOTION, Quantity
from dap3d_core.result.quantities.lookup import find
from dap3d_core.scene import SceneError
from dap3d_core.scene.coerce import canonical

if TYPE_CHECKING:
    import xarray

    from dap3d_core.assembly.motion.joint_motion import ModelMotions
    from dap3d_core.formulations.evaluator import Evaluator
    from dap3d_core.result.post.joint_coordinates import JointCoordinates
    from dap3d_core.scene.expressions.expression import Expression

#: Said of a file without counted turns.
NO_TURNS = (
    "the file holds no turns of angles, for an older dap3d wrote it: they are counted from one "
    "reported instant to the next, and wrong where a rate changes by more than half a turn per "
    "reporting step between two; run the scene anew"
)
#: Shapes of stored arrays by their dimension besides time.
SHAPES = {"": "(nt,)", "state": "(nt, 13 n)", "velocity": "(nt, 6 n)", "row": "(nt, m)",
          "input": "(nt, k)"}  # fmt: skip
#: A model, and a function that returns an evaluator of it.
Origin = tuple[Model, "Callable[[], Evaluator]"]
#: Makes an origin from the text of a scene.
Rebuild = Callable[[str], Origin]


class Values(NamedTuple):
    """Values (nt,) or (nt, components) of a quantity, its label, its SI unit."""

    values: Floats
    label: str
    unit: str


def _motion(array: str) -> cached_property[Floats]:
    """The attribute for an array of the catalogue."""
    motion = next(m for m in MOTION if m.array == array)

    def values(result: "Result") -> Floats:
        return read_only(motion.values(result, slice(None)))

    count = "n" if motion.owner == "body" else "nP"
    values.__doc__ = f"(nt, {count}, {len(motion.components)}) {motion.meaning}, {motion.unit}."
    return cached_property(values)


def _stored(array: str) -> Any:
    """The attribute for a stored array."""
    column = next(column for column in COLUMNS if column.name == array)

    def values(result: "Result") -> Floats:
        return getattr(result.arrays, array)

    unit = "" if column.unit == "SI" else f", {column.unit}"
    return property(values, doc=f"{SHAPES[column.dimension]} {column.meaning}{unit}.")


def _recorded(name: str, meaning: str) -> Any:
    """The attribute for a part of the record."""
    return property(lambda result: getattr(result.record, name), doc=meaning)


class Result(ResultDisplay, ResultContacts):
    """Result of a run: n bodies, m constraint rows, nP points at nt instants.

    Stored are t, u, v_dot, Lam, work and the potential energy; the other arrays of the manual's
    post-processor are computed on first use. Stored arrays are read-only. SI units;
    global axes except for names that end in p (body axes). Animation points are the last points.

    Attributes:
        summary: names and constants of bodies, joints and points.
        arrays: the stored arrays.
        record: metadata of the run.
        output_cache: outputs of the scene that were evaluated, by name.
    """

    summary: ModelSummary
    arrays: Arrays
    record: RunMetadata

    t: Floats = _stored("t")
    u: Floats = _stored("u")
    v_dot: Floats = _stored("v_dot")
    Lam: Floats = _stored("Lam")
    work: Floats = _stored("work")
    inputs: Floats = _stored("inputs")

    status: str = _recorded(
        "status", "done; interrupted by the user; stopped early by an event or a failure."
    )
    method: str = _recorded("method", "The formulation that was used.")
    integrator: str = _recorded("integrator", "The method of integration that was used.")
    events: tuple[EventRecord, ...] = _recorded("events", "Located switches and events, in order.")
    stats: RunStatistics = _recorded(
        "stats", "Cost: steps, rejected, rhs, projections, wall_time_s, compile_time_s."
    )
    scene_text: str = _recorded("scene_text", "The scene that was run, as text of a scene file.")

    r = _motion("r")
    p = _motion("p")
    rd = _motion("rd")
    w = _motion("w")
    wp = _motion("wp")
    rdd = _motion("rdd")
    wd = _motion("wd")
    wpd = _motion("wpd")
    rP = _motion("rP")
    rPd = _motion("rPd")
    rPdd = _motion("rPdd")

    def __init__(
        self,
        summary: ModelSummary,
        arrays: Arrays,
        record: RunMetadata,
        origin: Callable[[], Origin],
    ) -> None:
        """Composes a result of its parts.

        Args:
            summary, arrays, record: the parts.
            origin: returns the model and access to an evaluator when they are needed.
        """
        self.summary, self.arrays, self.record = summary, arrays, record
        self._make_origin = origin
        self._reactions: dict[str, dict[str, Reaction]] = {}
        self._forces: dict[str, ForceOutput] = {}
        self._coordinates: dict[str, JointCoordinates] = {}
        self._whole: tuple[Result, Integers] | None = None
        self.output_cache: dict[str, Quantity] = {}

    @classmethod
    def of_run(
        cls,
        model: Model,
        rows: Floats,
        record: RunMetadata,
        evaluator_of: "Callable[[], Evaluator]",
    ) -> Self:
        """The result of a run.

        Args:
            model: the model that was run.
            rows: (nt, width) integrator output (as of ``arrays_of``).
            record: metadata of the run.
            evaluator_of: returns the evaluator of the calling thread, for Jacobian and reactions.

        Raises:
            ValueError: the rows have another width.
        """
        summary = summary_of(model)
        return cls(summary, arrays_of(rows, summary), record, lambda: (model, evaluator_of))

    def at(self, index: Integers) -> "Result":
        """The result at some of its instants, (k,) rising indices; turns are those of the whole."""
        index = np.atleast_1d(np.asarray(index))
        rises = index.dtype.kind in "iu" and index.ndim == 1 and np.all(np.diff(index) > 0)
        if not rises or not 0 <= index[0] <= index[-1] < len(self.t):
            raise ValueError(f"index should be rising places in result.t, not {index!r}")
        part = Result(self.summary, self.arrays.at(index), self.record, lambda: self._origin)
        part._whole = self, index
        return part

    def __reduce__(self) -> Any:
        """For other processes: everything but the model and the evaluator."""
        return _received, (self.summary, (*self.arrays.columns(), self.arrays.u_error), self.record)

    # ------------------------------------------------------------------ stored

    @property
    def error(self) -> ErrorEstimate | None:
        """Estimated global error of the state: ``.r``, ``.p``, ``.rd``, ``.w``, ``.u``; no bound.

        None unless requested (``simulate(..., estimate_error=True)``) and available.
        """
        error = self.arrays.u_error
        if error is None:
            return None
        return ErrorEstimate(self.t, error, sizes_of(self.u), self.record.length)

    @property
    def notes(self) -> list[Note]:
        """Choices, changes and warnings of the run, in order."""
        return list(self.record.notes)

    def note(self, text: str) -> None:
        """Append a note, once."""
        if text not in self.record.notes:
            self.record = attrs.evolve(self.record, notes=(*self.record.notes, text))

    @property
    def settings(self) -> dict[str, Any]:
        """The settings of the run."""
        return dict(self.record.settings)

    @property
    def versions(self) -> dict[str, str]:
        """Versions of dap3d, numpy, llvmlite and python in the run."""
        return dict(self.record.versions)

    # ------------------------------------------------------------------ joints

    @property
    def model(self) -> Model:
        """The model; for a result from a file it is made from the scene on first use.

        Raises:
            ResultError: the file was opened without a way to do so, or gives another model.
        """
        return self._origin[0]

    @cached_property
    def _origin(self) -> Origin:
        return self._make_origin()

    @property
    def evaluator(self) -> "Evaluator":
        """The evaluator of the model for the calling thread.

        Raises:
            ResultError: as ``model``.
        """
        return self._origin[1]()

    @cached_property
    def Jac(self) -> Any:
        """(nt, m, 6 n) constraint Jacobian D, evaluated again; beyond 1000 rows a list of nt
        scipy CSR arrays (m, 6 n).

        Raises:
            ResultError: as ``model``.
        """
        return jacobians(self.evaluator, self.t, self.u, self.inputs)

    @checked
    def reaction(self, joint: str) -> Mapping[str, Reaction]:
        """Reaction of a joint on each of its bodies, ground included: D^T lambda.

        What a joint brings besides, such as the pressure angle of a ``gear``, is part of it; the
        friction of a force element is not.

        Args:
            joint: name of the joint.

        Returns:
            By slot ("i", "j", "k"): ``.force`` (nt, 3) N, ``.moment`` (nt, 3) N m about the body's
            mass centre, global axes; ``.force_body``, ``.moment_body`` the same in body axes;
            ``.moment_at_point`` about the joint's own point, global axes; ``.body`` its name.
            The moment on ground is about the origin.

        Raises:
            UnknownNameError: there is no such joint; names the nearest.
            ResultError: as ``model``.
        """
        joint = canonical(joint)
        if joint.partition(POINT)[0] in self.contact_names:
            raise UnknownNameError(f"{joint!r} is a contact: its forces are those of .contact()")
        if joint not in self.summary.joint_index:
            raise unknown("joint", joint, tuple(self.summary.joint_index))
        self._compute_reactions([joint])
        return dict(self._reactions[joint])

    def reactions(self) -> dict[str, Mapping[str, Reaction]]:
        """Reactions of all joints by name, computed in one pass; otherwise as ``reaction``."""
        names = self.summary.joint_index
        self._compute_reactions(names)
        return {name: dict(self._reactions[name]) for name in names}

    @checked
    def coordinates(self, joint: str) -> "JointCoordinates":
        """Coordinates of a joint and their rates.

        Args:
            joint: name of the joint.

        Returns:
            ``.q`` (nt, d) and ``.q_dot`` of d coordinates in rad and m, zero in the pose that the
            scene gives, turns counted; ``.units``; ``.aliases``, indices of angle and length.

        Raises:
            UnknownNameError: there is no such joint; its motion has no coordinates, says why.
            ResultError: as ``model``.
        """
        joint = canonical(joint)
        if joint not in self.summary.joint_index:
            raise unknown("joint", joint, tuple(self.summary.joint_index))
        if joint not in self._coordinates and self._whole is not None:
            whole, index = self._whole
            self._coordinates[joint] = whole.coordinates(joint).at(index)
        elif joint not in self._coordinates:
            from dap3d_core.result.post.joint_coordinates import coordinates_of, counted_angles

            place = self.summary.joint_index[joint]
            motion = self._motions.of(place)
            if motion is None or not motion.size:
                reason = self._motions.refused.get(place, "it leaves no freedom")
                raise UnknownNameError(f"the joint {joint!r} has no coordinates: {reason}")
            counted = counted_angles(self.summary, self.arrays, motion)
            if counted is None:
                self.note(NO_TURNS)
            self._coordinates[joint] = coordinates_of(motion, self.t, self.u, counted)
        return self._coordinates[joint]

    @cached_property
    def _motions(self) -> "ModelMotions":
        """The motions of the joints."""
        from dap3d_core.assembly.motion.classify import classify

        return self.model.motions or classify(self.model)

    def _compute_reactions(self, names: Iterable[str]) -> None:
        index = self.summary.joint_index
        missing = {index[name]: name for name in names if name not in self._reactions}
        if missing:
            by_joint = reactions_of(self.evaluator, self._instants, missing)
            self._reactions |= {missing[joint]: actions for joint, actions in by_joint.items()}

    # ------------------------------------------------------------------ forces

    @cached_property
    def force_names(self) -> tuple[str, ...]:
        """Names of the force elements, in the order of the scene."""
        return self.record.force_names

    @checked
    def force(self, name: str) -> ForceOutput:
        """Output of a force element, evaluated at the reported states.

        Args:
            name: of an element that acts on given bodies (not ``weight``).

        Returns:
            ``.on["i"]`` force and moment on the body of that slot, as in ``reaction``; ``.length``,
            ``.length_rate``, ``.tension`` and ``.energy``, (nt,) each, None if its type has none.

        Raises:
            UnknownNameError: there is no such force; names the nearest.
            ResultError: as ``model``; or an event changed its parameters during the run.
        """
        name = canonical(name)
        if name not in self.force_names:
            raise unknown("force", name, self.force_names)
        if any(name in event.changes for event in self.events):
            raise ResultError(
                f"an event changed numbers of force {name!r} in the course of the run: it cannot "
                "be evaluated again with those of the scene"
            )
        if name not in self._forces:
            found = self.record.actuation.get(name)
            actuation = None if found is None else np.array(found)
            self._forces[name] = force_output(
                self.evaluator, self._instants, self.v_dot, name, actuation
            )
        return self._forces[name]

    @cached_property
    def _instants(self) -> Instants:
        """The instants, for elements; an older file lacks the angles, whose turns are counted."""
        angles: Floats | None = self.arrays.angles
        if self.summary.angle_count not in (self.model.own_angle_count, self.model.angle_count):
            self.note(NO_TURNS)
            angles = None
        states = self.arrays.states if self.summary.state_names else None
        return Instants(self.t, self.u, self.Lam, angles, states, self.inputs)

    # ------------------------------------------------------------------ system

    @cached_property
    def outputs(self) -> "Mapping[str, Expression]":
        """Outputs of the scene by name: expressions of quantities.

        Raises:
            ResultError: the scene in a file has some that are wrong.
        """
        if not self.record.outputs:
            return {}
        from dap3d_core.scene.expressions.outputs import outputs_of

        try:
            return outputs_of(self.record.outputs, self.record.parameters)
        except SceneError as error:
            raise ResultError(f"the outputs of the scene are wrong: {error}") from error

    @cached_property
    def energy(self) -> Energy:
        """Energies at the reported instants: kinetic, potential, total, (nt,) each, J."""
        return Energy(kinetic_energy(self.summary, self.u), self.arrays.potential_energy)

    @cached_property
    def ledger(self) -> dict[str, Entry]:
        """Errors of conserved and vanishing quantities (post/ledger.py): entries by name."""
        return ledger_of(self.summary, self.arrays, self.record)

    def quantity(self, name: str) -> Values:
        """A quantity by name, such as ``crank.r.z``, ``P3.v``, ``J1.force.norm``, ``energy.total``.

        Args:
            name: as listed in quantities/lookup.py.

        Returns:
            (values, label, unit): (nt,) or (nt, components); a description; SI unit.

        Raises:
            UnknownNameError: there is no such quantity; names the nearest.
            ResultError: reactions and forces of a result from a file, as ``model``.
        """
        quantity = find(self, name)
        return Values(quantity.values, quantity.label, quantity.unit)

    @checked
    def save(self, path: str | os.PathLike[str], force: bool = False) -> None:
        """Writes a NetCDF-4 file, whole or not at all; ``open_result`` reads it.

        Args:
            path: the file.
            force: True to overwrite an existing file.

        Raises:
            ResultError: the file cannot be written, or exists and ``force`` is off.
        """
        from dap3d_core.result.file.write import save

        save(self.summary, self.record, self.arrays, path, force)

    def to_xarray(self) -> "xarray.Dataset":
        """All arrays and outputs with named dimensions and units, as an xarray.Dataset."""
        from dap3d_core.result.quantities.xarray_dataset import add_outputs, dataset_of

        return add_outputs(dataset_of(self), self)


def _received(summary: ModelSummary, arrays: tuple[Any, ...], record: RunMetadata) -> Result:
    """A result from another process."""
    return Result(summary, Arrays(*arrays), record, _no_origin)


def _no_origin() -> Origin:
    raise ResultError(
        "the model is needed, which does not travel between processes: ask for the Jacobian and "
        "reactions where the run was made, or save the result and open the file"
    )
