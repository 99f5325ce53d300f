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
import touching

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


def contacts(data):
    """Each method of time stepping: its coarsest step, that of the least error, time to 1e-6."""
    lines = ["| scene | program | steps, s | error, m | overlap, m | ms a step | s to 1e-6 |",
             "| --- " * 7 + "|"]  # fmt: skip
    for (scene, program, method), rows in touching.ladders(data["rows"]).items():
        best = min(rows, key=lambda r: math.inf if r["error"] is None else r["error"])
        shown = [rows[0]] if best is rows[0] else [rows[0], best]
        good = [r["seconds"] for r in rows if r["error"] is not None and r["error"] <= 1e-6]
        cells = [
            ["own" if r["step"] is None else f"{r['step']:.0e}" for r in shown],
            ["-" if r["error"] is None else f"{r['error']:.0e}" for r in shown],
            ["-" if r["overlap"] is None else f"{abs(r['overlap']):.0e}" for r in shown],
            ["-" if r["step"] is None else f"{1e3 * touching.seconds_a_step(r):.2g}"
             for r in shown],
            [f"{min(good):.2g}" if good else "-"],
        ]  # fmt: skip
        words = (scene, f"{program}, {method}", *(" / ".join(cell) for cell in cells))
        lines.append(f"| {' | '.join(words)} |")
    return lines


def contact_versions(data):
    """What the figures of contacts are from."""
    return [", ".join(f"{name} {number}" for name, number in data["versions"].items()) + "."]


PARTS = {"ratios": ratios, "missed": missed, "price": price, "chosen": chosen}


def filled(text, data):
    """The page with its generated parts made anew."""
    cells = data["cells"]
    scenes = list(dict.fromkeys(cell["scene"] for cell in cells))
    made = {name: make(cells, scenes) for name, make in PARTS.items()}
    made["stored"] = stored(cells, scenes, data)
    beside = json.loads(touching.RESULTS.read_text())
    made |= {"contacts": contacts(beside), "contact versions": contact_versions(beside)}
    for name, rows in made.items():
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
    glance = DOCS.parent / "pictures" / "peers.svg"
    figures.work_precision(data["cells"], glance, figures.GLANCE)
    figures.growth(data["cells"], DOCS / "peers-growth.svg")
    beside = json.loads(touching.RESULTS.read_text())
    figures.contacts(touching.ladders(beside["rows"]), DOCS / "peers-contacts.svg")
    print(f"{PAGE} and its pictures are made")


if __name__ == "__main__":
    main()
