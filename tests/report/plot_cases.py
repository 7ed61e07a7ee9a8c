"""Results made by hand, and every picture drawn from them once.

``python -m tests.report.plot_cases`` draws the pictures that `test_plots` compares with anew: look at them before you
commit them.
"""

import functools
from dataclasses import dataclass
from pathlib import Path
from types import SimpleNamespace

import matplotlib
import matplotlib.image
import matplotlib.style
import numpy as np
import pandas as pd

from rigdata.operating_point import OperatingPoint
from rigdata.record import VectorRecord
from tpjb_ident.clearance.locus import Locus, LocusPoint
from tpjb_ident.clearance.measure import ClearancePolygon
from tpjb_ident.clearance.polygon import corners
from tpjb_ident.phasors.slow_noise import NoiseModel
from tpjb_ident.pivot.curve import PivotCurve, PivotSteps
from tpjb_ident.pivot.dry_record import PadDirection
from tpjb_ident.pivot.law_fit import LawFit
from tpjb_ident.pivot.laws import LAWS
from tpjb_ident.report import plots

PICTURES = Path(__file__).parent / "pictures"
DPI = 60
ANGLES = np.radians([-90.0, -18.0, 54.0, 126.0, 198.0])


def curve(pad: int = 1, softer: float = 1.0, gap: float = 0.0, down: bool = False) -> PivotCurve:
    """Curve of a line contact; `gap` [m] of missing contact; `down` adds unloading steps."""
    # zero reading, friction, ln scale, kappa and, with contact loss, gap and ln load
    theta = [0.0, 0.004, np.log(7.25e-10 * softer), 0.0966, *((gap, np.log(500.0)) if gap else ())]
    spread = np.array([2e-8, 2e-3, 0.02, 0.015, *((1e-7, 0.06) if gap else ())])
    law = LawFit(LAWS["hertz-line"], 2000.0, bool(gap), np.array(theta), np.diag(spread**2), 0.0, 60.0, 100)
    load = np.linspace(500.0, 5000.0, 10)
    branch = np.ones(10)
    if down:
        load, branch = np.r_[load, load[-2::-1]], np.r_[branch, -np.ones(9)]
    reading, _ = law.reading_gradient(load / (1.0 - 0.004 * branch), branch)
    weight = np.ones(len(load))
    weight[4] = 0.0
    reading[4] += 0.8e-6
    n = len(load)
    steps = PivotSteps(load, reading, np.full(n, 4e-8), 0.03 * load, 0.15 * reading, branch.astype(int), weight)
    onset = 2200.0 if gap else 0.0
    return PivotCurve(
        pad=pad,
        angle=float(ANGLES[pad - 1]),
        steps=steps,
        fits=(law,),
        weights=np.ones(1),
        onset_load=onset,
        onset_load_se=100.0 if gap else 0.0,
        valid_from=max(onset, 250.0),
        valid_to=5000.0,
        load_direction=PadDirection(0.03, 0.001),
        displacement_direction=PadDirection(0.149, 0.01),
    )


def curves() -> list[PivotCurve]:
    """Five pads, the upper two with incomplete contact."""
    return [curve(p, 1.0 + 0.25 * p, 3e-6 if p in (3, 4) else 0.0) for p in range(1, 6)]


def formula(pad: int, load: float) -> tuple[float, float]:
    """Kirk-like secant and tangent [N/m]."""
    return 1.2e9 + 1e8 * np.log(load / 1000.0), 1.3e9 + 1e8 * np.log(load / 1000.0)


def polygon(clearance: float = 80e-6, odd: float = 8e-6) -> ClearancePolygon:
    """Pentagon with one pad off."""
    sides = np.full(5, clearance)
    sides[2] += odd
    se = np.full(5, 0.1e-6)
    return ClearancePolygon(
        run="c-1",
        point=OperatingPoint(200.0, 0.0, 0.0),
        angles=ANGLES,
        centre=np.zeros(2),
        centre_covariance=np.zeros((2, 2)),
        clearance=sides,
        clearance_se=se,
        clearance_pushed=sides + 3e-6,
        clearance_pushed_se=se,
        fitted_angle=ANGLES,
        fitted_angle_se=np.full(5, 1e-3),
        corners=corners(ANGLES, sides),
        push_load=200.0,
        pivot_scale=1.0,
        pivot_scale_se=0.02,
        noise=NoiseModel(1e-17, 1e-17, 1e-8),
    )


def locus(n: int = 10) -> Locus:
    """Positions on an oval."""
    points = []
    for k in range(n):
        direction = 2 * np.pi * k / n - np.pi / 2
        place = np.array([48e-6 * np.cos(direction), 44e-6 * np.sin(direction)])
        point = OperatingPoint(5000.0, direction, 2 * np.pi * 22.0)
        points.append(LocusPoint(f"l-{k}", point, 5000.0, direction, place, np.diag([1.2e-6, 0.6e-6]) ** 2))
    return Locus(tuple(points), np.zeros(2), np.full(2, np.nan))


def oval(scale: float) -> np.ndarray:
    """Predicted positions."""
    turn = np.linspace(0.0, 2 * np.pi, 20, endpoint=False)
    return scale * 1e-6 * np.column_stack([48 * np.cos(turn), 44 * np.sin(turn)])


def comparison(softer: float = 1.0) -> pd.DataFrame:
    """Table as comparison.csv: six loads at 25 Hz, four frequencies at 5 kN, three pivot models."""
    points = [(1e3 * w, 25.0) for w in (2.5, 3.75, 5.0, 6.25, 7.5, 8.75)] + [(5e3, f) for f in (10.0, 40.0, 50.0)]
    rows = []
    for variant, factor in (("rigid", 1.5), ("kirk", 1.25), ("measured", 1.01)):
        for load, frequency in points:
            row = {"pivots": variant, "static_load_N": load, "static_load_direction_deg": -90.0, "shaft_speed_Hz": 22.0,
                   "excitation_Hz": frequency, "pivot_extrapolated": load > 7e3,
                   "coherence": 1.0 - (0.2 if frequency == 50.0 else 1e-4)}  # fmt: skip
            for size, unit, part in ((3e4, "N_per_m", "k"), (80.0, "Ns_per_m", "c")):
                for entry, share in (("xx", 0.5), ("xy", 0.02), ("yx", -0.03), ("yy", 1.0)):
                    value = softer * share * size * load * (1.0 + 0.004 * (frequency - 25.0))
                    half = 0.03 * softer * size * load
                    name = f"{part}{entry}_{unit}"
                    row |= {name: value, f"{name}_lo": value - half, f"{name}_hi": value + half,
                            f"{name}_predicted": value * factor}  # fmt: skip
            rows.append(row)
    return pd.DataFrame(rows)


def band() -> pd.DataFrame:
    """Lines of a multi-sine: K-C with wider intervals where the coherence falls."""
    f = np.arange(10.0, 111.0, 5.0)
    table = pd.DataFrame({"static_load_N": 5000.0, "static_load_direction_deg": -90.0, "shaft_speed_Hz": 22.0,
                          "excitation": "multisine", "excitation_Hz": f})  # fmt: skip
    table["coherence_x"], table["coherence_y"] = 1 - 1e-5 * f, 1 - 4e-6 * f**2 / 2
    for entry, k, c in (("xx", 1.6e8, 4.2e5), ("yy", 2.4e8, 5.5e5)):
        for part, value in (("real", k + 0 * f), ("imag", 2 * np.pi * f * c)):
            half, name = 1e6 + 1e5 * f, f"h{entry}_{part}_N_per_m"
            wavy = value + 0.5 * half * np.sin(f)
            table[name], table[f"{name}_lo"], table[f"{name}_hi"] = wavy, wavy - half, wavy + half
    return table


@dataclass
class Shaken:
    """A dynamic run: a 25 Hz line and noise, forces that follow the displacement."""

    id: str = "d-1"
    sample_rate: float = 1000.0
    cells_every: int = 1  #: samples of the probes to one of the cells

    def __post_init__(self):
        rng = np.random.default_rng(4)
        t = np.arange(2000) / self.sample_rate
        line = np.sin(2 * np.pi * 25.0 * t)
        move = np.column_stack([line, 0.7 * line]) + 0.3 * rng.standard_normal((2000, 2))
        self.data = {"displacement": 1e-6 * move, "force": 500.0 * move + 150.0 * rng.standard_normal((2000, 2))}
        self.point = OperatingPoint(5000.0, 0.0, 2 * np.pi * 22.0, 2 * np.pi * 25.0)

    def vector(self, quantity):
        step = self.cells_every if quantity == "force" else 1
        values = self.data[quantity][::step]
        rate = self.sample_rate / step
        return VectorRecord(quantity, values, np.arange(len(values)) / rate, rate, ("H", "V"))


def windows() -> SimpleNamespace:
    """Weights of twenty windows, one of them rejected."""
    weights = np.column_stack([np.linspace(0.8, 1.0, 20), np.linspace(1.0, 0.7, 20)])
    weights[6] = 0.0, 0.1
    why = SimpleNamespace(run="d-05000-25-03", time=0.67, weight=0.0, reason="burst in X1A")
    return SimpleNamespace(stiffness=SimpleNamespace(weights=weights), rejected=(why,))


GAPS = {
    "kxx": {"heldout_before": 9.1, "heldout_after": 1.0},
    "cyy": {"heldout_before": 41.0, "heldout_after": 1.2},
    "locus_x": {"fitted_before": 2.0, "fitted_after": 3.0},
    "clearance_pushed": {"heldout_before": 1.0, "heldout_after": 0.9},
}
EFFECTS = ("pivot_flexibility", "soft_pivot, pad 1", "thermal_growth", "oil_viscosity")
SEPARATION = np.array([[np.nan, 1.2, 4.8, 5.5], [4.1, np.nan, 5.9, 5.0], [5.2, 3.4, np.nan, 2.2], [np.nan] * 4])


CASES = {
    "pad_projection": lambda: plots.pad_projection(curves()),
    "load_deflection": lambda: plots.load_deflection([curve(1, down=True), curve(3, 2.0, 3e-6)], up_to=6000.0),
    "pivot_stiffness": lambda: plots.pivot_stiffness(curves(), formula, loads=np.linspace(200.0, 6500.0, 80)),
    "clearance_and_locus": lambda: plots.clearance_and_locus(
        {"rocker": polygon(), "spherical": polygon(100e-6, 0.0)}, locus(), {"kirk": oval(0.8), "measured": oval(1.0)},
        drawing=(ANGLES, np.full(5, 80e-6)),
    ),
    "direct_coefficients": lambda: plots.direct_coefficients({"rocker": comparison(), "spherical": comparison(0.5)}),
    "coefficient": lambda: plots.coefficient(comparison(), "kyy"),
    "residual_map": lambda: plots.residual_map(comparison()),
    "residual_series": lambda: plots.residual_series(comparison(), "frequency"),
    "coherence": lambda: plots.coherence(comparison()[:9]),
    "coherence_spectrum": lambda: plots.coherence_spectrum(Shaken()),
    "frf": lambda: plots.frf(band()),
    "orbit": lambda: plots.orbit(Shaken()),
    "spectra": lambda: plots.spectra(Shaken()),
    "window_weights": lambda: plots.window_weights(windows()),
    "isolability": lambda: plots.isolability(SEPARATION, EFFECTS),
    "gap": lambda: plots.gap(GAPS),
}  # fmt: skip


def drawn(figure) -> np.ndarray:
    """Grey levels (h, w) of a figure at low resolution; its texts then know where they stand."""
    figure.set_dpi(DPI)
    figure.canvas.draw()
    return np.asarray(figure.canvas.buffer_rgba(), dtype=float)[..., :3] @ [0.299, 0.587, 0.114]


def default_style():
    """matplotlib's own style and font, whatever the user has set."""
    return matplotlib.style.context(["default", {"font.family": "DejaVu Sans"}])


@functools.cache
def picture(name: str):
    """Figure of a case, drawn, its grey levels, and whether it left the global style as it was."""
    with default_style():
        before = dict(matplotlib.rcParams)
        figure = CASES[name]()
        grey = drawn(figure)
        return figure, grey, dict(matplotlib.rcParams) == before


def main() -> None:
    """Draw all pictures anew."""
    for name in CASES:
        grey = np.round(picture(name)[1] / 17.0) * 17.0  # sixteen levels: a quarter of the bytes
        matplotlib.image.imsave(PICTURES / f"{name}.png", grey.astype(np.uint8), cmap="gray", vmin=0, vmax=255,
                                pil_kwargs={"compress_level": 9})  # fmt: skip


if __name__ == "__main__":
    main()
