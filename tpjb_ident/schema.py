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


STIFFNESS = Coefficient("k", "stiffness", "N_per_m", "Re h at the excitation frequency")
DAMPING = Coefficient("c", "damping", "Ns_per_m", "Im h / omega at the excitation frequency")
MASS = Coefficient("m", "mass", "kg", "apparent mass of K - omega^2 M")
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


#: Unit that a name ends in: the quantity, and the unit as people write it.
_UNITS = {
    "N_per_m": ("stiffness", "N/m"), "Ns_per_m": ("damping", "N s/m"), "N": ("force", "N"), "kg": ("mass", "kg"),
    "m3_per_s": ("flow", "m^3/s"), "m": ("length", "m"), "deg": ("angle", "deg"), "rad": ("angle", "rad"),
    "degC": ("temperature", "degC"), "K": ("temperature", "K"), "Pa": ("pressure", "Pa"), "Hz": ("frequency", "Hz"),
    "s": ("time", "s"), "J": ("energy", "J"), "W": ("power", "W"),
}  # fmt: skip
_NAME = re.compile(rf".+?_({'|'.join(_UNITS)})(?:_predicted)?")
#: Least value of a quantity in a table, and endings that are widths; anything else may be negative.
_LEAST = {"force": 0.0, "frequency": 0.0, "count": 0.0}
_WIDTHS = ("_se", "_se_systematic", "_random95", "_systematic95", "_dof")
#: What may be infinite, apart from the limits and widths of what is not known at all.
_UNBOUNDED = ("dof", "condition_number")


@dataclass(frozen=True)
class Column:
    """One column of a table."""

    name: str
    meaning: str
    kind: str = "text"  #: of what has no unit
    endings: tuple[str, ...] = ()

    @property
    def measured(self) -> tuple[str, str]:
        """Quantity and unit of its cells, by the end of the name; of what has no unit its kind."""
        match = _NAME.fullmatch(self.name)
        return _UNITS[match[1]] if match else (self.kind, "")

    @property
    def quantity(self) -> str:
        """What its cells are."""
        return self.measured[0]

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
    return tuple(Column(kind.column("{e}"), kind.meaning, endings=endings) for kind in kinds)


_STATIC = (
    Column("static_load_N", "static load, set point, per bearing"),
    Column("static_load_direction_deg", "where it pushes the shaft, counter-clockwise from x"),
    Column("shaft_speed_Hz", "set point of the shaft speed"),
    Column("rotation", "which way the shaft turns: counter-clockwise or clockwise", "rotation"),
)
_POINT = (*_STATIC[:3], Column("excitation_Hz", "frequency of the excitation"), _STATIC[3])
_MEASURED_LOAD = Column("static_load_measured_N", "mean load that the cells show")
_QUALITY = Column("quality", 'named conditions, "ok" if there are none')
_RUN = Column("run", "id of the run")
PAD = Column("pad", "number of the pad, from 1", "count")
_STATUS = Column("status", "named conditions of the solution or the curve")
_CONVERGED = Column("converged", "whether the model's solution converged", "truth value")
_PIVOTS = Column("pivots", "pivot model: rigid, kirk, kirk-secant, measured; or another table")


_MODEL_NAMES = (
    Column("model", "K-C or K-C-M"),
    Column("supported", "the simplest model that the data do not refuse"),
)
#: A model over frequency, of sines and of bands.
_MODEL = (
    Column("n_frequencies", "excitation frequencies, or lines of a band", "count"),
    Column("excitation_lowest_Hz", "lowest of them"),
    Column("excitation_highest_Hz", "highest of them"),
    Column("chi_square", "of the model against h, in eight parts of a band", "number"),
    Column("dof", "degrees of freedom of it", "count"),
    Column("probability", "of a chi-square as large by chance", "share"),
    Column("largest_misfit", "of h, noise of bands taken off: what using the model costs", "share"),
    *_coefficients(("_lo", "_hi", "_se", "_dof"), STIFFNESS, DAMPING, MASS),
)


def _position(endings: tuple[str, ...]) -> tuple[Column, ...]:
    return tuple(Column(f"{a}_m", f"{a} of the shaft centre", endings=endings) for a in "xy")


_ESTIMATES = (
    *_POINT,
    _MEASURED_LOAD,
    *_coefficients(_ALL, STIFFNESS, DAMPING),
    Column("method", "estimator"),
    Column("n_records", "runs that took part", "count"),
    Column("n_windows", "record windows that took part", "count"),
    Column("condition_number", "of the displacement directions", "number"),
    Column("outlier_fraction", "windows without weight", "share"),
    _QUALITY,
    Column("quality_detail", "the same with what was found"),
    Column("n_windows_rejected", "windows without weight", "count"),
    Column("coherence", "force explained by the displacement, the smaller axis", "share"),
    Column("amplitude_m", "largest displacement amplitude of a direction"),
    Column("amplitude_over_clearance", "the same over the smallest assembled clearance", "share"),
    Column("amplitude_slope", "change of h when the amplitude doubles, where several were run", "share", ("_se",)),
    Column("chi_square", "of the directions against their repeats", "number"),
    Column("attenuation", "what displacement noise would take off a plain regression", "share"),
    Column("inertia_corrected", "whether the housing's inertia was added to the cells' force", "truth value"),
    Column("baseline_subtracted", "whether a rig without bearing was taken off", "truth value"),
    Column("frequency_model", "what the load's frequencies support: K-C, K-C-M, raw H, or a single line"),
    *_position(("_se",)),
    Column("temperature_N_K", "mean film temperature of pad N"),
)
_BAND = (
    *_STATIC,
    Column("excitation", "multisine, sweep, random or impact, as the manifest states it"),
)
_FRF = (
    *_BAND,
    Column("excitation_Hz", "middle of the line"),
    Column("h{e}_real_N_per_m", "Re h", endings=("_lo", "_hi", "_se", "_se_systematic")),
    Column("h{e}_imag_N_per_m", "Im h", endings=("_lo", "_hi", "_se", "_se_systematic")),
    Column("coherence_x", "multiple coherence of the force along x with the displacements", "share"),
    Column("coherence_y", "the same along y", "share"),
    Column("method", "periods, iv (command as instrument), h1, h2 or hv"),
    Column("dof", "degrees of freedom of the random part, the least of the entries", "number"),
    Column("n_records", "runs that took part", "count"),
    Column("n_averages", "periods, or bins of a transform, that the line was averaged from", "count"),
    Column("resolution_Hz", "width of the line"),
    Column("condition_number", "of the displacement directions", "number"),
    _QUALITY,
)
_CLEARANCE = (
    PAD,
    Column("clearance_m", "assembled clearance at zero push load", endings=("_se",)),
    Column("clearance_pushed_m", "the same as measured, under the push load", endings=("_se",)),
    Column("pad_angle_deg", "where the pad stands by the bearing file"),
    Column("fitted_angle_deg", "where its side of the polygon stands", endings=("_se",)),
    Column("push_load_N", "load of the sweep"),
    *_STATIC[2:],
    Column("temperature_K", "mean temperature during the sweep"),
    _RUN,
)
_LOCUS = (
    *_STATIC,
    _MEASURED_LOAD,
    Column("static_load_direction_measured_deg", "direction that the cells show"),
    *_position(("_se",)),
    _RUN,
)
#: Columns of every table by file name.
TABLES: dict[str, tuple[Column, ...]] = {
    "coefficients": _ESTIMATES,
    "estimators": _ESTIMATES,
    "windows": (
        _RUN,
        Column("time_s", "start of the window in its run"),
        Column("excitation_direction_deg", "direction of the excitation"),
        Column("weight", "final robust weight", "share"),
        Column("reason", "what gave it away"),
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
        Column("method", "as in `frf`"),
        *_MODEL,
        _QUALITY,
    ),
    "budget": (
        *_POINT,
        Column("coefficient", "kxx .. kyy, cxx .. cyy"),
        Column("unit", "of its uncertainty"),
        Column("source", "what makes it uncertain"),
        Column("kind", "random (from run to run) or systematic (common to all runs)"),
        Column("standard_uncertainty", "one standard deviation that the source adds", "number"),
        Column("share", "of the coefficient's whole variance", "share"),
        Column("dof", "degrees of freedom; infinite where it is stated or known", "count"),
    ),
    "plain": (
        *_POINT,
        *_coefficients(("_se",), STIFFNESS, DAMPING),
        Column("norm", "of statsmodels' RLM"),
        Column("window_s", "length of a window"),
        Column("n_records", "runs", "count"),
        Column("n_windows", "windows", "count"),
        Column("status", "what the solver had to say"),
    ),
    "pivot_curves": (
        PAD,
        Column("force_N", "load on the pad"),
        Column("deflection_m", "pivot, pad back and housing seat together"),
        Column(TANGENT, "tangent, what small vibrations feel", endings=("_lo", "_hi")),
        Column(SECANT, "secant, force over deflection", endings=("_lo", "_hi")),
        Column("law", "law of the curve"),
        Column("extrapolated", "outside the measured loads", "truth value"),
        Column("contact_complete", "the shaft is fully in contact at this load", "truth value"),
        Column(f"formula_{SECANT}", "Kirk and Reedy as printed"),
        Column("formula_tangent_N_per_m", "its tangent"),
    ),
    "pivot_pads": (
        PAD,
        Column("law", "law of the curve"),
        Column("valid_from_N", "lowest load that was measured"),
        Column("valid_to_N", "highest load that was measured"),
        Column("onset_N", "load from which the shaft is in contact; 0: from the start", endings=("_se",)),
        Column("load_off_pad_deg", "angle of the load off the pad's direction", endings=("_se",)),
        Column("displacement_off_pad_deg", "angle of the displacement off it", endings=("_se",)),
        Column("loop_energy_J", "between loading and unloading; empty without unloading", endings=("_se",)),
        Column("loss_factor", "of that loop", "share", ("_se",)),
        Column("includes_housing", "the curve holds the housing's seat", "truth value"),
        Column("relative_calibration", "standard error of the whole curve's scale", "share"),
        Column("runs", "runs that took part"),
        _STATUS,
    ),
    "locus": _LOCUS,
    "clearance": _CLEARANCE,
    "clearance_runs": _CLEARANCE,
    "clearance_pairs": (
        _RUN,
        Column("against", "run that it is held against"),
        Column("compared", "push load (only that differs) or condition"),
        PAD,
        Column("change_m", "of the clearance at zero push load", endings=("_se",)),
        Column("load_N", "mean push load of the two"),
        Column(TANGENT, "of the pivot between the two push loads", endings=("_se",)),
    ),
    "prediction": (
        *_POINT,
        *_coefficients((), STIFFNESS, DAMPING),
        *_position(()),
        Column("padN_load_N", "load of pad N"),
        Column("padN_tilt_rad", "its tilt"),
        Column("padN_deflection_m", "of its pivot"),
        Column("padN_max_pressure_Pa", "largest pressure on it"),
        Column("padN_max_temperature_degC", "largest film temperature on it"),
        Column("padN_min_film_m", "least film on it"),
        Column("padN_inflow_m3_per_s", "oil through its leading edge"),
        Column("padN_outflow_m3_per_s", "oil through its trailing edge"),
        Column("padN_leakage_m3_per_s", "oil over both of its sides"),
        Column("padN_inlet_temperature_degC", "of the oil that enters"),
        Column("padN_outlet_temperature_degC", "of the oil that leaves at the trailing edge"),
        Column("max_pressure_Pa", "largest of all pads"),
        Column("max_temperature_degC", "largest of all pads"),
        Column("min_film_m", "least of all pads"),
        Column("power_loss_W", "friction of all films, of idle pads too"),
        Column("reynolds", "largest local Reynolds number rho U h / mu", "count"),
        Column("sommerfeld", "S = mu N D L / W (R / Cb)^2 of the oil that enters", "count"),
        Column("eccentricity_ratio", "distance of the shaft from the bearing centre / mean Cb", "share"),
        Column("attitude_angle_deg", "from the load's direction to the shaft, with rotation"),
        _CONVERGED,
        Column("idle_pads", "pads that carry nothing"),
        Column("mesh_error", "estimated error of the direct coefficients from the mesh", "share"),
        _STATUS,
    ),
    "comparison": (
        _PIVOTS,
        *_POINT,
        _MEASURED_LOAD,
        *_coefficients(_AGAINST, STIFFNESS, DAMPING),
        Column("x_m_predicted", "x of the shaft centre, predicted"),
        Column("y_m_predicted", "y of it"),
        _CONVERGED,
        Column("pivot_extrapolated", "a pad presses its pivot harder than the dry test did", "truth value"),
        _QUALITY,
        _STATUS,
    ),
    "locus_comparison": (
        _PIVOTS,
        *_LOCUS,
        Column("x_m_predicted", "x of the shaft centre, predicted"),
        Column("y_m_predicted", "y of it"),
    ),
    "difference": (
        *_POINT,
        Column("static_load_measured_N", "mean load that the cells show", endings=("_a", "_b")),
        Column("quality", 'named conditions, "ok" if there are none', endings=("_a", "_b")),
        *_coefficients(_CHANGE, STIFFNESS, DAMPING),
        *(Column(f"{s}{{e}}_changed", "yes, no, or cannot tell") for s in "kc"),
    ),
    "pivot_difference": (
        PAD,
        Column("force_N", "load on the pad"),
        Column(TANGENT, "tangent, what small vibrations feel", endings=_CHANGE),
        Column("stiffness_changed", "yes, no, or cannot tell"),
    ),
    "clearance_difference": (
        PAD,
        Column("clearance_m", "assembled clearance at zero push load", endings=_CHANGE),
        Column("clearance_changed", "yes, no, or cannot tell"),
    ),
}


def markdown(table: str) -> str:
    """Rows of the documentation's table of one file: name, unit, meaning."""
    rows = ["| column | unit | meaning |", "|---|---|---|"]
    for column in TABLES[table]:
        dots = " .. `" + column.name.replace("{e}", "yy") + "`" if "{e}" in column.name else ""
        names = [f"`{column.name.replace('{e}', 'xx')}`{dots}", *(f"`{ending}`" for ending in column.endings)]
        rows.append(f"| {', '.join(names)} | {column.measured[1]} | {column.meaning} |")
    return "\n".join(rows)
