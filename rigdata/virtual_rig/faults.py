"""Faults on request: one named defect in chosen runs and channels, for testing whoever reads the campaign.

Four places can be at fault: a sensor (its reading is wrong from the start), a record (readings are spoilt
after the converter), a run (the test was done or noted wrongly) and a file.
"""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import asdict, dataclass
from fnmatch import fnmatchcase
from math import inf
from typing import Literal

from rigdata.near_names import unknown_name
from rigdata.virtual_rig.truth import VirtualRigError

Place = Literal["sensor", "record", "run", "file"]

#: Where each kind sits, what it needs of the fault (or of the layout), and what it does.
KINDS: dict[str, tuple[Place, str, str]] = {
    "scaled": ("sensor", "channel value", "readings are `value` times the truth"),
    "delayed": ("sensor", "channel value", "recorded `value` seconds late"),
    "rotated": ("sensor", "channel value", "the sensor is `value` rad off its stated axis"),
    "offset": ("sensor", "channel value", "`value` (SI) is added"),
    "crosstalk": ("sensor", "channel value", "also reads this fraction `value` of the other axis"),
    "dead": ("record", "channel", "reads `value` (default 0) all the time"),
    "stuck": ("record", "channel", "from `start` on, for `length`, the reading does not change"),
    "clipped": ("record", "channel", "saturates at `value` (default 0.6) of its excursion about the middle"),
    "swapped": ("record", "channel other", "exchanged with the channel `other`"),
    "inverted": ("record", "channel", "wired the wrong way round: the reading has the wrong sign"),
    "nan_gap": ("record", "channel", "no value from `start` for `length`"),
    "glitch": ("record", "channel value", "is off by `value` (SI) from `start` for `length`"),
    "time_gap": ("record", "", "rows from `start` for `length` are missing in all channels"),
    "time_jitter": ("record", "times", "time stamps scatter by `value` (default 0.2) of a sample"),
    "missing_excitation": ("run", "", "the actuators were off"),
    "duplicate_run": ("run", "other", "the record is that of the run `other`"),
    "wrong_pad": ("run", "value", "the manifest names pad `value`"),
    "wrong_direction": ("run", "value", "the manifest's direction is off by `value` rad"),
    "wrong_frequency": ("run", "value", "the manifest's excitation frequency is off by `value` Hz"),
    "wrong_load": ("run", "value", "the manifest's static load is `value` times the truth"),
    "missing_channel": ("file", "channel", "the file lacks the channel"),
    "duplicate_column": ("file", "channel CsvLayout", "the column is there twice"),
    "truncated_line": ("file", "CsvLayout", "the last line ends in the middle"),
    "short_channel": ("file", "channel Hdf5Layout", "the dataset is shorter than the others"),
    "missing_file": ("file", "", "the run's file or group is not there"),
    "empty_file": ("file", "", "the run's file holds no samples"),
}


@dataclass(frozen=True)
class Fault:
    """One defect."""

    kind: str
    run: str = "*"
    channel: str | None = None
    value: float | None = None
    start: float = 0.0
    length: float = inf
    other: str | None = None

    def __post_init__(self) -> None:
        if self.kind not in KINDS:
            raise VirtualRigError(unknown_name("fault", self.kind, KINDS))
        for name in self.needs:
            if getattr(self, name, self) is None:
                raise VirtualRigError(f"fault {self.kind!r} needs {name}: {KINDS[self.kind][2]}")

    @property
    def needs(self) -> list[str]:
        """What its kind needs: fields of its own, a kind of layout, or times in the files."""
        return KINDS[self.kind][1].split()

    @property
    def place(self) -> Place:
        """Where it sits."""
        return KINDS[self.kind][0]

    def stated(self) -> dict[str, object]:
        """Its entries that say something; an open end is not a JSON number."""
        return {key: value for key, value in asdict(self).items() if value not in (None, inf)}

    def size(self, usual: float) -> float:
        """Its value, or the usual one."""
        return usual if self.value is None else self.value

    def affects(self, run: str) -> bool:
        """Whether it concerns a run."""
        return fnmatchcase(run, self.run)

    def is_in(self, channel: str) -> bool:
        """Whether it concerns a channel of its runs."""
        return self.channel is None or fnmatchcase(channel, self.channel)


def check_faults(faults: Iterable[Fault], runs: Iterable[str], channels: Iterable[str]) -> None:
    """Refuse faults that would strike nothing: a campaign must hold what was asked for."""
    runs, channels = list(runs), list(channels)
    for fault in faults:
        for name, pattern, names in (("run", fault.run, runs), ("channel", fault.channel or "*", channels)):
            if not any(fnmatchcase(candidate, pattern) for candidate in names):
                listed = ", ".join(names[:20])
                raise VirtualRigError(f"fault {fault.kind!r}: no {name} matches {pattern!r}; there are {listed}")
        candidates = channels if fault.kind == "swapped" else runs
        if fault.other is not None and fault.other not in candidates:
            raise VirtualRigError(f"fault {fault.kind!r}: there is no {fault.other!r} among {candidates}")
