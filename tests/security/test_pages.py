"""Pages of ``dap3d view``: texts of a scene stay texts."""

import base64
import hashlib
import json
import re
from html.parser import HTMLParser

import attrs
import pytest
from support import hostile
from support.process import REPOSITORY

import dap3d_core as dap
from dap3d_core.result import EventRecord

VENDOR = REPOSITORY / "src" / "dap3d_core" / "view" / "vendor"
#: sha256 of the file that tools/vendor_three.py made of three.js 0.187.0.
THREE = "31660239cfb5a11844af16acf427bc8b9c44a97382149a9aca6882d314694854"


@pytest.fixture(scope="module")
def result(tmp_path_factory):
    """A result all of whose texts mean harm."""
    folder = hostile.write(tmp_path_factory.mktemp("scene"))
    run = dap.simulate(dap.load(folder))
    bad = "".join(hostile.NAMES) + hostile.ESCAPES
    event = EventRecord(name=bad, t=0.01, direction=1, kind="stop")
    record = attrs.evolve(
        run.record,
        notes=(*run.notes, bad, *hostile.NAMES),
        method=bad,
        integrator=bad,
        events=[event],
        settings={**run.settings, bad: bad, "__proto__": {"x": bad}},
        known_versions={bad: bad},
    )
    return dap.Result(run.summary, run.arrays, record, run._make_origin)


class Page(HTMLParser):
    """Tags, attributes and the texts of scripts and styles of a page."""

    def __init__(self, text):
        super().__init__(convert_charrefs=True)
        self.tags, self.raw = [], []
        self.inside = None
        self.feed(text)
        self.close()

    def handle_starttag(self, tag, attributes):
        self.tags.append((tag, dict(attributes)))
        if tag in ("script", "style"):
            self.inside = tag
            self.raw.append((tag, dict(attributes), ""))

    def handle_endtag(self, tag):
        if tag == self.inside:
            self.inside = None

    def handle_data(self, data):
        if self.inside:
            tag, attributes, text = self.raw[-1]
            self.raw[-1] = tag, attributes, text + data


def test_a_page_has_the_same_tags_whatever_the_texts(result):
    """Nothing of a scene becomes a tag, an attribute or a script."""
    scene = dap.Scene(name="plain")
    scene.add_body("stone", mass=1.0, Jp=(1.0, 1.0, 1.0))
    plain = dap.simulate(scene, t_end=0.02, dt=0.01, integrator="rk4", step=0.01)
    one, other = Page(dap.view(plain).html), Page(dap.view(result).html)

    def shape(page):
        return [(t, a) for t, a in page.tags]

    assert shape(one) == shape(other)
    assert [x for x in one.raw if x[1].get("id") != "data"] == [
        x for x in other.raw if x[1].get("id") != "data"
    ]
    data = next(text for _, a, text in other.raw if a.get("id") == "data")
    assert "<" not in data
    about = json.loads(data)["about"]
    assert about["title"] == hostile.ESCAPES
    assert set(hostile.NAMES) <= set(about["notes"])


def test_a_page_allows_its_own_scripts_alone(result):
    page = Page(dap.view(result).html)
    (policy,) = [a["content"] for t, a in page.tags if a.get("http-equiv")]
    rules = dict(rule.strip().split(" ", 1) for rule in policy.split(";"))
    assert rules["default-src"] == "'none'"
    assert rules["base-uri"] == rules["form-action"] == "'none'"
    assert "unsafe" not in policy
    assert "http" not in policy
    for tag, rule in (("script", "script-src"), ("style", "style-src")):
        texts = [x for t, a, x in page.raw if t == tag and a.get("type") != "application/json"]
        digests = (hashlib.sha256(x.encode()).digest() for x in texts)
        expected = {f"'sha256-{base64.b64encode(d).decode()}'" for d in digests}
        assert set(rules[rule].split()) == expected
    first = [t for t, _ in page.tags].index("script")
    assert [bool(a.get("http-equiv")) for _, a in page.tags].index(True) < first
    assert not [t for t, a in page.tags if {"src", "href", "style"} & set(a) and t != "link"]


def test_a_page_never_reads_text_as_html():
    """The program builds elements; no text of the data is ever parsed."""
    assets = REPOSITORY / "src" / "dap3d_core" / "view" / "assets"
    text = "".join(file.read_text() for file in (assets / "js").glob("*.js"))
    for word in ("innerHTML", "outerHTML", "insertAdjacentHTML", "document.write", "eval(",
                 "new Function", "DOMParser", "createContextualFragment", "fetch(",
                 "XMLHttpRequest", "import(", "localStorage", "location"):  # fmt: skip
        assert word not in text, word
    assert not re.search(r'setAttribute\("(on|src|href|style)', text)


def test_a_notebook_shuts_the_page_in(result):
    (frame,) = [a for t, a in Page(dap.view(result)._repr_html_()).tags if t == "iframe"]
    assert set(frame["sandbox"].split()) == {"allow-scripts", "allow-forms"}


def test_three_js_is_the_file_that_was_vendored():
    """With its licence and its version; a new one is a change of this test."""
    bundle = (VENDOR / "three.min.js").read_bytes()
    assert hashlib.sha256(bundle).hexdigest() == THREE
    version = (VENDOR / "VERSION").read_text()
    assert version.startswith("three.js 0.187.0,")
    assert bundle.startswith(b"/* three.js 0.187.0, MIT licence")
    licence = (VENDOR / "LICENSE").read_text()
    assert "The MIT License" in licence
    assert "three.js authors" in licence


@pytest.mark.slow
def test_a_browser_runs_nothing_of_a_hostile_result(result, tmp_path):
    """The real page in a real browser: nothing is run, asked for, or complained about."""
    from support.browser import Opened, browser

    quantities = [f"{name}.r.x" for name in hostile.NAMES]
    path = dap.view(result, *quantities).save(tmp_path / "bad <name> \u2028 'x'.html")
    with browser() as chromium:
        opened = Opened(chromium, path)
        opened.page.on("dialog", lambda d: opened.complaints.append(f"dialog {d.message}"))
        for tab in ("display", "run", "source", "plots"):
            opened.page.click(f"[data-tab={tab}]")
        opened.run("t => dap3d.seek(t)", 0.01)
        opened.drawn()
        assert opened.run(f"typeof window.{hostile.MARK}") == "undefined"
        assert opened.run("document.querySelectorAll('img, iframe, object, embed').length") == 0
        assert opened.run("Object.prototype.x") is None
        assert hostile.NAMES[0] in opened.page.inner_text("#tab-plots")
        assert opened.complaints == []
        run = f"""() => {{ const s = document.createElement('script');
            s.textContent = 'window.{hostile.MARK} = 1'; document.body.append(s); }}"""
        opened.run(run)  # as an injection would: the policy forbids it
        assert opened.run(f"typeof window.{hostile.MARK}") == "undefined"
        assert any("Content Security Policy" in c for c in opened.complaints)
        opened.close()
