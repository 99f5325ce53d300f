"""Scene files that are made to take memory or files that are not theirs.
Nests, long keys and long numbers: tests/unit/scene/files/test_read_toml.py."""

import os

import pytest
from support.internals import LARGEST_FILE

import dap3d_core as dap
from dap3d_core.scene import check

BODY = "[bodies.b]\nmass = 1.0\nJp = [1.0, 1.0, 1.0]\n"


def refusal(path, text=None):
    """What is said of a scene; without the limits it would take minutes."""
    if text is not None:
        path.write_text(text, encoding="utf-8")
    with pytest.raises(dap.SceneError) as caught:
        check(dap.load(path), dap.load_registry())
    return str(caught.value)


def test_very_many_unknown_keys(tmp_path):
    text = BODY + "".join(f"k{k} = 1\n" for k in range(20_000))
    assert "more mistakes" in refusal(tmp_path / "scene.toml", text)


def test_a_file_too_large_is_not_read(tmp_path):
    path = tmp_path / "scene.toml"
    with path.open("wb") as file:
        file.truncate(LARGEST_FILE + 1)
    assert "at most 64 MiB" in refusal(path)


@pytest.mark.skipif(os.name != "posix", reason="no such files")
def test_what_is_no_file_is_not_opened(tmp_path):
    """A pipe would wait for ever, a device never end."""
    os.mkfifo(tmp_path / "scene.toml")
    assert "not a regular file" in refusal(tmp_path)
    (tmp_path / "zero.toml").symlink_to("/dev/zero")
    assert "not a regular file" in refusal(tmp_path / "zero.toml")
    for name in ("https://example.org/scene.toml", "file:///etc/passwd", "a\0b"):
        with pytest.raises(dap.SceneError):
            dap.load(name)


@pytest.mark.slow
def test_very_many_names_are_refused_before_the_memory_is_gone(tmp_path):
    """Very many bodies that are not right: no failure but mistakes."""
    resource = pytest.importorskip("resource")
    count = 37_500
    text = "".join(f"[bodies.k{k}]\nmass = -1\n" for k in range(count))
    (tmp_path / "scene.toml").write_text(text)
    most = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    with pytest.raises(dap.SceneError) as caught:
        check(dap.load(tmp_path / "scene.toml"), dap.load_registry())
    assert len(caught.value.mistakes) == count
    assert resource.getrusage(resource.RUSAGE_SELF).ru_maxrss < most + 2**18  # kB: 7 kB a body
