"""Tables of the page on hard cases that are not of one row a case: chaos, flips, hinges."""


def table(heads, rows):
    """Heads and rows of words as Markdown."""
    lines = [heads, ["---"] * len(heads), *rows]
    return "".join(f"| {' | '.join(word.replace('|', BAR) for word in line)} |\n" for line in lines)


#: A bar that is no border.
BAR = "\\|"


def _time(t):
    return "not lost" if t is None else f"{t:g}"


def chaos_table(kept):
    """A row for each run of the double pendulum."""
    rows = [
        (
            row["run"], str(row["steps"]), _time(row["meaningless_from"]), _time(row["parted"]),
            "no" if row["tenfold"] is None else f"{row['tenfold']:.2g}",
            f"{row['least_ratio']:.1f} / {row['median_ratio']:.1f} / {row['largest_ratio']:.0f}",
            f"{row['energy']:.1e}",
        )
        for row in kept if "tenfold" in row
    ]  # fmt: skip
    heads = ("settings", "steps", "meaningless_from, s", "true error beyond 1e-3, s",
             "tenfold in, s", "estimate / error: least, median, largest", "energy")  # fmt: skip
    return table(heads, rows)


def flips_table(kept):
    """A row for each run of the free body that turns over."""
    rows = [
        (
            row["run"], str(row["steps"]), str(row["flips"]), f"{row['first_late']:.1e}",
            f"{row['last_late']:.1e}", f"{row['late_power']:.1f}",
            *(f"{row[name]:.1e}" for name in ("energy", "L", "p")),
        )
        for row in kept if "last_late" in row
    ]  # fmt: skip
    heads = ("settings", "steps", "flips", "first off by, s", "last off by, s", "power of t",
             "energy", "L", "||p| - 1|")  # fmt: skip
    return table(heads, rows)


def hinges_table(kept):
    """A row for each kind of door: what becomes of it, by ranges of the misalignment."""
    rows = [row for row in kept if "size" in row]
    lines = []
    for run in dict.fromkeys(row["run"] for row in rows):
        doors = [row for row in rows if row["run"] == run]
        ranges = [_range(doors, name) for name in OUTCOMES]
        swung = [row for row in doors if row["outcome"] in OUTCOMES[:2]]
        standing = [row for row in doors if row["outcome"] == OUTCOMES[3]]
        lines.append((
            run, *ranges, f"{max(row['off'] for row in swung):.0e}",
            f"{max(row['force'] for row in swung):.0f} N, "
            f"{max(row['moment'] for row in swung):.0f} N m",
            ", ".join(f"{row['moment']:.1g}" for row in standing) or "-",
        ))  # fmt: skip
    heads = ("door", *OUTCOMES, "off, m", "largest reactions, swinging",
             "moments, standing, N m")  # fmt: skip
    return table(heads, lines)


#: As in hard/hinges.py.
OUTCOMES = ("swings", "swings, said to be open", "refused", "stands still")


def _range(doors, outcome):
    sizes = [row["size"] for row in doors if row["outcome"] == outcome]
    if not sizes:
        return "-"
    return f"{min(sizes):g}" if len(sizes) == 1 else f"{min(sizes):g} ... {max(sizes):g}"
