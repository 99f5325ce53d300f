"""Symbols of object files: ELF, COFF and Mach-O of 64 bits, as LLVM writes them."""

import struct
from typing import NamedTuple


class Symbols(NamedTuple):
    """Global symbols of an object file."""

    format: str
    defined: frozenset[str]
    undefined: frozenset[str]


def symbols_of(code: bytes) -> Symbols:
    """The symbol table of an object file.

    Raises:
        ValueError: the file has none of the three formats.
    """
    if code[:5] == b"\x7fELF\x02":
        return _elf(code)
    if code[:4] == b"\xcf\xfa\xed\xfe":
        return _mach_o(code)
    if code[:2] in (b"\x64\x86", b"\x64\xaa"):
        return _coff(code)
    raise ValueError(f"an object file cannot begin with {code[:5]!r}")


def _text(code: bytes, at: int) -> str:
    return code[at : code.index(b"\0", at)].decode()


def _elf(code: bytes) -> Symbols:
    (first,) = struct.unpack_from("<Q", code, 0x28)
    size, count = struct.unpack_from("<HH", code, 0x3A)
    sections = [struct.unpack_from("<IIQQQQII", code, first + size * k) for k in range(count)]
    found: dict[bool, set[str]] = {True: set(), False: set()}
    for _, kind, _, _, offset, length, link, _ in sections:
        if kind == 2:  # SHT_SYMTAB
            for at in range(offset, offset + length, 24):
                name, info, _, section = struct.unpack_from("<IBBH", code, at)
                if info >> 4 and name:  # not local
                    found[section != 0].add(_text(code, sections[link][4] + name))
    return Symbols("ELF", frozenset(found[True]), frozenset(found[False]))


def _coff(code: bytes) -> Symbols:
    first, count = struct.unpack_from("<II", code, 8)
    strings, k = first + 18 * count, 0
    found: dict[bool, set[str]] = {True: set(), False: set()}
    while k < count:
        at = first + 18 * k
        short, _, section, _, kind, more = struct.unpack_from("<8sIhHBB", code, at)
        if kind == 2:  # IMAGE_SYM_CLASS_EXTERNAL
            zeros, offset = struct.unpack("<II", short)
            name = _text(code, strings + offset) if not zeros else short.rstrip(b"\0").decode()
            found[section != 0].add(name)
        k += 1 + more
    return Symbols("COFF", frozenset(found[True]), frozenset(found[False]))


def _mach_o(code: bytes) -> Symbols:
    (commands,) = struct.unpack_from("<I", code, 16)
    found: dict[bool, set[str]] = {True: set(), False: set()}
    at = 32
    for _ in range(commands):
        command, size = struct.unpack_from("<II", code, at)
        if command == 2:  # LC_SYMTAB
            first, count, strings, _ = struct.unpack_from("<IIII", code, at + 8)
            for place in range(first, first + 16 * count, 16):
                name, kind, _, _, _ = struct.unpack_from("<IBBHQ", code, place)
                if kind & 1:  # N_EXT
                    found[kind & 0x0E != 0].add(_text(code, strings + name).removeprefix("_"))
        at += size
    return Symbols("Mach-O", frozenset(found[True]), frozenset(found[False]))
