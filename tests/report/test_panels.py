"""What the figures show."""

import numpy as np
import pandas as pd

from tpjb_ident.report.drawing.picture import longest_series
from tpjb_ident.report.sections import coefficient_sections, position_panels

NAMES = [f"{s}{e}_{u}" for s, u in (("k", "N_per_m"), ("c", "Ns_per_m")) for e in ("xx", "xy", "yx", "yy")]


def table(points, variants=("rigid", "kirk")):
    rows = []
    for variant in variants:
        for load, frequency in points:
            row = {"pivots": variant, "static_load_N": load, "static_load_direction_deg": -90.0,
                   "shaft_speed_Hz": 22.0, "excitation_Hz": frequency}  # fmt: skip
            for i, name in enumerate(NAMES):
                value = (i + 1) * load
                row |= {
                    name: value,
                    f"{name}_lo": 0.9 * value,
                    f"{name}_hi": 1.2 * value,
                    f"{name}_predicted": 2 * value,
                }
            rows.append(row)
    return pd.DataFrame(rows)


def coefficient_panels(points):
    return [panel for section in coefficient_sections(table(points)) for panel in section.panels]


def test_the_longest_series_is_taken():
    frame = table([(1e3, 25.0), (2e3, 25.0), (3e3, 25.0), (2e3, 10.0), (3e3, 10.0)])
    over_load = longest_series(frame, "load")
    assert set(over_load["excitation_Hz"]) == {25.0}
    assert over_load["static_load_N"].nunique() == 3
    over_frequency = longest_series(frame, "frequency")
    assert over_frequency["excitation_Hz"].nunique() == 2


def test_nothing_is_drawn_over_what_does_not_vary():
    panels = coefficient_panels([(1e3, 25.0), (2e3, 25.0)])
    assert {p.name for p in panels} == {f"{n[:3]}-over-load" for n in NAMES}
    assert coefficient_panels([(1e3, 25.0)]) == []


def test_measured_points_have_their_intervals_and_predictions_their_lines():
    panel = next(p for p in coefficient_panels([(2e3, 25.0), (1e3, 25.0)]) if p.name == "kyy-over-load")
    (axes,) = panel.figure.axes
    lines = {line.get_label(): line for line in axes.get_lines()}
    assert np.allclose(lines["rigid pivots"].get_xydata(), [[1.0, 8e3 / 1e6], [2.0, 16e3 / 1e6]])
    (bars,) = axes.containers
    low, high = bars[2][0].get_segments()[0][:, 1]
    assert (low, high) == (0.9 * 4e3 / 1e6, 1.2 * 4e3 / 1e6)


def test_positions_need_something_to_show():
    drawn = (np.radians([-90.0, -18.0, 54.0, 126.0, 198.0]), np.full(5, 80e-6))
    assert position_panels(None, drawn, np.zeros((0, 2)), {}) == []
    circle = 40e-6 * np.column_stack([np.cos([0, 2, 4]), np.sin([0, 2, 4])])
    (panel,) = position_panels(None, drawn, circle, {"rigid": circle})
    labels = {line.get_label() for line in panel.figure.axes[0].get_lines()}
    assert labels == {"clearance, drawing", "rigid pivots", "locus, measured"}
