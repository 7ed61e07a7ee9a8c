"""An identification at the terminal: summary, coefficients, flags, remarks, models over frequency."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import TYPE_CHECKING

from tpjb_ident.cli.common.terminal import print_line, table
from tpjb_ident.conditions import sentences, untrusted

if TYPE_CHECKING:
    from rigdata.arrays import FloatArray
    from tpjb_ident.dynamic.broadband.band_result import BandResult
    from tpjb_ident.dynamic.results.identification import Identification

#: Share of the mean direct coefficient from which a cross-coupled one is shown.
CROSS_MATTERS = 0.1
#: Lines of h that are shown per operating point; all are in the table on disk.
SHOWN = 5


def show_identification(result: Identification) -> None:
    """Print what was identified: a summary, coefficients and models over frequency, bands, remarks."""
    if result.points or not result.bands:
        _show_summary(result)
        _show_coefficients(result)
        _show_frequency_fits(result)
    _show_bands(result)
    _show_remarks(result)


def _show_summary(result: Identification) -> None:
    """Print how many points have an answer, and how many of those are to be trusted."""
    bad = sum(bool(untrusted(p.quality)) or not math.isfinite(float(p.stiffness.k[0, 0])) for p in result.points)
    flagged = sum(bool(p.quality) for p in result.points) - bad
    trusted = "all to be trusted" if not bad else f"{bad} NOT to be trusted"
    more = f", {flagged} with flags" if flagged else ""
    print_line(f"{result.campaign}: {len(result.points)} operating points, {trusted}{more}.")


def _show_coefficients(result: Identification) -> None:
    """Print K and C of every point with half the width of their intervals; what is flagged stands below in full."""
    import numpy as np

    letters = _flag_letters(result)
    rows, cross = [], []
    for p in result.points:
        half, omega = p.stiffness.half_width(), p.stiffness.omega
        values = np.concatenate([p.stiffness.k.ravel() / 1e6, p.stiffness.c.ravel() / 1e3])
        halves = half / np.repeat([1e6, 1e3 * omega], 4)
        cells = [with_half(v, h) for v, h in zip(values, halves, strict=True)]
        place = [f"{p.point.static_load / 1e3:g}", f"{p.point.static_load_direction_deg:g}",
                 f"{p.point.shaft_speed_hz:g}", f"{p.point.excitation_hz:g}"]  # fmt: skip
        flags = "".join(letters[str(q)] for q in p.quality)
        rows.append([*place, cells[0], cells[3], cells[4], cells[7], f"{100 * p.outlier_fraction:.0f}", flags])
        if cross_coupling_matters(values, halves):
            cross.append([*place, *(cells[i] for i in (1, 2, 5, 6))])
    point = ["load kN", "dir. deg", "speed Hz", "exc. Hz"]
    direct = ["kxx MN/m", "kyy MN/m", "cxx kNs/m", "cyy kNs/m"]
    title = f"{result.campaign}: {result.method}, 95 % intervals"
    table(title, [*point, *direct, "out %", "flags"], rows, words=(9,), whole="coefficients.csv")
    if cross:
        coupled = ["kxy MN/m", "kyx MN/m", "cxy kNs/m", "cyx kNs/m"]
        heading = "cross-coupled, where they are more than a tenth of the direct ones"
        table(heading, [*point, *coupled], cross, words=(), whole="coefficients.csv")


def _flag_letters(result: Identification) -> dict[str, str]:
    """A letter for every condition that a point has, in the order of their appearance."""
    names = dict.fromkeys(str(q) for p in result.points for q in p.quality)
    return dict(zip(names, "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ", strict=False))


def _show_remarks(result: Identification) -> None:
    """Print every condition once, under the letter by which the table marks its points."""
    letters = _flag_letters(result)
    for remark in result.remarks():
        name = next((n for n in letters if remark.startswith(f"{n} at ")), "")
        print_line(f"{letters[name]}: {remark}" if name else f"note: {remark}")


def with_half(value: float, half: float) -> str:
    """A number with half its interval, or that there is none."""
    if not math.isfinite(value):
        return "no answer"
    if not math.isfinite(half) or half <= 0:
        return f"{value:.4g} ±?"
    digits = max(0, -math.floor(math.log10(half))) if half < 10 else 0
    return f"{value:.{min(digits, 3)}f} ±{half:.{min(digits, 3)}f}"


def cross_coupling_matters(values: FloatArray, halves: FloatArray) -> bool:
    """Whether a cross-coupled term is beyond doubt more than a tenth of the direct ones."""
    import numpy as np

    for part in (slice(0, 4), slice(4, 8)):
        value, half = values[part], halves[part]
        direct = 0.5 * (abs(value[0]) + abs(value[3]))
        if np.isfinite(value).all() and (np.abs(value[1:3]) - half[1:3] > CROSS_MATTERS * direct).any():
            return True
    return False


def _show_frequency_fits(result: Identification) -> None:
    """Print which model over frequency the data of every load support."""
    rows = []
    for group in result.frequency_fits():
        point = group.points[0].point
        for name, fit in group.fits.items():
            misfit = f"{100 * fit.misfit:.1f}"
            verdict = "supported" if name == group.supported else "refused" if fit.refused else "not needed"
            figures = [f"{fit.chi_square:.1f}", str(fit.dof), f"{fit.probability:.2g}", misfit]
            rows.append([f"{point.static_load / 1e3:g}", name, *figures, verdict])
    if rows:
        columns = ["load kN", "model", "chi-square", "dof", "probability", "misfit %", "verdict"]
        table("over frequency", columns, rows, words=(1, 6), whole="frequency_fits.csv")
    refusing = [g.points[0].point.static_load for g in result.frequency_fits() if g.supported not in g.fits]
    if refusing:
        loads = ", ".join(f"{load / 1e3:g}" for load in refusing[:6]) + " kN"
        more = f" and {len(refusing) - 6} more loads" if len(refusing) > 6 else ""
        print_line(
            f"note: at {loads}{more} the data refuse K-C and K-C-M; use the coefficients of each excitation frequency"
        )


def _show_bands(result: Identification) -> None:
    """Print K, C and M of every point that was excited over a band, and h at some of its lines."""
    if not result.bands:
        return
    bad = sum(bool(untrusted(band.quality)) for band in result.bands)
    trusted = "all to be trusted" if not bad else f"{bad} NOT to be trusted"
    n = len(result.bands)
    print_line(f"{result.campaign}: {n} operating point{'s' if n > 1 else ''} excited over a band, {trusted}.")
    _models(result)
    _lines(result)
    refusing = [band for band in result.bands if band.models and band.supported == "raw H"]
    if refusing:
        loads = ", ".join(f"{band.point.static_load / 1e3:g}" for band in refusing[:6]) + " kN"
        print_line(f"note: at {loads} the lines refuse K-C and K-C-M; use h over frequency (frf.csv)")


def _models(result: Identification) -> None:
    rows = []
    for band in result.bands:
        for name, model in band.models.items():
            half = model.half_width()
            verdict = "supported" if name == band.supported else "refused" if model.refused else "not needed"
            scales = ((0, 1e6), (3, 1e6), (4, 1e3), (7, 1e3), (8, 1.0), (11, 1.0))
            known = [(i, s) for i, s in scales if i < len(half)]
            cells = [with_half(model.parameters[i] / s, half[i] / s) for i, s in known]
            cells += ["-"] * (6 - len(cells))
            rows.append([f"{band.point.static_load / 1e3:g}", name, *cells, verdict])
    columns = ["load kN", "model", "kxx MN/m", "kyy MN/m", "cxx kNs/m", "cyy kNs/m", "mxx kg", "myy kg", "verdict"]
    if rows:
        table("models over the band, 95 % intervals", columns, rows, words=(1, 8), whole="frf_models.csv")


def _lines(result: Identification) -> None:
    rows = []
    for band in result.bands:
        half = band.half_width() / 1e6
        step = max(1, (len(band.lines) - 1) // (SHOWN - 1)) if len(band.lines) > 1 else 1
        for k in list(range(0, len(band.lines), step))[:SHOWN]:
            line = band.lines[k]
            h = line.stiffness.vector / 1e6
            cells = [with_half(h[i], half[k, i]) for i in (0, 3, 4, 7)]
            place = [f"{band.point.static_load / 1e3:g}", band.kind, f"{line.frequency:.4g}"]
            rows.append([*place, *cells, f"{min(line.coherence):.3f}", line.method])
    columns = ["load kN", "excitation", "Hz", "Re hxx", "Re hyy", "Im hxx", "Im hyy", "coh.", "method"]
    if rows:
        table("dynamic stiffness over the band, MN/m", columns, rows, words=(1, 8), whole="frf.csv")


def refused_bands(bands: Sequence[BandResult]) -> list[str]:
    """What forbids trust in bands that give no points, one line each; where there are points, they say it."""
    found = []
    for band in bands:
        serious = sentences(untrusted(band.quality))
        if not band.points and (serious or not band.lines):
            why = "; ".join(serious) or "no line stands clear of the noise"
            found.append(f"{band.point.static_load / 1e3:g} kN, {band.kind}: {why}")
    return found
