"""HDF5 members reached without leaving the file: hard links, and soft links that stay inside."""

from __future__ import annotations

import math
from typing import Any

from rigdata.problem import Problem, RigDataError

_MAX_STEPS = 64


def resolve(start: Any, path: str, file: str, run: str | None = None) -> Any:
    """Walk `path` from the group `start`, one link at a time.

    Parameters
    ----------
    start : h5py.Group
    path : str
        Members parted by ``/``.
    file, run : str
        For the message.

    Returns
    -------
    h5py.Group, h5py.Dataset or None
        None where a member is absent.

    Raises
    ------
    RigDataError
        An external link anywhere on the way, a soft link that leads nowhere or in a circle.
    """
    import h5py

    def refuse(place: str, what: str) -> RigDataError:
        return RigDataError(Problem("error", file, place, what, "Copy the data into this file", run))

    here, todo, steps = start, [p for p in path.split("/") if p not in {"", "."}], 0
    soft = False
    while todo:
        steps += 1
        if steps > _MAX_STEPS:
            raise refuse(path, "is a circle of links, or too deep")
        name = todo.pop(0)
        known = isinstance(here, h5py.Group) and has_link(here, name)
        link = here.get(name, getlink=True) if known else None
        if link is None:
            if soft:
                raise refuse(path, "is a soft link that leads nowhere")
            return None
        if isinstance(link, h5py.ExternalLink):
            raise refuse(path, f"is a link out of the file (to {str(link.filename)[:80]!a})")
        if isinstance(link, h5py.SoftLink):
            target, soft = str(link.path), True
            here = here.file["/"] if target.startswith("/") else here
            todo = [p for p in target.split("/") if p not in {"", "."}] + todo
            continue
        if not isinstance(link, h5py.HardLink):
            raise refuse(path, "is a link of an unknown kind")
        here = here[name]
    return here


def has_link(group: Any, name: str) -> bool:
    """Whether the group has such a link: a dangling or external one counts and is never followed.

    Parameters
    ----------
    group : h5py.Group
        In which to look.
    name : str
        As the file has it.
    """
    return bool(group.id.links.exists(name.encode("utf-8", "surrogateescape")))


def chunk_bytes(group: Any, name: str) -> int:
    """Bytes of a stored chunk; zero of what is no chunked dataset, or leads out of the file.

    Parameters
    ----------
    group : h5py.Group
    name : str
        Of a member.
    """
    import h5py

    if not isinstance(group.get(name, getlink=True), h5py.HardLink):
        return 0
    member = group[name]
    chunk = member.chunks if isinstance(member, h5py.Dataset) else None
    return 0 if chunk is None else math.prod(chunk) * member.dtype.itemsize
