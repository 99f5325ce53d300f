"""Imports of all models in folders, compared with MuJoCo: masses, kinematics, accelerations.

    python benchmarks/imported_models.py FOLDER... [--poses 100] [--csv FILE]

needs the extra "peers". Each URDF file (without its shapes) and each MJCF file is read by both; a
row has the largest relative differences of masses and inertias, those of poses (m, 1) over random
poses, and those of accelerations at five random states, relative to the largest. Contacts, limits,
friction of joints, equalities, tendons and fluids are off; files that either refuses are listed
with the reason.
"""

import argparse
import csv
import sys
import tempfile
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import numpy as np

import dap3d_core as dap
from dap3d_core.formats.import_model import read_articulation
from dap3d_core.interface.formats import FormatError
from dap3d_core.model.rotations import rotation

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
from support.mujoco_models import Oracle

COLUMNS = ("mass", "inertia", "position", "rotation", "acceleration")
#: What is asked of each column.
MARKS = dict(zip(COLUMNS, (1e-12, 1e-12, 1e-12, 1e-12, 1e-9), strict=True))


def without_shapes(path, folder):
    """A URDF file as MuJoCo reads it without files of meshes; its static links merged."""
    root = ET.parse(path).getroot()
    for link in root.findall("link"):
        for tag in ("visual", "collision"):
            for element in link.findall(tag):
                link.remove(element)
    for element in root.findall("mujoco"):
        root.remove(element)
    settings = {"fusestatic": "true", "discardvisual": "true", "balanceinertia": "true"}
    ET.SubElement(ET.SubElement(root, "mujoco"), "compiler", settings)
    copy = Path(folder, path.name)
    ET.ElementTree(root).write(copy)
    return copy


def oracle_of(path):
    """The model in MuJoCo, without what has no counterpart or is soft."""
    with tempfile.TemporaryDirectory() as folder:
        oracle = Oracle(without_shapes(path, folder) if path.suffix == ".urdf" else path)
    m = oracle.model
    m.opt.density = m.opt.viscosity = 0.0
    m.opt.wind[:] = 0.0
    m.actuator_forcelimited[:] = m.jnt_actfrclimited[:] = 0
    for k in range(m.nu):  # a law that is not linear is left out
        kinds = (m.actuator_trntype[k], m.actuator_gaintype[k], m.actuator_biastype[k])
        if m.actuator_dyntype[k] or kinds[0] > 1 or kinds[1] or kinds[2] > 1:
            m.actuator_gear[k] = 0.0
    for array in (m.body_gravcomp, m.tendon_stiffness, m.tendon_damping, m.tendon_armature):
        array[:] = 0.0
    for j in range(m.njnt):  # a ball's spring, damper and armature are left out
        if m.jnt_type[j] in (0, 1):
            start, size = m.jnt_dofadr[j], 6 if m.jnt_type[j] == 0 else 3
            m.dof_damping[start : start + size] = m.dof_armature[start : start + size] = 0.0
            m.jnt_stiffness[j] = 0.0
    return oracle


def compare(path, poses, root):
    """The largest differences of a model, by column."""
    oracle, rng = oracle_of(path), np.random.default_rng(1)
    options = {"root": root, "shapes": False}
    model, _, _ = read_articulation(path, **options)
    names = [j.name for j in model.joints.values() if j.kind != "fixed" and not j.closes]
    oracle.unnamed = names if path.suffix == ".xml" else []
    worst = dict.fromkeys(COLUMNS, 0.0)
    for k in range(poses):
        positions, rates = oracle.randomise(rng)
        known = positions.keys() & model.joints.keys()
        scene, _ = dap.import_model(
            path, positions={n: positions[n] for n in known}, balance_inertia=True,
            rates={n: rates[n] for n in known}, **options,
        )  # fmt: skip
        for name, error in _kinematics(oracle, scene).items():
            worst[name] = max(worst[name], error)
        if k < 5:
            worst["acceleration"] = max(worst["acceleration"], _accelerations(oracle, scene))
    return worst, len(scene.bodies)


def _pairs(oracle, scene):
    numbers = {oracle.name("mjOBJ_BODY", b): b for b in range(1, oracle.model.nbody)}
    return [(k, numbers[n], b) for k, (n, b) in enumerate(scene.bodies.items()) if n in numbers]


def _kinematics(oracle, scene):
    errors = dict.fromkeys(COLUMNS, 0.0)
    for _, b, body in _pairs(oracle, scene):
        mass, com, J = oracle.group(b)
        if not mass:
            continue  # no mass in the file: a stand-in here
        A = oracle.data.xmat[b].reshape(3, 3)
        given = np.diag(body.Jp) if np.ndim(body.Jp) == 1 else np.array(body.Jp)
        found = {
            "mass": abs(body.mass - mass) / mass,
            "inertia": np.abs(given - J).max() / max(np.abs(J).max(), 1e-15),
            "position": np.abs(body.r - com).max() / max(1.0, np.abs(com).max()),
            "rotation": np.abs(rotation(np.array(body.p)) - A).max(),
        }
        errors = {name: max(errors[name], found.get(name, 0.0)) for name in COLUMNS}
    return errors


def _accelerations(oracle, scene):
    for name in [n for n, e in scene.forces.items() if "function" in e.fields]:
        del scene.forces[name]  # stops
    scene.functions.clear()
    if scene.description.endswith("urdf."):  # MuJoCo passes <constraint> over
        for name in [n for n, e in scene.joints.items() if e.type == "sph"]:
            del scene.joints[name]
    coupled = [n for n, e in scene.joints.items() if n.endswith("_coupling")]
    loops = {m.name for m in scene.joints.values() if m.type in ("sph", "tran", "drive-tran")}
    soft = {oracle.name("mjOBJ_EQUALITY", k) for k in range(oracle.model.neq)}
    for name in [*coupled, *(loops & (soft | {f"{n}_lock" for n in soft}))]:
        del scene.joints[name]
    compiled, bodies = dap.compile(scene), list(scene.bodies.values())
    pose = np.concatenate([[*b.r, *b.p] for b in bodies])
    rate = np.concatenate([[*b.r_dot, *b.w] for b in bodies])
    v_dot = compiled.rhs(0.0, np.concatenate([pose, rate]))[7 * len(bodies) :].reshape(-1, 6)
    scale = max(1.0, np.abs(oracle.data.qacc).max(initial=0.0))
    errors = [
        np.abs(v_dot[k] - oracle.acceleration(b, oracle.group(b)[1])).max() / scale
        for k, b, _ in _pairs(oracle, scene)
        if oracle.group(b)[0]
    ]
    return max(errors, default=0.0)


def main():
    """Compare all models below folders, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--poses", type=int, default=100)
    parser.add_argument("--csv", type=Path)
    options = parser.parse_args()
    rows, ends = [], Counter()
    for folder in options.folders:
        files = [folder] if folder.is_file() else sorted(folder.rglob("*"))
        base = folder.parent if folder.is_file() else folder
        for path in (f for f in files if f.suffix in (".urdf", ".xml") and _is_model(f)):
            row = _row(path, options.poses, base)
            ends[row["end"]] += 1
            rows.append(row)
            figures = "  ".join(f"{row[c]:8.1e}" for c in COLUMNS) if row["end"] == "ok" else ""
            name = str(path.relative_to(base))[-50:]
            print(f"{name:50} {row['end']:8} {figures} {row['why'][:90]}", flush=True)
    print(dict(ends))
    for column, mark in MARKS.items():
        values = [row[column] for row in rows if row["end"] == "ok"]
        print(f"{column}: {sum(v <= mark for v in values)} of {len(values)} within {mark:g}")
    if options.csv:
        with options.csv.open("w", newline="") as file:
            writer = csv.DictWriter(file, ("file", "end", "bodies", *COLUMNS, "why"))
            writer.writeheader()
            writer.writerows(rows)


def _is_model(path):
    text = path.read_bytes()[:100_000]
    return path.suffix == ".urdf" or (b"<mujoco" in text and b"<worldbody" in text)


def _row(path, poses, root):
    """The row of a file: compared, refused by dap3d, or not read by MuJoCo."""
    row = {"file": str(path), "end": "ok", "why": "", "bodies": 0}
    try:
        worst, row["bodies"] = compare(path, poses, root)
        return row | worst
    except (dap.SceneError, FormatError) as error:
        row |= {"end": "refused", "why": str(error).partition("\n")[0].rpartition("/")[2]}
    except (ValueError, ET.ParseError) as error:
        row |= {"end": "MuJoCo", "why": " ".join(str(error).split())}
    except Exception as error:
        row |= {"end": "CRASH", "why": f"{type(error).__name__}: {error}"}
    return row


if __name__ == "__main__":
    main()
