"""A look at an HDF5 file's global heaps before the HDF5 library walks them.

The library (1.14, 2.0) never comes back from a heap whose free-space entry has size zero, as one wrong byte
can make it; so such files are found here, by the layout of the HDF5 File Format Specification, III.E.
"""

from __future__ import annotations

import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import BinaryIO

#: With the version; three reserved bytes follow, which the library does not look at.
_SIGNATURE, _RESERVED = b"GCOL\x01", b"\0\0\0"
_HEADER, _OBJECT = 16, 16
#: Texts in attributes stand near the start or the end; the rest of a large file is samples [bytes].
_SCANNED = 2**26
_LARGEST_HEAP = 2**28
#: A reference to a text: its length, the address of its heap, its number there; it follows its attribute's name, behind
#: the descriptions of type and shape.
_REFERENCE, _BEHIND = struct.Struct("<IQI"), 80


def broken_heap(path: Path) -> int | None:
    """Find a global heap that cannot be walked.

    Parameters
    ----------
    path : Path
        HDF5 file; its first and last 64 MB are looked at.

    Returns
    -------
    int or None
        Its byte in the file; None where all are sound.
    """
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        for start, block in _ends(stream, size):
            for at in _places(block, _SIGNATURE):
                if not _is_sound(stream, start + at, size):
                    return start + at
    return None


def too_long_text(path: Path, names: Sequence[str], base: int = 0) -> str | None:
    """Find an attribute whose reference claims a text longer than the file: the library would make room for it first.

    Parameters
    ----------
    path : Path
        HDF5 file; its first and last 64 MB are looked at.
    names : sequence of str
        Of the attributes.
    base : int
        Size of the user block, from which addresses count [bytes].

    Returns
    -------
    str or None
        Its name; None where all are sound.
    """
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        heaps, behind = set[int](), list[tuple[str, bytes]]()
        for start, block in _ends(stream, size):
            heaps.update(start + at - base for at in _places(block, _SIGNATURE))
            for name in names:
                ends = (at + len(name) for at in _places(block, name.encode() + b"\0"))
                behind += [(name, block[end : end + _BEHIND]) for end in ends]
    for name, piece in behind:
        for place in range(len(piece) - _REFERENCE.size + 1):
            length, address, _ = _REFERENCE.unpack_from(piece, place)
            if address in heaps and length > size:
                return name
    return None


def _ends(stream: BinaryIO, size: int) -> Iterator[tuple[int, bytes]]:
    """Start and bytes of a file's first and last part."""
    starts = [0] if size <= 2 * _SCANNED else [0, size - _SCANNED]
    for start in starts:
        stream.seek(start)
        yield start, stream.read(size if size <= 2 * _SCANNED else _SCANNED)


def _places(block: bytes, wanted: bytes) -> Iterator[int]:
    at = block.find(wanted)
    while at >= 0:
        yield at
        at = block.find(wanted, at + 1)


def _is_sound(stream: BinaryIO, at: int, size: int) -> bool:
    stream.seek(at)
    header = stream.read(_HEADER).ljust(_HEADER, b"\0")
    (length,) = struct.unpack_from("<Q", header, 8)
    if length < _HEADER or at + length > size or length > _LARGEST_HEAP:
        # with odd reserved bytes: samples that look like a heap by chance
        return header[len(_SIGNATURE) : 8] != _RESERVED
    heap = stream.read(length - _HEADER)
    place = 0
    while place + _OBJECT <= len(heap):
        index, need = struct.unpack_from("<H6xQ", heap, place)
        if index:
            need = _OBJECT + (need + 7) // 8 * 8
        if need == 0 or place + need > len(heap):
            return False
        place += need
    return True
