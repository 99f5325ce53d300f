"""Runs that go on from a checkpoint are those that were not ended, bit for bit."""

import math
import shutil
import zipfile

import numpy as np
import pytest
from support import mechanisms, problems, trees
from support.bouncing import bouncing, swinging
from support.ended import EndedError, ended_at, leave, shorten_chunks
from support.internals import FORMAT, Checkpoint, path_of, read_checkpoint, write_checkpoint
from support.levels import quickly
from support.on_axles import driven, stone, wheel
from support.plain import jit_is_on
from support.results import same_run
from support.state_types import stated

import dap3d_core as dap
from dap3d_core.simulation import CheckpointError


def stiffer():
    """New events each time: an event may keep what it has seen."""
    return [
        dap.Event("stone.r.z", below=1.5, action=lambda here: here.set("spring", k=50.0)),
        dap.Event("stone.r.x", above=0.45),
        dap.Event("stone.r.x", above=0.6, action="stop"),
    ]


def kicks():
    """The stone is thrown anew where it has fallen to 1.5 m, again and again."""
    throw = {"r_dot": (0.5, None, 2.0), "w": (0.0, 0.0, 1.0)}
    return [dap.Event("stone.r.z", below=1.5, action=lambda here: here.set("stone", **throw))]


RADAU = {"integrator": "radau", "t_end": 2.0, "dt": 0.1}
#: Scene, settings, and where it may be ended, s.
CASES = {
    "dop853": (problems.pendulum, {}, 0.5),
    "dopri5": (problems.four_bar, {"integrator": "dopri5"}, 0.2),
    "adams": (problems.four_bar, {"integrator": "adams"}, 0.2),
    "rk4": (problems.pendulum, {"integrator": "rk4", "step": 0.004}, 0.3),
    "radau": (problems.pendulum, {"integrator": "radau"}, 0.3),
    "fixed steps": (problems.pendulum, {"step": 0.01}, 0.3),
    "no projection": (problems.four_bar, {"project": False, "t_end": 0.6}, 0.2),
    "penalty": (problems.four_bar, {"method": "penalty", "t_end": 0.5}, 0.1),
    "lsq": (mechanisms.door, {}, 0.3),
    "a singular pose": (lambda: dap.load("A02-1"), {"t_end": 1.0, "dt": 0.1}, 0.5),
    "radau across singular poses": (lambda: dap.load("A02-1"), RADAU, 1.0),
    "within a crossing of radau": (lambda: dap.load("A02-1"), RADAU, 0.7),
    "turns and friction": (wheel, {"t_end": 1.5, "dt": 0.05}, 0.7),
    "joint": (wheel, {"t_end": 1.5, "dt": 0.05, "method": "joint"}, 0.7),
    "joint, adams": (
        lambda: trees.random_tree(4, 1),
        {"method": "joint", "integrator": "adams"},
        0.5,
    ),
    "joint, loops": (lambda: dap.load("A02-1"), {"t_end": 1.0, "method": "joint"}, 0.5),
    "stiff": (lambda: dap.load("A05"), {"integrator": "auto", "t_end": 0.3, "dt": 0.01}, 0.02),
    "a function's breaks": (driven, {}, 0.4),
    "states of elements": (stated, {}, 0.4),
    "states, radau": (stated, {"integrator": "radau", "t_end": 1.0}, 0.4),
    "states, joint": (stated, {"method": "joint", "integrator": "adams"}, 0.4),
    "events": (stone, {"t_end": 2.0, "dt": 0.05, "events": stiffer}, 0.35),
    "jumps": (bouncing, {}, 0.6),
    "jumps in joint coordinates": (swinging, {"method": "joint"}, 0.6),
    "joint by auto": (lambda: problems.chain(16), {"t_end": 0.4}, 0.2),
    "radau by auto": (lambda: problems.chain(16), {"t_end": 0.2, "integrator": "radau"}, 0.1),
    "jumps by events": (stone, {"t_end": 2.0, "dt": 0.05, "events": kicks}, 0.35),
}
#: Tried in plain Python as well; the others take long there and keep no more than these.
SHORT_IN_PYTHON = ("dop853", "a function's breaks", "joint", "events", "jumps")
#: What each kind of integrator, formulation and event keeps; the others keep these together.
QUICK = {
    "dop853", "adams", "radau", "penalty", "lsq", "a singular pose", "within a crossing of radau",
    "turns and friction", "joint", "joint, loops", "stiff", "a function's breaks",
    "states of elements", "states, radau", "events", "jumps", "joint by auto", "jumps by events",
}  # fmt: skip


def settings_of(settings):
    """Settings of a run, its events made anew."""
    given = {"t_end": 2.0, "dt": 0.1} | settings
    return given | ({"events": given["events"]()} if "events" in given else {})


@pytest.fixture(autouse=True)
def short_chunks(monkeypatch):
    """As many chunks as there are steps; chains are long enough for auto to choose joint."""
    shorten_chunks(monkeypatch)
    monkeypatch.setattr("dap3d_core.simulation.compiled_model.MANY_BODIES", 16)


@pytest.mark.every(4)
@pytest.mark.parametrize(
    "case", quickly(sorted(CASES, key=lambda case: case not in QUICK), len(QUICK))
)
def test_a_resumed_run_is_that_of_one_that_was_not_ended(case, tmp_path):
    """Ended twice, and twice gone on with: arrays, counts and events are the same."""
    if case not in SHORT_IN_PYTHON and not jit_is_on():
        pytest.skip("takes long in plain Python")
    make, settings, t = CASES[case]
    whole = dap.simulate(make(), **settings_of(settings))
    checkpoint = leave(make(), tmp_path, t, **settings_of(settings))
    events = {"events": settings["events"]()} if "events" in settings else {}
    with pytest.raises(EndedError):
        dap.resume(checkpoint, watch=ended_at(t), **events)
    assert sorted(f.name for f in tmp_path.iterdir()) == ["run.nc", "run.nc.checkpoint"]
    events = {"events": settings["events"]()} if "events" in settings else {}
    found = dap.resume(checkpoint, **events)
    assert [f.name for f in tmp_path.iterdir()] == ["run.nc"]
    assert same_run(found, whole)
    assert same_run(dap.open(tmp_path / "run.nc"), whole)
    assert found.events == whole.events
    assert found.status == whole.status
    counts = ("steps", "rejected", "rhs", "projections")
    assert [getattr(found.stats, n) for n in counts] == [getattr(whole.stats, n) for n in counts]
    resumed = [note for note in found.notes if "resumed from a checkpoint" in note]
    assert len(resumed) == 2
    assert [n for n in found.notes if n not in resumed] == list(whole.notes)


def test_the_model_s_own_types_are_resumed_where_they_are_allowed(tmp_path):
    """And refused where they are not, or where they have changed."""
    folder = shutil.copytree(dap.shipped_models()["ball1"], tmp_path / "ball1")
    settings = {"t_end": 0.8, "dt": 0.02, "allow_code": True}
    whole = dap.simulate(folder, **settings)
    checkpoint = leave(folder, tmp_path, 0.45, **settings)  # the ball has met the floor
    with pytest.raises(CheckpointError, match=r"ball-contact.*--model FOLDER --allow-code"):
        dap.resume(checkpoint)
    text = (folder / "plugin.py").read_text()
    (folder / "plugin.py").write_text(f"{text}\nEXTRA = 1\n")
    with pytest.raises(CheckpointError, match=r"formulas of force ball-contact have changed"):
        dap.resume(checkpoint, model=folder, allow_code=True)
    (folder / "plugin.py").write_text(text)
    found = dap.resume(checkpoint, model=folder, allow_code=True)
    assert same_run(found, whole)
    assert found.events == whole.events
    assert [event.t > 0.45 for event in whole.events] == [False, True]


# ------------------------------------------------------------------ when they are written

SHORT = {"t_end": 0.6, "dt": 0.02}


def test_checkpoints_are_written_now_and_then(tmp_path, monkeypatch):
    """Each is whole, and its rows stand in the part beside it."""
    seen = []
    output = tmp_path / "run.nc"

    def watch(standing):
        found = read_checkpoint(path_of(output))
        part = dap.open(tmp_path / "run.nc.part")
        seen.append((found.header["t"], found.header["rows"], len(part.t)))
        assert found.header["t"] == standing.t
        assert not output.exists()

    whole = dap.simulate(problems.pendulum(), **SHORT)
    found = dap.simulate(problems.pendulum(), output=output, checkpoint=1e-9, watch=watch, **SHORT)
    assert same_run(found, whole)
    assert [f.name for f in tmp_path.iterdir()] == ["run.nc"]
    assert len(seen) > 5
    assert all(rows == there for _, rows, there in seen)


@pytest.mark.parametrize(
    ("every", "at"),
    [
        # killed before its first checkpoint is due: there is one from the beginning, with no row
        (1e6, {"run.nc.checkpoint": 0.0, "run.nc.part": 0.0}),
        # killed between two checkpoints: rows behind one are made again
        (1e-9, {"run.nc.checkpoint": 0.2, "run.nc.part": 0.4}),
    ],
)
def test_a_run_that_is_killed_is_resumed(every, at, tmp_path):
    """From the files that it leaves, as they are at some moments."""
    kept = tmp_path / "kept"
    kept.mkdir()

    def watch(standing):
        for name, t in at.items():
            if standing.t >= t and not (kept / name).exists():
                shutil.copy(tmp_path / name, kept / name)

    settings = {"output": tmp_path / "run.nc", "watch": watch} | SHORT
    whole = dap.simulate(problems.pendulum(), checkpoint=every, **settings)
    rows = read_checkpoint(kept / "run.nc.checkpoint").header["rows"]
    assert rows == 0 if every == 1e6 else rows < len(dap.open(kept / "run.nc.part").t)
    assert same_run(dap.resume(kept / "run.nc.checkpoint"), whole)
    assert [f.name for f in kept.iterdir()] == ["run.nc"]


def test_of_a_run_that_fails_at_its_start_nothing_is_left(tmp_path):
    """Neither a checkpoint that would fail in the same way, nor a part without rows."""
    scene = stone()
    scene.add_force("ptp", "stuck", P_i="stone.O", P_j="stone.O", k=1.0, l0=1.0)
    with pytest.raises((dap.SceneError, dap.SimulationError)):
        dap.simulate(scene, output=tmp_path / "run.nc", checkpoint=1e6, **SHORT)
    assert not list(tmp_path.iterdir())


def test_a_checkpoint_that_another_run_has_written_since_stays(tmp_path):
    """Of two runs with one output, the first to end leaves the checkpoint of the other."""
    checkpoint = leave(problems.pendulum(), tmp_path, 0.3, **SHORT)
    theirs = checkpoint.read_bytes()

    def watch(standing):
        checkpoint.write_bytes(theirs)

    dap.simulate(problems.pendulum(), output=tmp_path / "run.nc", checkpoint=1e6, force=True,
                 watch=watch, **SHORT)  # fmt: skip
    assert checkpoint.read_bytes() == theirs


def test_a_callback_that_fails_keeps_all_even_with_an_error_of_the_system(tmp_path):
    def broken(standing):
        raise ConnectionError("no one listens")

    with pytest.raises(ConnectionError) as caught:
        dap.simulate(problems.pendulum(), output=tmp_path / "run.nc", watch=broken,
                     checkpoint=math.inf, **SHORT)  # fmt: skip
    assert same_run(dap.open(tmp_path / "run.nc"), caught.value.result)
    whole = dap.simulate(problems.pendulum(), **SHORT)
    assert same_run(dap.resume(caught.value.checkpoint), whole)


def test_without_asking_there_is_none(tmp_path):
    with pytest.raises(EndedError):
        dap.simulate(problems.pendulum(), output=tmp_path / "run.nc", watch=ended_at(0.1), **SHORT)
    assert [f.name for f in tmp_path.iterdir()] == ["run.nc"]


def test_a_checkpoint_of_another_run_is_not_overwritten(tmp_path):
    checkpoint = leave(problems.pendulum(), tmp_path, 0.3, **SHORT)
    (tmp_path / "run.nc").unlink()
    before = checkpoint.read_bytes()
    with pytest.raises(OSError, match=r"exists: .*dap3d resume"):
        dap.simulate(problems.pendulum(), output=tmp_path / "run.nc", checkpoint=9.0, **SHORT)
    assert checkpoint.read_bytes() == before
    dap.simulate(
        problems.pendulum(), output=tmp_path / "run.nc", checkpoint=9.0, force=True, **SHORT
    )
    assert not checkpoint.exists()


@pytest.mark.parametrize(
    ("settings", "words"),
    [
        ({"checkpoint": 0.0, "output": "run.nc"}, "positive number of seconds"),
        ({"checkpoint": math.nan, "output": "run.nc"}, "positive number of seconds"),
        ({"checkpoint": "often", "output": "run.nc"}, "checkpoint should be a number"),
        ({"checkpoint": 1.0}, "give output"),
    ],
)
def test_settings_that_make_no_sense_are_refused(settings, words, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises((dap.SceneError, TypeError), match=words):
        dap.simulate(problems.pendulum(), **SHORT, **settings)
    assert not list(tmp_path.iterdir())


def test_an_estimate_of_the_error_follows_the_resumed_run(tmp_path):
    whole = dap.simulate(problems.pendulum(), estimate_error=True, **SHORT)
    found = dap.resume(leave(problems.pendulum(), tmp_path, 0.3, estimate_error=True, **SHORT))
    assert found.error.u.tobytes() == whole.error.u.tobytes()


# ------------------------------------------------------------------ what cannot be resumed


@pytest.fixture(scope="module")
def left(tmp_path_factory):
    """A folder with a run that was ended."""
    folder = tmp_path_factory.mktemp("left")
    with pytest.MonkeyPatch.context() as patch:
        shorten_chunks(patch)
        leave(problems.pendulum(), folder, 0.3, **SHORT)
    return folder


@pytest.fixture
def copied(left, tmp_path):
    """A copy of it; its checkpoint."""
    return shutil.copytree(left, tmp_path / "copied") / "run.nc.checkpoint"


def refused(path, words, **settings):
    with pytest.raises(CheckpointError, match=words) as caught:
        dap.resume(path, **settings)
    assert str(path) in str(caught.value)


def test_what_is_no_checkpoint_is_refused(copied, tmp_path):
    refused(tmp_path / "none.checkpoint", "there is no such file")
    refused(tmp_path, "it is a folder")
    (tmp_path / "empty").touch()
    refused(tmp_path / "empty", "the file is empty")
    (tmp_path / "text").write_text("t, x\n")
    refused(tmp_path / "text", "it is no checkpoint of dap3d")
    with zipfile.ZipFile(tmp_path / "other.zip", "w") as archive:
        archive.writestr("a.txt", "words")
    refused(tmp_path / "other.zip", "it is no checkpoint of dap3d")
    refused(copied.with_name("run.nc"), r"it is a result; .* is run\.nc\.checkpoint")


def test_a_checkpoint_that_was_cut_off_is_refused(copied):
    """At any place."""
    whole = copied.read_bytes()
    for count in np.linspace(4, len(whole) - 1, 60).astype(int):
        copied.write_bytes(whole[:count])
        refused(copied, "it is cut off or damaged")


def rewritten(path, **changes):
    """Write a checkpoint again with something changed in its header."""
    found = read_checkpoint(path)
    write_checkpoint(path, Checkpoint({**found.header, **changes}, found.arrays))


def test_a_newer_checkpoint_is_refused(copied):
    rewritten(copied, format=FORMAT + 1, versions={"dap3d": "9.0"})
    words = rf"dap3d 9\.0 wrote it in format {FORMAT + 1}, this program reads format {FORMAT}"
    refused(copied, f"{words}; install")


def test_other_versions_are_noted(copied):
    versions = read_checkpoint(copied).header["versions"]
    rewritten(copied, versions=versions | {"llvmlite": "0.1"})
    found = dap.resume(copied)
    assert found.notes[-1].startswith("the checkpoint was made with llvmlite 0.1")
    assert "digits may differ" in found.notes[-1]


def test_rows_that_are_gone_are_told(copied, tmp_path):
    whole = copied.with_name("run.nc").read_bytes()
    copied.with_name("run.nc").unlink()
    refused(copied, "the rows of its run are gone")
    dap.simulate(problems.pendulum(), output=copied.with_name("run.nc"), **SHORT)  # another run
    refused(copied, "the rows of its run are gone")
    copied.with_name("run.nc").write_bytes(whole)
    rewritten(copied, output="../../copied/run.nc")  # names no file of another folder
    assert dap.resume(copied).status == "done"


def test_a_type_that_is_not_installed_is_told(copied):
    scene = read_checkpoint(copied).header["scene"]
    rewritten(copied, scene=scene.replace('"sph-sph"', '"link"'))
    refused(copied, "there is no joint type 'link'.*install what brings the type")


def test_another_model_is_refused(copied):
    found = read_checkpoint(copied)
    arrays = {n: a for n, a in found.arrays.items() if n != "system.par"}
    write_checkpoint(copied, Checkpoint(found.header, arrays))
    refused(copied, "its scene gives another model here")


def test_events_must_be_given_again(tmp_path):
    settings = settings_of(CASES["events"][1])
    checkpoint = leave(stone(), tmp_path, 0.35, **settings)
    refused(checkpoint, r"the run has the events .*given are none; give the same again")
    refused(checkpoint, "give the same again", events=stiffer()[:1])


def test_another_output_leaves_what_there_is(copied):
    """With -o the run's own result stays; the checkpoint has done its work."""
    other = copied.with_name("other.nc")
    whole = dap.simulate(problems.pendulum(), **SHORT)
    other.write_text("precious")
    with pytest.raises(OSError, match="the file exists"):
        dap.resume(copied, output=other)
    assert same_run(dap.resume(copied, output=other, force=True), whole)
    assert sorted(f.name for f in copied.parent.iterdir()) == ["other.nc", "run.nc"]
    assert dap.open(copied.with_name("run.nc")).status == "stopped"


@pytest.mark.parametrize("name", ["0.tolerance.npy", "0.state.npy", "0.real.npy"])
def test_an_array_that_was_changed_by_hand_is_refused(name, tmp_path):
    """By its last bit: the digest is of all numbers."""
    checkpoint = leave(problems.pendulum(), tmp_path, 0.3, t_end=1.0, dt=0.1)
    with zipfile.ZipFile(checkpoint) as archive:
        members = {i.filename: archive.read(i) for i in archive.infolist()}
    content = bytearray(members[name])
    content[-8] ^= 1
    members[name] = bytes(content)
    with zipfile.ZipFile(checkpoint, "w") as archive:
        for other, text in members.items():
            archive.writestr(other, text)
    with pytest.raises(CheckpointError, match="it was changed since it was written"):
        dap.resume(checkpoint)


def test_a_resumed_run_removes_the_parts_of_a_killed_one(tmp_path, monkeypatch):
    """Its rows are copied first: killed again and again, a run has one unfinished file."""
    settings = {"t_end": 1.0, "dt": 0.01}
    checkpoint = leave(problems.pendulum(), tmp_path, 0.3, **settings)
    output = path_of(checkpoint).with_name(read_checkpoint(checkpoint).header["output"])
    for number in ("", "2", "3"):  # as kills of earlier versions left them
        shutil.copy(output, f"{output}.part{number}")
    output.unlink()
    kept = []

    def look(t, t_end):
        kept.append(sorted(p.name for p in tmp_path.glob("*.part*")))

    result = dap.resume(checkpoint, progress=look)
    assert all(len(names) == 1 for names in kept), kept
    assert same_run(result, dap.simulate(problems.pendulum(), **settings))
    assert not list(tmp_path.glob("*.part*"))
