"""HDF5 members reached without leaving the file: hard links, and soft links that stay inside."""

from __future__ import annotations

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
        link = (
            here.get(name, getlink=True) if isinstance(here, h5py.Group) and name in _members(here) else None
        )
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


class _Members:
    """Membership by link, not by target: a dangling or external link counts and is never followed."""

    def __init__(self, group: Any) -> None:
        self._links = group.id.links

    def __contains__(self, name: str) -> bool:
        return bool(self._links.exists(name.encode("utf-8", "surrogateescape")))


def _members(group: Any) -> _Members:
    return _Members(group)
