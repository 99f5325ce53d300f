"""Draw the pictures of the engineering gallery.

    python tools/gallery_pictures.py [FOLDER]

Writes MODEL.png for each model of models/engineering into FOLDER, by default
docs/how-to/engineering-gallery.
"""

import sys
from pathlib import Path

import dap3d_core as dap

ROOT = Path(__file__).resolve().parents[1]
#: The instant that is drawn, s.
AT = {
    "crane": 1.5,
    "engine": 0.004,
    "excavator": 2.5,
    "motion_platform": 0.7,
    "planetary": 0.5,
    "quarter_car": 0.3,
    "rotor": 3.5,
    "two_link_arm": 0.3,
    "wiper": 0.5,
}
#: Of plane mechanisms with shapes, the direction from which they are drawn.
VIEW = {"crane": "x", "quarter_car": "x"}


def main(folder: Path) -> None:
    """Draw every model into a folder."""
    folder.mkdir(parents=True, exist_ok=True)
    for name, t in AT.items():
        picture = folder / f"{name}.png"
        view = VIEW.get(name)
        dap.animate(dap.simulate(name), picture, at=t, size=(400, 0), view=view, force=True)
        print(f"{picture} written")


if __name__ == "__main__":
    main(Path(sys.argv[1]) if len(sys.argv) > 1 else ROOT / "docs/how-to/engineering-gallery")
