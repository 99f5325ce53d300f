"""Draw the pictures of the galleries of engineering and contact.

    python tools/gallery_pictures.py [MODEL...]

Writes docs/how-to/GROUP-gallery/MODEL.png, by default of every model of both.
"""

import sys
from pathlib import Path

import dap3d_core as dap

DOCS = Path(__file__).resolve().parents[1] / "docs/how-to"
#: The instant that is drawn, s.
AT = {
    "cradle": 0.5,
    "domino_row": 0.24,
    "gripper": 0.8,
    "hand": 1.0,
    "humanoid": 2.0,
    "marble_run": 0.9,
    "quadruped": 0.4,
    "sphere_box": 0.08,
    "walker": 0.125,
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
VIEW = {
    "crane": "x",
    "quarter_car": "x",
    "cradle": "y",
    "domino_row": "y",
    "gripper": "y",
    "marble_run": "y",
}


def main(names: list[str]) -> None:
    """Draw models, each into the folder of its gallery."""
    for name in names or AT:
        group = dap.shipped_models()[name].parent.name
        picture = DOCS / f"{group}-gallery" / f"{name}.png"
        picture.parent.mkdir(exist_ok=True)
        view = VIEW.get(name)
        dap.animate(dap.simulate(name), picture, at=AT[name], size=(400, 0), view=view, force=True)
        print(f"{picture} written")


if __name__ == "__main__":
    main(sys.argv[1:])
