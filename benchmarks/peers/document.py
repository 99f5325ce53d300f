"""Tables and pictures of docs/reference/peers.md, made from results.json.

``python benchmarks/peers/document.py`` after ``make bench-peers``; tests compare the tables.
"""

import json
import math
import re
from pathlib import Path

import goals
import levels
import tables

HERE = Path(__file__).parent
DOCS = HERE.parents[1] / "docs" / "reference"
PAGE = DOCS / "peers.md"


def _ratio(value):
    return f"{value:.2g}" if value < 100 else f"{value:.0f}"


def ratios(cells, scenes):
    """Times of the others over ours to the three levels."""
    lines = ["| scene | " + " | ".join(levels.PEERS) + " |", "| --- " * 5 + "|"]
    for scene in scenes:
        if scene.startswith("ball"):
            continue
        ours = [levels.best(cells, scene, levels.OURS, level)[0] for level in levels.LEVELS]
        row = []
        for peer in levels.PEERS:
            found = [levels.best(cells, scene, peer, level)[0] for level in levels.LEVELS]
            row.append(" / ".join(_ratio(t / o) if math.isfinite(t) and math.isfinite(o) else "-"
                                  for t, o in zip(found, ours, strict=True)))  # fmt: skip
        lines.append(f"| {scene} | " + " | ".join(row) + " |")
    return lines


def missed(cells, scenes):
    """Goals that are not met, as a table; a sentence where there is none."""
    rows = [row for row in goals.table(cells, scenes) if row["met"] is False]
    if not rows:
        return ["All goals are met."]
    lines = ["| scene | error | against | our time over theirs | asked for |", "| --- " * 5 + "|"]
    for row in rows:
        ratio = "not reached" if row["ratio"] is None else f"{row['ratio']:.2g}"
        lines.append(f"| {row['scene']} | {row['level']:.0e} | {row['peer']} | {ratio} | "
                     f"at most {row['goal']:.2g} |")  # fmt: skip
    return lines


def price(cells, _):
    """What a force written in Python costs."""
    lines = ["| program | method | force | step / step without it |", "| --- " * 4 + "|"]
    for row in tables.price(cells):
        if row["force"] != "no force" and row["times_without"]:
            words = (row["program"], row["method"], row["force"], f"{row['times_without']:.2g}")
            lines.append(f"| {' | '.join(words)} |")
    return lines


def chosen(cells, scenes):
    """The method by which each program got there first."""
    lines = ["| scene | " + " | ".join(levels.PROGRAMS) + " |", "| --- " * 6 + "|"]
    for scene in scenes:
        if scene.startswith("ball"):
            continue
        row = []
        for program in levels.PROGRAMS:
            names = [levels.best(cells, scene, program, level)[1] for level in levels.LEVELS]
            row.append(", ".join(dict.fromkeys(name or "-" for name in names)))
        lines.append(f"| {scene} | " + " | ".join(row) + " |")
    return lines


def stored(cells, scenes, data):
    """What the stored figures are from."""
    passes = 1 + max(turn for turn, _, _ in data["done"])
    versions = ", ".join(f"{name} {number}" for name, number in data["versions"].items())
    return [
        f"Stored are {len(cells)} settings of {len(scenes)} scenes, {passes} passes: {versions}."
    ]


PARTS = {"ratios": ratios, "missed": missed, "price": price, "chosen": chosen}


def filled(text, data):
    """The page with its generated parts made anew."""
    cells = data["cells"]
    scenes = list(dict.fromkeys(cell["scene"] for cell in cells))
    made = {name: make(cells, scenes) for name, make in PARTS.items()}
    for name, rows in (made | {"stored": stored(cells, scenes, data)}).items():
        lines = "\n".join(rows)
        part = rf"(<!-- {name} -->\n).*?(<!-- end -->)"
        text = re.sub(part, lambda m, t=lines: f"{m[1]}{t}\n{m[2]}", text, flags=re.DOTALL)
    return text


def main():
    """Rewrite the page and draw."""
    import figures

    data = json.loads((HERE / "results.json").read_text())
    PAGE.write_text(filled(PAGE.read_text(), data))
    figures.work_precision(data["cells"], DOCS / "peers-precision.svg")
    figures.growth(data["cells"], DOCS / "peers-growth.svg")
    print(f"{PAGE} and its pictures are made")


if __name__ == "__main__":
    main()
