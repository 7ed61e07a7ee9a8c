"""An identification on the command line: its settings, tables on disk, tables at the terminal, and trust."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from tpjb_ident.cli.command import Command
from tpjb_ident.cli.options import refuse_unknown
from tpjb_ident.columns import UNITS, Column, amount, size, symbol, words
from tpjb_ident.conditions import sentences, untrusted
from tpjb_ident.errors import BadInputError, NotTrustedError
from tpjb_ident.rounding import counted, listed

if TYPE_CHECKING:
    from collections.abc import Mapping

    from rigdata.arrays import FloatArray
    from rigdata.campaign import Campaign
    from tpjb_ident.identification.settings import IdentifySettings
    from tpjb_ident.results.frequency_model import FrequencyModel
    from tpjb_ident.results.identification import Identification

#: Share of the mean direct coefficient from which a cross-coupled one is shown.
_CROSS_COUPLED = 0.1
#: Lines of h that are shown per operating point; all are in the table on disk.
_MOST_LINES = 5
_LETTERS = "abcdefghijklmnopqrstuvwxyzABCDEFGHIJKLMNOPQRSTUVWXYZ"


def with_half(value: float, half: float) -> str:
    """A number with half its interval, or that there is none."""
    if not math.isfinite(value) or (value == 0.0 and not half > 0.0):
        return "no answer"
    if not math.isfinite(half) or half <= 0:
        return f"{value:.4g} ±?"
    digits = max(0, -math.floor(math.log10(half))) if half < 10 else 0
    return f"{value:.{min(digits, 3)}f} ±{half:.{min(digits, 3)}f}"


_LOAD = Column("load {load}")
_SPEED = Column("speed {speed}", lambda speed, spin: f"{speed:g}{' cw' if spin < 0.0 else ''}")
_POINT: tuple[Column | str, ...] = (_LOAD, "dir. {angle}", _SPEED, "exc. {frequency}")
#: Entries of (kxx, kxy, kyx, kyy, cxx, .. cyy).
_DIRECT, _CROSS = (0, 3, 4, 7), (1, 2, 5, 6)
_COEFFICIENTS = [
    *(Column(f"k{entry} {{stiffness}}", with_half) for entry in ("xx", "xy", "yx", "yy")),
    *(Column(f"c{entry} {{damping}}", with_half) for entry in ("xx", "xy", "yx", "yy")),
]
_MASSES = [Column(f"m{entry} {{mass}}", with_half) for entry in ("xx", "yy")]
_MODEL, _VERDICT = words("model", "verdict")
_MODEL_TABLE = [_LOAD, _MODEL, *(_COEFFICIENTS[i] for i in _DIRECT), *_MASSES, _VERDICT]


def identify_settings(c: Command, campaign: Campaign, method: str, norm: str | None) -> IdentifySettings:
    """Build `IdentifySettings` from options, with the campaign's clearance for the amplitude check."""
    from tpjb_ident.arguments import least_clearance
    from tpjb_ident.estimators.estimate import METHODS, NORMS
    from tpjb_ident.identification.settings import IdentifySettings

    refuse_unknown(method, METHODS, "--method")
    if norm is not None:
        refuse_unknown(norm, tuple(NORMS), "--norm")
        if method != "rlm":
            raise BadInputError(f"--norm: belongs to --method rlm, not to {method}.")
    if not campaign.of_kind("dynamic"):
        raise BadInputError(f"campaign {campaign.id}: has no dynamic runs; there is nothing to identify.")
    estimator = f"rlm:{norm or 'huber'}" if method == "rlm" else method
    return IdentifySettings(method=estimator, clearance=least_clearance(campaign, c.warn))


def identified(c: Command, campaign: Campaign, method: str, norm: str | None) -> Identification:
    """Identify a campaign."""
    from tpjb_ident.identification.identify import identify

    settings = identify_settings(c, campaign, method, norm)
    with c.progress(f"identifying {campaign.id}") as show:
        return identify(campaign, settings, show)


def write_identification(c: Command, result: Identification) -> None:
    """Write coefficients, estimators, windows and the models over frequency; h over the band where one was excited."""
    from tpjb_ident.results.band_result import frf_frame, models_frame

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
            bad.append(f"{amount(band.point.static_load, 'load')}, {band.kind}: {why}")
    for p in result.points:
        serious = sentences(untrusted(p.quality))
        if serious or not np.isfinite(p.stiffness.h).all():
            bad.append(f"{amount(p.point.static_load, 'load')}, {p.point.excitation_hz:g} Hz: {'; '.join(serious)}")
    lost = sentences(untrusted(result.conditions))
    if lost and not bad:
        raise NotTrustedError("; ".join(lost))
    if bad:
        total = len(result.points) + sum(not band.points for band in result.bands)
        raise NotTrustedError("\n".join([f"{len(bad)} of {total} points:", *lost, listed(bad, between="\n")]))


def show_identification(c: Command, result: Identification) -> None:
    """Print what was identified: a summary, coefficients and models over frequency, bands, remarks."""
    names = dict.fromkeys(str(q) for p in result.points for q in p.quality)
    letters = dict(zip(names, _LETTERS, strict=False))
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


def _show_coefficients(c: Command, result: Identification, letters: dict[str, str]) -> None:
    """Print K and C of every point with half the width of their intervals, its flags by their letters."""
    import numpy as np

    direct, cross = [], []
    for p in result.points:
        values = np.concatenate([p.stiffness.k.ravel(), p.stiffness.c.ravel()])
        halves = p.stiffness.half_width() / np.repeat([1.0, p.stiffness.omega], 4)
        cells = list(zip(values, halves, strict=True))
        point = p.point
        speed = point.shaft_speed_hz, point.spin
        place = point.static_load, point.static_load_direction_deg, speed, point.excitation_hz
        flags = "".join(letters[str(q)] for q in p.quality)
        direct.append([*place, *(cells[i] for i in _DIRECT), p.outlier_fraction, flags])
        if cross_coupling_matters(values, halves):
            cross.append([*place, *(cells[i] for i in _CROSS)])
    title = f"{result.campaign}: {result.method}, 95 % intervals"
    columns = [*_POINT, *(_COEFFICIENTS[i] for i in _DIRECT), Column("out {share}", ".0f"), *words("flags")]
    c.show(title, columns, direct, file="coefficients.csv")
    if cross:
        title = "cross-coupled, where they are more than a tenth of the direct ones"
        c.show(title, [*_POINT, *(_COEFFICIENTS[i] for i in _CROSS)], cross, file="coefficients.csv")


def cross_coupling_matters(values: FloatArray, halves: FloatArray) -> bool:
    """Whether a cross-coupled term of (8,) kxx .. cyy is beyond doubt more than a tenth of the direct ones."""
    import numpy as np

    for value, half in zip(np.split(values, 2), np.split(halves, 2), strict=True):
        limit = _CROSS_COUPLED * 0.5 * (abs(value[0]) + abs(value[3]))
        if np.isfinite(value).all() and (np.abs(value[1:3]) - half[1:3] > limit).any():
            return True
    return False


def _show_frequency_fits(c: Command, result: Identification) -> None:
    """Print which model over frequency the data of every load support."""
    rows, rejecting = [], []
    for group in result.frequency_fits():
        load = group.points[0].point.static_load
        if group.supported not in group.fits:
            rejecting.append(f"{load / size('load'):.6g}")
        rows += _model_rows(load, group.fits, group.supported)
    if rows:
        c.show("models over frequency, 95 % intervals", _MODEL_TABLE, rows, file="frequency_fits.csv")
    _print_rejecting(c, rejecting, "the coefficients of each excitation frequency")


def _print_rejecting(c: Command, loads: list[str], instead: str) -> None:
    """Say at which loads no model over frequency holds, and what to use."""
    if loads:
        c.print(f"note: at {listed(loads)} {symbol('load')} the data refuse K-C and K-C-M; use {instead}")


def _model_rows(load: float, models: Mapping[str, FrequencyModel], supported: str) -> list[list[object]]:
    """Direct coefficients of every model of one static point, with what the data say of it."""
    rows: list[list[object]] = []
    for name, model in models.items():
        pairs = [*zip(model.parameters, model.half_width(), strict=False), *4 * [None]]
        verdict = "supported" if name == supported else "refused" if model.refused else "not needed"
        rows.append([load, name, *(pairs[i] for i in (*_DIRECT, 8, 11)), verdict])
    return rows


def _show_bands(c: Command, result: Identification) -> None:
    """Print K, C and M of every point that was excited over a band, and h at some of its lines."""
    bad = sum(bool(untrusted(band.quality)) for band in result.bands)
    points = counted(len(result.bands), "operating point")
    c.print(f"{result.campaign}: {points} excited over a band, {_trust(bad)}.")
    models, lines, rejecting = [], [], []
    for band in result.bands:
        load = band.point.static_load
        models += _model_rows(load, band.models, band.supported)
        if band.models and band.supported == "raw H":
            rejecting.append(f"{load / size('load'):.6g}")
        half = band.half_width()
        step = max(1, (len(band.lines) - 1) // (_MOST_LINES - 1))
        for k in range(0, len(band.lines), step)[:_MOST_LINES]:
            line = band.lines[k]
            cells = [(line.stiffness.vector[i], half[k, i]) for i in _DIRECT]
            lines.append([load, band.kind, line.frequency, *cells, min(line.coherence), line.method])
    if models:
        c.show("models over the band, 95 % intervals", _MODEL_TABLE, models, file="frf_models.csv")
    if lines:
        entries = ("Re hxx", "Re hyy", "Im hxx", "Im hyy")
        parts = [Column(entry, with_half, quantity="stiffness") for entry in entries]
        excitation, method = words("excitation", "method")
        columns = [_LOAD, excitation, Column("{frequency}", ".4g"), *parts, Column("coh.", ".3f"), method]
        c.show(f"dynamic stiffness over the band, {UNITS['stiffness'][0]}", columns, lines, file="frf.csv")
    _print_rejecting(c, rejecting, "h over frequency (frf.csv)")
