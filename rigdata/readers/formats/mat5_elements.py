"""A walk over the elements of a MATLAB 5 file before scipy reads it.

scipy (1.17) looks the type of an element up in a table without asking whether it is one: a wrong byte there, and the
process is gone. So types, sizes and nesting are checked here by the layout of MathWorks' "MAT-File Format", chapter 1;
compressed variables are unpacked up to a limit, so that a small file cannot fill the memory.
"""

from __future__ import annotations

import struct
import zlib
from dataclasses import dataclass
from pathlib import Path

from rigdata.problem import Problem, RigDataError

#: Unpacked bytes of all variables above which a file is refused.
LARGEST = 2**31
_HEADER = 128
_MATRIX, _COMPRESSED = 14, 15
#: Number types of the format; text types come on top.
_NUMBERS = frozenset({1, 2, 3, 4, 5, 6, 7, 9, 12, 13})
_TEXTS = _NUMBERS | {16, 17, 18}
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_DEEPEST = 32


@dataclass
class _Bytes:
    """A stretch of a file and how far it has been walked."""

    data: bytes
    order: str
    at: int
    end: int

    def element(self, types: frozenset[int]) -> tuple[int, int, int]:
        """Type, start and size of the next element, which is passed."""
        if self.at + 8 > self.end:
            raise ValueError("ends inside an element")
        kind, size = struct.unpack_from(f"{self.order}II", self.data, self.at)
        if kind >> 16:  # at most four bytes, kept in the tag itself
            kind, size, start, step = kind & 0xFFFF, kind >> 16, self.at + 4, 8
            if size > 4:
                raise ValueError(f"a short element claims {size} bytes")
        else:
            start, step = self.at + 8, 8 + size + (-size % 8 if kind != _COMPRESSED else 0)
        if kind not in types:
            raise ValueError(f"an element has the type {kind}, which is not allowed there")
        if start + size > self.end:
            raise ValueError(f"an element claims {size} bytes, more than there are")
        self.at = min(self.at + step, self.end)
        return kind, start, size


def check_mat5(path: Path) -> None:
    """Walk a file; return if scipy can read it safely.

    Parameters
    ----------
    path : Path
        MATLAB 5 to 7.2; other files are left to scipy to refuse.

    Raises
    ------
    RigDataError
        A type, size or depth that the format does not allow, or more than `LARGEST` bytes unpacked.
    """
    data = path.read_bytes()
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if len(data) < _HEADER or not any(data[:4]) or order is None:
        return  # version 4, or no MATLAB file
    walk = _Bytes(data, order, _HEADER, len(data))
    left = LARGEST
    try:
        while walk.at < walk.end:
            kind, start, size = walk.element(frozenset({_MATRIX, _COMPRESSED}))
            if kind == _COMPRESSED:
                plain = _unpacked(data[start : start + size], left)
                left -= len(plain)
                inner = _Bytes(plain, order, 0, len(plain))
                _, start, size = inner.element(frozenset({_MATRIX}))
                _matrix(_Bytes(plain, order, start, start + size), 0)
            elif size:
                _matrix(_Bytes(data, order, start, start + size), 0)
    except ValueError as error:
        raise RigDataError(
            Problem("error", path.name, f"byte {walk.at}", f"is damaged: {error}", "Copy it again from the logger")
        ) from error


def _unpacked(packed: bytes, limit: int) -> bytes:
    worker = zlib.decompressobj()
    try:
        plain = worker.decompress(packed, limit + 1)
    except zlib.error as error:
        raise ValueError(f"a compressed variable cannot be unpacked ({error})") from error
    if len(plain) > limit:
        raise ValueError(f"unpacks to more than {LARGEST >> 20} MB")
    return plain


def _matrix(walk: _Bytes, depth: int) -> None:
    """Walk the parts of one variable."""
    if depth > _DEEPEST:
        raise ValueError("nests too deeply")
    if walk.at == walk.end:
        return  # an empty matrix has no parts at all
    _, start, size = walk.element(frozenset({6}))
    if size != 8:
        raise ValueError("a variable's flags have a wrong size")
    (flags,) = struct.unpack_from(f"{walk.order}I", walk.data, start)
    kind, complex_ = flags & 0xFF, bool(flags & 0x800)
    if kind == _OPAQUE:
        for _ in range(3):
            walk.element(frozenset({1}))
        _inner(walk, depth)
        return
    _, start, size = walk.element(frozenset({5}))
    shape = struct.unpack_from(f"{walk.order}{size // 4}i", walk.data, start)
    if size % 4 or not 1 <= len(shape) <= 32 or min(shape) < 0:
        raise ValueError("a variable has an impossible shape")
    walk.element(frozenset({1}))
    count = 1
    for length in shape:
        count *= length
    if kind in (_CELL, _STRUCT, _OBJECT, _FUNCTION):
        if kind == _OBJECT:
            walk.element(frozenset({1}))
        _members(walk, kind, count, depth)
    elif kind == _CHAR:
        walk.element(_TEXTS)
    elif kind == _SPARSE or 6 <= kind <= 15:
        for _ in range((2 if kind == _SPARSE else 0) + 1 + complex_):
            walk.element(_NUMBERS)
    else:
        raise ValueError(f"a variable is of the unknown class {kind}")


def _members(walk: _Bytes, kind: int, count: int, depth: int) -> None:
    """Walk what a cell array, structure or function holds: as many variables as it claims."""
    if kind in (_STRUCT, _OBJECT):
        _, start, size = walk.element(frozenset({5}))
        (length,) = struct.unpack_from(f"{walk.order}i", walk.data, start) if size == 4 else (0,)
        _, _, size = walk.element(frozenset({1}))
        if length <= 0 or size % length:
            raise ValueError("a structure's field names have an impossible length")
        count *= size // length
    if kind == _FUNCTION:
        count = 1
    if 8 * count > walk.end - walk.at:
        raise ValueError(f"claims {count} members, more than there is room for")
    for _ in range(count):
        _inner(walk, depth)


def _inner(walk: _Bytes, depth: int) -> None:
    _, start, size = walk.element(frozenset({_MATRIX}))
    _matrix(_Bytes(walk.data, walk.order, start, start + size), depth + 1)
