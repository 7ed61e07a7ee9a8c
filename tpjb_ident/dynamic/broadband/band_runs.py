"""Which dynamic runs are excited over a band, and which of them belong together."""

from __future__ import annotations

from dataclasses import dataclass

from rigdata.operating_point import OperatingPoint
from rigdata.problem import Problem, RigDataError
from rigdata.run import Run

SINE = "sine"


@dataclass(frozen=True)
class BandGroup:
    """Runs at one operating point, excited alike.

    Attributes
    ----------
    point : OperatingPoint
        Its excitation frequency is zero.
    kind : str
        ``"multisine"``, ``"sweep"``, ``"random"`` or ``"impact"``.
    band : (float, float)
        What all of the runs were excited over [Hz].
    runs : tuple of rigdata.run.Run
    """

    point: OperatingPoint
    kind: str
    band: tuple[float, float]
    runs: tuple[Run, ...]


def is_broadband(run: Run) -> bool:
    """Whether a run is excited over a band, not by a sine.

    Parameters
    ----------
    run : rigdata.run.Run
    """
    return getattr(run, "excitation_kind", SINE) != SINE


def band_groups(runs: tuple[Run, ...]) -> list[BandGroup]:
    """Group broadband runs by operating point and kind of excitation, sorted.

    Parameters
    ----------
    runs : tuple of rigdata.run.Run

    Raises
    ------
    RigDataError
        The bands of runs that belong together have nothing in common.
    """
    groups: dict[tuple[object, ...], list[Run]] = {}
    for run in runs:
        p = run.point
        key = (p.static_load, p.static_load_direction_deg, p.shaft_speed_hz, run.excitation_kind)
        groups.setdefault(key, []).append(run)
    return [_group(groups[key]) for key in sorted(groups, key=repr)]


def _group(runs: list[Run]) -> BandGroup:
    bands = [run.band for run in runs if run.band is not None]
    low, high = max(b[0] for b in bands), min(b[1] for b in bands)
    first = runs[0]
    if not low < high:
        what = f"runs at {first.point} have no common excitation_band"
        raise RigDataError(Problem("error", first.file, "excitation_band", what, "Check the bands", first.id))
    p = first.point
    point = OperatingPoint(p.static_load, p.static_load_direction, p.shaft_speed, 0.0)
    return BandGroup(point, first.excitation_kind, (low, high), tuple(runs))
