"""Coverage-guided fuzzing of the readers, from bytes: needs atheris (the extra "fuzz").
Started by run.py, one process for each target. Nothing that is read is run."""

import argparse
import json
import sys
import tempfile
import time
from collections.abc import Callable
from pathlib import Path

import attrs

ROOT = Path(__file__).parents[2]
sys.path[0] = str(ROOT / "tests")
FINDS = ROOT / "build" / "fuzz"
#: An input that computes for longer is a find, s; one that needs more memory, too, MiB.
SLOWEST, MOST_MEMORY = 20, 4096
#: Seconds between reports.
REPORT = 2.0
TOML_WORDS = (
    "[bodies.", "[joints.", "[forces.", "[functions.", "[points.", "[vectors.", "[vectors2.",
    "[shapes.",
    "[animation]", "[simulation]", "[scene]", "[[", "]]", " = ", "'''", "mass", "Jp", "sPp", "sp",
    "type",
    "P_i", "P_j", "a_i", "a_j", "body", "body_i", "ground", "ground.O", "ground.x", "rev", "sph",
    "weight",
    "ptp", "length", "coeff", "schema", "t_end", "dt", "nan", "inf", "1e308", "1e-320", "0xff",
    "{", "}",
    "1979-05-27", "\\u0000", "\\U0010ffff", "points", "limits", "hold", "method", "auto", "step",
)  # fmt: skip
MATLAB_WORDS = (
    "Body_struct", "Point_struct", "Joint_struct", "Force_struct", "Funct_struct", "Vector1_struct",
    "Vector2_struct", "Bodies", "Joints", "Points", "Forces", "zeros(", "ones(", "eye(", "diag(",
    "norm(", "sqrt(",
    "end", "function ", "global ", "...", ".*", "./", ".^", "'", "[", "]", "(", ")", ";", "1e308",
    "1e-320",
    "pi", ".mass", ".Jp", ".r", "(1)", " = ", "%", "if ", "for ", "while ", "@", "{", "}",
    "include_global",
)  # fmt: skip


def check_scene_bytes(data):
    """A file is refused with every mistake named, or is a scene whose text reads back equal."""
    from fuzz.acceptable import examine_lines, examine_text, file_of, read, strict

    with strict(SLOWEST), file_of(data) as path:
        examine_lines(data.decode("utf-8-sig", "ignore"))
        scene, _ = read(path)
        if scene is None:
            return "refused"
        examine_text(scene)
    return "read"


def check_matlab_bytes(data):
    """As ``fuzz.matlab.check_model``, of a file of bodies with any bytes in a small model."""
    from support.matlab import SMALL

    from fuzz.matlab import check_model

    return check_model(json.dumps({**SMALL, "inBodies.m": data.decode("latin-1")}).encode())


def scene_seeds():
    found = [p.read_bytes() for p in sorted((ROOT / "models").glob("*/scene.toml"))]
    return [data for data in found if len(data) < 8000]


def matlab_seeds():
    return [p.read_bytes() for p in sorted((ROOT / "tests" / "matlab").glob("*/inBodies.m"))]


@attrs.frozen
class Guided:
    """A target: what is checked, inputs to begin with, words, the modules that are watched."""

    check: Callable[[bytes], str]
    seeds: Callable[[], list[bytes]]
    words: tuple[str, ...]
    modules: tuple[str, ...]


GUIDED = {
    "scene-bytes": Guided(
        check_scene_bytes, scene_seeds, TOML_WORDS, ("tomllib", "dap3d_core.scene")
    ),
    "matlab-bytes": Guided(
        check_matlab_bytes, matlab_seeds, MATLAB_WORDS, ("dap3d_matlab", "dap3d_core.scene")
    ),
}


def work(name, number, seconds):
    """Fuzz one target; never returns."""
    import atheris

    target, folder = GUIDED[name], FINDS / name
    with atheris.instrument_imports(include=list(target.modules), enable_loader_override=False):
        pass
    corpus = Path(tempfile.mkdtemp(prefix="corpus-"))
    folder.mkdir(parents=True, exist_ok=True)
    for place, data in enumerate(target.seeds()):
        (corpus / f"seed{place}").write_bytes(data)
    dictionary = corpus.with_suffix(".dict")
    quoted = (word.replace("\\", "\\\\").replace('"', '\\"') for word in target.words)
    dictionary.write_text("".join(f'"{word}"\n' for word in quoted))
    (folder / "current").unlink(missing_ok=True)
    target.check(target.seeds()[0])  # what is imported late is no part of the first input
    counts, told = {}, time.monotonic()

    def one(data):
        nonlocal told
        (folder / "current").write_bytes(data)
        words = target.check(data)
        counts[words] = counts.get(words, 0) + 1
        if time.monotonic() > told + REPORT:
            print(json.dumps({"counts": counts, "found": []}), flush=True)
            counts.clear()
            told = time.monotonic()

    options = [f"-max_total_time={int(seconds)}", f"-seed={number}", "-max_len=8000",
    "-verbosity=0",
               f"-rss_limit_mb={MOST_MEMORY}", f"-dict={dictionary}",
               f"-artifact_prefix={folder}/"]  # fmt: skip
    atheris.Setup([sys.argv[0], *options, str(corpus)], one)
    atheris.Fuzz()


if __name__ == "__main__":
    parser = argparse.ArgumentParser()
    parser.add_argument("target", choices=GUIDED)
    parser.add_argument("--work", type=float)
    parser.add_argument("--seed", type=int)
    asked = parser.parse_args()
    work(asked.target, asked.seed, asked.work)
