"""Make src/dap3d_core/view/vendor/three.min.js: the part of three.js that `dap3d view` uses.

Needs node with npm, and a network; the build and the pages need neither. esbuild puts the names
below into one minified file that defines a global ``THREE``; the licence and the versions are laid
beside it.

    python tools/vendor_three.py [--three 0.187.0] [--esbuild 0.28.2]
"""

import argparse
import json
import shutil
import subprocess
import sys
import tempfile
from pathlib import Path

TARGET = Path(__file__).resolve().parent.parent / "src" / "dap3d_core" / "view" / "vendor"

#: What the page uses; anything else is left out of the file.
NAMES = (
    "BoxGeometry",
    "BufferAttribute",
    "BufferGeometry",
    "Color",
    "ConeGeometry",
    "CylinderGeometry",
    "DirectionalLight",
    "DoubleSide",
    "Float32BufferAttribute",
    "Group",
    "HemisphereLight",
    "InstancedMesh",
    "LineBasicMaterial",
    "LineSegments",
    "Matrix4",
    "Mesh",
    "MeshBasicMaterial",
    "MeshStandardMaterial",
    "PerspectiveCamera",
    "Quaternion",
    "Raycaster",
    "Scene",
    "SphereGeometry",
    "TorusGeometry",
    "Vector2",
    "Vector3",
    "WebGLRenderer",
    "REVISION",
)
ADDONS = {
    "OrbitControls": "controls/OrbitControls.js",
    "Line2": "lines/Line2.js",
    "LineGeometry": "lines/LineGeometry.js",
    "LineMaterial": "lines/LineMaterial.js",
}


def entry() -> str:
    """The module that esbuild starts from."""
    lines = [f"export {{ {', '.join(NAMES)} }} from 'three';"]
    lines += [f"export {{ {n} }} from 'three/addons/{path}';" for n, path in ADDONS.items()]
    return "\n".join(lines) + "\n"


def call(*words: str, folder: Path) -> str:
    """Run a program in a folder; what it printed."""
    done = subprocess.run(words, cwd=folder, check=True, capture_output=True, text=True)
    return done.stdout


def make(three: str, esbuild: str) -> None:
    """Fetch, bundle, and lay the three files into TARGET."""
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        (folder / "package.json").write_text("{}", encoding="utf-8")
        packages = (f"three@{three}", f"esbuild@{esbuild}")
        call("npm", "install", "--no-audit", "--no-fund", "--ignore-scripts", *packages,
             folder=folder)  # fmt: skip
        (folder / "entry.js").write_text(entry(), encoding="utf-8")
        bundle = ("--bundle", "--minify", "--format=iife", "--global-name=THREE")
        call(str(folder / "node_modules" / ".bin" / "esbuild"), "entry.js", *bundle,
             "--legal-comments=none", "--target=es2022", "--charset=ascii",
             "--outfile=three.min.js", folder=folder)  # fmt: skip
        package = folder / "node_modules" / "three"
        found = json.loads((package / "package.json").read_text(encoding="utf-8"))["version"]
        TARGET.mkdir(parents=True, exist_ok=True)
        banner = f"/* three.js {found}, MIT licence, https://threejs.org; see LICENSE */\n"
        text = (folder / "three.min.js").read_text(encoding="utf-8")
        (TARGET / "three.min.js").write_text(banner + text, encoding="utf-8")
        shutil.copyfile(package / "LICENSE", TARGET / "LICENSE")
        words = f"three.js {found}, bundled by esbuild {esbuild} with tools/vendor_three.py\n"
        (TARGET / "VERSION").write_text(words, encoding="utf-8")
    size = (TARGET / "three.min.js").stat().st_size
    print(f"{TARGET / 'three.min.js'}: three.js {found}, {size / 1000:.0f} kB")


if __name__ == "__main__":
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--three", default="0.187.0", help="version of three.js")
    parser.add_argument("--esbuild", default="0.28.2", help="version of esbuild")
    given = parser.parse_args()
    try:
        make(given.three, given.esbuild)
    except (OSError, subprocess.CalledProcessError) as error:
        sys.exit(f"cannot vendor three.js: {getattr(error, 'stderr', None) or error}")
