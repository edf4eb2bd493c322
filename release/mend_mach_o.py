"""Fixes a macOS module (a 64-bit Mach-O library) that ziglang has linked; zig-macos-rules.cmake runs it after linking.

python release/mend_mach_o.py MODULE

It exports PyInit_* only, without the linker's additions. Its inline functions and types are no longer looked up by name
in other libraries, which the linker requests although they are hidden: pybind11's exceptions would be those of another
module. The load command that names the dynamic linker is removed: it belongs in programs. The signature's hashes of
changed pages are updated, as 64-bit ARM requires. No code or data changes or moves.
"""

from __future__ import annotations

import hashlib
import struct
import sys
from collections.abc import Iterator
from pathlib import Path

LC_LOAD_DYLINKER = 0xE
LC_CODE_SIGNATURE = 0x1D
LC_DYLD_INFO_ONLY = 0x80000022
CODE_DIRECTORY = 0xFADE0C02
HEADER_SIZE = 32
WEAK_FLAGS = 0x8000 | 0x10000  # defines weak symbols, looks some up
ENTRY_POINT = "_PyInit_"


def mend_module(data: bytearray) -> None:
    """Do all of it, in place; ValueError if the module exports no PyInit_*."""
    drop_command(data, LC_LOAD_DYLINKER)
    places = {command: place for command, place, _ in load_commands(data)}
    info = places[LC_DYLD_INFO_ONLY]
    drop_weak_lookups(data, info)
    export_entry_point(data, *struct.unpack_from("<2I", data, info + 40))
    if LC_CODE_SIGNATURE in places:
        (signature,) = struct.unpack_from("<I", data, places[LC_CODE_SIGNATURE] + 8)
        hash_pages(data, signature)


def load_commands(data: bytes) -> Iterator[tuple[int, int, int]]:
    """Each load command: its number, where it starts, and its size."""
    (count,) = struct.unpack_from("<I", data, 16)
    place = HEADER_SIZE
    for _ in range(count):
        command, size = struct.unpack_from("<2I", data, place)
        yield command, place, size
        place += size


def drop_command(data: bytearray, unwanted: int) -> None:
    """Remove the commands of this number and close the gap; the freed bytes after the last command are zero."""
    kept = [data[place : place + size] for command, place, size in load_commands(data) if command != unwanted]
    (size,) = struct.unpack_from("<I", data, 20)
    commands = b"".join(kept)
    data[HEADER_SIZE : HEADER_SIZE + size] = commands.ljust(size, b"\0")
    struct.pack_into("<2I", data, 16, len(kept), len(commands))


def drop_weak_lookups(data: bytearray, info: int) -> None:
    """Keep references to inline functions and types as they are: by address, in this module."""
    start, size = struct.unpack_from("<2I", data, info + 24)
    data[start : start + size] = bytes(size)
    struct.pack_into("<2I", data, info + 24, 0, 0)
    (flags,) = struct.unpack_from("<I", data, 24)
    struct.pack_into("<I", data, 24, flags & ~WEAK_FLAGS)


def export_entry_point(data: bytearray, start: int, size: int) -> None:
    """Keep only PyInit_* in the trie of exported names, which begins at `start`."""
    exports = {name: value for name, value in read_trie(bytes(data[start : start + size])) if ENTRY_POINT in name}
    if len(exports) != 1:
        raise ValueError(f"mend_mach_o: expected one {ENTRY_POINT}* that is exported, got {sorted(exports)}")
    ((name, value),) = exports.items()
    edge = name.encode() + b"\0"
    # A root with one child, whose place comes last: two bytes, the name, and the byte that the place itself takes.
    trie = bytes([0, 1]) + edge + bytes([3 + len(edge)]) + bytes([len(value)]) + value + b"\0"
    if len(trie) > size or len(trie) > 0x7F:
        raise ValueError(f"mend_mach_o: expected room for {name} in {size} bytes of exported names")
    data[start : start + size] = trie.ljust(size, b"\0")


def read_trie(trie: bytes, place: int = 0, prefix: str = "") -> Iterator[tuple[str, bytes]]:
    """Every name in a trie of exported names, with its data."""
    size, place = read_number(trie, place)
    if size:
        yield prefix, trie[place : place + size]
    place += size
    for _ in range(trie[place]):
        end = trie.index(0, place + 1)
        label = trie[place + 1 : end].decode()
        child, next_place = read_number(trie, end + 1)
        yield from read_trie(trie, child, prefix + label)
        place = next_place - 1


def read_number(data: bytes, place: int) -> tuple[int, int]:
    """A number of seven bits a byte (ULEB128), and the place behind it."""
    number = shift = 0
    while True:
        number |= (data[place] & 0x7F) << shift
        place += 1
        if data[place - 1] < 0x80:
            return number, place
        shift += 7


def hash_pages(data: bytearray, signature: int) -> None:
    """Write the hashes of all pages into the code directory of the signature, which begins at `signature`."""
    (count,) = struct.unpack_from(">I", data, signature + 8)
    for index in range(count):
        (offset,) = struct.unpack_from(">I", data, signature + 12 + 8 * index + 4)
        directory = signature + offset
        if struct.unpack_from(">I", data, directory)[0] != CODE_DIRECTORY:
            continue
        (hashes,) = struct.unpack_from(">I", data, directory + 16)
        pages, limit = struct.unpack_from(">2I", data, directory + 28)
        page = 1 << data[directory + 39]
        for number in range(pages):
            digest = hashlib.sha256(data[number * page : min((number + 1) * page, limit)]).digest()
            place = directory + hashes + len(digest) * number
            data[place : place + len(digest)] = digest


if __name__ == "__main__":
    module = Path(sys.argv[1])
    content = bytearray(module.read_bytes())
    mend_module(content)
    module.write_bytes(content)
