"""``dap3d sweep`` as a user has it: what is told, how it ends, what a kill leaves of it."""

import json
import shlex
import signal
import time

import numpy as np
import pytest

import dap3d_core as dap
from dap3d_core.cli import main

FALL = ("sweep", "fall.toml", "--vary", "forces.gravity.gravity=1:9:5", "--keep", "stone.r.z")
#: A sweep that takes many seconds where it is slow: its kernels run as plain Python.
LONG = ("sweep", "pen1", "--vary", "bodies.cone.mass=1:5:60", "--keep", "cone.r.z:series",
        "--t-end", "6", "--dt", "0.6", "--threads", "1", "-o", "a.nc")  # fmt: skip
SLOW = {"DAP3D_PLAIN": "1"}


@pytest.fixture
def call(dap3d, scene_file, monkeypatch, capfd):
    """Run a command in this process, beside a scene; exit code, stdout, stderr."""
    scene_file()
    monkeypatch.chdir(dap3d.folder)
    monkeypatch.setenv("COLUMNS", "60")

    def run(*words):
        code = main([str(word) for word in words])
        out, err = capfd.readouterr()
        assert "Traceback" not in err
        assert all(len(line) <= 60 for line in err.splitlines()), err
        if "--json" not in words:
            assert all(len(line) <= 60 for line in out.splitlines()), out
        return code, out, err

    return run


def test_a_sweep_tells_what_came_of_it(call, tmp_path):
    """In 60 columns; the numbers are those of the fall, -g t^2 / 2."""
    code, out, err = call(*FALL)
    assert (code, err) == (0, "")
    words = " ".join(out.split())
    assert words.startswith("fall: 5 points points 5 done design grid 5")
    assert "points/s" in words
    assert "file fall-sweep.nc" in words
    assert "stone.r.z [m] min -0.045 forces.gravity.gravity = 9" in words
    assert "max -0.005 forces.gravity.gravity = 1" in words
    found = dap.open_sweep(tmp_path / "fall-sweep.nc")
    gravity = found["forces.gravity.gravity"]
    assert np.allclose(found["stone.r.z"], -0.5 * gravity * 0.1**2, rtol=0.0, atol=1e-12)
    code, told, err = call("info", "fall-sweep.nc")
    assert (code, err) == (0, "")
    assert "5 points" in told


def test_json_stands_alone_and_info_has_the_same(call):
    code, out, err = call(*FALL, "--json", "--keep", "stone.r.z:series", "--dt", "0.05")
    assert (code, err) == (0, "")
    found = json.loads(out)
    assert (found["points"], found["done"], found["exit_code"]) == (5, 5, 0)
    assert found["varied"] == [{"name": "forces.gravity.gravity", "spec": "1:9:5"}]
    end, series = found["outputs"]
    assert end["at_max"] == {"forces.gravity.gravity": 1.0}
    assert end["min"] == pytest.approx(-0.045, abs=1e-12)
    assert series["at_max"]["time"] == 0.0
    assert series["at_min"] == {"forces.gravity.gravity": 9.0, "time": 0.1}
    assert found["wall_time_s"] > 0.0
    again = json.loads(call("info", "fall-sweep.nc", "--json")[1])
    assert {k: v for k, v in again.items() if k in found} == {
        k: v for k, v in found.items() if k in again
    }


def test_samples_name_their_points(call):
    words = ("sweep", "fall.toml", "--vary", "bodies.stone.r.z=0~1", "--sample", "7", "--seed", "5",
             "--design", "random", "--keep", "stone.r.z:max")  # fmt: skip
    code, out, _ = call(*words)
    assert code == 0
    told = " ".join(out.split())
    assert "random, 7 samples, seed 5" in told
    assert "point " in told


def test_points_that_go_wrong_are_listed_and_judged(call):
    """Ten of them, and how to see the others; 0, with --strict 1, with none left 3."""
    masses = ",".join(str(-k) for k in range(1, 13))
    words = ("sweep", "fall.toml", "--keep", "stone.r.z", "--force")
    code, _, err = call(*words, "--vary", f"bodies.stone.mass=1,{masses}")
    assert code == 0
    told = " ".join(err.split())
    assert "12 of 13 points went wrong" in told
    assert told.count("bodies.stone.mass = -") >= 10
    assert "and 2 more: dap3d info fall-sweep.nc --json has them" in told
    failing = json.loads(call("info", "fall-sweep.nc", "--json")[1])["failing"]
    assert [f["at"]["bodies.stone.mass"] for f in failing] == [float(-k) for k in range(1, 13)]
    assert all("greater than 0" in f["note"] for f in failing)
    code, _, err = call(*words, "--vary", "bodies.stone.mass=1,-1", "--strict", "-q")
    assert code == 1
    assert "--strict: points went wrong" in err
    code, out, err = call(*words, "--vary", "bodies.stone.mass=-1,-2", "--json")
    assert code == 3
    assert "all points failed" in err
    assert json.loads(out)["reason"] == "all points failed"


def test_quiet_is_quiet(call):
    assert call(*FALL, "-q") == (0, "", "")


def _wait_for(process, file, count):
    """Wait until so many points stand in the part."""
    deadline = time.monotonic() + 200
    while time.monotonic() < deadline and process.poll() is None:
        if file.exists():
            found = dap.open_sweep(file)
            if int((found["status"] == 1).sum()) >= count:
                return
        time.sleep(0.1)
    pytest.fail(f"ended with {process.poll()}: {process.communicate()[1]}")


@pytest.fixture(scope="module")
def whole():
    """What the long sweep gives when nobody ends it."""
    return dap.sweep("pen1", ["bodies.cone.mass=1:5:60"], outputs=["cone.r.z:series"],
                     t_end=6.0, dt=0.6)  # fmt: skip


@pytest.mark.slow
def test_a_killed_sweep_goes_on(dap3d, whole):
    """SIGKILL twice in the middle: each time the part is whole and holds numbers of the sweep;
    the file is in the end that of a sweep that was not killed."""
    part, words, before = dap3d.folder / "a.nc.part", LONG, 0
    for _ in range(2):
        process = dap3d.start(*words, **SLOW)
        _wait_for(process, part, before + 1)
        process.kill()
        process.communicate()
        left = dap.open_sweep(part)
        done = left["status"].values == 1
        assert before < done.sum() < 60
        assert (left["status"].values[~done] == 0).all()
        series = left["cone.r.z:series"].values
        assert (series[done] == whole["cone.r.z:series"].values[done]).all()
        assert np.isnan(series[~done]).all()
        before, words = int(done.sum()), (*LONG, "--resume")
    done = dap3d.succeed(*words, "--json")
    assert json.loads(done.stdout)["done"] == 60
    assert dap.open_sweep(dap3d.folder / "a.nc").identical(whole)
    assert not part.exists()


@pytest.mark.slow
def test_a_signal_keeps_the_points(dap3d, whole):
    """The command that is told goes on."""
    process = dap3d.start(*LONG, **SLOW)
    _wait_for(process, dap3d.folder / "a.nc.part", 1)
    process.send_signal(signal.SIGTERM)
    out, err = process.communicate(timeout=60)
    assert process.returncode == 3, err
    assert "Traceback" not in err
    assert "not run" in out
    assert "what was computed until then is in a.nc.part" in err
    command = shlex.split(err.strip().splitlines()[-1])
    assert command == ["dap3d", *LONG, "--resume"]
    dap3d.succeed(*command[1:])
    assert dap.open_sweep(dap3d.folder / "a.nc").identical(whole)
