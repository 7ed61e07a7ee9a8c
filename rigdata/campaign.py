"""A campaign: its manifest read and checked, its runs ready to be read lazily."""

import hashlib
import html
import itertools
import os
import re
import stat
from collections import Counter
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path, PureWindowsPath
from typing import Any

from rigdata.calibration import Channel, Channels
from rigdata.manifest.manifest import MAX_MANIFEST, Description, Manifest, RunDescription, RunEntry, parse_manifest
from rigdata.near_names import hint
from rigdata.problem import Problem, RigDataError, refuse
from rigdata.readers.base import TEXT, ReadingCache, RunReader
from rigdata.run import Run

MANIFEST_NAME = "campaign.toml"
HDF5_SUFFIXES = (".h5", ".hdf5", ".hdf", ".he5")
_MAX_BEARING = 2**20
_DRIVE = re.compile(r"^[A-Za-z]:|^[\\/]{2}")
_MAX_NAME = 1000


@dataclass(frozen=True, kw_only=True)
class Campaign(Description):
    """A test series: what was measured on one bearing, and how.

    Attributes
    ----------
    id, description : str
    path : Path
        Folder or HDF5 file.
    bearing_name : str
        As the manifest names the bearing file.
    bearing_text : str
        Its content; "" where the campaign does not carry it.
    housing_mass : float
        Stator mass between film and load cells [kg]; NaN where unknown.
    channels : mapping of str to Channel
    runs : tuple of Run
    notes : tuple of Problem
        Findings that did not stop loading.
    files : mapping of str to Path
        Everything that the campaign consists of, by display name.
    mass_uncertainty : float
        Of the housing's mass, one standard deviation [kg].
    mains : float or None
        Mains frequency as the manifest states it [Hz].
    rotation : str
        ``"counter-clockwise"`` or ``"clockwise"``.
    mount : str or None
        ``"floating"``: the stator hangs on its stingers; ``"cells"``: it stands on the load cells; None: not stated.
    date, by : str
        When and by whom it was measured, as the manifest says.

    Examples
    --------
    >>> campaign = load_campaign(demo)
    >>> print(campaign)
    campaign demo: 58 runs (42 dynamic, 10 locus, 5 dry_pivot, 1 clearance), 12 channels
    """

    path: Path
    bearing_text: str
    runs: tuple[Run, ...]
    files: Mapping[str, Path]

    def __str__(self) -> str:
        counts = Counter(run.kind for run in self.runs)
        listed = ", ".join(f"{count} {kind}" for kind, count in counts.items())
        return f"campaign {self.id}: {len(self.runs)} runs ({listed}), {len(self.channels)} channels"

    def __repr__(self) -> str:
        return f"<Campaign {str(self).partition(' ')[2]}, {self.path.name}>"

    def _repr_html_(self) -> str:
        """In a notebook: what it is, and a row per kind of run."""
        rows: list[tuple[str, ...]] = [("kind", "runs", "load, kN", "shaft, Hz", "excitation, Hz")]
        for kind in dict.fromkeys(run.kind for run in self.runs):
            points = [run.point for run in self.of_kind(kind)]
            columns = zip(*((p.static_load / 1e3, p.shaft_speed_hz, p.excitation_hz) for p in points), strict=True)
            spans = [(f"{min(values):.4g}", f"{max(values):.4g}") for values in columns]
            rows.append((kind, str(len(points)), *(" to ".join(dict.fromkeys(span)) for span in spans)))
        body = "".join(f"<tr><td>{'</td><td>'.join(row)}</td></tr>" for row in rows)
        return f"<p>{html.escape(str(self))}</p><table>{body}</table>"

    def run(self, run_id: str) -> Run:
        """Find the run `run_id`.

        Parameters
        ----------
        run_id : str

        Raises
        ------
        RigDataError
            There is none; names the nearest.

        Examples
        --------
        >>> print(load_campaign(demo).run("d-02500-25-01").point)
        2500 N at -90 deg, shaft 22 Hz, excited at 25 Hz
        """
        runs = {run.id: run for run in self.runs}
        if run_id in runs:
            return runs[run_id]
        cure = hint(run_id, runs, "There are")[:200]
        raise refuse(self.path.name, "", f"no run has the id {run_id!r}", cure)

    def of_kind(self, kind: str) -> tuple[Run, ...]:
        """All runs of one kind, in the manifest's order.

        Parameters
        ----------
        kind : str
            ``"dynamic"``, ``"dry_pivot"``, ``"locus"`` or ``"clearance"``.

        Examples
        --------
        >>> [run.pad for run in load_campaign(demo).of_kind("dry_pivot")]
        [1, 2, 3, 4, 5]
        """
        return tuple(r for r in self.runs if r.kind == kind)

    def fingerprint(self) -> dict[str, str]:
        """SHA-256 of every file of the campaign, by display name; ``"missing"`` where one is not there."""
        return {name: _sha256(path) for name, path in self.files.items()}


def _sha256(path: Path) -> str:
    try:
        with path.open("rb") as stream:
            return hashlib.file_digest(stream, "sha256").hexdigest()
    except (FileNotFoundError, IsADirectoryError):
        return "missing"
    except OSError as error:
        raise refuse(path.name, "", f"cannot be read ({error.strerror})", "Check the rights of the file") from error


def load_campaign(path: str | Path) -> Campaign:
    """Open a campaign; records are read only when they are asked for.

    Parameters
    ----------
    path : str or Path
        A folder with ``campaign.toml``, that file, one HDF5 file, or a folder with one of these in it.

    Returns
    -------
    Campaign

    Raises
    ------
    RigDataError
        Every problem of the manifest at once, each with its line.

    Examples
    --------
    >>> load_campaign(demo).housing_mass
    30.0
    """
    try:
        source = campaign_place(Path(path))
        if source.is_dir() and (source / MANIFEST_NAME).exists():
            inside(source, MANIFEST_NAME, str(source), "")  # a stranger's folder may link it elsewhere
            return _load_folder(source, source / MANIFEST_NAME)
        _refuse_other(source)
    except RigDataError:
        raise
    except (OSError, ValueError) as error:  # a name too long or with a NUL, a folder that may not be entered
        message = f"cannot be opened ({getattr(error, 'strerror', None) or error})"
        raise refuse(str(path)[:100], "", message, "Check the path and its rights") from error
    return _load_folder(source.parent, source) if source.suffix.lower() == ".toml" else _load_hdf5(source)


def campaign_place(path: Path) -> Path:
    """`path`, or the one campaign that is in it, as in the output folder of `tpjb simulate`."""
    path = path if path.name else path.resolve()  # "." has no name for messages
    campaigns = _campaigns_in(path) if path.is_dir() and not (path / MANIFEST_NAME).exists() else []
    return campaigns[0] if len(campaigns) == 1 else path


def _campaigns_in(folder: Path) -> list[Path]:
    members = sorted(itertools.islice(folder.iterdir(), 1000))
    return [p for p in members if p.suffix.lower() in HDF5_SUFFIXES or (p / MANIFEST_NAME).is_file()]


def _refuse_other(source: Path) -> None:
    """Refuse what is neither a manifest nor may be an HDF5 file."""
    cure, fault = f"Give the folder that holds {MANIFEST_NAME}, or an HDF5 file", ""
    if source.is_dir():
        fault = f"the folder has no {MANIFEST_NAME}"
        stored = [p.name for p in _campaigns_in(source)]
        listed = f" ({', '.join(stored[:3])})" if stored else ""
        cure += f"{listed}; `tpjb init FOLDER` drafts one for records"
    elif not source.exists():
        fault, cure = "there is no such file or folder", "Check the path"
    elif not source.is_file():
        fault = "is not an ordinary file"
    elif source.suffix.lower() in TEXT:
        fault = "is a record, not a campaign"
    if fault:
        raise refuse(str(source)[:200], "", fault, cure)


def _read_text(path: Path, file: str, limit: int) -> str:
    try:
        if not stat.S_ISREG(path.stat().st_mode):
            raise refuse(file, "", "is not an ordinary file", "Give a text file")
        with path.open("rb") as stream:
            data = stream.read(limit + 1)
    except OSError as error:
        message = f"cannot be read ({error.strerror or error})"
        raise refuse(file, "", message, "Check the path and its rights") from error
    if len(data) > limit:
        raise refuse(file, "", f"is larger than {limit >> 20} MB", "Is it the right file?")
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        line = data[: error.start].count(b"\n") + 1
        raise refuse(file, f"line {line}", "is not UTF-8 text", "Save the file as UTF-8") from error


def inside(folder: Path, name: str, file: str, place: str, run: str | None = None) -> Path:
    r"""Resolve a file name of a manifest, which a stranger may have written, below its folder."""
    target = folder
    fault = ""
    parts = name.replace("\\", "/").split("/")
    if not name.strip() or len(name) > _MAX_NAME or not name.isprintable():
        fault = "is empty, too long or holds control characters"
    elif _DRIVE.match(name) or name.startswith(("/", "\\", "~")) or PureWindowsPath(name).drive:
        fault = "is not relative"
    elif ".." in parts:
        fault = "leaves the campaign folder by '..'"
    else:
        root = folder.resolve()
        try:
            target = root.joinpath(*parts).resolve()
        except (OSError, RuntimeError) as error:  # a loop of symlinks
            fault = f"cannot be resolved ({type(error).__name__})"
        else:
            fault = "" if target.is_relative_to(root) else "leaves the campaign folder by a symlink"
    if fault:
        cure = "Give a path relative to the campaign folder, inside it"
        raise refuse(file, place, f"file {name[:120]!a} {fault}", cure, run)
    return target


def _load_folder(folder: Path, manifest_path: Path) -> Campaign:
    from rigdata.readers.file_reader import FileReader

    text = _read_text(manifest_path, manifest_path.name, MAX_MANIFEST)
    files = {manifest_path.name: manifest_path}
    text_of = _named_file(folder, manifest_path.name, files)
    manifest = parse_manifest(text, manifest_path.name, text_of)
    problems = []
    bearing, name = "", manifest.bearing_name
    try:
        if os.path.isfile(inside(folder, name, manifest_path.name, "bearing")):
            bearing = text_of(name, "bearing")
        else:
            fault = f"the bearing file {name!r} is not in the folder"
            remedy = "Add it, or give --bearing where one is needed"
            problems.append(Problem("warning", manifest_path.name, "bearing", fault, remedy))
    except RigDataError as error:
        problems.extend(error.problems)
    cache = ReadingCache()

    def reader_of(entry: RunEntry, rate: float | None, channels: Channels) -> RunReader:
        place = f"[[runs]] no. {entry.index + 1} file"
        target = inside(folder, entry.file, manifest_path.name, place, entry.id)
        files[entry.file] = target
        return FileReader(target, entry.file, entry.id, channels, rate, manifest.csv, cache)

    return _assembled(manifest, reader_of, problems, path=folder, bearing_text=bearing, files=files)


def run_in_file(run: Run, path: Path, file: str, run_id: str) -> Run:
    """The same test in another file: a repeat, or a record that landed under another name."""
    return replace(run, id=run_id, reader=replace(run.reader, path=path, file=file, run=run_id))


def _load_hdf5(path: Path) -> Campaign:
    from rigdata.readers.hdf5.guards import refuse_claims
    from rigdata.readers.hdf5.reader import Hdf5Reader, open_readonly, read_texts

    text, bearing = read_texts(path, path.name)
    files = {path.name: path}
    manifest = parse_manifest(text, f"{path.name}:manifest", _named_file(path.parent, path.name, files))
    with open_readonly(path, path.name) as handle:
        refuse_claims(handle, path, [run.id for run in manifest.runs], list(manifest.channels))
    problems = []
    if not bearing or len(bearing) > _MAX_BEARING:
        cure = "Store the bearing's TOML text there, or give --bearing where one is needed"
        problems.append(Problem("warning", path.name, "root attribute bearing", "is missing or too long", cure))
        bearing = ""

    def reader_of(entry: RunEntry, rate: float | None, channels: Channels) -> RunReader:
        return Hdf5Reader(path, f"{path.name}:/runs/{entry.id}", entry.id, channels, rate)

    return _assembled(manifest, reader_of, problems, path=path, bearing_text=bearing, files=files)


def _named_file(folder: Path, file: str, files: dict[str, Path]) -> Callable[[str, str], str]:
    """Reads small text files of the campaign that the manifest names, and notes them in `files`."""

    def read(name: str, place: str) -> str:
        files[name] = inside(folder, name, file, place)
        return _read_text(files[name], name, _MAX_BEARING)

    return read


def _assembled(
    manifest: Manifest,
    reader_of: Callable[[RunEntry, float | None, Channels], RunReader],
    problems: list[Problem],
    **source: Any,
) -> Campaign:
    """The campaign of a manifest, with a reader for each run; refused if anything is wrong with either."""
    channels = _used(manifest.channels)
    runs = []
    for entry in manifest.runs:
        run_channels = manifest.described.get(entry.id)
        try:
            reader = reader_of(entry, entry.sample_rate or manifest.sample_rate, run_channels or manifest.channels)
        except RigDataError as error:
            problems.extend(error.problems)
            continue
        description = {name: getattr(entry, name) for name in RunDescription.__dataclass_fields__}
        used = channels if run_channels is None else _used(run_channels)
        runs.append(Run(**description, channels=used, reader=reader, housing_mass=manifest.housing_mass))
    if any(p.severity == "error" for p in problems):
        raise RigDataError([*manifest.notes, *problems])
    described = {name: getattr(manifest, name) for name in Description.__dataclass_fields__}
    described |= {"channels": channels, "notes": (*manifest.notes, *problems)}
    return Campaign(**described, runs=tuple(runs), **source)


def _used(channels: Channels) -> dict[str, Channel]:
    return {name: channel for name, channel in channels.items() if channel.quantity != "ignore"}
