"""SHA-256 of a run as it is stored in an HDF5 file: the packed bytes, which are quicker to read than the samples."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

_PIECE = 2**20
#: HDF5's class of texts (H5T_STRING), and the classes of what stands in its own place: integers, floats, texts.
TEXT = 3
_PLAIN = (0, 1, TEXT)


def group_hash(path: Path, group: Any, names: tuple[str, ...]) -> str:
    """Hash the datasets `names` of an open group: how they are stored, and every stored byte."""
    digest = hashlib.sha256()
    with path.open("rb") as file:
        for name in sorted(names):
            dataset = group[name]
            layout = (name, dataset.dtype.str, dataset.shape, dataset.chunks, _filters(dataset))
            digest.update(repr(layout).encode())
            for offset, size in _pieces(dataset):
                digest.update(repr((offset, size)).encode())
                _feed(digest, file, offset + group.file.userblock_size, size)
        digest.update(repr(_numbers(group)).encode())
    return digest.hexdigest()


def _numbers(group: Any) -> list[tuple[str, str]]:
    """Attributes that lie in the group itself, as the rate; of what they refer to elsewhere no result depends."""
    names = sorted(key for key in group.attrs if is_plain(group.attrs.get_id(key), _PIECE))
    return [(key, repr(group.attrs[key])) for key in names]


def is_plain(attribute: Any, most: int) -> bool:
    """Whether an attribute is made of numbers or texts of up to `most` bytes that stand where it stands itself.

    A text elsewhere in the file is as long as its reference says, and a damaged one says gigabytes, for which the
    library makes room before it looks.
    """
    kind = attribute.get_type()
    within = kind.get_class() in _PLAIN and not (kind.get_class() == TEXT and kind.is_variable_str())
    return within and attribute.get_storage_size() <= most


def _filters(dataset: Any) -> list[Any]:
    creation = dataset.id.get_create_plist()
    return [creation.get_filter(i)[:3] for i in range(creation.get_nfilters())]


def _pieces(dataset: Any) -> Iterator[tuple[int, int]]:
    """Offset and size of everything stored, in the order of the file's own index."""
    if dataset.chunks is None:
        offset = dataset.id.get_offset()
        if offset is not None:
            yield offset, dataset.id.get_storage_size()
        return
    found: list[tuple[int, int]] = []
    dataset.id.chunk_iter(lambda chunk: found.append((chunk.byte_offset, chunk.size)))
    yield from found


def _feed(digest: Any, file: BinaryIO, offset: int, size: int) -> None:
    file.seek(offset)
    while size > 0:
        piece = file.read(min(size, _PIECE))
        if not piece:
            return
        digest.update(piece)
        size -= len(piece)
