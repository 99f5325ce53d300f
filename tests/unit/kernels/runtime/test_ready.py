"""Ready-made objects of a wheel: for every target, and never used where anything is amiss."""

import sys

import numpy as np
import pytest
from support.internals import FLOAT, Array, Program, Signature, objects, ready, units
from support.plain import jit_is_on
from support.process import REPOSITORY

from dap3d_core.kernels import atan2, sin, sqrt

pytestmark = pytest.mark.skipif(not jit_is_on(), reason="nothing is compiled")
sys.path.append(str(REPOSITORY / "tools"))
from object_symbols import symbols_of  # noqa: E402
from ready_objects import pack_of  # noqa: E402

SIGNATURE = Signature((FLOAT, Array(FLOAT, 1)))
NAME = "curve-1"


def curve(x, out):
    out[0] = sin(x) + sqrt(2.0 * x) * atan2(x, 2.0)


def write(symbols):
    """As ``Unit`` asks for it."""
    program = Program()
    program.export(curve, SIGNATURE.arguments, symbols[0])
    return program.module(), ["None"]


def here():
    return ready.target_of(objects.processor().triple, objects.host_features())


def value(folder=None):
    """The curve at 0.7, and whether its code was made here."""
    units.compiled_units.clear()
    entry = units.Entry(
        units.Unit("curve-here", 1, write, folder, optimise=True, ready_name=NAME), 0, SIGNATURE
    )
    out = np.zeros(1)
    entry(0.7, out)
    return out[0], bool(units.compiled_units)


@pytest.fixture(scope="module")
def packs():
    """The files of all targets, with one unit."""
    return {
        name: pack_of(name, {NAME: write([f"{NAME.replace('-', '_')}_0"])})[0]
        for name in ready.TARGETS
    }


@pytest.fixture
def pack(tmp_path, monkeypatch, packs):
    """The file that this machine takes its objects from."""
    if here() is None:
        pytest.skip("objects are made for no such machine")
    monkeypatch.delenv("DAP3D_CPU", raising=False)
    monkeypatch.setattr(ready, "FOLDER", tmp_path / "package")
    path = tmp_path / "package" / f"{here()}.pack"
    path.parent.mkdir()
    path.write_bytes(packs[here()])
    ready._pack.cache_clear()
    yield path
    ready._pack.cache_clear()


def test_a_ready_made_object_is_run_and_has_the_same_bits(pack):
    found, is_made = value()
    assert not is_made
    pack.unlink()
    ready._pack.cache_clear()
    assert value() == (found, True)


@pytest.mark.parametrize("place", [0, 30, 200, -80, -1])
def test_a_damaged_file_is_noted_once_and_code_is_made_here(pack, tmp_path, place):
    """Wherever the damage is; what is made is kept, so that the next process need not look."""
    data = bytearray(pack.read_bytes())
    data[place] ^= 4
    pack.write_bytes(data)
    cache = tmp_path / "cache"
    cache.mkdir()
    with pytest.warns(RuntimeWarning, match=r"ready-made code was damaged .*\.pack"):
        expected, is_made = value(cache)
    assert is_made
    assert value(cache) == (expected, False)


@pytest.mark.parametrize("size", [0, 1, 5, 100, -1])
def test_a_file_that_is_cut_off_is_not_used(pack, size):
    pack.write_bytes(pack.read_bytes()[:size])
    with pytest.warns(RuntimeWarning, match="ready-made code was damaged"):
        assert value()[1]


def test_what_a_file_does_not_hold_and_code_of_another_processor_is_made_here(
    pack, packs, monkeypatch
):
    with monkeypatch.context() as named:
        named.setenv("DAP3D_CPU", "x86-64")
        assert value()[1]
    pack.write_bytes(ready.packed({"curve-2": (["None"], b"")}))
    assert value()[1]


V3 = ready.V3 | {"sse2"}


@pytest.mark.parametrize(("triple", "features", "target"), [
    ("x86_64-unknown-linux-gnu", V3, "linux-x86-64-v3"),
    ("x86_64-unknown-linux-gnu", V3 - {"fma"}, "linux-x86-64"),
    ("x86_64-conda-linux-gnu", V3, "linux-x86-64-v3"),
    ("aarch64-unknown-linux-musl", {"neon"}, "linux-arm64"),
    ("arm64-apple-darwin24.1.0", {"neon"}, "macos-arm64"),
    ("x86_64-apple-darwin20.6.0", V3, "macos-x86-64-v3"),
    ("x86_64-pc-windows-msvc", frozenset(), "windows-x86-64"),
    ("aarch64-pc-windows-msvc", {"neon"}, "windows-arm64"),
    ("i686-pc-windows-msvc", V3, None),
    ("x86_64-w64-windows-gnu", V3, None),
    ("riscv64-unknown-linux-gnu", frozenset(), None),
])  # fmt: skip
def test_the_target_of_a_machine(triple, features, target):
    """Nothing is run that a processor may not know."""
    assert ready.target_of(triple, frozenset(features)) == target
    assert target is None or target in ready.TARGETS


FORMATS = {"linux": "ELF", "macos": "Mach-O", "windows": "COFF"}


@pytest.mark.parametrize("target", ready.TARGETS)
def test_objects_of_every_target_take_only_what_their_system_has(target, packs, tmp_path):
    """Of the system's format; the function is there, and wants the C library's by their names."""
    path = tmp_path / "pack"
    path.write_bytes(packs[target])
    about, code = ready.Pack.of(path).read(NAME)
    assert about == ["None"]
    found = symbols_of(code)
    assert found.format == FORMATS[target.partition("-")[0]]
    assert found.defined >= {f"{NAME.replace('-', '_')}_0"}
    assert found.undefined - {"_fltused"} == {"sin", "atan2"}


def test_rounding_of_a_processor_without_instructions_for_it_is_the_c_librarys():
    """It is exact there as well; x86-64 has none, x86-64-v3 has."""
    text = "declare double @llvm.floor.f64(double)\ndefine double @f(double %x) {\n"
    text += "  %y = call double @llvm.floor.f64(double %x)\n  ret double %y\n}\n"
    assert pack_of("linux-x86-64", {"one": (text, [])})[1] == 1


def test_a_unit_that_wants_what_no_system_has_is_left_out():
    text = "declare double @unheard_of(double)\ndefine double @f(double %x) {\n"
    text += "  %y = call double @unheard_of(double %x)\n  ret double %y\n}\n"
    assert (
        pack_of("linux-x86-64", {"one": (text, []), NAME: write([f"{NAME.replace('-', '_')}_0"])})[
            1
        ]
        == 1
    )
