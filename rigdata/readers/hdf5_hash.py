"""SHA-256 of a run as it is stored in an HDF5 file: the packed bytes, which are quicker to read than the samples."""

from __future__ import annotations

import hashlib
from collections.abc import Iterator
from pathlib import Path
from typing import Any, BinaryIO

_PIECE = 2**20


def group_hash(path: Path, group: Any, names: tuple[str, ...]) -> str:
    """Hash the datasets `names` of an open group: how they are stored, and every stored byte.

    Parameters
    ----------
    path : Path
        Of the file.
    group : h5py.Group
    names : tuple of str
        Datasets that hold their data in this file (see `Hdf5Reader`).

    Returns
    -------
    str
        Hexadecimal.
    """
    digest = hashlib.sha256()
    with path.open("rb") as file:
        for name in sorted(names):
            dataset = group[name]
            layout = (name, dataset.dtype.str, dataset.shape, dataset.chunks, _filters(dataset))
            digest.update(repr(layout).encode())
            for offset, size in _pieces(dataset):
                digest.update(repr((offset, size)).encode())
                _feed(digest, file, offset + group.file.userblock_size, size)
        digest.update(repr([(key, repr(group.attrs[key])) for key in sorted(group.attrs)]).encode())
    return digest.hexdigest()


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
