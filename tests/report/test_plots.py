"""Pictures against pictures that were looked at, and what they must say whatever they look like."""

import importlib
import inspect
from pathlib import Path

import matplotlib
import matplotlib.image
import numpy as np
import pytest
from matplotlib.figure import Figure

import tpjb_ident as ti
from tests.report.plot_cases import (
    CASES,
    GAPS,
    PICTURES,
    Shaken,
    comparison,
    curve,
    curves,
    default_style,
    drawn,
    formula,
    locus,
    picture,
    polygon,
)
from tpjb_ident.report import plots
from tpjb_ident.report.drawing.picture import LIGHT
from tpjb_ident.report.plots.residuals import residual_frame

#: Root mean square difference of grey levels, out of 255, that another freetype or anti-aliasing may make.
TOLERANCE = 5.0


def kept(name):
    return 255.0 * matplotlib.image.imread(PICTURES / f"{name}.png")[..., 0].astype(float)


def difference(one, other):
    """Root mean square difference of two pictures, each averaged over 2 x 2 pixels."""
    assert one.shape == other.shape
    small = [p[: p.shape[0] // 2 * 2, : p.shape[1] // 2 * 2] for p in (one, other)]
    small = [p.reshape(p.shape[0] // 2, 2, -1, 2).mean(axis=(1, 3)) for p in small]
    return float(np.sqrt(np.mean((small[0] - small[1]) ** 2)))


def test_every_function_has_its_picture():
    assert set(CASES) == set(plots.__all__)
    assert {p.stem for p in PICTURES.glob("*.png")} == set(CASES)


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_picture(name):
    _, grey, style_is_kept = picture(name)
    assert difference(grey, kept(name)) < TOLERANCE
    assert style_is_kept


@pytest.mark.slow
@pytest.mark.parametrize("name", ["pivot_stiffness", "clearance_and_locus", "coefficient", "gap"])
def test_a_missing_or_other_curve_is_noticed(name):
    with default_style():
        figure = CASES[name]()
        axes = figure.axes[0]
        for artist in [*axes.get_lines()[:2], *axes.patches[:2]]:
            artist.remove()
        assert difference(drawn(figure), kept(name)) > TOLERANCE


def shown_ticks(axis):
    """Labels of the ticks within the panel; matplotlib keeps some outside, which it does not draw."""
    low, high = sorted(axis.get_view_interval())
    edge = 1e-9 * (high - low)
    return [t.label1 for t in axis.get_major_ticks() if low - edge <= t.get_loc() <= high + edge]


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_all_text_lies_inside_and_says_its_unit(name):
    figure = picture(name)[0]
    width, height = figure.canvas.get_width_height()
    for axes in figure.axes:
        texts = [axes.xaxis.label, axes.yaxis.label, axes.title, *axes.texts]
        texts += [t for axis in (axes.xaxis, axes.yaxis) for t in shown_ticks(axis)]
        texts += list(axes.get_legend().get_texts()) if axes.get_legend() else []
        for text in (t for t in texts if t.get_text() and t.get_visible()):
            box = text.get_window_extent()
            assert box.x0 > -1.5, text
            assert box.x1 < width + 1.5, text
            assert box.y0 > -1.5, text
            assert box.y1 < height + 1.5, text


UNITLESS = {"window, in the order of the runs", "robust weight", "multiple coherence", "1 - coherence", "",
            "could pass for (framed: closer than 3)", "effect at work",
            "share of campaigns", "share of campaigns at or below it", "p-value", "said", "hidden",
            "share of 95 % intervals that hold the truth", "share of the squared gap closed",
            "fall of the squared misfit per point", "data set (ambiguous campaigns)"}  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_axes_have_units(name):
    for axes in picture(name)[0].axes:
        for text in (axes.get_xlabel(), axes.get_ylabel()):
            assert text in UNITLESS or "sigma" in text or text.rsplit(", ", 1)[-1].split()[0] in {
                "kN", "N", "µm", "MN/m", "Hz", "deg", "°C", "standard", "%",
            }, text  # fmt: skip


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_legends_do_not_cover_their_panels_nor_each_other(name):
    figure = picture(name)[0]
    boxes = [axes.get_legend().get_window_extent() for axes in figure.axes if axes.get_legend()]
    boxes += [figure._suptitle.get_window_extent()] if figure._suptitle else []
    for k, box in enumerate(boxes):
        assert not any(box.overlaps(other) for other in boxes[:k])
        for axes in figure.axes:
            inside = axes.get_window_extent()
            assert box.y0 > inside.y1 - 2 or box.y1 < inside.y0 + 2 or box.x0 > inside.x1 or box.x1 < inside.x0


def test_h_of_sines_is_k_and_omega_c_over_the_longest_series():
    table = comparison()[:9]
    real, imag = plots.frf(table, entries=("xx",)).axes
    series = table[table["static_load_N"] == 5e3].sort_values("excitation_Hz")
    drawn_real, drawn_imag = (axes.containers[0][0].get_ydata() for axes in (real, imag))
    np.testing.assert_allclose(1e6 * drawn_real, series["kxx_N_per_m"])
    np.testing.assert_allclose(1e6 * drawn_imag, 2 * np.pi * series["excitation_Hz"] * series["cxx_Ns_per_m"])
    with pytest.raises(ValueError, match="no two excitation frequencies"):
        plots.frf(table[table["excitation_Hz"] == 25.0])


@pytest.mark.parametrize("cells_every", [1, 4])
def test_a_spectrum_reads_the_amplitude_of_a_line(cells_every):
    """Cells at a rate of their own, too."""
    move, force = plots.spectra(Shaken(cells_every=cells_every)).axes
    for axes, true in ((move, 1.0), (force, 500.0)):
        line = axes.get_lines()[0]
        at = np.argmax(line.get_ydata())
        assert line.get_xdata()[at] == pytest.approx(25.0)
        assert line.get_ydata()[at] == pytest.approx(true, rel=0.05)


@pytest.mark.parametrize("cells_every", [1, 4])
def test_coherence_pairs_what_was_read_at_one_time(cells_every):
    lines = plots.coherence_spectrum(Shaken(cells_every=cells_every), segment=0.25).axes[0].get_lines()
    frequency, value = lines[0].get_xdata(), lines[0].get_ydata()
    at_line = np.abs(frequency - 25.0) < 3.0
    assert value[at_line].max() > 0.98
    assert np.median(value[(frequency > 10.0) & (frequency < 100.0)]) > 0.35  # forces follow the displacement's noise


def test_a_figure_shows_itself_in_a_notebook():
    before = dict(matplotlib.rcParams)  # here no test has set a style
    assert CASES["coefficient"]()._repr_png_()[:8] == b"\x89PNG\r\n\x1a\n"
    assert dict(matplotlib.rcParams) == before


def test_every_function_that_gives_a_figure_is_handed_on_by_its_name():
    assert ti.plots is plots
    files = {path.stem for path in Path(plots.__file__).parent.glob("*.py")} - {"__init__"}
    drawing = set()
    for file in files:
        module = importlib.import_module(f"{plots.__name__}.{file}")
        for name, value in vars(module).items():
            is_plot = inspect.isfunction(value) and value.__annotations__.get("return") in ("Figure", Figure)
            if is_plot and value.__module__ == module.__name__ and not name.startswith("_"):
                drawing.add(name)
                assert (getattr(plots, name), value.__name__) == (value, name)
    assert drawing == set(plots.__all__)


def test_differences_reach_the_closest_prediction_that_has_the_coefficient():
    table = comparison()
    table.loc[table["pivots"] == "measured", "kyy_N_per_m_predicted"] = np.nan
    (_, below) = plots.coefficient(table, "kyy").axes
    assert 25.0 < below.get_ylim()[1] < 50.0  # kirk's, 25 % off; rigid's are 50 % off


def test_extrapolation_is_drawn_apart():
    axes = plots.pivot_stiffness([curve(3, 1.0, 3e-6)], loads=np.linspace(200.0, 6500.0, 64)).axes[0]
    solid, dotted = axes.get_lines()[:2]
    load = solid.get_xdata() * 1e3
    seen = np.isfinite(solid.get_ydata())
    assert load[seen].min() >= 2200.0
    assert load[seen].max() <= 5000.0
    assert np.isfinite(dotted.get_ydata()[load > 5200.0]).all()
    assert any(t.get_text().strip() == "extrapolated" for t in axes.texts)


def test_kirk_stands_beside_as_tangent_and_as_printed():
    axes = plots.pivot_stiffness(curves(), formula).axes[0]
    lines = {line.get_label(): line for line in axes.get_lines()}
    load = lines["Kirk, tangent"].get_xdata() * 1e3
    assert lines["Kirk, tangent"].get_ydata() == pytest.approx([formula(1, w)[1] / 1e6 for w in load])
    assert lines["Kirk, printed"].get_ydata() == pytest.approx([formula(1, w)[0] / 1e6 for w in load])


def test_the_band_is_that_of_the_curve():
    one = curve()
    axes = plots.pivot_stiffness([one], loads=np.linspace(500.0, 5000.0, 30)).axes[0]
    outline = axes.collections[0].get_paths()[0].vertices
    at = outline[np.isclose(outline[:, 0], 5.0)][:, 1]
    low, high = one.stiffness_band(5000.0)
    assert [at.min(), at.max()] == pytest.approx([float(low) / 1e6, float(high) / 1e6], rel=1e-6)


def test_measured_vectors_and_their_projections():
    one = curve()
    forces = plots.pad_projection([one]).axes[0]
    direction, measured, projected = (line.get_xydata() for line in forces.get_lines())
    used = one.steps.weight > 0
    # pad 1 points down: along is -y, across (counter-clockwise) is +x
    assert measured[:, 1] == pytest.approx(-one.steps.load[used] / 1e3)
    assert measured[:, 0] == pytest.approx(one.steps.across_load[used] / 1e3)
    assert projected[:, 0] == pytest.approx(0.0, abs=1e-12)
    assert direction[1] == pytest.approx([0.0, -1.12 * 5.0], abs=1e-9)


def test_the_locus_carries_its_uncertainty():
    axes = plots.clearance_and_locus(polygon(), locus()).axes[0]
    assert len(axes.patches) == len(locus().points)
    assert sorted([axes.patches[0].width, axes.patches[0].height]) == pytest.approx(
        [2 * 2.4477 * 0.6, 2 * 2.4477 * 1.2]
    )


def test_residuals_are_whitened_by_the_measurement():
    frame = residual_frame(comparison())
    row = frame[(frame["model"] == "rigid") & (frame["entry"] == "kyy") & (frame["static_load_N"] == 5e3)
                & (frame["excitation_Hz"] == 25.0)]  # fmt: skip
    assert row["z"].to_numpy() == pytest.approx([-0.5 / (0.03 / 1.959964)])


def test_what_got_worse_is_said():
    words = [t.get_text() for t in plots.gap(GAPS).axes[0].get_yticklabels()]
    assert words == ["kxx", "cyy", "locus x* (worse)", "clearance pushed"]


NOTHING = [
    (lambda: plots.pivot_stiffness([]), "at least one"),
    (lambda: plots.clearance_and_locus(), "nothing to draw"),
    (lambda: plots.coefficient(comparison(), "kzz"), "must be one of"),
    (lambda: plots.coefficient(comparison()[:1], "kxx"), "no two points"),
    (lambda: plots.gap({}), "no gap"),
    (lambda: plots.isolability(np.eye(3), ["a"]), "square"),
]


@pytest.mark.parametrize(("make", "message"), NOTHING)
def test_nothing_to_draw_is_said(make, message):
    with pytest.raises(ValueError, match=message):
        make()


def test_colours_are_told_apart_by_the_colour_blind():
    """Pad colours keep a distance in lightness or hue for deuteranopes (Machado's matrix, severity 1)."""
    matrix = np.array([[0.367, 0.861, -0.228], [0.280, 0.673, 0.047], [-0.012, 0.043, 0.969]])
    rgb = np.array([[int(LIGHT[c][i : i + 2], 16) / 255 for i in (1, 3, 5)]
                    for c in ("blue", "red", "green", "purple", "orange")])  # fmt: skip
    linear = np.where(rgb <= 0.04045, rgb / 12.92, ((rgb + 0.055) / 1.055) ** 2.4)
    seen = np.clip(linear @ matrix.T, 0.0, 1.0) ** (1 / 2.4)
    apart = np.linalg.norm(seen[:, None] - seen[None], axis=2)[np.triu_indices(5, 1)]
    assert apart.min() > 0.1
