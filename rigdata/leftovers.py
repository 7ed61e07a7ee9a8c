"""Records that lie beside the campaign's runs and that its manifest does not name."""

from __future__ import annotations

import itertools
from pathlib import Path

from rigdata.campaign import Campaign
from rigdata.problem import Problem, RigDataError

_LISTED = 5
_MAX_LOOKED_AT = 10_000


def leftovers(campaign: Campaign) -> list[Problem]:
    """Note records without a run: forgotten in the manifest, or left from another campaign.

    Parameters
    ----------
    campaign : Campaign
    """
    if campaign.path.is_dir():
        names = _files(campaign)
        where, what = campaign.path.name, "file"
    else:
        names = _groups(campaign)
        where, what = f"{campaign.path.name}:/runs", "group"
    if not names:
        return []
    more = f", ... ({len(names)} in all)" if len(names) > _LISTED else ""
    listed = ", ".join(ascii(n)[1:-1][:60] for n in names[:_LISTED])
    text = f"no run names the {what}{'' if len(names) == 1 else 's'} {listed}{more}"
    return [Problem("note", where, "", text, "Add them to the manifest, or nothing if they are not wanted")]


def _files(campaign: Campaign) -> list[str]:
    known = {p.resolve() for p in campaign.files.values()}
    records = [p for n, p in campaign.files.items() if n not in {"campaign.toml", campaign.bearing_name}]
    suffixes = {p.suffix.lower() for p in records}
    found: list[Path] = []
    for folder in sorted({p.parent for p in records}):
        try:
            beside = list(itertools.islice(folder.iterdir(), _MAX_LOOKED_AT))
        except OSError:  # the folder is not there: the runs themselves say so
            continue
        found += [p for p in beside if p.suffix.lower() in suffixes and p.resolve() not in known and p.is_file()]
    return sorted(p.name for p in found)


def _groups(campaign: Campaign) -> list[str]:
    from rigdata.readers.hdf5.links import resolve
    from rigdata.readers.hdf5.reader import open_readonly

    known = {run.id for run in campaign.runs}
    try:
        with open_readonly(campaign.path, campaign.path.name) as handle:
            runs = resolve(handle, "runs", campaign.path.name)
            names = [] if runs is None else [str(n) for n in itertools.islice(runs, _MAX_LOOKED_AT)]
    except RigDataError:  # the runs themselves say so
        return []
    return sorted(set(names) - known)
