"""Faults on request: one named defect in chosen runs and channels, for testing whoever reads the campaign.

Four places can be at fault: a sensor (its reading is wrong from the start), a record (readings are spoilt
after the converter), a run (the test was done or noted wrongly) and a file.
"""

from collections.abc import Iterable, Sequence
from dataclasses import asdict, dataclass
from fnmatch import fnmatchcase
from math import inf

from rigdata.near_names import unknown_name
from rigdata.virtual_rig.truth import PAPER_RIG, VirtualRigError

#: Where each kind sits, what it needs of the fault or of the layout, and what it does.
KINDS = PAPER_RIG["faults"]


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
                raise VirtualRigError(f"fault {self.kind!r} needs {name}: {KINDS[self.kind]['does']}")

    @property
    def needs(self) -> tuple[str, ...]:
        """What its kind needs: fields of its own, a kind of layout, or times in the files."""
        return tuple(KINDS[self.kind]["needs"])

    @property
    def place(self) -> str:
        """Where it sits: "sensor", "record", "run" or "file"."""
        return str(KINDS[self.kind]["place"])

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


def check_faults(faults: Iterable[Fault], runs: Sequence[str], channels: Sequence[str]) -> None:
    """Refuse faults that would strike nothing: a campaign must hold what was asked for."""
    for fault in faults:
        for name, pattern, names in (("run", fault.run, runs), ("channel", fault.channel or "*", channels)):
            if not any(fnmatchcase(candidate, pattern) for candidate in names):
                listed = ", ".join(names[:20])
                raise VirtualRigError(f"fault {fault.kind!r}: no {name} matches {pattern!r}; there are {listed}")
        candidates = channels if fault.kind == "swapped" else runs
        if fault.other is not None and fault.other not in candidates:
            raise VirtualRigError(f"fault {fault.kind!r}: there is no {fault.other!r} among {candidates}")
