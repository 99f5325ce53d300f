"""Reading a scene: what is found under a name, and one clear error for every file that is none."""

import os

import pytest
from support.internals import group_of

import dap3d_core as dap

TEXT = '[scene]\nname = "small"\n\n[bodies.a]\nmass = 1.0\nJp = [1.0, 1.0, 1.0]\n'


def refused(source):
    with pytest.raises(dap.SceneError) as caught:
        dap.load(source)
    assert len(caught.value.mistakes) == 1
    return str(caught.value)


def test_a_folder_and_a_file_are_read(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(TEXT)
    for source in (tmp_path, str(tmp_path), file, str(file), os.fsencode(file)):
        scene = dap.load(source)
        assert scene.name == "small"
        assert (scene.path, scene.folder) == (file, tmp_path)


@pytest.mark.parametrize("name", ["a b.toml", 'it\'s "q".toml', "-o.toml", "a\nb.toml", "ü.txt"])
def test_odd_file_names_are_read(tmp_path, monkeypatch, name):
    (tmp_path / name).write_text(TEXT)
    monkeypatch.chdir(tmp_path)
    assert dap.load(name).name == "small"


def test_shipped_models_are_read_by_name(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    models = dap.shipped_models()
    assert models, "there are some"
    for name, folder in models.items():
        assert dap.load(name).path == folder / "scene.toml"


def test_models_of_a_group_are_read_with_and_without_it(monkeypatch, tmp_path):
    monkeypatch.chdir(tmp_path)
    models = dap.shipped_models()
    groups = [group_of(folder) for folder in models.values()]
    assert groups == sorted(groups), "models without a group come first"
    assert set(groups) == {"", "benchmarks", "contact", "engineering"}
    assert dap.load("benchmarks/A04").path == dap.load("A04").path == models["A04"] / "scene.toml"
    for name in ("benchmarks/pen1", "models/pen1", "other/A04", "/A04", "/pen1", "benchmarks"):
        refused(name)


def test_a_folder_of_the_users_own_goes_before_a_shipped_model_and_says_so(monkeypatch, tmp_path):
    name = next(iter(dap.shipped_models()))
    monkeypatch.chdir(tmp_path)
    (tmp_path / name).mkdir()
    assert dap.load(name).name != "small", "a folder without a scene is not meant"
    (tmp_path / name / "scene.toml").write_text(TEXT)
    scene = dap.load(name)
    assert scene.name == "small"
    assert "also the name of a shipped model" in scene.notes[0]


def test_a_missing_file_names_the_nearest_in_its_folder(tmp_path, monkeypatch):
    (tmp_path / "derrick.toml").write_text(TEXT)
    near = str(tmp_path / "derrick.toml")
    assert f"did you mean {near!r}?" in refused(tmp_path / "derrick.tml")
    monkeypatch.chdir(tmp_path)
    assert "did you mean 'derrick.toml'?" in refused("derrick")


@pytest.mark.parametrize(
    ("source", "words"),
    [
        ("", "empty"),
        ("https://example.com/scene.toml", "a URL cannot be loaded"),
        ("x" * 300, "too long"),
        ("a\0b", "there is no file"),
        ("no/such/file.toml", "there is no file"),
        ("/dev/null", "not a regular file"),
        ("/dev/zero", "not a regular file"),
    ],
)
def test_what_is_no_scene_is_refused(source, words):
    assert words in refused(source)


def test_a_folder_without_a_scene_names_what_it_holds(tmp_path):
    assert "no scene.toml" in refused(tmp_path)
    (tmp_path / "four.toml").write_text(TEXT)
    assert "it holds four.toml" in refused(tmp_path)
    assert "there is no file" in refused(tmp_path / "four.toml" / "scene.toml")
    (tmp_path / "scene.toml").mkdir()
    assert "not a regular file" in refused(tmp_path)
    (tmp_path / "a.toml").symlink_to(tmp_path / "a.toml")
    assert "cannot be read" in refused(tmp_path / "a.toml")  # a loop of links
    (tmp_path / "inBodies.m").write_text("B1 = Body_struct;\nsystem('true');\n")
    assert "import-matlab" in refused(tmp_path / "inBodies.m")


def test_a_file_that_may_not_be_read_is_refused(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_text(TEXT)
    file.chmod(0)
    if os.access(file, os.R_OK):
        pytest.skip("this user may read everything")
    assert "Permission denied" in refused(file)


BAD_CONTENT = {
    "image": (b"\x89PNG\r\n\x1a\n\0\0\0\rIHDR", ["NUL bytes"]),
    "result": (b"\x89HDF\r\n\x1a\n\0", ["NUL bytes", "dap3d info describes it"]),
    "NUL": (TEXT.encode() + b"x = '\0'", ["NUL bytes"]),
    "UTF-16": (TEXT.encode("utf-16"), ["NUL bytes"]),
    "latin-1": (TEXT.encode() + "# ü".encode("latin-1"), [":7:", "0xfc", "UTF-8"]),
    "truncated list": (TEXT.encode()[:-6], [":6:", "not valid TOML"]),
    "truncated text": (b'[scene]\nname = "sm', ["not valid TOML", "end of the file"]),
    "key twice": (TEXT.encode() + b"mass = 2.0\n", [":7:", "mass is there twice, first in line 5"]),
    "table twice": (
        TEXT.encode() + b"[bodies.a]\n",
        [":7:", "bodies.a is there twice, first in line 4"],
    ),
    "no value": (b"[scene]\nname =\n", [":2:", "line 2, column 7"]),
    "word": (b"[scene]\nname = small\n", [":2:", "column 8", "in quotes"]),
    "deep": (b"x = " + b"[" * 100_000, ["nested too deeply"]),
    "inline key twice": (b"x = {a = 1, a = 2}\n", [":1:", "'a' at line 1, column 1"]),
    "long integer": (b"\nx = " + b"9" * 10_000, [":2:", "a number of thousands of digits"]),
    "old line ends": (TEXT.replace("\n", "\r").encode(), ["not valid TOML"]),
    "decimal comma": (b"[scene]\nx = 1,5\n", [":2:", "decimal point"]),
    "no digit": (b"[scene]\nx = .5\n", [":2:", "digits on both sides"]),
    "no digit in a list": (b"[scene]\nx = [1., 2.5]\n", [":2:", "digits on both sides"]),
    "no commas": (b"[scene]\nx = [1 -2.5 3]\n", [":2:", "commas between"]),
    "semicolons": (b"[scene]\nx = [0, 1; 2, 3]\n", [":2:", "commas between"]),
    "tuple": (b"[scene]\nx = (1, 2)\n", [":2:", "square brackets"]),
    "unit": (b"[scene]\nx = 10 mm  # long\n", [":2:", "SI units"]),
    "word in a list": (b"[scene]\nx = [true, False]\n", [":2:", "true or false"]),
    "NaN": (b"[scene]\nx = NaN\n", [":2:", "finite numbers"]),
    "program": (b"function inBodies\nsystem('rm -rf /tmp/x')\n", [":1:", "not valid TOML"]),
}


@pytest.mark.parametrize(("content", "words"), BAD_CONTENT.values(), ids=BAD_CONTENT)
def test_a_file_that_is_not_toml_is_refused_with_its_place(tmp_path, content, words):
    file = tmp_path / "scene.toml"
    file.write_bytes(content)
    said = refused(file)
    for word in [str(file), *words]:
        assert word in said


def test_a_byte_order_mark_and_mixed_line_ends_are_read(tmp_path):
    file = tmp_path / "scene.toml"
    file.write_bytes(b"\xef\xbb\xbf" + TEXT.replace("\n", "\r\n", 3).encode())
    assert dap.load(file).bodies["a"].mass == 1.0


@pytest.mark.parametrize("depth", [60, 20_000])
@pytest.mark.parametrize(
    "nested",
    [
        lambda n: "joints.a" + ".a" * n + " = 1",
        lambda n: "[joints.a" + " . 'a'" * n + "]",
        lambda n: '[joints.j]\ntype = "sph"\nP_i = ' + "[" * n + "]" * n,
        lambda n: '[joints.j]\ntype = "sph"\nP_i = ' + "{a = " * n + "1" + "}" * n,
    ],
    ids=["dotted key", "dotted table", "lists", "inline tables"],
)
def test_deep_nesting_is_refused_at_once(tmp_path, nested, depth):
    """Keys of 20 000 names took tomllib a minute, those of 500 more levels than Python has."""
    file = tmp_path / "scene.toml"
    file.write_text(nested(depth))
    assert any(w in refused(file) for w in ("more than 32 parts", "nested too deeply"))


def test_what_looks_like_a_long_key_is_read_quickly(tmp_path):
    """The search for long keys takes a time that grows with the file, whatever stands in it."""
    file = tmp_path / "scene.toml"
    words = "a" * 1_000_000 + '"' * 100_000 + "0.1, " * 100_000 + "a.b.c " * 100_000 + "." * 999
    file.write_text(TEXT.replace("\n", f"\ndescription = '{words}'\n", 1))
    assert dap.load(file).description == words
