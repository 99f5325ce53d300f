"""Scenes: what a mechanism is made of, and how a script describes it."""

from pathlib import Path
from typing import Any

import attrs

from dap3d_core.registry.arguments import checked
from dap3d_core.scene.coerce import entry_of, keys_of, plain, with_identifiers
from dap3d_core.scene.contacts.tables import Collisions
from dap3d_core.scene.display import SceneDisplay
from dap3d_core.scene.errors import Mistake, MistakeList, SceneError
from dap3d_core.scene.tables import NAMED, AnimationPoint, Element, SceneTables, fault_of_name


@attrs.define(repr=False)
class Scene(SceneTables, SceneDisplay):
    """A mechanism and the settings of its simulation, as the user described them.

    Attributes:
        name, description: for people.
        schema: version of the file format.
        bodies, points, vectors, vectors2, joints, forces, functions: by name, in file order.
        inputs, shapes, materials, contacts: the same.
        requires: ranges of versions of the distributions that bring its types, by name.
        parameters: numbers by name, for expressions in place of numbers (text that begins with =).
        outputs: expressions of quantities, by name; or tables of ``value`` and ``unit``.
        collisions: which shapes that collide meet each other; None where the scene says nothing.
        animation, simulation: points to draw; settings of a run.
        path: the file this was read from, or None.
        faults: mistakes found in reading (unknown keys, wrong tables); ``check`` reports them.
        notes: information about the choice of the file.
        included: the files of its sub-assemblies, by their names.
        files: meshes that lie elsewhere until the scene is saved with them, as of an import.
    """

    def resolved(self) -> "Scene":
        """A copy with numbers in place of expressions of parameters; itself without parameters.

        Raises:
            SceneError: all mistakes in parameters and expressions.
        """
        if not self.parameters:
            return self
        from dap3d_core.scene.expressions.parameters import resolve

        return resolve(self)

    def add_body(self, name: str, **fields: Any) -> str:
        """Add a body and return its name.

        Args:
            name: without dots, not ``ground``, not used by another body.
            fields: mass, Jp, r, p, r_dot, w, color, as in ``Body``.

        Raises:
            SceneError: the name is taken or illegal, or a key is unknown.
        """
        return self._add("bodies", name, fields)

    def add_point(self, name: str, body: Any = None, sPp: Any = None, **unknown: Any) -> str:
        """Add a point fixed in a body at ``sPp`` (3 numbers in its axes, m) and return its name.

        Raises:
            SceneError: the name is taken or illegal, or a key is unknown.
        """
        return self._add("points", name, {"body": body, "sPp": sPp} | unknown)

    def add_vector(self, name: str, body: Any = None, sp: Any = None, **unknown: Any) -> str:
        """Add a vector fixed in a body (3 components in its axes) and return its name.

        Raises:
            SceneError: the name is taken or illegal, or a key is unknown.
        """
        return self._add("vectors", name, {"body": body, "sp": sp} | unknown)

    def add_vector2(self, name: str, P_i: Any = None, P_j: Any = None, **unknown: Any) -> str:
        """Add a vector from point ``P_i`` to point ``P_j`` and return its name.

        Raises:
            SceneError: the name is taken or illegal, or a key is unknown.
        """
        return self._add("vectors2", name, {"P_i": P_i, "P_j": P_j} | unknown)

    def add_joint(self, type: str, name: str | None = None, **fields: Any) -> str:
        """Add a joint of a type (its keyword) and return its name, made from the type if None.

        Raises:
            SceneError: the name is taken or illegal. Fields are checked with the whole scene.
        """
        return self._add_element("joints", type, name, fields)

    def add_force(self, type: str, name: str | None = None, **fields: Any) -> str:
        """Add a force element of a type (its keyword) and return its name, made from it if None.

        Raises:
            SceneError: the name is taken or illegal. Fields are checked with the whole scene.
        """
        return self._add_element("forces", type, name, fields)

    def add_function(self, type: str, name: str | None = None, **fields: Any) -> str:
        """Add a function of a type (its keyword) and return its name, made from the type if None.

        Raises:
            SceneError: the name is taken or illegal. Fields are checked with the whole scene.
        """
        return self._add_element("functions", type, name, fields)

    def add_input(self, name: str, value: Any = 0.0, **unknown: Any) -> str:
        """Add an input, a number that a controller or a script sets, and return its name.

        Args:
            name: a word, also the name of the quantity in results.
            value: at the start of a run.

        Raises:
            SceneError: the name is taken or illegal, or a key is unknown.
        """
        return self._add("inputs", name, {"value": value} | unknown)

    def add_shape(self, type: str, name: str | None = None, **fields: Any) -> str:
        """Add a shape (box, sphere, plane, mesh and others); its name.

        It is drawn; with ``collides=True`` it meets others that do, but lines, cones and disks.

        Raises:
            SceneError: the name is taken or illegal. Fields are checked with the whole scene.
        """
        return self._add_element("shapes", type, name, fields)

    def add_material(self, name: str, **fields: Any) -> str:
        """Add a material, fields that contacts take from it, and return its name.

        Args:
            name: without dots, not used by another material.
            fields: mu, mu_s, mu_roll, mu_spin, e, law, ``with_``, as in ``Material``.

        Raises:
            SceneError: the name is taken or illegal, or a key is unknown.
        """
        return self._add("materials", name, fields)

    def add_contact(self, type: str, name: str | None = None, **fields: Any) -> str:
        """Add a contact of a type (its keyword) and return its name, made from the type if None.

        Raises:
            SceneError: the name is taken or illegal. Fields are checked with the whole scene.
        """
        return self._add_element("contacts", type, name, fields)

    def add_collisions(
        self, bodies: Any = "all", exclude: Any = (), material: str | None = None
    ) -> None:
        """Let shapes with ``collides=True`` meet; arguments as of ``Collisions``.

        Without it all of them do. Pairs that were excluded before, as by sub-assemblies, remain.
        """
        before = self.collisions.exclude if self.collisions else ()
        pairs = [x if type(x) is tuple else (x,) for x in map(plain, (before, exclude))]
        self.collisions = Collisions(bodies, (*pairs[0], *pairs[1]), material)

    @checked
    def add_requirement(self, name: str, versions: str = "*") -> str:
        """Add a distribution that brings types of the scene, and return its name.

        Args:
            name: what pip installs, such as ``dap3d-example``.
            versions: a range of versions, such as ``">=0.2, <1"``; ``"*"`` is any. It is checked
                with the whole scene.
        """
        self.requires[plain(name)] = plain(versions)
        return name

    def add_parameter(self, name: str, value: float | str) -> str:
        """Add a parameter, a number that expressions such as ``"= L / 2"`` name; returns its name.

        Args:
            name: a word, not used by another parameter.
            value: a number, or an expression of other parameters: ``"= 2 * L"``.

        Raises:
            SceneError: the name is taken or illegal.
        """
        name = plain(name)
        self._check_name("parameters", self.parameters, name)
        self.parameters[name] = plain(value)
        return name

    def add_output(self, name: str, expression: str, unit: str | None = None) -> str:
        """Add an output, a quantity of results, and return its name.

        Args:
            name: a word, not used by another output.
            expression: of quantities, such as ``"0.5 * (left.r.z + right.r.z)"``; it is parsed with
                the check of the whole scene.
            unit: of its value, such as ``"deg"``; left out, as the expression has it.

        Raises:
            SceneError: the name is taken or illegal.
        """
        name = plain(name)
        self._check_name("outputs", self.outputs, name)
        value = plain(expression)
        self.outputs[name] = value if unit is None else {"value": value, "unit": plain(unit)}
        return name

    def add_animation_point(self, body: str, sPp: Any) -> None:
        """Add a point that is only drawn, at ``sPp`` (3 numbers in the axes of a body, m)."""
        self.animation.points.append(AnimationPoint(body, sPp))

    def to_toml(self) -> str:
        """The scene as the text of a scene file; reading it gives an equal scene.

        Raises:
            SceneError: it holds something that a scene file cannot.
        """
        from dap3d_core.scene.files.write_toml import to_toml

        return to_toml(self)

    @checked
    def save(self, path: str | Path, force: bool = False) -> Path:
        """Write the scene to a file, or to ``scene.toml`` in a folder; returns the file.

        Args:
            path: the file, or the folder.
            force: True to overwrite an existing file.

        Raises:
            SceneError: it cannot be written, or exists and ``force`` is off.
        """
        from dap3d_core.scene.files.write_toml import save

        return save(self, path, force)

    def _add(self, table: str, name: str, fields: dict[str, Any]) -> str:
        named, class_ = getattr(self, table), NAMED[table]
        name, fields = plain(name), {k.rstrip("_"): plain(v) for k, v in fields.items()}
        self._check_name(table, named, name)
        if not fields.keys() <= keys_of(class_):
            mistakes = MistakeList()
            mistakes.add_unknown_keys((table, name), fields, keys_of(class_))
            mistakes.raise_mistakes()
        named[name] = entry_of(class_, name, {k: v for k, v in fields.items() if v is not None})
        return name

    def _add_element(self, table: str, type_: Any, name: str | None, fields: dict[str, Any]) -> str:
        elements = getattr(self, table)
        type_ = plain(type_)
        if type(type_) is not str or not type_:
            what = 'the type of an element is the keyword of a type, such as "sph"'
            raise SceneError([Mistake(f"{table}.{name or ''}".rstrip("."), type_, what)])
        if name is None:
            count = self._counts.get(f"{table}.{type_}", 0) + 1
            while f"{type_}{count}" in elements:
                count += 1
            self._counts[f"{table}.{type_}"] = count
            name = f"{type_}{count}"
        name = plain(name)
        self._check_name(table, elements, name)
        fields = {k: plain(v) for k, v in with_identifiers(fields).items() if v is not None}
        elements[name] = Element(name, type_, fields)
        return name

    @staticmethod
    def _check_name(table: str, taken: dict[str, Any], name: Any) -> None:
        fault = fault_of_name(name)
        if not fault and name in taken:
            fault = f"there is one of this name in {table} already"
        if fault:
            raise SceneError([Mistake(table, name, f"not a name for one of the {table}: {fault}")])
