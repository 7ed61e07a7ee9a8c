"""Pivot laws: how far a pivot gives under the pad load, and how stiff it is for small vibrations.

The Kirk and Reedy formulas, Eq. (16) and (17), are secant stiffnesses K = W / delta. Statics use the deflection
delta(W) = W / K(W); small vibrations feel the tangent dW/ddelta. ``kirk-secant`` keeps the printed K for the
vibrations too, which is what the paper compares.
"""

import math
from collections.abc import Iterable, Sequence
from dataclasses import dataclass
from functools import lru_cache
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

import numpy as np

from model.bearing import Bearing, BearingError, Pivot
from model.conditions import named
from model.measured_pivot import FormulaPivot, MeasuredPivot
from model.pad.pivot import CONSTANT, OTHER, ROCKER, SPHERICAL
from model.toml_text import read_page, read_table
from rigdata.arrays import FloatArray
from rigdata.near_names import hint
from rigdata.problem import Condition

#: Condition of a prediction.
BEYOND_TEST = "pads {pads} press their pivots harder than the dry tests did"


@runtime_checkable
class PivotLaw(Protocol):
    """Load-deflection law of one pivot."""

    @property
    def name(self) -> str:
        """What the law is called."""
        ...

    def deflection(self, load: float) -> float:
        """delta(W) [m], for W >= 0 [N].

        Parameters
        ----------
        load : float
            Pad load [N], zero or positive.

        Returns
        -------
        float
            [m]
        """
        ...

    def stiffness(self, load: float) -> float:
        """Tangent dW/ddelta [N/m]; infinite for a rigid pivot.

        Parameters
        ----------
        load : float
            Pad load [N], zero or positive.

        Returns
        -------
        float
            [N/m]
        """
        ...

    def vibration_stiffness(self, load: float) -> float:
        """What small vibrations feel [N/m]: the tangent, unless the law says otherwise.

        Parameters
        ----------
        load : float
            Pad load [N], zero or positive.

        Returns
        -------
        float
            [N/m]
        """
        ...


def constant_pivot(stiffness: float) -> FormulaPivot:
    """A linear spring, W / K."""
    return FormulaPivot((CONSTANT, stiffness, 0.0, 1.0), "constant")


@dataclass(frozen=True)
class ScaledPivot:
    """Another law whose deflection is divided by a factor."""

    law: PivotLaw
    stiffness_factor: float

    @property
    def valid_to(self) -> float:
        """Largest load of the dry test of the law [N]."""
        return getattr(self.law, "valid_to", math.inf)

    @property
    def name(self) -> str:
        """Name of the law and the factor."""
        return f"{self.law.name} x {self.stiffness_factor:g}"

    def deflection(self, load: float) -> float:
        """delta(W) / f [m]."""
        return self.law.deflection(load) / self.stiffness_factor

    def stiffness(self, load: float) -> float:
        """F dW/ddelta [N/m]."""
        return self.law.stiffness(load) * self.stiffness_factor

    def vibration_stiffness(self, load: float) -> float:
        """F times the law's own [N/m]."""
        return self.law.vibration_stiffness(load) * self.stiffness_factor


RIGID_PIVOT = FormulaPivot((CONSTANT, math.inf, 0.0, 1.0), "rigid")


def encoded(laws: Sequence[PivotLaw]) -> tuple[FloatArray, FloatArray]:
    """Laws as rows of numbers, (n, 4), and the measured curves among them, (n, 5, m)."""
    try:
        rows, curves = _encoded(tuple(laws))
    except TypeError:  # a law of somebody's own that has no hash
        rows, curves = _encoded.__wrapped__(tuple(laws))
    return rows.copy(), curves


@lru_cache(maxsize=256)
def _encoded(laws: tuple[PivotLaw, ...]) -> tuple[FloatArray, FloatArray]:
    rows, curves = np.zeros((len(laws), 4)), []
    for row, law in zip(rows, laws, strict=True):
        factor = 1.0
        while type(law) is ScaledPivot:
            factor, law = factor * law.stiffness_factor, law.law
        # a law derived from one that compiled searches know may deflect otherwise
        if type(law) is FormulaPivot or type(law) is MeasuredPivot:
            row[:] = law.numbers
            row[3] = factor
            curves.append(law.curve)
        else:
            row[:] = OTHER, 0.0, 0.0, 1.0
            curves.append(np.zeros((5, 1)))
    table = np.zeros((len(laws), 5, max(c.shape[1] for c in curves)))
    for padded, curve in zip(table, curves, strict=True):
        padded[:, : curve.shape[1]] = curve
    return rows, table


def pressed_beyond(laws: Sequence[PivotLaw], loads: FloatArray) -> tuple[Condition, ...]:
    """Name the pads that press measured pivots harder than the dry tests did: `loads` (n,) [N]."""
    tested = np.array([getattr(law, "valid_to", math.inf) for law in laws])
    numbers = (np.flatnonzero(loads > tested) + 1).tolist()
    return (named(BEYOND_TEST, numbers),) if numbers else ()


def ask_laws(laws: Sequence[PivotLaw], rows: FloatArray, loads: FloatArray) -> None:
    """Ask the laws that have no formula here: `rows` (n, 4), `loads` (n,) [N]."""
    for law, row, load in zip(laws, rows, loads.tolist(), strict=True):
        if row[0] == OTHER:
            # a Hertzian pivot has no stiffness at zero
            row[1] = law.deflection(max(load, 0.0))
            row[2] = 1.0 / law.stiffness(max(load, 1e-6))


@lru_cache(maxsize=64)
def formula_pivot(pivot: Pivot, secant_vibrations: bool = False) -> FormulaPivot:
    """The printed formula for a contact geometry, Eq. (16) or (17) of the paper.

    Line contact (Kirk and Reedy): K = pi E L / { 2 (1 - nu^2) [ 2/3 + ln( pi E L (D_H - D_P) / (4 W (1 - nu^2)) ) ] }
    is the secant; its tangent has 1/3 less than the logarithm: [ ln(...) - 1/3 ]. Past W = load_scale / e the formula
    leaves its physics (the contact is as wide as the gap), and is held there.

    Point contact, sphere on flat (= Hertz): K = W / cbrt(9 W^2 (1 - nu^2)^2 / (2 E^2 D_s)); the tangent is 1.5 K.
    """
    modulus = pivot.youngs_modulus / (1.0 - pivot.poissons_ratio**2)
    name = "kirk-secant" if secant_vibrations else "kirk"
    if pivot.kind == "rocker":
        line = math.pi * modulus * pivot.contact_length
        load_scale = 0.25 * line * (pivot.housing_diameter - pivot.pivot_diameter)
        return FormulaPivot((ROCKER, 0.5 * line, load_scale, 1.0), name, secant_vibrations)
    if pivot.kind == "spherical":
        coefficient = (9.0 / (2.0 * modulus**2 * pivot.sphere_diameter)) ** (1.0 / 3.0)
        return FormulaPivot((SPHERICAL, coefficient, 0.0, 1.0), name, secant_vibrations)
    return RIGID_PIVOT


#: What `pivot_laws` knows by name.
NAMED_LAWS = ("rigid", "kirk", "kirk-secant")


def pivot_laws(choice: Any, bearing: Bearing) -> tuple[PivotLaw, ...]:
    """One law per pad from what a user may say."""
    n = len(bearing.pads)
    if isinstance(choice, str) and choice in NAMED_LAWS:
        return tuple(
            formula_pivot(Pivot() if choice == "rigid" else bearing.pivot_of(pad), choice == "kirk-secant")
            for pad in bearing.pads
        )
    if isinstance(choice, (str, Path)):
        if not Path(choice).suffix:
            advice = hint(str(choice), NAMED_LAWS, "Give a pivots.toml or use one of")
            raise BearingError(f"pivots: {str(choice)!r} is not known. {advice}")
        return load_pivots(choice, n)
    if isinstance(choice, (int, float)) and not isinstance(choice, bool):
        if not (math.isfinite(choice) and choice > 0):
            raise BearingError(f"pivots: a constant stiffness must be positive, got {choice!r} N/m.")
        choice = constant_pivot(float(choice))
    if isinstance(choice, PivotLaw):
        return (choice,) * n
    laws = tuple(choice) if isinstance(choice, Iterable) else ()
    if len(laws) != n or not all(isinstance(law, PivotLaw) for law in laws):
        raise BearingError(
            f"pivots: need {n} pivot laws, one per pad, such as constant_pivot(5e8), or a name; got {choice!r:.90}."
        )
    return laws


def load_pivots(path: str | Path, pads: int | None = None) -> tuple[PivotLaw, ...]:
    r"""Read measured pivot laws from a ``pivots.toml`` (schema ``tpjb-pivots/1``), pad #1 first.

    Parameters
    ----------
    path : str or Path
    pads : int, optional
        How many laws are needed; default: as many as there are.

    Returns
    -------
    tuple of PivotLaw

    Raises
    ------
    BearingError
        Missing or broken file, a pad left out, or a curve that does not rise.

    Examples
    --------
    >>> lines = ['schema = "tpjb-pivots/1"', "[[pads]]", "pad = 1", "force_N = [0, 1e3, 4e3]"]
    >>> text = "\n".join([*lines, "deflection_m = [0, 4e-6, 1e-5]"])
    >>> _ = Path("pivots.toml").write_text(text)
    >>> [law.name for law in load_pivots("pivots.toml")]
    ['measured']
    """
    path = Path(path)
    text = read_page(
        path, BearingError, "A pivots.toml holds some hundred numbers", "`tpjb pivot CAMPAIGN` writes one.", 20
    )
    data = read_table(text, path.name, "tpjb-pivots/1", BearingError)
    _refuse_unknown(data, _FILE_KEYS, path.name)
    tables = data.get("pads")
    housing = data.get("includes_housing", True)
    if not isinstance(tables, list) or not tables:
        raise BearingError(f"{path.name}: no [[pads]] table. Write it anew with `tpjb pivot CAMPAIGN`.")
    if not isinstance(housing, bool):
        raise BearingError(f"{path.name}, includes_housing: must be true or false, got {housing!r}. Correct it.")
    return measured_pivots(tables, path.name, pads, housing)


def measured_pivots(
    tables: Sequence[Any], source: str, pads: int | None = None, includes_housing: bool = True
) -> tuple[PivotLaw, ...]:
    """Make pivot laws of the pads' tables, pad #1 first."""
    laws = {}
    for table in tables:
        number, law = _read_pad(table, source, includes_housing)
        if number in laws:
            raise BearingError(f"{source}, pad {number}: has two [[pads]] tables. Keep one of them.")
        laws[number] = law
    count = pads or max(laws)
    missing = sorted(set(range(1, count + 1)) - set(laws))
    if missing or max(laws) > count:
        raise BearingError(
            f"{source}: has pads {sorted(laws)}, needs 1 to {count}. Measure pad #{(missing or [count])[0]} too."
        )
    return tuple(laws[k] for k in range(1, count + 1))


#: Keys of a pivots.toml, of all and of a pad.
_FILE_KEYS = ("schema", "source", "includes_housing", "pads")
_PAD_KEYS = (
    "pad", "law", "valid_from_N", "valid_to_N", "relative_calibration", "force_N", "deflection_m",
    "stiffness_N_per_m", "stiffness_relative_se",
)  # fmt: skip


def _read_pad(table: Any, name: str, housing: bool) -> tuple[int, MeasuredPivot]:
    number = table.get("pad") if isinstance(table, dict) else None
    if type(number) is not int or not 1 <= number <= 40:
        raise BearingError(f"{name}, [[pads]]: pad must be a number from 1, got {number!r}.")
    place = f"{name}, pad {number}"
    _refuse_unknown(table, _PAD_KEYS, place)
    try:
        force = np.array([_number(value, "force_N") for value in table["force_N"]])
        points = np.array([_number(value, "deflection_m") for value in table["deflection_m"]])
        for entry, value in enumerate(table.get("stiffness_N_per_m", ()), start=1):
            if not _number(value, "stiffness_N_per_m") > 0.0:
                raise ValueError(f"stiffness_N_per_m: entry {entry} is {value!r}, no stiffness")
        low = _number(table.get("valid_from_N", 0.0), "valid_from_N")
        high = _number(table.get("valid_to_N", table["force_N"][-1]), "valid_to_N")
        if not 0.0 <= low < high:
            raise ValueError(f"valid from {low:g} to {high:g} N")
        law = MeasuredPivot(force, points, str(table.get("law", "measured")), housing, high)
    except (KeyError, TypeError, ValueError, OverflowError) as error:  # whole numbers of 400 digits overflow
        raise BearingError(f"{place}: {error}. Write it anew with `tpjb pivot CAMPAIGN`.") from error
    return number, law


def _number(value: Any, key: str) -> float:
    """A number of the file: neither text nor a truth value, and none that is not there."""
    number = float(value) if type(value) in (int, float) else math.nan
    if math.isnan(number):
        raise ValueError(f"{key}: {value!r} is no number")
    return number


def _refuse_unknown(table: dict[str, Any], keys: Sequence[str], place: str) -> None:
    for key in table:
        if key not in keys:
            raise BearingError(f"{place}: {key!r} is not known. {hint(key, keys)}")
