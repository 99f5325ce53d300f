"""The site is built from an empty folder, without a warning and without a network."""

import re
import subprocess
import sys

import pytest
from support.process import REPOSITORY, environment

pytestmark = pytest.mark.slow


#: By theme, the models whose pages are run as they are built: one of each group, and all of them.
RUN = {"basic": "(ball1|A05|cradle|wiper)", "furo": ""}


@pytest.fixture(scope="module", params=["basic", pytest.param("furo", marks=pytest.mark.long)])
def site(request, tmp_path_factory):
    """The folder of the built site; its own theme and all models take as long as all the rest."""
    for package in ("sphinx", "myst_parser", "furo", "sphinx_gallery", "latex2mathml"):
        pytest.importorskip(package, reason=f"{package} is not installed: pip install '.[docs]'")
    folder = tmp_path_factory.mktemp("site")
    source, built = folder / "source", folder / request.param
    source.mkdir()
    words = ["sphinx", "-W", "--keep-going", "-q", "-c", REPOSITORY / "docs"]
    words += ["-D", f"html_theme={request.param}"]
    words += ["-D", f"sphinx_gallery_conf.filename_pattern={RUN[request.param]}", source, built]
    nowhere = dict.fromkeys(("http_proxy", "https_proxy"), "http://127.0.0.1:9")
    done = subprocess.run(
        [sys.executable, "-m", *map(str, words)],
        cwd=folder,
        env=environment(MPLBACKEND="Agg", DAP3D_SITE_FPS=1, **nowhere),
        capture_output=True,
        text=True,
        timeout=600,
    )
    assert done.returncode == 0, done.stdout + done.stderr
    return built


def test_every_model_has_its_picture(site):
    """Drawn by the build; its page shows it, and the text of the model's own page."""
    for scene in (REPOSITORY / "models").rglob("scene.toml"):
        name = scene.parent.name
        (page,) = (site / "models").rglob(f"{name}.html")
        text = page.read_text()
        assert f"dap3d run {name}" in text
        if not re.search(RUN[site.name], name):
            continue
        assert (site / "_images" / f"sphx_glr_{name}_001.png").stat().st_size > 3000
        assert f"sphx_glr_{name}_001.png" in text
        assert '<img src="data:image/gif;base64,' in text  # and its motion


def test_what_the_sources_say_is_shown(site):
    """A type's fields, a command's option, a function's signature, a formula."""
    disk = (site / "reference" / "joints" / "disk.html").read_text()
    assert "directions without slip" in disk
    assert "no longitudinal slip" in disk
    assert "--target-error" in (site / "reference" / "command-line.html").read_text()
    python = (site / "reference" / "python.html").read_text()
    assert 'id="dap3d_core.simulate"' in python
    assert 'id="dap3d_core.Scene.add_body"' in python
    coordinates = (site / "concepts" / "coordinates.html").read_text()
    assert "<math" in coordinates
    assert "$" not in re.sub(r"<pre>.*?</pre>", "", coordinates, flags=re.DOTALL)


def test_pages_need_nothing_from_elsewhere(site):
    """No script, style or picture comes from another place than the site."""
    for page in site.rglob("*.html"):
        found = re.findall(
            r'<(?:script|link|img)[^>]+(?:src|href)="(https?:[^"]+)"', page.read_text()
        )
        assert not found, page
