"""MATLAB files: version 5 to 7.2 by scipy, 7.3 (HDF5) by h5py; vectors and structures of vectors become channels."""

from __future__ import annotations

import inspect
import math
import re
import struct
import zlib
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from rigdata.problem import RigDataError, refuse
from rigdata.readers.base import SAMPLE, refuse_claim
from rigdata.readers.hdf5.guards import claimed_bytes, foreign_filters
from rigdata.readers.series import Series, equidistant, is_time

_RATES = re.compile(r"fs|sample_?rate|sample_rate_hz|abtastrate")
#: Variables that name the columns of a matrix, and state their units.
_NAMES = re.compile(r"name|label|header|kanal|channel|signal|voie|column")
_UNITS = re.compile(r"unit|einheit|unite")
_SHORTEST, _MOST_NAMES, _LONGEST = 8, 4096, 1000
_DEEPEST = 4
_HDF5 = b"\x89HDF\r\n\x1a\n"
_HEADER = 128
#: Types of elements: variables, packed ones, names, whole numbers, flags; numbers of any size, and texts besides.
_MATRIX, _COMPRESSED, _NAME, _WHOLE, _FLAGS = 14, 15, 1, 5, 6
_NUMBERS = (*range(1, 8), 9, 12, 13)
_TEXTS = (*_NUMBERS, 16, 17, 18)
_CELL, _STRUCT, _OBJECT, _CHAR, _SPARSE, _FUNCTION, _OPAQUE = 1, 2, 3, 4, 5, 16, 17
_DEEPEST_ELEMENT = 32


def read_mat(path: Path) -> list[Series]:
    """Read every numeric vector.

    A variable or structure field with at least eight numbers is a channel. The columns of a matrix are channels,
    named by a list of as many texts next to it (``ChannelNames``, ``labels``, ..; units likewise), else ``name_1``,
    ``name_2``, ..; where the list has as many names as the matrix has rows, its rows are the channels. One named like
    a time (``t``, ``time``, ``Zeit``) is the clock, a scalar ``fs`` or ``sample_rate`` [Hz] stands in for it.

    Parameters
    ----------
    path : Path
        ``.mat``
    """
    variables = list(_flattened(_load(path), "", 0))
    texts = {name: value for name, value in variables if isinstance(value, list)}
    channels = {}
    rates = []
    for name, value in variables:
        if isinstance(value, list):
            continue
        if value.size == 1 and value.item() > 0 and _RATES.fullmatch(_last_part(name).lower()):
            rates.append(value.item())
        elif value.size >= _SHORTEST:
            for channel in _columns(name, value, texts):
                channels[channel.name] = channel
    if not channels:
        names = ", ".join(name for name, _ in variables[:6]) or "no numbers at all"
        fault = f"holds no vector of at least {_SHORTEST} numbers, only {names}"
        raise refuse(path.name, "", fault, "Save the channels as vectors, or as a matrix")
    timed = {len(channel) for name, channel in channels.items() if is_time(_last_part(name))}
    for name, channel in channels.items():
        if rates and len(channel) not in timed:
            channels[name] = replace(channel, time=equidistant(len(channel), 1.0 / rates[0]))
    return list(channels.values())


def _last_part(name: str) -> str:
    return name.rpartition(".")[2]


def _load(path: Path) -> dict[str, Any]:
    with path.open("rb") as stream:
        head = stream.read(520)
    if _HDF5 in (head[:8], head[512:]):  # a 7.3 file is HDF5 behind 512 bytes of MATLAB's own text
        import h5py

        with h5py.File(path, "r", locking="best-effort") as file:
            items = list(_datasets(file, path))
            refuse_claim(sum(claimed_bytes(item) for _, item in items), path)
            values = {}  # numbers, and texts that a dataset refers to
            for name, item in items:
                texts = _cell_texts(item) if item.dtype == h5py.ref_dtype else []
                if texts:
                    values[name] = np.array(texts, dtype=object)
                elif item.dtype.kind in "fiu" and _is_inside(item) and not _is_text(item):
                    values[name] = np.asarray(item[()], dtype=float).T  # MATLAB writes columns first
            return values
    from scipy.io import loadmat

    check_mat5(path)
    # named from scipy 1.18 on, which warns where it is not given
    sparse = {"spmatrix": False} if "spmatrix" in inspect.signature(loadmat).parameters else {}
    variables = loadmat(path, simplify_cells=True, **sparse)
    return {name: value for name, value in variables.items() if not name.startswith("__")}


def _datasets(group: Any, path: Path, prefix: str = "", depth: int = 0) -> Iterator[tuple[str, Any]]:
    """Datasets of a 7.3 file by their dotted names; MATLAB's own store of references is left alone."""
    import h5py

    for name in group:
        if name.startswith("#") or depth > _DEEPEST:
            continue
        if isinstance(group.get(name, getlink=True), (h5py.ExternalLink, h5py.SoftLink)):
            raise refuse(path.name, f"dataset {name}", "is a link", "Store the data in this file")
        item = group[name]
        if isinstance(item, h5py.Group):
            yield from _datasets(item, path, f"{prefix}{name}.", depth + 1)
        else:
            yield f"{prefix}{name}", item


def _cell_texts(item: Any) -> list[str]:
    """Texts of a cell array of characters in a 7.3 file, which holds a reference to each; none if it holds others."""
    if item.size > _MOST_NAMES or not _is_inside(item):
        return []
    texts = []
    for reference in np.ravel(item[()], "F"):
        text = item.file[reference] if reference else None
        if text is None or not hasattr(text, "dtype") or text.dtype.kind != "u" or text.size > _LONGEST:
            return []
        if not (_is_text(text) and _is_inside(text)):
            return []
        texts.append("".join(map(chr, np.ravel(text[()], "F").tolist())))
    return texts


def _is_inside(item: Any) -> bool:
    """Whether a dataset's samples are in the file itself, and no foreign code unpacks them."""
    return not (item.is_virtual or item.external or foreign_filters(item))


def _is_text(item: Any) -> bool:
    return item.attrs.get("MATLAB_class") in (b"char", "char")


def _flattened(value: Any, name: str, depth: int) -> Iterator[tuple[str, np.ndarray | list[str]]]:
    """Numbers as arrays and lists of texts, by their dotted names."""
    if isinstance(value, dict):
        if depth <= _DEEPEST:
            for key, inner in value.items():
                yield from _flattened(inner, f"{name}.{key}" if name else key, depth + 1)
        return
    array = np.asarray(value)
    if array.dtype.kind in "fiu" and array.size and array.ndim <= 2:
        yield name, array.astype(float, copy=False)
    elif array.dtype.kind in "UO" and 0 < array.size <= _MOST_NAMES:
        cells = array.reshape(-1).tolist()
        if all(isinstance(cell, str) for cell in cells):
            yield name, [cell.strip() for cell in cells]


def _columns(name: str, value: np.ndarray, texts: dict[str, list[str]]) -> Iterator[Series]:
    """Channels of a variable, named and with units as lists next to it say."""
    if value.ndim == 1 or 1 in value.shape:
        yield Series(name, "", np.ravel(value))
        return
    level = name.rpartition(".")[0]
    lists = {_last_part(key).lower(): cells for key, cells in texts.items() if key.rpartition(".")[0] == level}
    names = _listed(lists, _NAMES, value.shape) or [name] * value.shape[1]
    units = _listed(lists, _UNITS, (len(names),)) or [""] * len(names)
    columns = value.T if len(names) == value.shape[1] else value
    for i, label in enumerate(names):
        if not label or names.count(label) > 1:
            label = f"{label or name}_{i + 1}"
        yield Series(label, units[i], np.ascontiguousarray(columns[i]))


def _listed(lists: dict[str, list[str]], named: re.Pattern[str], lengths: tuple[int, ...]) -> list[str]:
    """The first list of such a name and length; empty where there is none."""
    for key, cells in lists.items():
        if named.search(key) and len(cells) in lengths:
            return cells
    return []


@dataclass
class _Bytes:
    """A stretch of a file and how far it has been walked."""

    data: bytes
    order: str
    at: int
    end: int

    def element(self, *types: int) -> _Bytes:
        """What the next element holds; it is passed."""
        if self.at + 8 > self.end:
            raise ValueError("ends inside an element")
        kind, size = struct.unpack_from(f"{self.order}II", self.data, self.at)
        start, step = self.at + 8, 8 + size + (-size % 8 if kind != _COMPRESSED else 0)
        if kind >> 16:  # at most four bytes, kept in the tag itself
            kind, size, start, step = kind & 0xFFFF, kind >> 16, self.at + 4, 8
        if kind not in types or start + size > self.end:
            raise ValueError(f"an element of type {kind} claims {size} bytes, which is not allowed there")
        self.at = min(self.at + step, self.end)
        return _Bytes(self.data, self.order, start, start + size)

    def numbers(self, letter: str) -> tuple[int, ...]:
        """All that is left as whole numbers of four bytes."""
        return struct.unpack_from(f"{self.order}{(self.end - self.at) // 4}{letter}", self.data, self.at)


def check_mat5(path: Path) -> None:
    """Walk a file; return if scipy can read it safely.

    scipy (1.17) looks the type of an element up in a table without asking whether it is one: a wrong byte there, and
    the process is gone. So types, sizes and nesting are checked here by the layout of MathWorks' "MAT-File Format",
    chapter 1; compressed variables are unpacked as far as their own head claims, so that a small file cannot fill the
    memory.
    """
    data = path.read_bytes()
    order = {b"IM": "<", b"MI": ">"}.get(data[126:128])
    if len(data) < _HEADER or not any(data[:4]) or order is None:
        return  # version 4, or no MATLAB file
    walk, claimed = _Bytes(data, order, _HEADER, len(data)), 0
    try:
        while walk.at < walk.end:
            is_packed = walk.numbers("I")[:1] == (_COMPRESSED,)
            element = walk.element(_MATRIX, _COMPRESSED)
            if is_packed:
                packed = data[element.at : element.end]
                length = _Bytes(zlib.decompressobj().decompress(packed, 8), order, 0, 8).numbers("I")[1]
                claimed += SAMPLE * length  # small numbers take a byte each
                refuse_claim(claimed, path)
                plain = zlib.decompressobj().decompress(packed, length + 16)
                element = _Bytes(plain, order, 0, len(plain)).element(_MATRIX)
            _walk_matrix(element, 0)
    except RigDataError:
        raise
    except (ValueError, struct.error, zlib.error) as error:
        remedy = "Copy it again from the logger"
        raise refuse(path.name, f"byte {walk.at}", f"is damaged: {error}", remedy) from error


def _walk_matrix(walk: _Bytes, depth: int) -> None:
    """Walk the parts of one variable: flags, shape and name, then what its class has."""
    if depth > _DEEPEST_ELEMENT:
        raise ValueError("nests too deeply")
    if walk.at == walk.end:
        return  # an empty matrix has no parts at all
    flags, _ = walk.element(_FLAGS).numbers("I")
    kind, is_complex = flags & 0xFF, bool(flags & 0x800)
    count = 1
    if kind == _OPAQUE:
        for _ in range(3):
            walk.element(_NAME)
    else:
        shape = walk.element(_WHOLE).numbers("i")
        walk.element(_NAME)
        count = math.prod(shape)
        if not 1 <= len(shape) <= 32 or min(shape) < 0:
            raise ValueError("a variable has an impossible shape")
    if kind == _CHAR:
        walk.element(*_TEXTS)
    elif kind == _SPARSE or 6 <= kind <= 15:
        for _ in range(2 * (kind == _SPARSE) + 1 + is_complex):
            walk.element(*_NUMBERS)
    elif kind in (_CELL, _STRUCT, _OBJECT, _FUNCTION, _OPAQUE):
        if kind == _OBJECT:
            walk.element(_NAME)
        if kind in (_STRUCT, _OBJECT):
            (length,) = walk.element(_WHOLE).numbers("i")
            names = walk.element(_NAME)
            count *= (names.end - names.at) // max(length, 1)
        count = 1 if kind == _FUNCTION else count
        if 8 * count > walk.end - walk.at or (kind in (_STRUCT, _OBJECT) and length <= 0):
            raise ValueError(f"claims {count} members, more than there is room for")
        for _ in range(count):
            _walk_matrix(walk.element(_MATRIX), depth + 1)
    else:
        raise ValueError(f"a variable is of the unknown class {kind}")
