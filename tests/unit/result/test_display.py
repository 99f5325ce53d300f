"""A result in a notebook: picture, facts, ledger and notes; its texts are escaped."""

import base64
import re
import sys

import pytest
from support.results import circling
from unit.scene.test_display import HOSTILE, TAGS, Seen

import dap3d_core as dap


@pytest.fixture(scope="module")
def result():
    return circling(nt=5)[0]


def test_a_notebook_shows_the_mechanism_and_the_ledger(result):
    page = result._repr_html_()
    (image,) = re.findall(r'src="data:image/png;base64,([^"]+)"', page)
    assert base64.b64decode(image).startswith(b"\x89PNG")
    shown = Seen(page)
    assert shown.tags <= {*TAGS, "img", "ul", "li"}
    assert repr(result)[1:-1] in shown.text
    for name, entry in result.ledger.items():
        assert f"{name}{entry.value:.1e}" in shown.text


def test_without_matplotlib_there_are_the_tables(result, monkeypatch):
    monkeypatch.setitem(sys.modules, "dap3d_core.plot", None)
    page = result._repr_html_()
    assert "<img" not in page
    assert page.count("<table>") == 2


def test_names_and_notes_are_text_not_tags():
    scene = dap.Scene(name=HOSTILE)
    scene.add_body("b")
    still = dap.simulate(scene, t_end=0.0)
    still.note(HOSTILE)
    shown = Seen(still._repr_html_())
    assert "onerror" not in shown.names
    assert shown.text.count("onerror") == 2
