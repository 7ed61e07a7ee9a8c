"""An identification on the command line: its settings, tables on disk, tables at the terminal, and trust."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from tpjb_ident.cli.common.command import Command
from tpjb_ident.cli.common.options import refuse_unknown
from tpjb_ident.conditions import sentences, untrusted
from tpjb_ident.errors import BadInputError, NotTrustedError

if TYPE_CHECKING:
    from rigdata.arrays import FloatArray
    from rigdata.campaign import Campaign
    from rigdata.operating_point import OperatingPoint
    from tpjb_ident.dynamic.results.identification import Identification
    from tpjb_ident.dynamic.settings import IdentifySettings

#: Share of the mean direct coefficient from which a cross-coupled one is shown.
CROSS_COUPLED = 0.1
#: Lines of h that are shown per operating point; all are in the table on disk.
MOST_LINES = 5
LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"
POINT = ["load kN", "dir. deg", "speed Hz", "exc. Hz"]
DIRECT = ["kxx MN/m", "kyy MN/m", "cxx kNs/m", "cyy kNs/m"]


def identify_settings(c: Command, campaign: Campaign, method: str, norm: str | None) -> IdentifySettings:
    """Build `IdentifySettings` from options, with the campaign's clearance for the amplitude check."""
    from tpjb_ident.dynamic.estimators.estimate import METHODS, NORMS
    from tpjb_ident.dynamic.settings import IdentifySettings

    refuse_unknown(method, METHODS, "--method")
    if norm is not None:
        refuse_unknown(norm, tuple(NORMS), "--norm")
        if method != "rlm":
            raise BadInputError(f"--norm: belongs to --method rlm, not to {method}.")
    if not campaign.of_kind("dynamic"):
        raise BadInputError(f"campaign {campaign.id}: has no dynamic runs; there is nothing to identify.")
    estimator = f"rlm:{norm or 'huber'}" if method == "rlm" else method
    return IdentifySettings(method=estimator, clearance=_clearance(c, campaign))


def _clearance(c: Command, campaign: Campaign) -> float | None:
    """Smallest assembled clearance [m], None if the campaign carries no bearing that can be read."""
    from model.bearing import BearingError
    from model.bearing_file import parse_bearing

    if not campaign.bearing_text:
        return None
    try:
        bearing = parse_bearing(campaign.bearing_text, campaign.bearing_name)
    except BearingError as error:  # coefficients need no bearing
        c.warn(f"{error} Until then the amplitude is not held against the clearance.")
        return None
    return min(pad.assembled_clearance for pad in bearing.pads)


def write_identification(c: Command, result: Identification) -> None:
    """Write coefficients, estimators, windows and the models over frequency; h over the band where one was excited."""
    from tpjb_ident.dynamic.broadband.band_result import frf_frame, models_frame

    if result.bands:
        c.table("frf", frf_frame(result.bands))
        c.table("frf_estimators", frf_frame(result.bands, every_method=True))
        c.table("frf_models", models_frame(result.bands))
    if result.bands and not result.points:
        return
    c.table("coefficients", result.to_frame())
    c.table("estimators", result.estimators_frame())
    c.table("windows", result.windows_frame())
    c.table("frequency_fits", result.frequency_frame())
    c.table("budget", result.budget_frame())


def refuse_untrusted(result: Identification) -> None:
    """End with exit code 3 if a point has no answer, or one that is not to be trusted, or no run any more."""
    import numpy as np

    bad = []
    for band in result.bands:  # where there are points, they say it
        serious = sentences(untrusted(band.quality))
        if not band.points and (serious or not band.lines):
            why = "; ".join(serious) or "no line stands clear of the noise"
            bad.append(f"{_load(band.point)} kN, {band.kind}: {why}")
    for p in result.points:
        serious = sentences(untrusted(p.quality))
        if serious or not np.isfinite(p.stiffness.h).all():
            bad.append(f"{_load(p.point)} kN, {p.point.excitation_hz:g} Hz: {'; '.join(serious)}")
    lost = sentences(untrusted(result.conditions))
    if lost and not bad:
        raise NotTrustedError("; ".join(lost))
    if bad:
        more = f"\n... and {len(bad) - 5} more" if len(bad) > 5 else ""
        total = len(result.points) + sum(not band.points for band in result.bands)
        raise NotTrustedError(f"{len(bad)} of {total} points:\n" + "\n".join([*bad[:5], *lost]) + more)


def show_identification(c: Command, result: Identification) -> None:
    """Print what was identified: a summary, coefficients and models over frequency, bands, remarks."""
    names = dict.fromkeys(str(q) for p in result.points for q in p.quality)
    letters = dict(zip(names, LETTERS, strict=False))
    if result.points or not result.bands:
        _show_summary(c, result)
        _show_coefficients(c, result, letters)
        _show_frequency_fits(c, result)
    if result.bands:
        _show_bands(c, result)
    for remark in result.remarks():
        name = next((n for n in letters if remark.startswith(f"{n} at ")), "")
        c.print(f"{letters.get(name, 'note')}: {remark}")


def _show_summary(c: Command, result: Identification) -> None:
    """Print how many points have an answer, and how many of those are to be trusted."""
    bad = flagged = 0
    for p in result.points:
        if untrusted(p.quality) or not math.isfinite(float(p.stiffness.k[0, 0])):
            bad += 1
        elif p.quality:
            flagged += 1
    flags = f", {flagged} with flags" if flagged else ""
    c.print(f"{result.campaign}: {len(result.points)} operating points, {_trust(bad)}{flags}.")


def _trust(bad: int) -> str:
    return f"{bad} NOT to be trusted" if bad else "all to be trusted"


def _load(point: OperatingPoint) -> str:
    return f"{point.static_load / 1e3:g}"


def _show_coefficients(c: Command, result: Identification, letters: dict[str, str]) -> None:
    """Print K and C of every point with half the width of their intervals, its flags by their letters."""
    import numpy as np

    direct, coupled = [], []
    for p in result.points:
        values = np.concatenate([p.stiffness.k.ravel() / 1e6, p.stiffness.c.ravel() / 1e3])
        halves = p.stiffness.half_width() / np.repeat([1e6, 1e3 * p.stiffness.omega], 4)
        cells = [with_half(value, half) for value, half in zip(values, halves, strict=True)]
        place = [
            _load(p.point),
            f"{p.point.static_load_direction_deg:g}",
            f"{p.point.shaft_speed_hz:g}",
            f"{p.point.excitation_hz:g}",
        ]
        flags = "".join(letters[str(q)] for q in p.quality)
        direct.append([*place, cells[0], cells[3], cells[4], cells[7], f"{100 * p.outlier_fraction:.0f}", flags])
        if cross_coupling_matters(values, halves):
            coupled.append([*place, cells[1], cells[2], cells[5], cells[6]])
    title = f"{result.campaign}: {result.method}, 95 % intervals"
    c.show(title, [*POINT, *DIRECT, "out %", "flags"], direct, words=(9,), file="coefficients.csv")
    if coupled:
        columns = [*POINT, "kxy MN/m", "kyx MN/m", "cxy kNs/m", "cyx kNs/m"]
        title = "cross-coupled, where they are more than a tenth of the direct ones"
        c.show(title, columns, coupled, words=(), file="coefficients.csv")


def with_half(value: float, half: float) -> str:
    """A number with half its interval, or that there is none."""
    if not math.isfinite(value):
        return "no answer"
    if not math.isfinite(half) or half <= 0:
        return f"{value:.4g} ±?"
    digits = max(0, -math.floor(math.log10(half))) if half < 10 else 0
    return f"{value:.{min(digits, 3)}f} ±{half:.{min(digits, 3)}f}"


def cross_coupling_matters(values: FloatArray, halves: FloatArray) -> bool:
    """Whether a cross-coupled term of (8,) kxx .. cyy is beyond doubt more than a tenth of the direct ones."""
    import numpy as np

    for value, half in zip(np.split(values, 2), np.split(halves, 2), strict=True):
        limit = CROSS_COUPLED * 0.5 * (abs(value[0]) + abs(value[3]))
        if np.isfinite(value).all() and (np.abs(value[1:3]) - half[1:3] > limit).any():
            return True
    return False


def _show_frequency_fits(c: Command, result: Identification) -> None:
    """Print which model over frequency the data of every load support."""
    rows, refusing = [], []
    for group in result.frequency_fits():
        load = _load(group.points[0].point)
        if group.supported not in group.fits:
            refusing.append(load)
        for name, fit in group.fits.items():
            figures = [f"{fit.chi_square:.1f}", str(fit.dof), f"{fit.probability:.2g}", f"{100 * fit.misfit:.1f}"]
            rows.append([load, name, *figures, _verdict(name == group.supported, fit.refused)])
    if rows:
        columns = ["load kN", "model", "chi-square", "dof", "probability", "misfit %", "verdict"]
        c.show("over frequency", columns, rows, words=(1, 6), file="frequency_fits.csv")
    if refusing:
        more = f" and {len(refusing) - 6} more loads" if len(refusing) > 6 else ""
        c.print(
            f"note: at {', '.join(refusing[:6])} kN{more} the data refuse K-C and K-C-M; use the coefficients of each "
            "excitation frequency"
        )


def _verdict(supported: bool, refused: bool) -> str:
    return "supported" if supported else "refused" if refused else "not needed"


def _show_bands(c: Command, result: Identification) -> None:
    """Print K, C and M of every point that was excited over a band, and h at some of its lines."""
    bad = sum(bool(untrusted(band.quality)) for band in result.bands)
    n = len(result.bands)
    c.print(f"{result.campaign}: {n} operating point{'s' if n > 1 else ''} excited over a band, {_trust(bad)}.")
    _show_band_models(c, result)
    rows = []
    for band in result.bands:
        half = band.half_width() / 1e6
        step = max(1, (len(band.lines) - 1) // (MOST_LINES - 1))
        for k in range(0, len(band.lines), step)[:MOST_LINES]:
            line = band.lines[k]
            h = line.stiffness.vector / 1e6
            cells = [with_half(h[i], half[k, i]) for i in (0, 3, 4, 7)]
            place = [_load(band.point), band.kind, f"{line.frequency:.4g}"]
            rows.append([*place, *cells, f"{min(line.coherence):.3f}", line.method])
    columns = ["load kN", "excitation", "Hz", "Re hxx", "Re hyy", "Im hxx", "Im hyy", "coh.", "method"]
    if rows:
        c.show("dynamic stiffness over the band, MN/m", columns, rows, words=(1, 8), file="frf.csv")
    refusing = [_load(band.point) for band in result.bands if band.models and band.supported == "raw H"]
    if refusing:
        loads = ", ".join(refusing[:6])
        c.print(f"note: at {loads} kN the lines refuse K-C and K-C-M; use h over frequency (frf.csv)")


def _show_band_models(c: Command, result: Identification) -> None:
    scales: Sequence[tuple[int, float]] = ((0, 1e6), (3, 1e6), (4, 1e3), (7, 1e3), (8, 1.0), (11, 1.0))
    rows = []
    for band in result.bands:
        for name, model in band.models.items():
            half = model.half_width()
            cells = [with_half(model.parameters[i] / s, half[i] / s) if i < len(half) else "-" for i, s in scales]
            verdict = _verdict(name == band.supported, model.refused)
            rows.append([_load(band.point), name, *cells, verdict])
    if rows:
        columns = ["load kN", "model", *DIRECT, "mxx kg", "myy kg", "verdict"]
        c.show("models over the band, 95 % intervals", columns, rows, words=(1, 8), file="frf_models.csv")
