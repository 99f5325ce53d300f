"""Base classes of joint, force and function types: fields, and pure functions of quantities.

A type is an attrs class. Its functions are static, without ``self``, and their parameter names are
the quantities they need, as a pytest test names its fixtures; ``codegen/kernel_arguments.py`` lists
these names.
"""

from collections.abc import Callable, Mapping, Sequence
from itertools import combinations
from typing import Any, ClassVar

import attrs

from dap3d_core.interface.element_states import (
    add_state_fields,
    add_unknown_fields,
    state_lengths,
    unknown_names,
)

#: Increased by one when a type written for the old interface no longer works.
INTERFACE_VERSION = 1

#: Symbols that pictures have for joints and forces -> the body slots, fields and kinds of fields
#: that each is drawn from (view/scene3d/symbols.py).
SYMBOLS: Mapping[str, tuple[str, ...]] = {
    "ball": ("i",),
    "block": ("i",),
    "cross": ("i", "a_i", "n_j"),
    "hinge": ("i", "a_i"),
    "link": ("i", "j"),
    "plate": ("i", "a_j"),
    "ring": ("vector",),
    "sleeve": ("i", "j", "a_j"),
    "slider": ("i", "j", "a_j"),
    "spring": ("i", "j"),
    "wheel": ("i", "radius"),
}


class TypeBase:
    """Base of the three kinds: collects the kernels, makes the class an attrs class."""

    kind: ClassVar[str] = ""
    kernel_names: ClassVar[tuple[str, ...]] = ()
    keyword: ClassVar[str] = ""
    #: Classes that replace this one for certain values of fields: (conditions, class).
    variants: ClassVar[tuple[tuple[Mapping[str, Any], type["TypeBase"]], ...]] = ()
    #: True for a type that uses the axes of ground in its formulas; or the one direction of ground
    #: that it measures along, an axis ("z") or a field (a vector). It need not be invariant to a
    #: common rigid motion of its bodies (docs/how-to/check-plugin.md); a sub-assembly that is moved
    #: along that direction, or turned against it, refuses such elements.
    ground_axes: ClassVar[bool | str] = False
    #: Slots whose body's axes it uses, as for the edges of a box; None: those whose ``A_`` or
    #: ``p_`` its kernels name. Sub-assemblies that are turned refuse it where ground is that body.
    body_axes: ClassVar[tuple[str, ...] | None] = None
    symbol: ClassVar[str] = ""
    #: Of the example of ``describe``: fields -> what is written there, where no value is usual.
    example: ClassVar[Mapping[str, str]] = {}
    #: For checks of a type with lists: bodies of the entries of each, and lists of constants.
    samples: ClassVar[tuple[Mapping[str, Sequence[float]], ...]] = ()
    #: Other names of the type, of other programs, say: messages suggest its keyword for them.
    synonyms: ClassVar[tuple[str, ...]] = ()
    #: True for impulses that drive bodies: check-plugin lets them add kinetic energy.
    gives_energy: ClassVar[bool] = False
    #: A contact, whose rows hold and let go (interface/contacts).
    is_contact: ClassVar[bool] = False
    #: Functions of which kernels are made, and no loop calls.
    declared: ClassVar[tuple[str, ...]] = ()
    #: States of its own: names, or name -> length (docs/concepts/kernels.md).
    states: ClassVar[tuple[str, ...] | Mapping[str, int | str]] = ()

    def __init_subclass__(cls, **conditions: Any) -> None:
        super().__init_subclass__()
        if "kernel_names" in vars(cls):  # Joint, Force, Function themselves
            return
        if conditions:  # class NoSlip(Disk, slip="xyz"): a variant of the type with the keyword
            root: Any = next(base for base in cls.__mro__ if "keyword" in vars(base))
            root.variants = (*root.variants, (conditions, cls))
        for name in cls.kernel_names:
            function = vars(cls).get(name)
            if callable(function):
                setattr(cls, name, staticmethod(function))
        add_state_fields(cls)
        add_unknown_fields(cls)
        # slots would make a second class, but hooks return the first
        attrs.define(cls, slots=False, kw_only=True)

    @classmethod
    def kernels(cls) -> dict[str, Callable[..., Any]]:
        """The pure functions this type defines, by name."""
        return {n: getattr(cls, n) for n in cls.kernel_names if getattr(cls, n, None) is not None}

    @classmethod
    def state_lengths(cls) -> dict[str, int]:
        """Length of each of its states."""
        return state_lengths(cls)

    def prepare(self, bodies: Mapping[str, Any]) -> dict[str, Any]:
        """Constants of this instance, such as the coefficients of a polynomial.

        A 3-tuple with a name in _i, _j, _k, ... is a vector in that body's axes.
        """
        return {}

    def prepare_functions(
        self, functions: Mapping[str, Callable[[float], tuple[float, ...]]]
    ) -> dict[str, Any]:
        """Constants that take the functions of an argument which the scene gives, by field.

        Each returns (f, f', f'', f''') of a number. Names and shapes are those of ``prepare``,
        whose values these replace. A ``ValueError`` refuses the functions.
        """
        return {}


class Joint(TypeBase):
    """A kinematic constraint or driver: ``rows`` equations between one, two or more bodies.

    Subclasses define, each a pure function of named quantities:

    * ``C``      position level, one number a row that ``holonomic`` keeps;
    * ``J``      dC/dq, one block of rows x 6 (tuples of rows) a body slot, in their order;
    * ``gamma``  right-hand side of the acceleration level, J v_dot = gamma;
    * ``nu``     right-hand side of the velocity level, J v = nu; zero where not defined;
    * ``G``      dC/ds of its own unknowns s, one tuple a row of C.

    ``G``, ``J`` and ``gamma`` may be left out: they are derived, with ``nu``, from ``C``
    (derive/derive.py) and, for rows of the velocity level alone, from

    * ``C_dot``  vanishes there, linear in the velocities: one number a row not in ``C``.

    It may also define:

    * ``friction``  the wrench of its Coulomb friction on each body, as a force returns it; takes
      ``lam`` (its multipliers), ``mu``, ``v_tol``, ``radius``; a force ``friction`` with ``v_tol``
      switches it on, one without switches on the ``grips``;
    * ``switch``    a number, or a tuple of numbers, smooth in time. With ``switch_words`` the run
      ends with this message where one becomes negative; without, the integration restarts where
      one changes its sign: there the element's law takes another branch (docs/how-to/events.md);
    * ``impulse``   impulses on its bodies where a switch changes its sign, as for forces without
      ``J``. Its own rows hold through a jump (docs/how-to/jumps.md);
    * ``rate``      the derivatives in time of its ``states``: a number, or a tuple in their order.

    ``prepare(self, bodies)`` may return constants of the poses in the scene. A subclass that names
    values of fields, ``class NoSlip(Disk, slip="xyz")``, is a variant of the type: it replaces it,
    with its own rows and kernels, where the fields have these values (True for a function: one is
    given).

    Attributes:
        keyword: the name of the type in a scene.
        rows: number of constraint equations; of a type with lists also by the size of one: "n",
            "n - 1".
        holonomic: True, False, or one truth value a row: the rows of the position level.
        coordinate: "angle" or "length", what a motor in this joint acts on; "" for what it says.
        limit: keyword of the contact that limits that coordinate where the scene gives ``lower`` or
            ``upper``; "" for none.
        drives: it prescribes a freedom that other joints leave; where there are none between its
            bodies a scene gets a note.
        unilateral: rows, from 0, with multipliers that are not negative in a valid motion: ground
            carries and does not pull. A run where one is gets a note with the instant. True: all
            rows of a type whose rows are counted by a list.
        unilateral_words: the meaning of a negative multiplier, for that note.
        unknowns: names of unknowns of its own, such as the place of a contact, that C may name: of
            ``rows`` as many fewer constrain the bodies. They are solved for at all levels, from
            fields such as ``s_0``, within ``s_min`` and ``s_max``; ``s_dot`` is their rate.
        periodic: unknowns that begin at one bound again where they pass the other; a run ends where
            any other passes one.
        states: names of states of its own, or name -> length; with them come the fields ``NAME_0``,
            initial values, and ``NAME_atol``, absolute tolerances.
        symbol: symbol in pictures, one of SYMBOLS; "": drawn from the declared fields.
        grips: its friction that sticks, types derived from ``Contact`` with ``of=`` it.
        brings: a field, the keyword of a force and the field by which that names a joint: where the
            first is not zero the joint brings such a force, with its own fields of the same names.
            Its wrench is part of the joint's reaction, and moves nothing where joints carry it.
    """

    kind = "joint"
    kernel_names = (
        "C", "C_dot", "G", "J", "gamma", "nu", "friction", "switch", "rate", "impulse", "reset"
    )  # fmt: skip
    switch_words: ClassVar[str] = ""
    rows: ClassVar[int] = 0
    holonomic: ClassVar[bool | tuple[bool, ...]] = True
    coordinate: ClassVar[str] = ""
    limit: ClassVar[str] = ""
    drives: ClassVar[bool] = False
    brings: ClassVar[tuple[str, ...]] = ()
    unilateral: ClassVar[tuple[int, ...]] = ()
    unilateral_words: ClassVar[str] = ""
    grips: ClassVar[tuple[Any, ...]] = ()
    unknowns: ClassVar[tuple[str, ...]] = ()
    periodic: ClassVar[tuple[str, ...]] = ()

    @classmethod
    def constraint_mask(cls) -> tuple[bool, ...]:
        """Of each row that constrains the bodies, True where it has a position level."""
        position = len(cls.position_rows()) - len(unknown_names(cls))
        if not unknown_names(cls):
            return tuple(k in cls.position_rows() for k in range(cls.rows))
        return (True,) * position + (False,) * len(cls.velocity_rows())

    @classmethod
    def position_rows(cls) -> tuple[int, ...]:
        """Indices of the rows that have a position-level equation."""
        mask = cls.holonomic
        if isinstance(mask, bool):
            mask = (mask,) * cls.rows
        return tuple(k for k, is_position_row in enumerate(mask) if is_position_row)

    @classmethod
    def velocity_rows(cls) -> tuple[int, ...]:
        """Indices of the rows of the velocity level alone."""
        return tuple(k for k in range(cls.rows) if k not in cls.position_rows())


class Force(TypeBase):
    """A force element on one, two or more bodies.

    Subclasses define ``wrench``, which returns for each body slot a pair (force, moment about the
    mass centre) in global axes, and for conservative forces ``energy``, the potential in J. Of
    ``energy`` alone the ``wrench`` is derived (derive/derive.py). Variants, ``switch``, ``states``
    and ``rate`` are as for joints. A force that defines neither and names one joint, by a ``joint``
    field, switches on the friction of that joint; one with a ``wrench`` does not.

    ``tension``, a number or a tuple, positive where it pulls, is for results alone.

    Where a ``switch`` changes its sign velocities may jump (docs/how-to/jumps.md), by ``impulse``:

    * without ``J``: for each body slot (impulse, moment of impulse about the mass centre), global;
    * with ``J``, one block of rows x 6 a body slot, as of a joint: the change of J v, one number a
      row. It takes ``Jv``, J v before. Where ``impulse`` names ``Jv`` and the type has no ``J``,
      that is derived from ``switch``, whose rates the rows then are.

    Attributes:
        keyword: the name of the type in a scene.
        each_body: True if the element acts on every body of the scene (slot i in turn).
        each_pair: True if it acts between every two bodies of the scene, without ground (slots i
            and j in turn, each pair once).
        symbol: symbol in pictures, one of SYMBOLS; "": a spring between two ends, if it has them,
            else drawn from the declared fields.
        energy_where: the condition, to follow "only", for the energy to be the potential of the
            wrench; "" for no condition.
        actuates: field, a number or three, that an actuator sets: the wrench is linear in it. Of
            three numbers the direction stays. Inverse dynamics finds it; "" for no such field.
        unilateral: rows of ``J``, from 0, whose impulses are not negative: they push and do not
            pull.
        restitution: field, the coefficient of restitution e of all rows: J v becomes -e J v. It is
            for ``dap3d check-plugin``; "" for no such field.
        regularised: field, the speed or rate below which its friction fades as tanh(v / field)
            does: a run in which it creeps instead of sticking says so; "" for no such field.
    """

    kind = "force"
    kernel_names = ("wrench", "energy", "switch", "rate", "J", "impulse", "reset", "tension")
    switch_words: ClassVar[str] = ""
    unilateral: ClassVar[tuple[int, ...]] = ()
    restitution: ClassVar[str] = ""
    each_body: ClassVar[bool] = False
    each_pair: ClassVar[bool] = False
    energy_where: ClassVar[str] = ""
    actuates: ClassVar[str] = ""
    regularised: ClassVar[str] = ""


class Function(TypeBase):
    """A function of one variable: ``value(x, ...)`` returns (f, f', f'', f''').

    One of two, ``arguments = 2``, has ``value(x, y, ...)``, which returns (f, f_x, f_y, f_xx, f_xy,
    f_yy), and no ``breaks``; types call it whose field ``function`` has two arguments.

    Of one that returns f alone the others are derived (derive/derive.py). No step of a run passes
    over an argument listed by ``breaks``, a time or an elongation: a change shorter than a step is
    not missed.

    Attributes:
        keyword: the name of the type in a scene.
        arguments: how many it takes, 1 or 2.
        smooth: it has one smooth form everywhere. Of a function of another argument than time that
            is not declared smooth and has no ``breaks`` a run notes that steps may pass over
            changes of it.
    """

    kind = "function"
    kernel_names = ("value",)
    arguments: ClassVar[int] = 1
    smooth: ClassVar[bool] = False

    def breaks(self) -> Sequence[float]:
        """Arguments at which this instance changes its form: both ends of a transition."""
        return ()


def acts_on_all(type_: type[TypeBase]) -> int:
    """Bodies that a type acts on in turn: 1 of ``each_body``, 2 of ``each_pair``; else 0."""
    return 2 if getattr(type_, "each_pair", False) else int(getattr(type_, "each_body", False))


def has_prepare(type_: Any) -> bool:
    """True if a type defines ``prepare``."""
    return type_.prepare not in (base.__dict__.get("prepare") for base in TypeBase.__subclasses__())


def turns_of(type_: type[TypeBase], body_count: int) -> list[tuple[int, ...]]:
    """The bodies, or pairs of bodies, that such a type acts on in turn, by their indices."""
    return list(combinations(range(1, body_count + 1), acts_on_all(type_)))


@attrs.frozen
class BodyPose:
    """Pose of a body: position r, Euler parameters p, rotation matrix A (rows).

    Jp is its inertia matrix (rows) in its own axes, kg m^2; zeros for ground.
    """

    r: tuple[float, ...]
    p: tuple[float, ...]
    A: tuple[tuple[float, ...], ...]
    Jp: tuple[tuple[float, ...], ...] = ((0.0, 0.0, 0.0),) * 3

    def to_local(self, s: Any) -> tuple[float, ...]:
        """Components on the body of a global 3-vector."""
        return tuple(sum(self.A[r][c] * s[r] for r in range(3)) for c in range(3))

    def to_global(self, s: Any) -> tuple[float, ...]:
        """Global components of a 3-vector given on the body."""
        return tuple(sum(self.A[r][c] * s[c] for c in range(3)) for r in range(3))

    def place(self, s: Any) -> tuple[float, ...]:
        """Global position of a point given by its coordinates on the body."""
        return tuple(a + b for a, b in zip(self.r, self.to_global(s), strict=True))


def pose(r: Any, p: Any, Jp: Any = ((0.0, 0.0, 0.0),) * 3) -> BodyPose:
    """The pose of a body from its position, (unit) Euler parameters and inertia matrix."""
    e0, e1, e2, e3 = (float(x) for x in p)
    matrix = (
        (1 - 2 * (e2 * e2 + e3 * e3), 2 * (e1 * e2 - e0 * e3), 2 * (e1 * e3 + e0 * e2)),
        (2 * (e1 * e2 + e0 * e3), 1 - 2 * (e1 * e1 + e3 * e3), 2 * (e2 * e3 - e0 * e1)),
        (2 * (e1 * e3 - e0 * e2), 2 * (e2 * e3 + e0 * e1), 1 - 2 * (e1 * e1 + e2 * e2)),
    )
    inertia = tuple(tuple(float(x) for x in row) for row in Jp)
    return BodyPose(tuple(float(x) for x in r), (e0, e1, e2, e3), matrix, inertia)
