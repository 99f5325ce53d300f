"""Draw the pictures of the README: the page of `dap3d view`, and films of a mechanism and a grasp.

    python tools/readme_pictures.py [FOLDER]

Writes view.png, leg.gif and gripper.gif into FOLDER, docs/pictures by default. The page is drawn by
an installed Chromium (on Debian: apt-get install chromium), which playwright drives.
"""

import shutil
import sys
import tempfile
from pathlib import Path

import dap3d_core as dap

ROOT = Path(__file__).resolve().parents[1]
#: WebGL is drawn in software; no sandbox, as in containers.
FLAGS = ["--no-sandbox", "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader"]


def draw_page(page: Path, picture: Path) -> None:
    """Draw a page of `dap3d view` as a browser shows it.

    Raises:
        SystemExit: no browser is installed.
    """
    from playwright.sync_api import sync_playwright

    program = shutil.which("chromium") or shutil.which("google-chrome")
    if program is None:
        sys.exit("no Chromium is installed (on Debian: apt-get install chromium)")
    with sync_playwright() as driver:
        browser = driver.chromium.launch(executable_path=program, args=FLAGS)
        tab = browser.new_page(viewport={"width": 1000, "height": 600})
        tab.goto(page.resolve().as_uri())
        tab.wait_for_selector("html[data-ready]", state="attached", timeout=30_000)
        tab.wait_for_timeout(1000)
        tab.screenshot(path=picture)
        browser.close()


def main(folder: Path) -> None:
    """Draw the pictures into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    with tempfile.TemporaryDirectory() as place:
        page = Path(place) / "page.html"
        dap.view(dap.simulate("fourbar3", dt=0.01)).save(page)
        draw_page(page, folder / "view.png")
    jansen, _ = dap.import_model(ROOT / "models" / "robots" / "jansen.xml")
    films = {
        "leg.gif": dap.simulate(jansen, t_end=4.0, dt=0.02),
        "gripper.gif": dap.simulate("gripper"),
    }
    for name, motion in films.items():
        dap.animate(motion, folder / name, size=(360, 320), fps=15, force=True)
    for name in ("view.png", *films):
        print(f"{folder / name} written")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs" / "pictures")
