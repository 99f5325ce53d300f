"""An installed Chromium without a window, a network and a past; tests are skipped without one."""

import shutil
from contextlib import contextmanager

import pytest

NAMES = ("chromium", "chromium-browser", "google-chrome")
#: No sandbox: tests also run as root, in containers. WebGL is drawn in software.
FLAGS = (
    "--no-sandbox",
    "--disable-dev-shm-usage",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    "--use-gl=angle",
    "--use-angle=swiftshader",
    "--enable-unsafe-swiftshader",
)


@contextmanager
def browser():
    """A browser with an empty folder of its own, closed at the end."""
    playwright = pytest.importorskip(
        "playwright.sync_api", reason="playwright is not installed: pip install -e '.[test]'"
    )
    program = next((path for path in map(shutil.which, NAMES) if path), None)
    if program is None:
        pytest.skip("no Chromium is installed (on Debian: apt-get install chromium)")
    with playwright.sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=program, args=list(FLAGS))
        try:
            yield found
        finally:
            found.close()


class Opened:
    """A page of ``dap3d view`` that was opened from disk, with all that it complains about.

    Attributes:
        page: the page of playwright.
        complaints: messages of the console, uncaught errors, requests that leave the disk.
    """

    def __init__(self, found, path, *, width=1000, height=700, theme="light"):
        size = {"width": width, "height": height}
        self.context = found.new_context(viewport=size, offline=True, color_scheme=theme)
        self.page = self.context.new_page()
        self.complaints = []
        self.page.on("console", lambda m: self._console(m))
        self.page.on("pageerror", lambda error: self.complaints.append(str(error)))
        self.page.on("request", lambda r: self._request(r.url))
        self.page.goto(path.resolve().as_uri())
        self.page.wait_for_selector("html[data-ready]", state="attached", timeout=30_000)

    def _console(self, message):
        if message.type in ("error", "warning"):
            self.complaints.append(message.text)

    def _request(self, url):
        if not url.startswith(("file:", "data:")):
            self.complaints.append(f"asked for {url}")

    def run(self, script, *arguments):
        """What a script of the page gives, with one argument at most."""
        return self.page.evaluate(script, *arguments)

    def drawn(self):
        """Wait until what was changed before is in the picture: some frames of the browser."""
        frame = "new Promise(requestAnimationFrame)"
        self.page.evaluate(f"async () => {{ for (let k = 0; k < 4; k++) await {frame}; }}")

    def picture(self):
        """The page as it is, (height, width, 3) bytes."""
        import io

        import matplotlib.image
        import numpy as np

        image = matplotlib.image.imread(io.BytesIO(self.page.screenshot()), format="png")
        return np.round(255 * image[..., :3]).astype(int)

    def close(self):
        """Close it."""
        self.context.close()
