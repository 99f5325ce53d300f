"""What is printed of texts from elsewhere: they neither move a cursor nor forge a line."""

import csv
import re

import pytest
from support import hostile

import dap3d_core as dap
from dap3d_core.cli import main

#: A line that only the program itself may write.
FORGED = re.compile(r"^no mistakes found", re.MULTILINE)


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """A hostile scene and its result."""
    folder = hostile.write(tmp_path_factory.mktemp("bad") / "model")
    dap.simulate(dap.load(folder)).save(folder / "run.nc")
    return folder


@pytest.fixture
def say(folder, monkeypatch, capfd):
    """Run a command in the folder: exit code, stdout, stderr, of which nothing may act."""
    monkeypatch.chdir(folder)

    def call(*words):
        code = main([*words])
        out, err = capfd.readouterr()
        acting = {c for c in out + err if not c.isprintable() and c != "\n"}
        assert not acting, (words, acting)
        assert "Traceback" not in err
        assert "unexpected" not in err
        return code, out, err

    return call


def test_every_command_prints_plain_text(say, tmp_path):
    name = hostile.NAMES[0]
    for words in (
        ("check", "."), ("run", ".", "-o", "again.nc", "--force"),
        ("info", "run.nc"), ("info", "run.nc", "--json"),
        ("plot", "run.nc", f"{name}.r.x", "-o", str(tmp_path / "a.svg")),
        ("view", "run.nc", "-o", str(tmp_path / "a.html")),
        ("post", "run.nc", "-o", str(tmp_path / "a.csv")),
    ):  # fmt: skip
        code, out, _ = say(*words)
        assert code == 0, words
        assert len(FORGED.findall(out)) == (words == ("check", ".")), words
    for words in (("plot", "run.nc", "x\x1b[31m.r"), ("info", "no\x1b[31m\nfile.nc"),
                  ("run", "no\x1b]0;x\x07\u202e"), ("describe", "\x1b[2J"),
                  ("\x1b[31mcommand",), ("run", ".", "--method", "\x1b[31m"),
                  ("run", ".", "--\x1b[31m", "1"),
                  ("plot", "run.nc", "-o", "\x1b[31m")):  # fmt: skip
        code, _, err = say(*words)
        assert code == 2, words
        assert err
    svg = (tmp_path / "a.svg").read_text()
    assert "<script" not in svg
    assert "\x1b" not in svg


@pytest.mark.slow
def test_a_film_has_no_controls_in_its_title(say, tmp_path):
    assert say("animate", "run.nc", "-o", str(tmp_path / "a.gif"), "--fps", "1")[0] == 0


def test_mistakes_of_a_scene_are_plain_text(say, tmp_path):
    bad = hostile.quoted(hostile.ESCAPES)
    lines = [f"[bodies.{bad}]", f"mass = {bad}", f"{bad} = 1", f"[joints.J]\ntype = {bad}",
             f"[{bad}]", "[points.P]", f"body = {bad}", f"[functions.{bad}]",
             f"type = {bad}"]  # fmt: skip
    folder = hostile.write(tmp_path / "x\x1b[31m\nno mistakes found", "\n".join(lines))
    for more in ((), ("--json",)):
        code, out, err = say("check", str(folder), *more)
        assert code == 2
        assert not FORGED.search(out)
        assert not FORGED.search(err)


def test_warnings_of_libraries_are_plain_text(say, monkeypatch):
    import warnings

    def warn(folder):
        warnings.warn("glyph \x1b[31m\nno mistakes found", stacklevel=1)
        return {"group": "", "bodies": 0, "joints": {}, "description": "", "own_types": False}

    monkeypatch.setattr("dap3d_core.cli.commands.models._data", warn)
    with warnings.catch_warnings():
        warnings.simplefilter("always")
        code, _, err = say("models")
    assert code == 0
    assert "warning: glyph" in err
    assert not FORGED.search(err)


def test_markup_of_rich_is_text(say):
    _, out, _ = say("check", ".")
    assert f"[red]{hostile.MARK}[/red]" in " ".join(out.split())


def test_a_table_begins_no_cell_with_a_formula(say, tmp_path):
    """A spreadsheet works out what begins with = + - @."""
    say("post", "run.nc", "-o", str(tmp_path / "a.csv"))
    with (tmp_path / "a.csv").open(newline="", encoding="utf-8") as file:
        heading = next(csv.reader(file))
    assert not [cell for cell in heading if cell.startswith(("=", "+", "-", "@", "\t", "\r"))]
    assert [cell for cell in heading if cell.startswith("'=cmd")]
