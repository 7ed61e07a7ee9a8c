"""Guards before the HDF5 library reads a file: heaps that it never comes back from, links that leave the file.

The library (1.14, 2.0) never comes back from a heap whose free-space entry has size zero, as one wrong byte
can make it; so such files are found here, by the layout of the HDF5 File Format Specification, III.E.
"""

import contextlib
import math
import re
import struct
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, BinaryIO

import h5py

from rigdata.problem import RigDataError, refuse
from rigdata.readers.base import SAMPLE, refuse_claim

#: With the version; three reserved bytes follow, which the library does not look at.
_SIGNATURE, _RESERVED = b"GCOL\x01", b"\0\0\0"
_HEADER, _OBJECT = 16, 16
#: Texts in attributes stand near the start or the end; the rest of a large file is samples [bytes].
_SCANNED = 2**26
#: Bytes that are looked at in one go, and of those behind them: a name and its reference.
_PIECE, _NEXT = 2**20, 128
_LARGEST_HEAP = 2**28
_LONGEST_UNIT = 64
#: A reference to a text: its length, the address of its heap, its number there; it follows its attribute's name, behind
#: the descriptions of type and shape.
_REFERENCE, _BEHIND = struct.Struct("<IQI"), 80
_MAX_STEPS = 64
#: What h5py raises of a damaged file.
_BROKEN = (RigDataError, OSError, RuntimeError, KeyError, ValueError, TypeError)
#: Filters that the library brings along: gzip, shuffle, fletcher32, szip, nbit, scaleoffset, lzf.
_FILTERS = {*range(1, 7), 32000}
#: Attributes of a dataset that state its unit.
UNIT = ("unit", "units", "Unit", "Units")
#: HDF5's class of texts (H5T_STRING), and the classes of what is stored in its own place: integers, floats, texts.
TEXT = 3
_PLAIN = (0, 1, TEXT)


def broken_heap(path: Path) -> int | None:
    """Find a global heap that cannot be walked."""
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        for start, block in _pieces(stream, size):
            for match in re.finditer(_SIGNATURE, block):
                if not _is_sound(stream, start + match.start(), size):
                    return start + match.start()
    return None


def too_long_text(path: Path, names: Sequence[str], base: int = 0) -> str | None:
    """Find an attribute whose reference claims a text longer than the file.

    The library would make room for it first.
    """
    with path.open("rb") as stream:
        size = stream.seek(0, 2)
        heaps, followers = set[int](), list[tuple[str, bytes]]()
        for start, block in _pieces(stream, size):
            heaps.update(start + match.start() - base for match in re.finditer(_SIGNATURE, block))
            for name in names:
                for match in re.finditer(name.encode() + b"\0", block):
                    end = match.end() - 1
                    followers.append((name, block[end : end + _BEHIND]))
    for name, piece in followers:
        for place in range(len(piece) - _REFERENCE.size + 1):
            length, address, _ = _REFERENCE.unpack_from(piece, place)
            if address in heaps and length > size:
                return name
    return None


def _pieces(stream: BinaryIO, size: int) -> Iterator[tuple[int, bytes]]:
    """Start and bytes of the pieces of a file's first and last part, each with the beginning of the next."""
    for start in range(0, size, _PIECE):
        if not _SCANNED <= start < size - _SCANNED:
            stream.seek(start)
            yield start, stream.read(_PIECE + _NEXT)


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


def resolve(start: Any, path: str, file: str, run: str | None = None) -> Any:
    """Walk `path` from the group `start`, one link at a time; None where there is no such member."""
    remedy = "Copy the data into this file"
    place, remaining, is_soft = start, _parts(path), False
    for _ in range(_MAX_STEPS):
        if not remaining:
            return place
        name = remaining.pop(0)
        link = place.get(name, getlink=True) if isinstance(place, h5py.Group) else None
        if isinstance(link, h5py.HardLink):
            place = place[name]
        elif isinstance(link, h5py.SoftLink):
            place = place.file if link.path.startswith("/") else place
            remaining, is_soft = _parts(link.path) + remaining, True
        elif isinstance(link, h5py.ExternalLink):
            raise refuse(file, path, f"is a link out of the file (to {link.filename[:80]!a})", remedy, run)
        elif is_soft:
            raise refuse(file, path, "is a soft link that leads nowhere", remedy, run)
        else:
            return None
    raise refuse(file, path, "is a circle of links, or too deep", remedy, run)


def _parts(path: str) -> list[str]:
    return [part for part in path.split("/") if part not in ("", ".")]


def claimed_bytes(member: Any) -> int:
    """Bytes that a dataset claims to be, as numbers or as one stored chunk; zero of what is none."""
    if not isinstance(member, h5py.Dataset) or member.shape is None:
        return 0
    return max(SAMPLE * math.prod(member.shape), chunk_bytes(member))


def chunk_bytes(dataset: Any) -> int:
    """Bytes of a stored chunk; zero of what is stored in one piece."""
    return 0 if dataset.chunks is None else math.prod(dataset.chunks) * dataset.dtype.itemsize


def refuse_claims(handle: Any, path: Path, runs: Sequence[str], names: Sequence[str]) -> None:
    """Refuse a file whose runs claim more samples than it can hold; what cannot be opened is refused by its reader."""
    claimed = 0
    for run in runs:
        with contextlib.suppress(*_BROKEN):
            group = resolve(handle, f"runs/{run}", "")
            for name in names:
                with contextlib.suppress(*_BROKEN):
                    claimed += claimed_bytes(resolve(group, name, ""))
    refuse_claim(claimed, path)


def foreign_filters(dataset: Any) -> list[int]:
    """Filters of a dataset that the HDF5 library does not bring along: they would load foreign code."""
    return [code for code, *_ in filters(dataset) if code not in _FILTERS]


def filters(dataset: Any) -> list[Any]:
    """Code, flags and values of every filter of a dataset."""
    creation = dataset.id.get_create_plist()
    return [creation.get_filter(i)[:3] for i in range(creation.get_nfilters())]


def is_plain(attribute: Any, most: int) -> bool:
    """Whether an attribute is made of numbers or texts of up to `most` bytes that are stored where it is itself.

    A text elsewhere in the file is as long as its reference says, and a damaged one says gigabytes, for which the
    library makes room before it looks.
    """
    kind = attribute.get_type()
    is_within = kind.get_class() in _PLAIN and not (kind.get_class() == TEXT and kind.is_variable_str())
    return is_within and attribute.get_storage_size() <= most


def is_text(attribute: Any, path: Path) -> bool:
    """Whether an attribute is a text that can be read: stored where it is itself, or in a file scanned as a whole."""
    kind = attribute.get_type()
    if kind.get_class() != TEXT or attribute.shape != ():
        return False
    return is_plain(attribute, _LONGEST_UNIT) or (kind.is_variable_str() and path.stat().st_size <= 2 * _SCANNED)
