"""Signs and places of sensors, from how the shaft answers to force.

A bearing film pushes back: the symmetric parts of stiffness and damping are positive definite. A probe
wired to the wrong input or with the wrong sign turns the answer into its mirror image, which is not.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from rigdata.calibration import Channel
from rigdata.checking.observation import Observation
from rigdata.checking.set_points import excited, oil_force, to_plane
from rigdata.checking.wiring import name_fault, repairs
from rigdata.problem import Severity

FloatArray = NDArray[np.float64]
ComplexArray = NDArray[np.complex128]
#: A run whose force differs by this share from what the others foretell stands apart.
_OUTLIER = 0.08
#: Only where the others agree this well among themselves.
_AGREE = 0.03
_DEFINITE = 0.05
_MAX_ANISOTROPY = 6.0


@dataclass(frozen=True)
class _Answer:
    """One dynamic run: force and displacement phasors.

    Attributes
    ----------
    seen : Observation
    force : (2,) complex ndarray
        X, Y [N].
    readings : (2,) complex ndarray
        Of the two displacement channels, SI.
    channels : tuple of Channel
        These two.
    """

    seen: Observation
    force: ComplexArray
    readings: ComplexArray
    channels: tuple[Channel, ...]

    @property
    def displacement(self) -> ComplexArray:
        """X, Y [m]."""
        return to_plane(self.channels, self.readings)


def check_responses(runs: Sequence[Observation], mass: float) -> None:
    """Compare the dynamic runs of every operating point with each other and with what a film can do."""
    groups: dict[object, list[_Answer]] = {}
    for seen in runs:
        answer = _answer(seen, mass)
        if answer is not None:
            names = tuple(c.name for c in answer.channels)
            groups.setdefault((seen.run.point, names), []).append(answer)
    for group in groups.values():
        stiffness = _robust_stiffness(group)
        if stiffness is None:
            continue
        _check_signs(group, stiffness)
        _check_agreement(group, stiffness)


def _answer(seen: Observation, mass: float) -> _Answer | None:
    where = seen.pick("displacement")
    force = oil_force(seen, mass)
    if len(where) != 2 or force is None or seen.lines is None or "force" in seen.report.doubts or not excited(seen):
        return None
    readings = seen.lines.phasor[where]
    if not np.all(np.isfinite(readings)) or not np.any(np.abs(readings) > 8 * seen.lines.floor[where]):
        return None
    return _Answer(seen, force, readings, tuple(seen.channels[i] for i in where))


def _solve(answers: Sequence[_Answer]) -> ComplexArray | None:
    """H of ``F = H D``, least squares; None where the runs excite one direction only."""
    displacement = np.stack([a.displacement for a in answers], axis=1)
    force = np.stack([a.force for a in answers], axis=1)
    scale = np.linalg.norm(displacement, axis=0)
    if np.any(scale == 0) or not np.all(np.isfinite(displacement)):
        return None
    sizes = np.linalg.svd(displacement / scale, compute_uv=False)
    if sizes[-1] < 0.2 * sizes[0]:
        return None
    weights = 1.0 / scale
    return np.linalg.lstsq((displacement * weights).T, (force * weights).T, rcond=None)[0].T


def _misfit(answer: _Answer, stiffness: ComplexArray, repair: FloatArray | None = None) -> float:
    readings = answer.readings if repair is None else repair @ answer.readings
    predicted = stiffness @ to_plane(answer.channels, readings)
    return float(np.linalg.norm(answer.force - predicted) / np.linalg.norm(answer.force))


def _robust_stiffness(group: Sequence[_Answer]) -> ComplexArray | None:
    """H with the least median misfit among all pairs of runs, so that a faulty run cannot pull it."""
    best: tuple[float, ComplexArray] | None = None
    for pair in combinations(group[:24], 2):
        stiffness = _solve(pair)
        if stiffness is None:
            continue
        misfit = float(np.median([_misfit(a, stiffness) for a in group]))
        if best is None or misfit < best[0]:
            best = (misfit, stiffness)
    if best is None:
        return None
    close = [a for a in group if _misfit(a, best[1]) <= max(3 * best[0], 1e-9)]
    refined = _solve(close)
    return best[1] if refined is None else refined


def definiteness(matrix: NDArray) -> float:
    """Least over greatest eigenvalue of the symmetric part; 1 is isotropic, not above 0 impossible."""
    low, high = np.linalg.eigvalsh((matrix + matrix.T) / 2)
    return float(low / high) if high > 0 else -1.0


def _film_like(stiffness: ComplexArray) -> float:
    return min(definiteness(stiffness.real), definiteness(stiffness.imag))


def mirrored(channels: Sequence[Channel], repair: FloatArray) -> FloatArray:
    """What a repair (2, 2) of the readings of two channels does to X, Y (2, 2)."""
    inverse = np.stack([to_plane(channels, e) for e in np.eye(2)], axis=1)
    return np.asarray(inverse @ repair @ np.linalg.inv(inverse))


def _check_signs(group: Sequence[_Answer], stiffness: ComplexArray) -> None:
    """Positive stiffness and damping; most of the runs must agree, else there is no one answer to judge."""
    if np.median([_misfit(a, stiffness) for a in group]) > _OUTLIER:
        return
    channels = group[0].channels
    names = " and ".join(c.name for c in channels)
    if _film_like(stiffness) > _DEFINITE:
        _check_scales(group, stiffness, names)
        return
    hint = name_fault(channels, lambda repair: _film_like(stiffness @ np.linalg.inv(mirrored(channels, repair))))
    damping = float(np.linalg.eigvalsh((stiffness.imag + stiffness.imag.T) / 2)[0])
    kind = "damping" if definiteness(stiffness.real) > _DEFINITE else "stiffness"
    for answer in group:
        what = f"answer the force with negative {kind}, which a film does not have{hint}"
        cure = "Check axis, polarity and cables of the probes (and of the cells)"
        severity: Severity = "error" if hint or damping < 0 else "warning"
        answer.seen.report.say(f"signs {names}{hint}", severity, f"channels {names}", what, cure)


def _check_scales(group: Sequence[_Answer], stiffness: ComplexArray, names: str) -> None:
    """A film is not many times stiffer along one probe than along the other."""
    channels = group[0].channels
    along = np.stack([to_plane(channels, e) for e in np.eye(2)], axis=1)
    sizes = np.linalg.norm(stiffness @ along, axis=0)
    if sizes.max() < _MAX_ANISOTROPY * sizes.min():
        return
    large, small = channels[int(np.argmin(sizes))].name, channels[int(np.argmax(sizes))].name
    what = (
        f"{large} moves {sizes.max() / sizes.min():.0f} times more per force than {small}; "
        "as if one sensitivity were ten times off"
    )
    for answer in group:
        cure = "Check the sensitivities of the two probes"
        answer.seen.report.say(f"scales {names}", "warning", f"channels {names}", what, cure)


def _check_agreement(group: Sequence[_Answer], stiffness: ComplexArray) -> None:
    """A run that answers otherwise than the others at its operating point."""
    if len(group) < 4:
        return
    misfits = np.array([_misfit(a, stiffness) for a in group])
    if np.median(misfits) > _AGREE:
        return
    for answer, misfit in zip(group, misfits):
        if misfit <= max(_OUTLIER, 6 * float(np.median(misfits))):
            continue
        hint = _name_misfit(answer, stiffness, float(misfit))
        severity: Severity = "error" if misfit > 0.5 or (hint and misfit > 0.2) else "warning"
        what = f"differs by {misfit:.0%} from the other runs at this operating point{hint}"
        cure = "Check this run's channels and set points; leave it out or repeat it"
        answer.seen.report.say("disagrees", severity, "displacement and force", what, cure)


def _name_misfit(answer: _Answer, stiffness: ComplexArray, misfit: float) -> str:
    """Name the one fault of probes or cells that explains a run apart from the others."""
    tried = [(_misfit(answer, stiffness, m), w) for w, m in repairs(answer.channels, scales=True)]
    seen, where = answer.seen, answer.seen.pick("force")
    cells = [seen.channels[i] for i in where]
    if len(cells) == 2 and seen.lines is not None:
        phasors = seen.lines.phasor[where]
        for words, matrix in repairs(cells, scales=True):
            # The inertia part of the force stays: only the cells are supposed to be at fault.
            force = answer.force + to_plane(cells, matrix @ phasors - phasors)
            tried.append((_misfit(replace(answer, force=force), stiffness), words))
    tried.sort()
    clear = tried[0][0] < misfit / 4 and tried[0][0] < tried[1][0] / 2
    return f"; as if {tried[0][1]}" if clear else ""


def check_accelerometers(runs: Sequence[Observation]) -> None:
    """Housing acceleration against cell force: on springs, the two are in antiphase."""
    shown: dict[str, list[tuple[Observation, complex]]] = {}
    for seen in runs:
        for name, ratio in _accelerations(seen):
            shown.setdefault(name, []).append((seen, ratio))
    cure = "Check polarity, axis and sensitivity of the accelerometer"
    usual = {n: float(np.median([abs(r) for _, r in v])) for n, v in shown.items() if len(v) >= 3}
    for name, ratios in shown.items():
        directions = [r / abs(r) for _, r in ratios]
        if len(ratios) >= 3 and float(np.mean(np.real(directions))) > 0.7:
            what = "moves in phase with the cell force; the housing on its springs should move against it"
            for seen, _ in ratios:
                seen.report.say(f"accelerometer {name}", "warning", f"channel {name}", what, cure)
        least = min(usual.values(), default=math.nan)
        if name in usual and usual[name] > _MAX_ANISOTROPY * least:
            what = f"shows {usual[name] / least:.0f} times the acceleration per force of the other direction"
            for seen, _ in ratios:
                seen.report.say(f"acceleration {name}", "warning", f"channel {name}", what, cure)


def _accelerations(seen: Observation) -> list[tuple[str, complex]]:
    """Acceleration over cell force along each accelerometer that shows the line clearly."""
    lines, where = seen.lines, seen.pick("force")
    if lines is None or len(where) < 2 or "force" in seen.report.doubts or not excited(seen):
        return []
    force = to_plane([seen.channels[i] for i in where], lines.phasor[where])
    found: list[tuple[str, complex]] = []
    for index in seen.pick("acceleration"):
        channel, phasor = seen.channels[index], lines.phasor[index]
        axis = channel.axis or 0.0
        along = complex(force @ np.array([math.cos(axis), math.sin(axis)]))
        if abs(phasor) > 8 * lines.floor[index] and abs(along) > 0.3 * float(np.linalg.norm(force)):
            found.append((channel.name, complex(phasor) / along))
    return found
