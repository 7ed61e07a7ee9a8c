"""An HDF5 campaign: the manifest's text, and a group per run with a 1-D dataset per channel, read slice by slice."""

import hashlib
import itertools
import math
from collections.abc import Iterator, Sequence
from contextlib import ExitStack, contextmanager, suppress
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any, BinaryIO

import h5py
import numpy as np

from rigdata.arrays import FloatArray
from rigdata.device import Grid, timed_grid
from rigdata.near_names import hint
from rigdata.problem import Problem, RigDataError, refuse
from rigdata.readers.base import MAX_REQUEST, MAX_SAMPLES, MOST_RATE, Layout, RunReader
from rigdata.readers.hdf5.guards import (
    TEXT,
    UNIT,
    broken_heap,
    chunk_bytes,
    filters,
    foreign_filters,
    is_plain,
    is_text,
    resolve,
    too_long_text,
)
from rigdata.readers.series import Series, seconds, serving, time_columns

_MAX_CHUNK = 256 * 2**20
_PIECE = 2**20
#: Bytes of an attribute that is one number.
_MOST_NUMBER = 64
#: Members of a group that are looked at, and faults that are listed.
_MAX_MEMBERS, _LISTED = 4096, 20
#: Attribute of a run's group.
_RATE = "sample_rate_hz"
#: Key of an open group among the opened members; no dataset can have this name.
_GROUP = "/"
#: Samples of a time dataset that tell its rate, and which rows a logger left out.
_LOOK = 2**26
#: Bytes of unpacked chunks that the library keeps per dataset.
_LEAST_CACHE, _MOST_CACHE = 2**20, 2**25
_MAX_TEXT = 8 * 2**20


@contextmanager
def open_readonly(path: Path, file: str, run: str | None = None, cache: int | None = None) -> Iterator[Any]:
    """Open an HDF5 file for reading; turn what h5py raises on a broken file into `RigDataError`."""
    with _translated_faults(file, run), h5py.File(path, "r", locking="best-effort", rdcc_nbytes=cache) as handle:
        yield handle


@contextmanager
def _translated_faults(file: str, run: str | None) -> Iterator[None]:
    """Turn what h5py raises on a broken file into `RigDataError`."""
    try:
        yield
    except RigDataError:
        raise
    except FileNotFoundError as error:
        raise refuse(file, "", "the file is not there", "Check the path", run) from error
    except BlockingIOError as error:  # HDF5's file lock
        fault = "the file is being written by another program"
        raise refuse(file, "", fault, "Wait until the export has ended, or copy it first", run) from error
    except (OSError, RuntimeError, KeyError, ValueError, TypeError, OverflowError, MemoryError) as error:
        fault = f"the file cannot be read as HDF5 ({_first_line(error)})"
        raise refuse(file, "", fault, "Copy it again from the rig, or check it with h5dump", run) from error


def _first_line(error: BaseException) -> str:
    text = str(error).splitlines()[0] if str(error) else type(error).__name__
    if "signature not found" in text:
        return "it is empty, or of another kind"
    return "it is cut off before its end" if "truncated file" in text else text[:160]


#: Attributes by which writers turn stored counts into numbers.
_SCALES = {"scale_factor", "scale", "gain"}


@dataclass(frozen=True)
class _Members(Layout):
    """What every request needs, cached until the file changes."""

    members: tuple[str, ...]
    units: dict[str, str]  #: as the file states them
    largest_chunk: int  #: bytes


@dataclass(frozen=True)
class Hdf5Reader(RunReader):
    """One run's group in an HDF5 file; the file is opened for every request and closed again."""

    opened_members: dict[str, Any] = field(default_factory=dict, repr=False, compare=False)

    @contextmanager
    def _group(self, cache: int | None = None) -> Iterator[Any]:
        if _GROUP in self.opened_members:
            with _translated_faults(self.path.name, self.run):
                yield self.opened_members[_GROUP]
            return
        with open_readonly(self.path, self.path.name, self.run, cache) as handle:
            group = resolve(handle, f"runs/{self.run}", self.path.name, self.run)
            if group is None:
                remedy = "Delete the run from the manifest, or add the group"
                raise self.refuse("", "the group is missing", remedy)
            if not isinstance(group, h5py.Group):
                raise self.refuse("", "is not a group", "Store one dataset per channel in a group")
            yield group

    @contextmanager
    def opened(self) -> Iterator[None]:
        """Keep the file open while the block runs, so that many small requests cost little.

        The library's cache then holds a whole stored chunk of every dataset: slices that are no multiples of the
        chunks would else be unpacked again and again.
        """
        if _GROUP in self.opened_members:  # by whoever called
            yield
            return
        stack = ExitStack()
        try:
            self.opened_members[_GROUP] = stack.enter_context(self._group(_LEAST_CACHE))
            needed = min(2 * self._layout().largest_chunk, _MOST_CACHE)
            if needed > _LEAST_CACHE:  # the cache is given when a file is opened
                self.opened_members.clear()
                stack.close()
                self.opened_members[_GROUP] = stack.enter_context(self._group(needed))
            yield
        finally:  # closed without the block's own errors, which are no faults of the file
            self.opened_members.clear()
            stack.close()

    def _dataset(self, group: Any, name: str) -> Any:
        """A dataset that can be read without leaving the file, foreign code or vast memory."""
        if name in self.opened_members:
            return self.opened_members[name]
        dataset = resolve(group, name, self.file, self.run)
        if dataset is None:
            held = hint(name, itertools.islice(group, 20), "It holds:")[:220]
            raise self.refuse(f"dataset {name}", "channel is missing in the file", held)
        fault = ""
        if not isinstance(dataset, h5py.Dataset):
            fault = "is not a dataset"
        elif dataset.dtype.kind not in "fiu" or dataset.ndim != 1:
            fault = f"has type {dataset.dtype} and shape {dataset.shape}, not 1-D numbers"
        elif dataset.dtype.kind in "iu" and (scales := _SCALES.intersection(dataset.attrs)):
            fault = f"holds counts, and its attribute {min(scales)} is not applied"
        elif dataset.shape[0] > MAX_SAMPLES:
            fault = f"claims {dataset.shape[0]} samples"
        elif dataset.is_virtual or dataset.external:
            fault = "holds its data in another file"
        elif foreign := foreign_filters(dataset):
            fault = f"needs HDF5 filter {foreign[0]}, which is not a built-in one"
        elif chunk_bytes(dataset) > _MAX_CHUNK:
            fault = f"has chunks of {dataset.chunks[0]} samples"
        if fault:
            remedy = "Store one 1-D dataset of physical numbers per channel in this file, packed by gzip at most"
            raise self.refuse(f"dataset {name}", fault, remedy)
        if _GROUP in self.opened_members:
            self.opened_members[name] = dataset
        return dataset

    def _read_layout(self) -> _Members:
        """What is sampled together: by time datasets, stated rates, and the length that most channels have."""
        with self._group() as group:
            members = tuple(itertools.islice(group, _MAX_MEMBERS))
            datasets, units, problems = {}, {}, list[Problem]()
            for name in members:
                try:
                    datasets[name] = self._dataset(group, name)
                except RigDataError as error:  # raised again when that channel is asked for
                    problems.extend(error.problems)
            for name in self.channels:
                with suppress(RigDataError):  # as above
                    units[name] = self._unit(datasets.get(name) or self._dataset(group, name))
            if not datasets:
                fault = "the group holds no dataset of numbers"
                empty = self.problem("error", "", fault, "Store one dataset per channel")
                raise RigDataError(problems[:_LISTED] or empty)
            lengths = {name: dataset.shape[0] for name, dataset in datasets.items()}
            rate = self._checked_rate(group.attrs)
            run_rate = rate or self.stated_rate
            names = [name for name in self.channels if name in lengths]
            if run_rate is None:  # else nobody needs times that are not described
                names += [name for name in lengths if name not in self.channels]
            clocks = time_columns(names, self.channels)
            timed = {}
            for place in clocks:
                clock = names[place]
                time = self._seconds(group, clock, 0, min(lengths[clock], _LOOK))
                grid = timed_grid(lengths[clock], clock, time, clock, run_rate)
                if rate is not None and not (grid.even or self.channels[clock].clock):
                    grid = replace(grid, rate=rate)
                timed[clock] = grid
            timings = {name: Grid(length) for name, length in lengths.items() if name not in timed}
            for name, i in zip(names, serving(names, clocks, self.channels), strict=True):
                if i is not None and name in timings:
                    matches = [clock for clock in (names[i], *timed) if lengths[clock] == lengths[name]]
                    timings[name] = timed[matches[0]] if matches else Grid(lengths[name], times=lengths[names[i]])
            remedy = "State its sample_rate or a time dataset of its clock, or store channels of one length"
            grids, faults = self._planned(timings, run_rate, "dataset", remedy)
            unserved = Grid(max(lengths.values()), "", run_rate or np.nan)
            return _Members(grids or (unserved,), faults, members, units, max(map(chunk_bytes, datasets.values())))

    def _seconds(self, group: Any, clock: str, start: int, stop: int) -> FloatArray:
        """Some times of a time dataset [s]; one that is not described tells its unit itself."""
        values = self._samples(group, clock, start, stop)
        if clock in self.channels:
            return self.channels[clock].to_si(values)
        return seconds(Series(clock, self._unit(self._dataset(group, clock)), values))

    def _checked_rate(self, attributes: Any) -> float | None:
        if _RATE not in attributes:
            return None
        rate = math.nan
        if is_plain(attributes.get_id(_RATE), _MOST_NUMBER):
            with suppress(ValueError, TypeError):
                rate = float(np.asarray(attributes[_RATE]).reshape(()))
        if not 0.0 < rate < MOST_RATE:
            raise self.refuse(f"attribute {_RATE}", "is no rate", "Store one positive number, in Hz")
        return rate

    def _clock_times(self, clock: str, start: int, stop: int) -> FloatArray:
        with self._group() as group:
            return self._seconds(group, clock, start, stop)

    def _stored(self, names: Sequence[str], start: int, stop: int) -> list[FloatArray]:
        if stop - start > MAX_REQUEST:
            raise self.refuse("", f"{stop - start} samples asked for at once", "Read the run in slices")
        with self._group() as group:
            return [self._samples(group, name, start, stop) for name in names]

    def _samples(self, group: Any, name: str, start: int, stop: int) -> FloatArray:
        dataset = self._dataset(group, name)
        try:
            with np.errstate(invalid="ignore"):  # a signalling NaN is a missing value as well
                return np.asarray(dataset[start:stop], dtype=np.float64)
        except (OSError, RuntimeError) as error:  # what a filter says of damaged bytes
            fault = f"the stored samples are damaged ({_first_line(error)})"
            raise self.refuse(f"dataset {name}", fault, "Copy the file again from the rig") from error

    def stored_hash(self) -> str:
        """SHA-256 of the run as it is stored: attributes, and packed bytes, which are quicker to read than samples."""
        digest = hashlib.sha256()
        with self._group() as group, self.path.open("rb") as file:
            for name in sorted(self._layout().members):
                with suppress(RigDataError):  # raised when that channel is asked for; no result can come from it
                    _hash_dataset(digest, file, name, self._dataset(group, name))
            plain = sorted(key for key in group.attrs if is_plain(group.attrs.get_id(key), _PIECE))
            digest.update(repr([(key, repr(group.attrs[key])) for key in plain]).encode())
        return digest.hexdigest()

    def problems(self) -> tuple[Problem, ...]:
        """Tell which datasets nobody describes, and which state another unit than the manifest."""
        layout = self._layout()
        return self._notes("datasets", layout.members, layout.units)

    def _unit(self, dataset: Any) -> str:
        attributes = dataset.attrs
        for key in UNIT:
            if key in attributes and is_text(attributes.get_id(key), self.path):
                return str(_text(attributes[key]) or "")
        return ""


def _text(value: Any) -> object:
    """An attribute as text where it is one; as it is where it is none."""
    value = value.item() if isinstance(value, np.ndarray) and value.size == 1 else value
    return value.decode("utf-8", "replace") if isinstance(value, bytes) else value


def _hash_dataset(digest: Any, file: BinaryIO, name: str, dataset: Any) -> None:
    """Feed how a dataset is stored, and every stored byte, in the order of the file's own index."""
    layout = (name, dataset.dtype.str, dataset.shape, dataset.chunks, filters(dataset))
    digest.update(repr(layout).encode())
    pieces = []
    if dataset.chunks is not None:
        dataset.id.chunk_iter(lambda chunk: pieces.append((chunk.byte_offset, chunk.size)))
    elif dataset.id.get_offset() is not None:
        pieces.append((dataset.id.get_offset(), dataset.id.get_storage_size()))
    for offset, size in pieces:
        digest.update(repr((offset, size)).encode())
        file.seek(offset + dataset.file.userblock_size)
        while size > 0 and (block := file.read(min(size, _PIECE))):
            digest.update(block)
            size -= len(block)


def read_texts(path: Path, file: str) -> tuple[str, str]:
    """Read the manifest and the bearing text from the root attributes."""
    try:
        heap = broken_heap(path)
    except OSError as error:
        raise refuse(file, "", f"cannot be read ({error.strerror or error})", "Check the path") from error
    if heap is not None:
        fault = "the file is damaged: its store of texts cannot be walked"
        raise refuse(file, f"byte {heap}", fault, "Copy the file again from the rig")
    with open_readonly(path, file) as handle:
        if "manifest" not in handle.attrs:
            raise refuse(file, "root attribute manifest", "is missing", "Store campaign.toml's text there")
        damaged = too_long_text(path, ("manifest", "bearing", *UNIT), handle.userblock_size)
        if damaged is not None:
            raise refuse(file, f"attribute {damaged}", "claims a text longer than the file", "Copy the file again")
        manifest = _text_attribute(handle, "manifest", file)
        return manifest, _text_attribute(handle, "bearing", file) if "bearing" in handle.attrs else ""


def _text_attribute(handle: Any, name: str, file: str) -> str:
    stored, value = handle.attrs.get_id(name), None
    if stored.get_storage_size() <= _MAX_TEXT and stored.get_type().get_class() == TEXT:
        value = _text(handle.attrs[name])
    if not isinstance(value, str) or "\ufffd" in value:  # what is no UTF-8
        fault = "is not a text, or far too long"
        raise refuse(file, f"root attribute {name}", fault, "Store it as one UTF-8 string")
    return value
