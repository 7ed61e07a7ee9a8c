"""What was identified over a band, at the terminal: the models, and h where it is asked for most."""

from __future__ import annotations

from collections.abc import Sequence
from typing import TYPE_CHECKING

from tpjb_ident.cli.common.identification_display import with_half
from tpjb_ident.cli.common.terminal import print_line, table
from tpjb_ident.conditions import sentences, untrusted

if TYPE_CHECKING:
    from tpjb_ident.dynamic.broadband.band_result import BandResult
    from tpjb_ident.dynamic.results.identification import Identification

#: Lines of h that are shown per operating point; all are in the table on disk.
SHOWN = 5


def show_bands(result: Identification) -> None:
    """Print K, C and M of every point that was excited over a band, and h at some of its lines.

    Parameters
    ----------
    result : Identification
    """
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
    """What forbids trust in bands that give no points, one line each; where there are points, they say it.

    Parameters
    ----------
    bands : sequence of BandResult
    """
    found = []
    for band in bands:
        serious = sentences(untrusted(band.quality))
        if not band.points and (serious or not band.lines):
            why = "; ".join(serious) or "no line stands clear of the noise"
            found.append(f"{band.point.static_load / 1e3:g} kN, {band.kind}: {why}")
    return found
