"""A look at an HDF5 file's global heaps before the HDF5 library walks them.

The library (1.14, 2.0) never comes back from a heap whose free-space entry has size zero, as one wrong byte
can make it; so such files are found here, by the layout of the HDF5 File Format Specification, III.E.
"""

from __future__ import annotations

import struct
from pathlib import Path
from typing import BinaryIO

_SIGNATURE = b"GCOL\x01\x00\x00\x00"
_HEADER, _OBJECT = 16, 16
#: Texts in attributes stand near the start or the end; the rest of a large file is samples [bytes].
_SCANNED = 2**26
_LARGEST_HEAP = 2**28


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
        starts = [0] if size <= 2 * _SCANNED else [0, size - _SCANNED]
        length = size if size <= 2 * _SCANNED else _SCANNED
        for start in starts:
            stream.seek(start)
            block = stream.read(length)
            at = block.find(_SIGNATURE)
            while at >= 0:
                if not _is_sound(stream, start + at, size):
                    return start + at
                at = block.find(_SIGNATURE, at + 1)
    return None


def _is_sound(stream: BinaryIO, at: int, size: int) -> bool:
    stream.seek(at + 8)
    (length,) = struct.unpack("<Q", stream.read(8).ljust(8, b"\0"))
    if length < _HEADER or at + length > size or length > _LARGEST_HEAP:
        return False
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
