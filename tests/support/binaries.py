"""What shared libraries of Windows and macOS import and export, read from the files.
Sources: Microsoft, PE Format; Apple, mach-o/loader.h and mach-o/nlist.h."""

import struct


def pe_names(content):
    """Libraries that a 64-bit DLL imports, and names that it exports."""
    (header,) = struct.unpack_from("<I", content, 0x3C)
    assert content[header : header + 4] == b"PE\0\0"
    (count,) = struct.unpack_from("<H", content, header + 6)
    (optional,) = struct.unpack_from("<H", content, header + 20)
    first = header + 24
    assert struct.unpack_from("<H", content, first) == (0x20B,)  # PE32+
    exports, _, imports, _ = struct.unpack_from("<4I", content, first + 112)
    sections = [struct.unpack_from("<8s4I", content, first + optional + 40 * k)
                for k in range(count)]  # fmt: skip

    def at(address):
        """Offset in the file of an address in memory."""
        for _, size, begin, raw, offset in sections:
            if begin <= address < begin + max(size, raw):
                return offset + address - begin
        raise ValueError(f"address {address:#x} is in no section")

    def text(address):
        place = at(address)
        return content[place : content.index(b"\0", place)].decode()

    libraries, place = [], at(imports)
    while (row := struct.unpack_from("<5I", content, place))[3]:
        libraries.append(text(row[3]).lower())
        place += 20
    named, _, names = struct.unpack_from("<3I", content, at(exports) + 24)
    where = struct.unpack_from(f"<{named}I", content, at(names))
    return libraries, [text(address) for address in where]


def macho_names(content):
    """Libraries that a 64-bit Mach-O library loads, and names that others see."""
    assert content[:4] == b"\xcf\xfa\xed\xfe"
    (count,) = struct.unpack_from("<I", content, 16)
    libraries, names, place = [], [], 32
    for _ in range(count):
        command, size = struct.unpack_from("<2I", content, place)
        if command in (0xC, 0x80000018):  # LC_LOAD_DYLIB, and weak
            (offset,) = struct.unpack_from("<I", content, place + 8)
            words = content[place + offset : place + size]
            libraries.append(words.rstrip(b"\0").decode())
        elif command == 0x2:  # LC_SYMTAB
            symbols, number, strings, _ = struct.unpack_from("<4I", content, place + 8)
            for k in range(number):
                name, type_ = struct.unpack_from("<IB", content, symbols + 16 * k)
                if type_ & 0xF1 == 0x1 and type_ & 0xE == 0xE:  # external, of a section, public
                    begin = strings + name
                    names.append(content[begin : content.index(b"\0", begin)].decode())
        place += size
    return libraries, names
