"""Models in MuJoCo without what is soft or has no counterpart, with forces on all joints."""

import tempfile
import xml.etree.ElementTree as ET
from pathlib import Path

import mujoco
import numpy as np

from support.mujoco_models import Oracle


class BareOracle(Oracle):
    """A model with passive joints and linear servos alone, and random forces on its joints.

    Attributes:
        largest: the largest acceleration of a joint, at least 1.
    """

    def __init__(self, path):
        with tempfile.TemporaryDirectory() as folder:
            self._bare(Path(folder, path.name), path)
        self.largest = 1.0

    def _bare(self, copy, path):
        if path.suffix == ".urdf":
            write_without_shapes(path, copy)
            super().__init__(copy)
        else:
            super().__init__(path, compiled=compiled(path))
        m = self.model
        m.opt.density = m.opt.viscosity = 0.0
        m.opt.wind[:] = 0.0
        m.actuator_forcelimited[:] = m.actuator_ctrllimited[:] = m.jnt_actfrclimited[:] = 0
        for k in range(len(m.actuator_trntype)):  # a law that is not linear is left out
            kinds = (m.actuator_trntype[k], m.actuator_gaintype[k], m.actuator_biastype[k])
            if m.actuator_dyntype[k] or kinds[0] > 1 or kinds[1] or kinds[2] > 1:
                m.actuator_gear[k] = 0.0
        for array in (m.body_gravcomp, m.tendon_stiffness, m.tendon_damping, m.tendon_armature):
            array[:] = 0.0
        for j in range(m.njnt):  # what a ball or free joint has but damping is left out
            start, size = m.jnt_dofadr[j], {0: 6, 1: 3}.get(int(m.jnt_type[j]), 0)
            m.dof_armature[start : start + size] = 0.0
            if m.jnt_type[j] == 0:
                m.jnt_stiffness[j] = 0.0

    def use(self, model):
        """Take the names of joints, for those that have none in the file."""
        two = ("universal", "cylindrical")  # two joints in MuJoCo
        kinds = {name: joint.kind for name, joint in model.joints.items()}
        moving = [n for name, kind in kinds.items() if kind != "fixed"
                  for n in ((name, f"{name}_2") if kind in two else (name,))]  # fmt: skip
        self.unnamed = moving if len(moving) == self.model.njnt else []
        self.scalar = {n for n, kind in kinds.items() if kind in ("revolute", "prismatic")}
        self.known = set(kinds)
        self.pairs = {n: (n, f"{n}_2") for n, kind in kinds.items() if kind == "universal"}
        #: of a cylindrical joint the angle comes first, which is the second joint
        self.pairs |= {n: (f"{n}_2", n) for n, kind in kinds.items() if kind == "cylindrical"}

    def randomise(self, rng):
        """A random state: coordinates, rates and forces of the joints by name."""
        m, d, torques = self.model, self.data, {}
        names = [self.name("mjOBJ_JOINT", j) for j in range(m.njnt)]
        names = [n or (self.unnamed[j] if self.unnamed else None) for j, n in enumerate(names)]
        for j, name in enumerate(names):
            if name in self.scalar:
                torques[name] = d.qfrc_applied[m.jnt_dofadr[j]] = rng.uniform(-1.0, 1.0)
        q, v = super().randomise(rng)
        self.largest = max(1.0, np.abs(d.qacc).max(initial=0.0))
        q, v = ({n: np.atleast_1d(x).tolist() for n, x in one.items()} for one in (q, v))
        q, v = (one | {n: one[a] + one[b] for n, (a, b) in self.pairs.items()} for one in (q, v))
        q, v = ({n: x for n, x in one.items() if n in self.known} for one in (q, v))
        return q, v, torques

    def evaluate(self, *, accelerations):
        """Nothing is left to do: a random state is evaluated where it is made."""

    def bodies(self, *, accelerations):
        """Link -> mass, mass centre, inertia and axes; acceleration there and angular one."""
        found = {}
        for b in range(1, self.model.nbody):
            group = [k for k in range(1, self.model.nbody) if self.model.body_weldid[k] == b]
            if self.model.body_mass[group].sum():
                mass, com, J = self.group(b)
                both = self.acceleration(b, com) if accelerations else None
                A = self.data.xmat[b].reshape(3, 3)
                found[self.name("mjOBJ_BODY", b)] = mass, com, J, A, both
        return found


def write_without_shapes(path, copy):
    """Write a URDF file as MuJoCo reads it without files of meshes; its static links merged."""
    root = ET.parse(path).getroot()
    for link in root.findall("link"):
        for tag in ("visual", "collision"):
            for element in link.findall(tag):
                link.remove(element)
    for element in root.findall("mujoco"):
        root.remove(element)
    settings = {"fusestatic": "true", "discardvisual": "true", "balanceinertia": "true"}
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", settings)
    ET.ElementTree(root).write(copy)


def compiled(path):
    """An MJCF model; without the textures and meshes whose files are missing, if any are."""
    try:
        return mujoco.MjModel.from_xml_path(str(path))
    except ValueError as error:
        if "opening file" not in str(error):
            raise
    spec = mujoco.MjSpec.from_file(str(path))
    for material in spec.materials:
        material.textures = [""] * len(material.textures)
    for texture in list(spec.textures):
        spec.delete(texture)
    folder = path.parent / (spec.meshdir or "")
    gone = {m.name or Path(m.file).stem for m in spec.meshes
            if m.file and not (folder / m.file).is_file()}  # fmt: skip
    for geom in list(spec.geoms):
        if geom.meshname in gone:
            spec.delete(geom)
    for mesh in list(spec.meshes):
        if (mesh.name or Path(mesh.file).stem) in gone:
            spec.delete(mesh)
    return spec.compile()
