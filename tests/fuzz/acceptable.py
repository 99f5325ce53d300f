"""What must be true of any scene: refused in words, or run with a result that can be trusted."""

import contextlib
import functools
import re
import signal
import tempfile
import time
import tomllib
import warnings
from pathlib import Path

import numpy as np
from support.internals import lines_of

import dap3d_core as dap
from dap3d_core.scene import check, parse
from fuzz.scenes import events_of

#: A case that computes for longer hangs, s; kernels that are not cached are compiled in it, too.
HANG = 60
#: A run that goes on for longer is stopped where it reports its progress, s.
ENOUGH = 1.5
ARRAYS = ("t", "u", "r", "p", "rd", "w", "wp", "rdd", "wd", "wpd", "rP", "rPd", "rPdd", "Lam",
          "work")  # fmt: skip


class HangError(Exception):
    """A case took too long."""


class _Enough(Exception):
    """A run was seen to go on."""


@contextlib.contextmanager
def strict(seconds=HANG):
    """Warnings are errors, and so is what computes for longer than some seconds."""

    def ring(*_):
        raise HangError(f"no end after {seconds} s")

    before = signal.signal(signal.SIGPROF, ring)
    signal.setitimer(signal.ITIMER_PROF, seconds)
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            warnings.filterwarnings("ignore", "First-class function type feature")
            warnings.filterwarnings("ignore", "numpy.ndarray size changed")
            yield
    finally:
        signal.setitimer(signal.ITIMER_PROF, 0)
        signal.signal(signal.SIGPROF, before)


@contextlib.contextmanager
def file_of(data, name="scene.toml"):
    """A file with these bytes."""
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder, name)
        path.write_bytes(data)
        yield path


@functools.cache
def registry():
    """The installed types, found once."""
    return dap.load_registry()


def read(path):
    """The scene in a file and what the check made of it; the words of a refusal are examined."""
    try:
        scene = dap.load(path)
        return scene, check(scene, registry())
    except dap.SceneError as error:
        examine_mistakes(error, path)
        return None, error


def examine_mistakes(error, path):
    """Each mistake says what is wrong, where, and is printed as text that can be written."""
    assert error.mistakes
    str(error).encode("utf-8")
    try:
        tables = tomllib.loads(path.read_bytes().decode("utf-8-sig"))
    except (ValueError, RecursionError):
        tables = {}  # no keys: the file as a whole is refused
    for mistake in error.mistakes:
        assert mistake.what, mistake
        assert mistake.file in (str(path), ""), mistake  # settings of a run have no file
        assert mistake.key or len(error.mistakes) == 1, mistake  # the file as a whole
        table = mistake.key.split(".")[0]
        assert mistake.line or not mistake.key or table not in tables, f"no line: {mistake}"


def examine_lines(text):
    """Every key of a text that is TOML has a line, on which it stands."""
    try:
        tables = tomllib.loads(text)
    except (ValueError, RecursionError):
        return
    lines, rows = lines_of(text), text.split("\n")
    waiting = [((), tables)]
    while waiting:
        path, content = waiting.pop()
        named = isinstance(content, dict)
        for name, value in content.items() if named else enumerate(content):
            key = (*path, name)
            if named or isinstance(value, dict):
                assert key in lines, f"no line: {key}"
                row = rows[lines[key] - 1]
                is_plain = named and re.fullmatch(r"[A-Za-z0-9_-]+", name) and "\\" not in row
                assert name in row if is_plain else row.strip(), f"{key} is not on {row!r}"
            if isinstance(value, (dict, list)):
                waiting.append((key, value))


def examine_text(scene):
    """The text that a scene writes reads back equal."""
    assert parse(scene.to_toml()) == scene


def run(scene, events=()):
    """How a run ended, in words, and its result; None where it was stopped in its course."""
    end = time.monotonic() + ENOUGH

    def progress(*_):
        if time.monotonic() > end:
            raise _Enough

    try:
        result = dap.simulate(scene, events=events, progress=progress)
        return result.status, result
    except _Enough:
        return "went on", None
    except dap.SimulationError as error:
        examine_words(str(error), scene)
        return str(error), error.result


def examine_words(words, scene):
    """What stopped a run has a name: a part of the scene, or a setting."""
    names = {n for t in ("bodies", "joints", "forces") for n in getattr(scene, t)}
    settings = ("method", "integrator", "constraint", "t_end", "step")
    assert any(n in words for n in (*names, *settings)), f"names nothing: {words}"


def examine_result(result):
    """No number is missing, and the ledger says what its numbers say."""
    for name in ARRAYS:
        assert np.isfinite(getattr(result, name)).all(), f"{name} is not finite"
    for name in ("kinetic", "potential", "total"):
        assert np.isfinite(getattr(result.energy, name)).all(), f"energy.{name} is not finite"
    for name, entry in result.ledger.items():
        assert np.isfinite(entry.value), f"{name}: {entry}"
        assert entry.ok is (None if entry.limit is None else entry.value <= entry.limit)
    for joint in result.summary.joint_names:
        if joint.partition("#")[0] in result.contact_names:
            continue
        for action in result.reaction(joint).values():
            assert np.isfinite(action.force).all(), joint
            assert np.isfinite(action.moment).all(), joint


def same(one, other):
    """Whether two results are equal bit for bit."""
    if one is None or other is None:
        return one is other
    stored = ("t", "u", "v_dot", "Lam", "work", "potential_energy")
    return all(
        getattr(one.arrays, n).tobytes() == getattr(other.arrays, n).tobytes() for n in stored
    ) and (one.events == other.events and one.notes == other.notes)


def check_good_scene(data):
    """A valid scene is accepted, runs or says why not, and does so again in the same way."""
    text = data.decode()
    with strict(), file_of(data) as path:
        scene, error = read(path)
        assert scene is not None, f"refused: {error}"
        examine_text(scene)
        words, result = run(scene, events_of(text))
        if result is not None:
            examine_result(result)
        again, other = run(dap.load(path), events_of(text))
        if "went on" in (words, again):
            return "went on"
        assert words == again
        assert same(result, other), "a second run gives other numbers"
    return words if words in ("done", "stopped") else "failed"


def check_any_scene(data):
    """Whatever a file holds is refused with every mistake named, or acceptable."""
    with strict(), file_of(data) as path:
        examine_lines(data.decode("utf-8-sig", "ignore"))
        scene, _ = read(path)
        if scene is None:
            return "refused"
        examine_text(scene)
        try:
            words, result = run(scene)
        except dap.SceneError as error:  # settings that a run alone can judge
            examine_mistakes(error, path)
            return "refused"
        if result is not None:
            examine_result(result)
    return words if words in ("done", "stopped", "went on") else "failed"
