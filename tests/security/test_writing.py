"""Where things are written: whole, where they were asked for; a link that is named stays one."""

import json
import os
import stat

import pytest
from support.internals import distrust
from support.matlab import SMALL
from support.matlab import write as write_matlab
from support.process import run

import dap3d_core as dap
from dap3d_core.cli import main
from dap3d_core.result import ResultError, check_target

pytestmark = pytest.mark.skipif(os.name != "posix", reason="links and owners as POSIX has them")


@pytest.fixture
def command(tmp_path, monkeypatch, capfd):
    monkeypatch.chdir(tmp_path)

    def call(*words):
        return main([*map(str, words)]), capfd.readouterr()

    return call


@pytest.mark.parametrize(
    ("mode", "words"),
    [(0o700, ""), (0o755, ""), (0o775, "others may write to it"), (0o1777, "others may write")],
)
def test_a_folder_is_trusted_unless_others_may_write_to_it(tmp_path, mode, words):
    folder = tmp_path / "cache"
    folder.mkdir()
    folder.chmod(mode)
    (tmp_path / "link").symlink_to(folder)
    for path in (folder, tmp_path / "link"):
        assert words in distrust(path)
        assert bool(words) is bool(distrust(path))


def test_a_folder_whose_parent_lets_everybody_rename_it_is_not(tmp_path):
    folder = tmp_path / "open" / "cache"
    folder.mkdir(parents=True, mode=0o700)
    folder.parent.chmod(0o777)
    assert "everybody may rename" in distrust(folder)
    folder.parent.chmod(0o1777)  # as that of temporary files
    assert distrust(folder) == ""


@pytest.mark.skipif(os.name != "posix" or os.geteuid() != 0, reason="only root gives files away")
def test_a_folder_or_a_link_of_another_user_is_not(tmp_path):
    folder = tmp_path / "cache"
    folder.mkdir(mode=0o700)
    (tmp_path / "link").symlink_to(folder)
    os.lchown(tmp_path / "link", 12345, 12345)
    assert "another user" in distrust(tmp_path / "link")
    os.chown(folder, 12345, 12345)
    assert "another user (uid 12345)" in distrust(folder)


@pytest.mark.slow
def test_another_folder_is_taken_and_a_note_says_so(tmp_path):
    """Nothing is written into the one that is not trusted."""
    cache, home = tmp_path / "cache", tmp_path / "home"
    cache.mkdir()
    cache.chmod(0o777)
    script = """
import dap3d_core as dap, json
from dap3d_core.kernels.runtime.cache import cache_folder
scene = dap.Scene(); scene.add_body("b", mass=1.0, Jp=(1.0, 1.0, 1.0))
print(json.dumps([str(cache_folder()), dap.compile(scene).notes]))
"""
    told = run(script, cache, XDG_CACHE_HOME=home, DAP3D_PLAIN=1)
    taken, notes = json.loads(told.splitlines()[-1])
    assert taken == str(home / "dap3d")
    assert stat.S_IMODE((home / "dap3d").stat().st_mode) == 0o700
    (note,) = [n for n in notes if str(cache) in n]
    assert note.startswith("for information: compiled code is not kept in")
    assert list(cache.iterdir()) == []


@pytest.mark.parametrize(
    "name", ["../evil", "/etc/x", "..", "a\\b", "a\nb", "-x", "\u202ea", "x" * 500]
)
def test_a_plugin_has_a_plain_name(command, tmp_path, name):
    code, said = command("new-plugin", "--", name)
    assert code == 2, said
    assert list(tmp_path.iterdir()) == []


def test_a_plugin_is_not_written_through_links(command, tmp_path):
    victim = tmp_path / "victim"
    victim.mkdir()
    (victim / "README.md").write_text("mine")
    folder = tmp_path / "package"
    folder.mkdir()
    (folder / "README.md").symlink_to(victim / "README.md")
    code, _ = command("new-plugin", "spring2", "--kind", "force", "-o", folder, "--force")
    assert code == 0
    assert (victim / "README.md").read_text() == "mine"
    assert not (folder / "README.md").is_symlink()

    other = tmp_path / "other"
    other.mkdir()
    (other / "src").symlink_to(victim)
    code, said = command("new-plugin", "spring2", "--kind", "force", "-o", other, "--force")
    assert code == 2
    assert "is a link out of the folder" in said.err
    assert [p.name for p in victim.iterdir()] == ["README.md"]


def test_an_imported_model_is_not_written_through_links(command, tmp_path):
    """Also not through links that lead nowhere yet: they would make a file there."""
    user = SMALL["inForces.m"].replace("Forces =", "F = Force_struct; F.type = 'user';\nForces =")
    model = write_matlab(tmp_path / "model", inForces=user.replace("[S1]", "[S1; F]"))
    (model / "user_force.m").write_text("Bodies(1)\n")
    for name in ("plugin.py", "scene.toml"):
        (tmp_path / name).symlink_to(tmp_path / "elsewhere")
        code, said = command("import-matlab", "model", "--stub")
        assert code == 2
        assert f"cannot write {name}: it is a link that leads nowhere" in " ".join(said.err.split())
        assert not (tmp_path / "elsewhere").exists()
        (tmp_path / name).unlink()
    (tmp_path / "plugin.py").symlink_to(tmp_path / "elsewhere")
    assert command("import-matlab", "model", "--stub", "--force")[0] == 0
    assert not (tmp_path / "elsewhere").exists()
    assert "UserForce" in (tmp_path / "plugin.py").read_text()


def test_a_result_is_written_where_a_link_leads(tmp_path):
    """A link that is named stays: /dev/stdout, which is the system's, is not replaced by a file."""
    scene = dap.Scene(name="fall")
    scene.add_body("stone", mass=1.0, Jp=(1.0, 1.0, 1.0))
    run = dap.simulate(scene, t_end=0.0)
    (tmp_path / "other").mkdir()
    (tmp_path / "other" / "mine").write_text("mine")
    (tmp_path / "run.nc").symlink_to(tmp_path / "other" / "mine")
    with pytest.raises(ResultError, match="mine: the file exists"):
        run.save(tmp_path / "run.nc")
    run.save(tmp_path / "run.nc", force=True)
    assert (tmp_path / "run.nc").readlink() == tmp_path / "other" / "mine"
    assert dap.open(tmp_path / "other" / "mine").t.tolist() == [0.0]
    assert [p.name for p in (tmp_path / "other").iterdir()] == ["mine"]

    (tmp_path / "gone.nc").symlink_to(tmp_path / "nowhere")
    with pytest.raises(ResultError, match="link that leads nowhere"):
        run.save(tmp_path / "gone.nc")
    run.save(tmp_path / "gone.nc", force=True)
    assert (tmp_path / "gone.nc").is_symlink()
    assert dap.open(tmp_path / "nowhere").t.tolist() == [0.0]
    # a name that somebody put there in advance is not taken for ours
    (tmp_path / "late.nc.part").symlink_to(tmp_path / "mine")
    run.save(tmp_path / "late.nc")
    assert not (tmp_path / "mine").exists()


def test_a_link_to_an_open_file_without_a_name_is_refused(tmp_path):
    """What /proc calls such a file is no path; a file of that name would be a new one."""
    with (tmp_path / "open").open("w") as file:
        link = tmp_path / "run.nc"
        link.symlink_to(f"/proc/{os.getpid()}/fd/{file.fileno()}")
        if not link.exists():
            pytest.skip("no /proc")
        (tmp_path / "open").unlink()
        with pytest.raises(ResultError, match="the file that it stands for has no name"):
            check_target(link, force=True)


def test_a_link_to_a_pipe_or_a_device_is_refused(tmp_path):
    os.mkfifo(tmp_path / "pipe")
    (tmp_path / "run.nc").symlink_to(tmp_path / "pipe")
    with pytest.raises(ResultError, match=r"run\.nc: it is no regular file but a pipe"):
        check_target(tmp_path / "run.nc", force=True)
    (tmp_path / "null.nc").symlink_to("/dev/null")
    with pytest.raises(ResultError, match="it is no regular file but a device"):
        check_target(tmp_path / "null.nc", force=True)


def test_a_scene_is_written_where_a_link_leads(tmp_path):
    scene = dap.Scene(name="fall")
    scene.add_body("stone", mass=1.0, Jp=(1.0, 1.0, 1.0))
    (tmp_path / "scene.toml").symlink_to(tmp_path / "other.toml")
    scene.save(tmp_path / "scene.toml")
    assert (tmp_path / "scene.toml").is_symlink()
    assert "stone" in (tmp_path / "other.toml").read_text()
