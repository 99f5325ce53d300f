"""Runs the checks of a type, all at once or each as a separate test."""

import contextlib
import io
from collections.abc import Callable
from functools import partial
from typing import Any

import attrs

from dap3d_core.interface.codegen.reactions import joints_read
from dap3d_core.interface.codegen.type_info import TypeInfo
from dap3d_core.interface.errors import PluginError, where_is
from dap3d_core.interface.examine.examine import examine
from dap3d_core.testing.checks import branches, elements, joints, purity
from dap3d_core.testing.checks.findings import (
    FAILED,
    LEFT_OUT,
    CheckOutcome,
    Finding,
    Report,
    TypeMotion,
)
from dap3d_core.testing.checks.joints import motion_of_type
from dap3d_core.testing.samples.sampled_type import SampledType, UndefinedError, sampled_types

#: Default number of random poses on and off the manifold, and their seed.
POSES, SEED = 4, 1


@attrs.frozen(eq=False)
class Check:
    """One check of a type, or of one of its variants; a test calls it.

    Attributes:
        name: the formula or property, such as gamma.
        subject: the type or variant, with its random poses.
        inapplicable: the reason why the check does not apply; "" where it does.
    """

    name: str
    subject: SampledType
    inapplicable: str
    _run: Callable[[SampledType], CheckOutcome]

    def run(self) -> CheckOutcome:
        """Run the check."""
        if self.inapplicable:
            return CheckOutcome(self.name, self.subject.variant, LEFT_OUT, self.inapplicable)
        with contextlib.redirect_stdout(io.StringIO()) as printed:
            outcome = self._outcome()
        if self.name == "purity" and (said := printed.getvalue().strip()):
            note = f"what its kernels print is not shown: {said.splitlines()[0]!r} and so on"
            return attrs.evolve(outcome, notes=(*outcome.notes, note))
        return outcome

    def _outcome(self) -> CheckOutcome:
        try:
            if self.name != "purity" and purity.differing(self.subject):
                words = "its kernels give other numbers each time they are called (see purity)"
                return CheckOutcome(self.name, self.subject.variant, LEFT_OUT, words)
            return attrs.evolve(self._run(self.subject), check=self.name)
        except Exception as error:  # of a kernel, or of random poses that give no number
            known = isinstance(error, UndefinedError)
            words = str(error) if known else f"it could not be carried out: {_reason(error)}"
            finding = Finding(self.name, self.subject.variant, "", 0, words)
            return CheckOutcome(self.name, self.subject.variant, FAILED, words, findings=(finding,))

    def __call__(self) -> None:
        """Run the check.

        Raises:
            AssertionError: a formula is wrong; lists the findings.
        """
        outcome = self.run()
        if not outcome.ok:
            raise AssertionError(f"{where_is(self.subject.type)}\n{outcome}")

    def __str__(self) -> str:
        values = ",".join(f"{n}={v}" for n, v in self.subject.choices.items())
        name = self.name.replace(" ", "-")
        return f"{name}[{values}]" if values else name


def check_type(type_: Any, *, poses: int = POSES, seed: int = SEED) -> Report:
    """Check the formulas of a joint, force or function type, with all its variants.

    Args:
        type_: the class, or the result of ``examine``.
        poses: random poses off the manifold, and as many on it.
        seed: of the random poses.

    Returns:
        the outcome of each check, and of a joint the motion that it leaves free.

    Raises:
        PluginError: the type cannot be used at all.
    """
    type_info = type_ if isinstance(type_, TypeInfo) else examine(type_)
    outcomes = tuple(check.run() for check in _checks(type_info, poses, seed))
    kind = "contact" if type_info.type.is_contact else type_info.type.kind
    motions = type_motions(type_info, seed=seed)
    title = where_is(type_info.type)
    return Report(kind, type_info.type.keyword, title, seed, poses, outcomes, motions)


def type_motions(type_info: TypeInfo, *, seed: int = SEED) -> tuple[TypeMotion, ...]:
    """The motions that a joint type and its variants leave free; none for other types."""
    if type_info.type.kind != "joint":
        return ()
    with contextlib.redirect_stdout(io.StringIO()):
        return tuple(_motion(subject) for subject in sampled_types(type_info, seed, 1))


def _motion(subject: SampledType) -> TypeMotion:
    try:
        return motion_of_type(subject)
    except Exception as error:  # of a kernel
        what = "cannot be compiled" if isinstance(error, PluginError) else f"fail: {_reason(error)}"
        return TypeMotion(subject.variant, f"rows stay: its kernels {what}", None)


def checks_for(type_: Any, *, poses: int = POSES, seed: int = SEED) -> list[Check]:
    """The checks that apply to a type, to be called as separate tests.

        @pytest.mark.parametrize("check", checks_for(Screw), ids=str)
        def test_screw(check):
            check()

    Args:
        type_: the class, or the result of ``examine``.
        poses: random poses off the manifold, and as many on it.
        seed: of the random poses.

    Raises:
        PluginError: the type cannot be used at all.
    """
    type_info = type_ if isinstance(type_, TypeInfo) else examine(type_)
    return [check for check in _checks(type_info, poses, seed) if not check.inapplicable]


def _checks(type_info: TypeInfo, poses: int, seed: int) -> list[Check]:
    if poses < 1:
        raise ValueError(f"poses is {poses}; a check takes one or more")
    of_kind: dict[str, Callable[[SampledType], list[Check]]] = {
        "joint": _of_joint, "force": _of_force,
        "function": lambda subject: [Check("derivatives", subject, "", elements.derivatives)],
    }  # fmt: skip
    checks = []
    for subject in sampled_types(type_info, seed, poses):
        by_joint = "its formulas are the friction of its joint, which is checked with that"
        if subject.type_info.friction_joint:
            checks.append(Check("energy", subject, by_joint, elements.potential))
            continue
        checks += of_kind[subject.type.kind](subject)
        if "rate" in subject.type_info.kernels:
            ground = joints.against_ground(subject)
            checks.append(Check("rate", subject, "", elements.tangent))
            checks.append(Check("rate frame", subject, ground, elements.rate_frame))
        checks.append(Check("branches", subject, "", branches.switches))
        checks.append(Check("rest", subject, "", branches.rest))
        checks.append(Check("purity", subject, "", purity.purity))
        checks.append(Check("plain", subject, "", purity.plain))
        checks.append(Check("compiled", subject, "", purity.compiled))
    return checks


def _of_joint(subject: SampledType) -> list[Check]:
    no_position = "" if subject.type.position_rows() else "it has no row at position level"
    no_form = "" if "C_dot" in subject.kernels.names() else "it defines no C_dot"
    ground = joints.against_ground(subject)
    turns = fewer = ""
    if subject.type.is_contact and subject.type.is_friction_alone():
        fewer = "" if all(subject.type.holds) else "some of its three rows stay zero"
    elif subject.type.is_contact and subject.type.at is None:
        turns = "its gap is an angle, whose rows are those of bodies that turn about its normal"
    checks = [
        Check("J", subject, no_position or turns, joints.jacobian),
        Check("nu", subject, no_position, joints.velocity_side),
        Check("velocity form", subject, no_form, joints.velocity_form),
        Check("gamma", subject, turns, joints.acceleration_side),
        Check("virtual power", subject, no_position or turns, joints.virtual_power),
        Check("assembly", subject, no_position or turns, joints.assembly),
        Check("rank", subject, turns or fewer, joints.rank),
        Check("frame", subject, ground, joints.frame),
        Check("action and reaction", subject, ground, joints.action_and_reaction),
    ]
    if "G" in subject.type_info.kernels:
        checks.insert(0, Check("G", subject, "", joints.gradient_of_unknowns))
    if subject.type.is_contact and not subject.type.is_friction_alone():
        checks.append(Check("normal", subject, "", elements.normal))
    if subject.type.is_contact and subject.type.grip is not None:
        checks.append(Check("grip", subject, "", elements.grip))
    if subject.type.is_contact and subject.type.resist is not None:
        checks.append(Check("resist", subject, "", elements.resist))
    checks += _of_jumps(subject)
    if "friction" in subject.type_info.kernels:
        checks.append(Check("friction power", subject, "", _on_friction(elements.dissipation)))
        for run in (elements.frame, elements.balance):
            on_friction = _on_friction(partial(run, kernel="friction"))
            checks.append(Check(f"friction {run.__name__}", subject, ground, on_friction))
    return checks


def _on_friction(
    run: Callable[[SampledType], CheckOutcome],
) -> Callable[[SampledType], CheckOutcome]:
    return lambda subject: run(subject.friction)


def _of_force(subject: SampledType) -> list[Check]:
    ground = joints.against_ground(subject)
    energy = "" if "energy" in subject.kernels.names() else "it has no energy"
    if not energy and subject.type.energy_where:
        energy = f"its energy is declared to be that of the wrench only {subject.type.energy_where}"
    if "wrench" not in subject.kernels.names():
        ground = "it has no wrench, and acts by its jumps alone"
    checks = [
        Check("energy", subject, energy, elements.potential),
        Check("frame", subject, ground, elements.frame),
        Check("action and reaction", subject, ground, elements.balance),
    ]
    if joints_read(subject.type_info):
        checks.append(Check("unloaded", subject, "", elements.unloaded))
    return checks + _of_jumps(subject)


def _of_jumps(subject: SampledType) -> list[Check]:
    """Checks of the kernel ``impulse`` of a force or joint."""
    if "impulse" not in subject.kernels.names():
        return []
    from dap3d_core.testing.checks import jumps

    ground = joints.against_ground(subject)
    gives = "" if jumps.follows_velocities(subject) else "its impulse does not follow velocities"
    if subject.type.gives_energy:
        gives = "it declares gives_energy"
    if subject.type.kind == "force" and subject.type.restitution:
        gives = "the check restitution sees energy created"
    energy = Check("impulse energy", subject, gives, jumps.energy)
    if not jumps.has_rows(subject):
        frame = partial(elements.frame, kernel="impulse")
        balance = partial(elements.balance, kernel="impulse")
        return [
            energy,
            Check("jump frame", subject, ground, frame),
            Check("impulse and reaction", subject, ground, balance),
        ]
    checks = [
        energy,
        Check("jump rows", subject, jumps.why_no_gap(subject), jumps.rows),
        Check("round", subject, "", jumps.settling),
        Check("jump frame", subject, ground, jumps.frame),
        Check("impulse and reaction", subject, ground, jumps.balance),
    ]
    if subject.type.restitution:
        checks.append(Check("restitution", subject, "", jumps.restitution))
    if subject.type.unilateral:
        checks.append(Check("unilateral", subject, "", jumps.pushing))
    return checks


def _reason(error: Exception) -> str:
    return f"{type(error).__name__}: {error}" if str(error) else type(error).__name__
