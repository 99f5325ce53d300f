"""What a run left behind, in memory: stored arrays, and all that is computed from them."""

import os
from collections.abc import Callable, Iterable, Mapping
from functools import cached_property
from typing import TYPE_CHECKING, Any, NamedTuple, Self

import attrs

from dap3d_core.model import Model
from dap3d_core.model.groups import Floats
from dap3d_core.result.arrays import COLUMNS, Arrays, arrays_of
from dap3d_core.result.errors import ResultError, unknown
from dap3d_core.result.event_record import Occurrence
from dap3d_core.result.file.lazy_arrays import FileArrays
from dap3d_core.result.metadata import Record, Statistics
from dap3d_core.result.model_summary import Subject, subject_of
from dap3d_core.result.post.force_output import Applied, applied
from dap3d_core.result.post.global_error import ErrorEstimate, estimate_of
from dap3d_core.result.post.ledger import Entry, ledger_of
from dap3d_core.result.post.point_motion import Energy, kinetic_energy
from dap3d_core.result.post.reactions import Reaction, jacobians, reactions
from dap3d_core.result.quantities.lookup import find
from dap3d_core.result.quantities.motion_arrays import Kinematics

if TYPE_CHECKING:
    import xarray

    from dap3d_core.formulations.evaluator import Machine

#: A model, and how to get a machine that evaluates it.
Origin = tuple[Model, "Callable[[], Machine]"]
#: Makes an origin from the text of a scene.
Rebuild = Callable[[str], Origin]


class Values(NamedTuple):
    """Values (nt,) or (nt, components) of a quantity, what it is in words, its SI unit."""

    values: Floats
    label: str
    unit: str


class Result(Kinematics):
    """What a run left behind: n bodies, m constraint rows, nP points at nt instants.

    Stored are t, u, v_dot, Lam, work and the potential energy; the other arrays of the manual's
    post-processor (spec 10) are computed when they are first asked for. Arrays that are stored are
    read-only. SI units; global axes except where a name ends in p (body axes).

    Attributes:
        subject: names and constants of bodies, joints and points.
        arrays: what is stored.
        record: what the run says of itself.
    """

    record: Record

    def __init__(
        self,
        *,
        model: Model,
        machine_of: "Callable[[], Machine]",
        rows: Floats,
        scene_text: str,
        stats: Statistics | None = None,
        status: str = "done",
        method: str = "",
        integrator: str = "",
        notes: Iterable[str] = (),
        settings: Mapping[str, Any] | None = None,
        versions: Mapping[str, str] | None = None,
    ) -> None:
        """The result of a run.

        Args:
            model: what was run.
            machine_of: gives a machine for the Jacobian and reactions: the calling thread's.
            rows: (nt, 1 + 13 n + 1 + 6 n + m + 4) as the integrator delivers them: t; coordinates,
                velocities with the angular one in body axes, work; v_dot (global axes); lambda;
                potential energy; largest |C|, |D v - nu|, |D v_dot - gamma|.
            scene_text, stats, status, method, integrator, notes, settings, versions: as ``Record``
                has them; versions by default those that are installed.

        Raises:
            ValueError: the rows have another width, or the status is none.
        """
        subject = subject_of(model)
        record = Record(
            scene_text=scene_text,
            status=status,
            method=method,
            integrator=integrator,
            notes=notes,
            settings=settings or {},
            stats=stats or Statistics(),
            known_versions=versions,
        )
        self._fill(subject, arrays_of(rows, subject), record, lambda: (model, machine_of))

    @classmethod
    def of_run(
        cls, model: Model, rows: Floats, record: Record, machine_of: "Callable[[], Machine]"
    ) -> Self:
        """The result of a run whose record is at hand; arguments as for the class itself."""
        subject = subject_of(model)
        return cls.of_parts(subject, arrays_of(rows, subject), record, lambda: (model, machine_of))

    @classmethod
    def of_parts(
        cls,
        subject: Subject,
        arrays: Arrays | FileArrays,
        record: Record,
        origin: Callable[[], Origin],
    ) -> Self:
        """A result put together from its parts, as one from a file is.

        Args:
            subject, arrays, record: the parts.
            origin: gives the model and a way to a machine when one is needed.
        """
        result = cls.__new__(cls)
        result._fill(subject, arrays, record, origin)
        return result

    def _fill(
        self,
        subject: Subject,
        arrays: Arrays | FileArrays,
        record: Record,
        origin: Callable[[], Origin],
    ) -> None:
        self.subject, self.arrays, self.record = subject, arrays, record
        self._make_origin = origin
        self._reactions: dict[str, dict[str, Reaction]] = {}
        self._applied: dict[str, Applied] = {}

    def __reduce__(self) -> Any:
        """For other processes: everything but the model and the machine."""
        arrays = tuple(getattr(self.arrays, column.name) for column in COLUMNS)
        return _received, (self.subject, (*arrays, self.arrays.u_error), self.record)

    def __repr__(self) -> str:
        times = f", t = {self.t[0]:g} ... {self.t[-1]:g} s" if len(self.t) else ""
        return (
            f"<Result {self.record.title!r}: {self.status}, {self.subject.body_count} bodies, "
            f"{self.subject.row_count} rows, {len(self.t)} instants{times}>"
        )

    # ------------------------------------------------------------------ what is stored

    @property
    def Lam(self) -> Floats:
        """(nt, m) Lagrange multipliers: D^T Lam is what the joints exert."""
        return self.arrays.Lam

    @property
    def work(self) -> Floats:
        """(nt,) work done on the system by forces and drivers since the start, J."""
        return self.arrays.work

    @property
    def error(self) -> ErrorEstimate | None:
        """Estimated global error of the state: ``.r``, ``.p``, ``.rd``, ``.w``, ``.u``; no bound.

        None unless asked for (``simulate(..., estimate_error=True)``) and found.
        """
        return estimate_of(self.t, self.u, self.arrays.u_error, self.record.length)

    @property
    def status(self) -> str:
        """done; interrupted by the user; stopped early by an event or a failure."""
        return self.record.status

    @property
    def method(self) -> str:
        """The formulation that was used."""
        return self.record.method

    @property
    def integrator(self) -> str:
        """The method of integration that was used."""
        return self.record.integrator

    @property
    def notes(self) -> list[str]:
        """What the run chose, changed or noticed, in order."""
        return list(self.record.notes)

    @property
    def events(self) -> tuple[Occurrence, ...]:
        """What happened at instants that were located, in order: switches, events of a script."""
        return self.record.events

    @property
    def stats(self) -> Statistics:
        """What the run cost: steps, rejected, rhs, projections, wall_time_s, compile_time_s."""
        return self.record.stats

    @property
    def settings(self) -> dict[str, Any]:
        """The settings as they were used."""
        return dict(self.record.settings)

    @property
    def versions(self) -> dict[str, str]:
        """Versions of dap3d, numpy, llvmlite and python that made it."""
        return dict(self.record.versions)

    @property
    def scene_text(self) -> str:
        """The scene that was run, as the text of a scene file."""
        return self.record.scene_text

    # ------------------------------------------------------------------ joints

    @property
    def model(self) -> Model:
        """The model; of a result from a file it is made from the scene when first asked for.

        Raises:
            ResultError: the file was opened without a way to do so, or gives another model.
        """
        return self._origin[0]

    @cached_property
    def _origin(self) -> Origin:
        return self._make_origin()

    @property
    def machine(self) -> "Machine":
        """What evaluates the model for the thread that asks.

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
        return jacobians(self.machine, self.t, self.u)

    def reaction(self, joint: str) -> Mapping[str, Reaction]:
        """What a joint exerts on each of its bodies: D^T lambda (spec 2).

        Ground has its reaction too, from the joint's own block for it, its moment about the
        origin. Friction that a force element adds to a joint is not part of it.

        Args:
            joint: name of the joint.

        Returns:
            By slot ("i", "j", "k"): ``.force`` (nt, 3) N, ``.moment`` (nt, 3) N m about the body's
            mass centre, global axes; ``.force_body``, ``.moment_body`` the same in body axes;
            ``.moment_at_point`` about the joint's own point, global axes; ``.body`` its name.

        Raises:
            UnknownNameError: there is no such joint; names the nearest.
            ResultError: as ``model``.
        """
        place = self.subject.joint_index.get(joint)
        if place is None:
            raise unknown("joint", joint, self.subject.joint_names)
        if joint not in self._reactions:
            self._find_reactions([place])
        return dict(self._reactions[joint])

    def reactions(self) -> dict[str, Mapping[str, Reaction]]:
        """The reactions of all joints by name, found in one pass; else as ``reaction``."""
        names = self.subject.joint_names
        self._find_reactions([k for k, name in enumerate(names) if name not in self._reactions])
        return {name: dict(self._reactions[name]) for name in names}

    def _find_reactions(self, joints: list[int]) -> None:
        if joints:
            angles = self._angles()
            found = reactions(self.machine, self.t, self.u, self.Lam, joints, angles)
            names = self.subject.joint_names
            self._reactions |= {names[joint]: one for joint, one in found.items()}

    # ------------------------------------------------------------------ forces

    @cached_property
    def force_names(self) -> tuple[str, ...]:
        """Names of the force elements, as they stand in the scene."""
        return self.record.force_names

    def force(self, name: str) -> Applied:
        """What a force element did, its kernels evaluated again at the reported states (spec 6).

        Args:
            name: of an element that acts on bodies of its own (not ``weight``).

        Returns:
            ``.on["i"]`` what it exerts on the body of that slot, as ``reaction`` has it;
            ``.length``, ``.length_rate``, ``.tension`` and ``.energy``, (nt,) each, where its type
            has them, else None.

        Raises:
            UnknownNameError: there is no such force; names the nearest.
            ResultError: as ``model``; or an event changed its numbers on the way.
        """
        if name not in self.force_names:
            raise unknown("force", name, self.force_names)
        if any(name in event.changes for event in self.events):
            raise ResultError(
                f"an event changed numbers of force {name!r} in the course of the run: it cannot "
                "be evaluated again with those of the scene"
            )
        if name not in self._applied:
            place = self.model.force_names.index(name)
            self._applied[name] = applied(
                self.machine, self.t, self.u, self.v_dot, name, place, self._angles()
            )
        return self._applied[name]

    def _angles(self) -> Floats | None:
        """(nt, k) the angles whose turns are counted; None where an older file has none of them."""
        if self.subject.angle_count == self.model.angle_count:
            return self.arrays.angles
        note = (
            "the file holds no turns of angles, for an older dap3d wrote it: they are counted from "
            "one reported instant to the next, and wrong where a body turns by more than half a "
            "turn between two; run the scene anew"
        )
        if note not in self.record.notes:
            self.record = attrs.evolve(self.record, notes=(*self.record.notes, note))
        return None

    # ------------------------------------------------------------------ the whole

    @cached_property
    def energy(self) -> Energy:
        """Energies at the reported instants: kinetic, potential, total, (nt,) each, J."""
        return Energy(kinetic_energy(self.subject, self.u), self.arrays.potential_energy)

    @cached_property
    def ledger(self) -> dict[str, Entry]:
        """What should be conserved or zero, and how far it is (post/ledger.py): entries by name."""
        return ledger_of(self.subject, self.arrays, self.record)

    def quantity(self, name: str) -> Values:
        """A quantity by name, such as ``crank.r.z``, ``P3.v``, ``J1.force.norm``, ``energy.total``.

        Args:
            name: as quantities/lookup.py lists them.

        Returns:
            (values, label, unit): (nt,) or (nt, components); what it is in words; SI unit.

        Raises:
            UnknownNameError: there is no such quantity; names the nearest.
            ResultError: reactions and forces of a result from a file, as ``model``.
        """
        found = find(self, name)
        return Values(found.values, found.label, found.unit)

    def save(self, path: str | os.PathLike[str], force: bool = False) -> None:
        """Write a NetCDF-4 file, whole or not at all; ``open_result`` reads it.

        Args:
            path: the file.
            force: whether an existing file is overwritten.

        Raises:
            ResultError: the file cannot be written, or exists and ``force`` is off.
        """
        from dap3d_core.result.file.write import save

        save(self, path, force)

    def to_xarray(self) -> "xarray.Dataset":
        """All arrays with named dimensions and units, as an xarray.Dataset."""
        from dap3d_core.result.quantities.xarray_dataset import dataset_of

        return dataset_of(self)


def _received(subject: Subject, arrays: tuple[Any, ...], record: Record) -> Result:
    """A result from another process."""
    return Result.of_parts(subject, Arrays(*arrays), record, _no_origin)


def _no_origin() -> Origin:
    raise ResultError(
        "the model is needed, which does not travel between processes: ask for the Jacobian and "
        "reactions where the run was made, or save the result and open the file"
    )
