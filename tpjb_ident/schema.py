"""Every column of the tables on disk, once: name, quantity, unit, meaning; and which table holds which.

The names are promised to scripts (docs/results.md, whose lists a test holds to this file). A name ends in its unit;
what is derived from a column (an interval's ends, a standard error) adds its own ending behind the unit.
"""

from __future__ import annotations

import math
import re
from dataclasses import dataclass

from tpjb_ident.columns import size, symbol

ENTRIES = ("xx", "xy", "yx", "yy")


@dataclass(frozen=True)
class Coefficient:
    """A kind of coefficient: stiffness, damping or mass."""

    symbol: str
    quantity: str
    suffix: str
    unit: str
    meaning: str

    @property
    def display_unit(self) -> str:
        """Symbol of the unit that people read."""
        return symbol(self.quantity)

    @property
    def display_scale(self) -> float:
        """Its size in SI."""
        return size(self.quantity)

    def column(self, entry: str) -> str:
        """Name of the column of one entry, ``"xx"`` to ``"yy"``."""
        return f"{self.symbol}{entry}_{self.suffix}"

    @property
    def columns(self) -> tuple[str, ...]:
        """Names of all four, row by row."""
        return tuple(self.column(entry) for entry in ENTRIES)


STIFFNESS = Coefficient("k", "stiffness", "N_per_m", "N/m", "Re h at the excitation frequency")
DAMPING = Coefficient("c", "damping", "Ns_per_m", "N s/m", "Im h / omega at the excitation frequency")
MASS = Coefficient("m", "mass", "kg", "kg", "apparent mass of K - omega^2 M")
KINDS = {kind.symbol: kind for kind in (STIFFNESS, DAMPING, MASS)}
#: Columns of K and C, row by row.
COEFFICIENT_COLUMNS = (*STIFFNESS.columns, *DAMPING.columns)
#: Columns that say which operating point a row is about: static point first.
STATIC_COLUMNS = ("static_load_N", "static_load_direction_deg", "shaft_speed_Hz")
POINT_COLUMNS = (*STATIC_COLUMNS, "excitation_Hz")
#: The same with the sense of turning: the values of `OperatingPoint.static_key` and `key`.
STATIC_KEY = (*STATIC_COLUMNS, "rotation")
POINT_KEY = (*POINT_COLUMNS, "rotation")
#: Of pivot curves: tangent and secant.
TANGENT, SECANT = f"stiffness_{STIFFNESS.suffix}", f"secant_{STIFFNESS.suffix}"


def coefficient_column(name: str) -> str:
    """Column of a coefficient."""
    return KINDS[name[0]].column(name[1:])


#: Least value of a quantity in a table, and endings that are widths; anything else may be negative.
_LEAST = {"force": 0.0, "frequency": 0.0, "count": 0.0}
_WIDTHS = ("_se", "_se_systematic", "_random95", "_systematic95", "_dof")
#: What may be infinite, apart from the limits and widths of what is not known at all.
_UNBOUNDED = ("dof", "condition_number")


@dataclass(frozen=True)
class Column:
    """One column of a table."""

    name: str
    quantity: str
    unit: str
    meaning: str
    endings: tuple[str, ...] = ()

    def least(self, ending: str = "") -> float:
        """Least value that a cell can hold."""
        return 0.0 if ending in _WIDTHS else -math.inf if ending else _LEAST.get(self.quantity, -math.inf)

    def may_be_infinite(self, ending: str = "") -> bool:
        """Whether a cell may hold an infinite number."""
        return ending in (*_WIDTHS, "_lo", "_hi") or self.name in _UNBOUNDED

    def pattern(self) -> str:
        """Regular expression of the names that this column stands for."""
        name = re.escape(self.name).replace(r"\{e\}", "(xx|xy|yx|yy)").replace("padN", r"pad\d+")
        name = name.replace("_N_K", r"_\d+_K")
        return name + ("(" + "|".join(re.escape(e) for e in self.endings) + ")?" if self.endings else "")


ENDINGS = {
    "_lo": "lower end of the 95 % interval, random and calibration errors together",
    "_hi": "its upper end",
    "_se": "standard error, random part alone",
    "_se_systematic": "standard error from the calibration",
    "_random95": "half of the random part's 95 % interval",
    "_systematic95": "half of the calibration's 95 % interval",
    "_dof": "degrees of freedom of `_se`",
    "_predicted": "what the model gives",
    "_difference": "predicted - measured",
    "_ratio": "predicted / measured; empty where the measured interval holds zero",
    "_a": "of the first of two campaigns",
    "_a_lo": "lower end of its 95 % interval",
    "_a_hi": "its upper end",
    "_b": "of the second",
    "_b_lo": "lower end of its 95 % interval",
    "_b_hi": "its upper end",
    "_difference_lo": "lower end of the 95 % interval of second - first, without what both share",
    "_difference_hi": "its upper end",
}
_ALL = ("_lo", "_hi", "_se", "_se_systematic", "_random95", "_systematic95")
_CHANGE = tuple(f"_{side}{end}" for side in ("a", "b", "difference") for end in ("", "_lo", "_hi"))
_AGAINST = ("_lo", "_hi", "_predicted", "_difference", "_ratio")


def _coefficients(endings: tuple[str, ...], *kinds: Coefficient) -> tuple[Column, ...]:
    return tuple(Column(kind.column("{e}"), kind.quantity, kind.unit, kind.meaning, endings) for kind in kinds)


_STATIC = (
    Column("static_load_N", "force", "N", "static load, set point, per bearing"),
    Column("static_load_direction_deg", "angle", "deg", "where it pushes the shaft, counter-clockwise from x"),
    Column("shaft_speed_Hz", "frequency", "Hz", "set point of the shaft speed"),
    Column("rotation", "rotation", "", "which way the shaft turns: counter-clockwise or clockwise"),
)
_POINT = (*_STATIC[:3], Column("excitation_Hz", "frequency", "Hz", "frequency of the excitation"), _STATIC[3])
_MEASURED_LOAD = Column("static_load_measured_N", "force", "N", "mean load that the cells show")
_QUALITY = Column("quality", "text", "", 'named conditions, "ok" if there are none')
_RUN = Column("run", "text", "", "id of the run")
PAD = Column("pad", "count", "", "number of the pad, from 1")
_STATUS = Column("status", "text", "", "named conditions of the solution or the curve")
_CONVERGED = Column("converged", "truth value", "", "whether the model's solution converged")
_PIVOTS = Column("pivots", "text", "", "pivot model: rigid, kirk, kirk-secant, measured; or another table")


_MODEL_NAMES = (
    Column("model", "text", "", "K-C or K-C-M"),
    Column("supported", "text", "", "the simplest model that the data do not refuse"),
)
#: A model over frequency, of sines and of bands.
_MODEL = (
    Column("n_frequencies", "count", "", "excitation frequencies, or lines of a band"),
    Column("excitation_lowest_Hz", "frequency", "Hz", "lowest of them"),
    Column("excitation_highest_Hz", "frequency", "Hz", "highest of them"),
    Column("chi_square", "number", "", "of the model against h, in eight parts of a band"),
    Column("dof", "count", "", "degrees of freedom of it"),
    Column("probability", "share", "", "of a chi-square as large by chance"),
    Column("largest_misfit", "share", "", "of h, noise of bands taken off: what using the model costs"),
    *_coefficients(("_lo", "_hi", "_se", "_dof"), STIFFNESS, DAMPING, MASS),
)


def _position(endings: tuple[str, ...]) -> tuple[Column, ...]:
    return tuple(Column(f"{a}_m", "length", "m", f"{a} of the shaft centre", endings) for a in "xy")


_ESTIMATES = (
    *_POINT,
    _MEASURED_LOAD,
    *_coefficients(_ALL, STIFFNESS, DAMPING),
    Column("method", "text", "", "estimator"),
    Column("n_records", "count", "", "runs that took part"),
    Column("n_windows", "count", "", "record windows that took part"),
    Column("condition_number", "number", "", "of the displacement directions"),
    Column("outlier_fraction", "share", "", "windows without weight"),
    _QUALITY,
    Column("quality_detail", "text", "", "the same with what was found"),
    Column("n_windows_rejected", "count", "", "windows without weight"),
    Column("coherence", "share", "", "force explained by the displacement, the smaller axis"),
    Column("amplitude_m", "length", "m", "largest displacement amplitude of a direction"),
    Column("amplitude_over_clearance", "share", "", "the same over the smallest assembled clearance"),
    Column("amplitude_slope", "share", "", "change of h when the amplitude doubles, where several were run", ("_se",)),
    Column("chi_square", "number", "", "of the directions against their repeats"),
    Column("attenuation", "share", "", "what displacement noise would take off a plain regression"),
    Column("inertia_corrected", "truth value", "", "whether the housing's inertia was added to the cells' force"),
    Column("baseline_subtracted", "truth value", "", "whether a rig without bearing was taken off"),
    Column("frequency_model", "text", "", "what the load's frequencies support: K-C, K-C-M, raw H, or a single line"),
    *_position(("_se",)),
    Column("temperature_N_K", "temperature", "K", "mean film temperature of pad N"),
)
_BAND = (
    *_STATIC,
    Column("excitation", "text", "", "multisine, sweep, random or impact, as the manifest states it"),
)
_FRF = (
    *_BAND,
    Column("excitation_Hz", "frequency", "Hz", "middle of the line"),
    Column("h{e}_real_N_per_m", "stiffness", "N/m", "Re h", ("_lo", "_hi", "_se", "_se_systematic")),
    Column("h{e}_imag_N_per_m", "stiffness", "N/m", "Im h", ("_lo", "_hi", "_se", "_se_systematic")),
    Column("coherence_x", "share", "", "multiple coherence of the force along x with the displacements"),
    Column("coherence_y", "share", "", "the same along y"),
    Column("method", "text", "", "periods, iv (command as instrument), h1, h2 or hv"),
    Column("dof", "number", "", "degrees of freedom of the random part, the least of the entries"),
    Column("n_records", "count", "", "runs that took part"),
    Column("n_averages", "count", "", "periods, or bins of a transform, that the line was averaged from"),
    Column("resolution_Hz", "frequency", "Hz", "width of the line"),
    Column("condition_number", "number", "", "of the displacement directions"),
    _QUALITY,
)
_CLEARANCE = (
    PAD,
    Column("clearance_m", "length", "m", "assembled clearance at zero push load", ("_se",)),
    Column("clearance_pushed_m", "length", "m", "the same as measured, under the push load", ("_se",)),
    Column("pad_angle_deg", "angle", "deg", "where the pad stands by the bearing file"),
    Column("fitted_angle_deg", "angle", "deg", "where its side of the polygon stands", ("_se",)),
    Column("push_load_N", "force", "N", "load of the sweep"),
    *_STATIC[2:],
    Column("temperature_K", "temperature", "K", "mean temperature during the sweep"),
    _RUN,
)
_LOCUS = (
    *_STATIC,
    _MEASURED_LOAD,
    Column("static_load_direction_measured_deg", "angle", "deg", "direction that the cells show"),
    *_position(("_se",)),
    _RUN,
)
#: Columns of every table by file name.
TABLES: dict[str, tuple[Column, ...]] = {
    "coefficients": _ESTIMATES,
    "estimators": _ESTIMATES,
    "windows": (
        _RUN,
        Column("time_s", "time", "s", "start of the window in its run"),
        Column("excitation_direction_deg", "angle", "deg", "direction of the excitation"),
        Column("weight", "share", "", "final robust weight"),
        Column("reason", "text", "", "what gave it away"),
        *_POINT,
    ),
    "frequency_fits": (
        *_STATIC,
        *_MODEL_NAMES,
        *_MODEL,
    ),
    "frf": _FRF,
    "frf_estimators": _FRF,
    "frf_models": (
        *_BAND,
        *_MODEL_NAMES,
        Column("method", "text", "", "as in `frf`"),
        *_MODEL,
        _QUALITY,
    ),
    "budget": (
        *_POINT,
        Column("coefficient", "text", "", "kxx .. kyy, cxx .. cyy"),
        Column("unit", "text", "", "of its uncertainty"),
        Column("source", "text", "", "what makes it uncertain"),
        Column("kind", "text", "", "random (from run to run) or systematic (common to all runs)"),
        Column("standard_uncertainty", "number", "", "one standard deviation that the source adds"),
        Column("share", "share", "", "of the coefficient's whole variance"),
        Column("dof", "count", "", "degrees of freedom; infinite where it is stated or known"),
    ),
    "plain": (
        *_POINT,
        *_coefficients(("_se",), STIFFNESS, DAMPING),
        Column("norm", "text", "", "of statsmodels' RLM"),
        Column("window_s", "time", "s", "length of a window"),
        Column("n_records", "count", "", "runs"),
        Column("n_windows", "count", "", "windows"),
        Column("status", "text", "", "what the solver had to say"),
    ),
    "pivot_curves": (
        PAD,
        Column("force_N", "force", "N", "load on the pad"),
        Column("deflection_m", "length", "m", "pivot, pad back and housing seat together"),
        Column(TANGENT, "stiffness", "N/m", "tangent, what small vibrations feel", ("_lo", "_hi")),
        Column(SECANT, "stiffness", "N/m", "secant, force over deflection", ("_lo", "_hi")),
        Column("law", "text", "", "law of the curve"),
        Column("extrapolated", "truth value", "", "outside the measured loads"),
        Column("contact_complete", "truth value", "", "the shaft is fully in contact at this load"),
        Column(f"formula_{SECANT}", "stiffness", "N/m", "Kirk and Reedy as printed"),
        Column("formula_tangent_N_per_m", "stiffness", "N/m", "its tangent"),
    ),
    "pivot_pads": (
        PAD,
        Column("law", "text", "", "law of the curve"),
        Column("valid_from_N", "force", "N", "lowest load that was measured"),
        Column("valid_to_N", "force", "N", "highest load that was measured"),
        Column("onset_N", "force", "N", "load from which the shaft is in contact; 0: from the start", ("_se",)),
        Column("load_off_pad_deg", "angle", "deg", "angle of the load off the pad's direction", ("_se",)),
        Column("displacement_off_pad_deg", "angle", "deg", "angle of the displacement off it", ("_se",)),
        Column("loop_energy_J", "energy", "J", "between loading and unloading; empty without unloading", ("_se",)),
        Column("loss_factor", "share", "", "of that loop", ("_se",)),
        Column("includes_housing", "truth value", "", "the curve holds the housing's seat"),
        Column("relative_calibration", "share", "", "standard error of the whole curve's scale"),
        Column("runs", "text", "", "runs that took part"),
        _STATUS,
    ),
    "locus": _LOCUS,
    "clearance": _CLEARANCE,
    "clearance_runs": _CLEARANCE,
    "clearance_pairs": (
        _RUN,
        Column("against", "text", "", "run that it is held against"),
        Column("compared", "text", "", "push load (only that differs) or condition"),
        PAD,
        Column("change_m", "length", "m", "of the clearance at zero push load", ("_se",)),
        Column("load_N", "force", "N", "mean push load of the two"),
        Column(TANGENT, "stiffness", "N/m", "of the pivot between the two push loads", ("_se",)),
    ),
    "prediction": (
        *_POINT,
        *_coefficients((), STIFFNESS, DAMPING),
        *_position(()),
        Column("padN_load_N", "force", "N", "load of pad N"),
        Column("padN_tilt_rad", "angle", "rad", "its tilt"),
        Column("padN_deflection_m", "length", "m", "of its pivot"),
        Column("padN_max_pressure_Pa", "pressure", "Pa", "largest pressure on it"),
        Column("padN_max_temperature_degC", "temperature", "degC", "largest film temperature on it"),
        Column("padN_min_film_m", "length", "m", "least film on it"),
        Column("padN_inflow_m3_per_s", "flow", "m^3/s", "oil through its leading edge"),
        Column("padN_outflow_m3_per_s", "flow", "m^3/s", "oil through its trailing edge"),
        Column("padN_leakage_m3_per_s", "flow", "m^3/s", "oil over both of its sides"),
        Column("padN_inlet_temperature_degC", "temperature", "degC", "of the oil that enters"),
        Column("padN_outlet_temperature_degC", "temperature", "degC", "of the oil that leaves at the trailing edge"),
        Column("max_pressure_Pa", "pressure", "Pa", "largest of all pads"),
        Column("max_temperature_degC", "temperature", "degC", "largest of all pads"),
        Column("min_film_m", "length", "m", "least of all pads"),
        Column("power_loss_W", "power", "W", "friction of all films, of idle pads too"),
        Column("reynolds", "count", "", "largest local Reynolds number rho U h / mu"),
        Column("sommerfeld", "count", "", "S = mu N D L / W (R / Cb)^2 of the oil that enters"),
        Column("eccentricity_ratio", "share", "", "distance of the shaft from the bearing centre / mean Cb"),
        Column("attitude_angle_deg", "angle", "deg", "from the load's direction to the shaft, with rotation"),
        _CONVERGED,
        Column("idle_pads", "text", "", "pads that carry nothing"),
        Column("mesh_error", "share", "", "estimated error of the direct coefficients from the mesh"),
        _STATUS,
    ),
    "comparison": (
        _PIVOTS,
        *_POINT,
        _MEASURED_LOAD,
        *_coefficients(_AGAINST, STIFFNESS, DAMPING),
        Column("x_m_predicted", "length", "m", "x of the shaft centre, predicted"),
        Column("y_m_predicted", "length", "m", "y of it"),
        _CONVERGED,
        Column("pivot_extrapolated", "truth value", "", "a pad presses its pivot harder than the dry test did"),
        _QUALITY,
        _STATUS,
    ),
    "locus_comparison": (
        _PIVOTS,
        *_LOCUS,
        Column("x_m_predicted", "length", "m", "x of the shaft centre, predicted"),
        Column("y_m_predicted", "length", "m", "y of it"),
    ),
    "difference": (
        *_POINT,
        Column("static_load_measured_N", "force", "N", "mean load that the cells show", ("_a", "_b")),
        Column("quality", "text", "", 'named conditions, "ok" if there are none', ("_a", "_b")),
        *_coefficients(_CHANGE, STIFFNESS, DAMPING),
        *(Column(f"{s}{{e}}_changed", "text", "", "yes, no, or cannot tell") for s in "kc"),
    ),
    "pivot_difference": (
        PAD,
        Column("force_N", "force", "N", "load on the pad"),
        Column(TANGENT, "stiffness", "N/m", "tangent, what small vibrations feel", _CHANGE),
        Column("stiffness_changed", "text", "", "yes, no, or cannot tell"),
    ),
    "clearance_difference": (
        PAD,
        Column("clearance_m", "length", "m", "assembled clearance at zero push load", _CHANGE),
        Column("clearance_changed", "text", "", "yes, no, or cannot tell"),
    ),
}


def markdown(table: str) -> str:
    """Rows of the documentation's table of one file: name, unit, meaning."""
    rows = ["| column | unit | meaning |", "|---|---|---|"]
    for column in TABLES[table]:
        dots = " .. `" + column.name.replace("{e}", "yy") + "`" if "{e}" in column.name else ""
        names = [f"`{column.name.replace('{e}', 'xx')}`{dots}", *(f"`{ending}`" for ending in column.endings)]
        rows.append(f"| {', '.join(names)} | {column.unit} | {column.meaning} |")
    return "\n".join(rows)
