"""Commands in a shell that is not as usual: full disks, pipes for files, a folder that is gone."""

import os
import subprocess
from pathlib import Path

import pytest
from support.levels import quickly

import dap3d_core as dap
from dap3d_core.cli import main

from .conftest import COMMAND, environment

FULL = Path("/dev/full")
posix = pytest.mark.skipif(os.name != "posix", reason="pipes and links as POSIX has them")
has_full = pytest.mark.skipif(not FULL.exists(), reason="needs /dev/full")


def in_shell(words, folder, **variables):
    """Run a line of a shell, in which $DAP3D is the command."""
    found = subprocess.run(
        words, shell=True, cwd=folder, env=environment(DAP3D=" ".join(COMMAND), **variables),
        stdin=subprocess.DEVNULL, capture_output=True, text=True, timeout=300, check=False,
    )  # fmt: skip
    assert "Traceback" not in found.stderr
    return found


@pytest.mark.slow
@has_full
@pytest.mark.parametrize("option", ["", "--json"])
def test_a_result_is_saved_though_its_words_are_lost(scene_file, option):
    """Stdout on a full disk: the exit code is that of the run, stderr says what was lost."""
    folder = scene_file().parent
    found = in_shell(f"$DAP3D run fall.toml --t-end 0.1 {option} > /dev/full", folder)
    assert found.returncode == 0
    assert found.stderr.endswith(  # where it compiles for the first time, stderr has said so
        "cannot write to the standard output: No space left on device; the files of the command "
        "are saved\n"
    )
    assert dap.open(folder / "fall.nc").status == "done"


@pytest.mark.slow
@has_full
def test_a_full_stderr_ends_no_run(scene_file):
    folder = scene_file().parent
    found = in_shell("$DAP3D run fall.toml --t-end 0.1 2> /dev/full", folder)
    assert (found.returncode, "fall.nc written" in found.stdout) == (0, True)


def test_a_quiet_view_says_nothing(scene_file, capfd, monkeypatch):
    scene = scene_file()
    monkeypatch.chdir(scene.parent)
    assert main(["run", "fall.toml", "-q"]) == 0
    assert main(["view", "fall.nc", "-q"]) == 0
    assert capfd.readouterr() == ("", "")
    assert (scene.parent / "fall.html").exists()


@pytest.mark.parametrize("columns", ["0", ""])
def test_a_width_of_no_columns_is_none(scene_file, monkeypatch, capfd, columns):
    """Some services export COLUMNS=0; no output at all would be the answer to that."""
    scene = scene_file()
    monkeypatch.setenv("COLUMNS", columns)
    assert main(["check", str(scene)]) == 0
    assert "no mistakes found" in capfd.readouterr().out
    monkeypatch.setenv("COLUMNS", columns)
    assert main(["check", "not-there"]) == 2
    assert "no shipped model of that name" in capfd.readouterr().err


@pytest.mark.slow
def test_a_full_disk_is_named_and_what_was_computed_is_kept(scene_file):
    """On a disk of 2 MiB: a run that fills it, all that writes a file, and a cache there.
    What the run has written is a result, and the run goes on once there is room."""
    steps = 't_end = 600.0\nintegrator = "rk4"\nstep = 0.01'  # so many that rows come in chunks
    folder = scene_file(("t_end = 0.1", steps)).parent
    (folder / "disk").mkdir()
    mount = f"mount -t tmpfs -o size=2m tmpfs {folder / 'disk'}"
    if in_shell(f"unshare -m {mount}", folder).returncode:
        pytest.skip("needs a file system of its own")
    found = in_shell(
        f"""unshare -m sh -c '
        {mount}; $DAP3D run fall.toml --t-end 0.1 -o disk/small.nc -q; cd disk
        $DAP3D run ../fall.toml -o large.nc -q --checkpoint 0.01; echo run $?
        $DAP3D info large.nc.part --json > ../part.json; echo info $?
        dd if=/dev/zero of=filled bs=1k 2> /dev/null
        for words in "run ../fall.toml --t-end 0.1 -o a.nc -q" "post small.nc -o a.csv" \
            "view small.nc -o a.html"
        do $DAP3D $words; echo written $?; done
        DAP3D_CACHE_DIR=$PWD/cache $DAP3D plugins > /dev/null; echo cache $?
        rm -rf filled cache; mount -o remount,size=100m .; $DAP3D resume large.nc.checkpoint -q
        echo resumed $?; ls; cp large.nc ..'""",
        folder,
    )
    lines = found.stdout.split()
    assert lines[:4] == ["run", "3", "info", "0"], found
    assert lines[4:12] == ["written", "1"] * 3 + ["cache", "0"], found
    assert lines[12:] == ["resumed", "0", "large.nc", "small.nc"], found
    first, *others = found.stderr.splitlines()
    assert "what was computed until then is in large.nc.part" in first
    assert "dap3d resume large.nc.checkpoint continues the run" in first
    names = ("a.nc", "a.csv", "a.html")
    assert others == [f"cannot write {name}: No space left on device" for name in names]
    assert dap.open(folder / "large.nc").t[-1] == 600.0


@posix
@pytest.mark.parametrize(
    "words", ["info f.nc", "resume f.nc", "run f.nc", "resume /dev/null", "info /dev/zero"]
)
def test_a_pipe_or_a_device_is_not_waited_for(dap3d, refuse, words):
    os.mkfifo(dap3d.folder / "f.nc")
    assert "regular file" in refuse(*words.split())


@posix
def test_a_sweep_does_not_wait_for_a_part_that_is_a_pipe(scene_file, refuse):
    scene = scene_file()
    os.mkfifo(scene.parent / "s.nc.part")
    words = f"sweep {scene} --vary bodies.stone.mass=1:2:2 --keep stone.r.z --t-end 0.1 -o s.nc"
    assert "no regular file but a pipe" in refuse(*words.split(), "--resume")


@posix
def test_own_types_and_measured_data_are_no_pipes(scene_file, refuse, tmp_path):
    scene = scene_file()
    os.mkfifo(tmp_path / "plugin.py")
    assert main(["check", str(scene)]) == 0  # without --allow-code it is not opened
    os.mkfifo(tmp_path / "data.csv")
    with pytest.raises(dap.SceneError, match="no regular file but a pipe"):
        dap.fit(dap.load(scene), {"bodies.stone.mass": (0.5, 2.0)}, tmp_path / "data.csv")


@posix
def test_a_file_of_the_system_without_a_size_is_empty(refuse):
    """Some never end, or have nothing to give yet: /proc/kmsg would be waited for."""
    if not Path("/proc/self/status").exists():
        pytest.skip("no /proc")
    assert "empty" in refuse("info", "/proc/self/status")


@pytest.mark.slow
@posix
def test_a_link_of_the_system_stays_and_its_pipe_is_refused(scene_file):
    """As root, ``-o /dev/stdout --force`` replaced the system's link by a result."""
    folder = scene_file().parent
    (folder / "stdout.nc").symlink_to("/proc/self/fd/1")
    if not (folder / "stdout.nc").exists():
        pytest.skip("no /proc")
    piped = in_shell("$DAP3D run fall.toml --t-end 0.1 -o stdout.nc --force | cat", folder)
    assert "cannot write stdout.nc: it is no regular file but a pipe" in piped.stderr
    to_file = in_shell("$DAP3D run fall.toml --t-end 0.1 -o stdout.nc --force > r.nc", folder)
    assert to_file.returncode == 2
    assert "stdout.nc is the standard output of this command" in to_file.stderr
    assert (folder / "stdout.nc").is_symlink()
    assert sorted(p.name for p in folder.iterdir()) == ["fall.toml", "r.nc", "stdout.nc"]


@pytest.mark.slow
@posix
def test_a_current_folder_that_is_gone_is_named(tmp_path):
    found = in_shell("mkdir gone && cd gone && rmdir ../gone && $DAP3D check pen1", tmp_path)
    assert (found.returncode, found.stdout) == (2, "")
    assert found.stderr == "the current folder no longer exists; change to another one (cd)\n"


def test_ctrl_c_while_options_are_parsed_is_an_interruption(monkeypatch, capfd):
    """The words of a command line are parsed before a command can answer for itself."""

    def interrupted(*_):
        raise KeyboardInterrupt

    monkeypatch.setattr("dap3d_core.cli.framework.command.Command.parse_args", interrupted)
    assert main(["models"]) == 130
    assert capfd.readouterr().err.strip() == "interrupted"


linux = pytest.mark.skipif(not Path("/proc").exists(), reason="limits as Linux has them")


@pytest.mark.every(5)
@linux
@pytest.mark.parametrize("limit", [150_000, 200_000, 250_000, 300_000, 350_000])
def test_a_limit_on_memory_is_named(scene_file, limit):
    """Whatever library fails first: no type is to blame, and no Ctrl-C was pressed."""
    folder = scene_file().parent
    found = in_shell(f"ulimit -v {limit}; $DAP3D run fall.toml", folder)
    assert found.returncode == 1, found
    assert found.stderr == (
        f"there is not enough memory for this; it may take {limit:,} kB (ulimit -v)\n"
    )


@pytest.mark.slow
@linux
def test_a_limit_on_files_is_named_before_the_run(scene_file):
    """The unit of dash is 512 bytes, that of bash 1024: the figure says which bound it."""
    folder = scene_file().parent
    found = in_shell("ulimit -f 200; $DAP3D run fall.toml --t-end 2000 --dt 0.01", folder)
    assert found.returncode == 2, found
    assert "in a file, by its limit (ulimit -f)" in found.stderr
    assert "dt of at least" in found.stderr
    found = in_shell("ulimit -f 2000; $DAP3D run fall.toml --t-end 1 --dt 0.5", folder)
    assert found.returncode == 0, found


@pytest.mark.slow
@pytest.mark.parametrize("name", quickly(["nonsense", "../x", "x86-64-v2 ", "pentium4", "'"]))
def test_an_unknown_processor_is_one_sentence(scene_file, name):
    """LLVM would end the process; the type whose kernels come first is not blamed."""
    folder = scene_file().parent
    found = in_shell("$DAP3D run fall.toml -q", folder, DAP3D_CPU=name)
    assert found.returncode == 1
    assert "the environment variable DAP3D_CPU is" in found.stderr
    assert "unset it" in found.stderr
    assert not any(words in found.stderr for words in ("LLVM ERROR", "kernels", "unexpected"))
    assert not (folder / "fall.nc").exists()


@pytest.mark.slow
@pytest.mark.parametrize(
    "command", quickly(["plot fall.nc t -o a.png", "animate fall.nc -o a.gif"])
)
def test_an_unknown_backend_of_matplotlib_is_one_sentence(scene_file, dap3d, command):
    folder = scene_file().parent
    dap3d("run", "fall.toml", "-q")
    found = in_shell(f"$DAP3D {command}", folder, MPLBACKEND="nonsense")
    assert found.returncode == 1
    assert "the environment variable MPLBACKEND is 'nonsense'" in found.stderr
    assert "unexpected" not in found.stderr
