"""What an effect is: a name, parameters with units and plausible ranges, and one function."""

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from typing import Any, Literal

from model.bearing import Bearing
from model.errors import ModelError
from model.setup import Setup
from rigdata.near_names import hint
from rigdata.units import UnitError, to_si

#: A bearing file lists no more pads.
MAX_PADS = 40
Side = Literal["bearing", "structure", "measurement"]


class EffectError(ModelError):
    """An effect that is not known, or a parameter that is missing, unknown or out of its bounds."""


@dataclass(frozen=True)
class Parameter:
    """One parameter of an effect.

    Attributes
    ----------
    name : str
        As in `docs/theory.md`.
    unit : str
        SI unit as text ("1" for a ratio, "pad" for a pad number).
    dimension : str
        Key of `rigdata.units.SI_UNITS`, for quantities with units in effects files.
    neutral : float
        Value at which the effect does nothing (nan: there is none, e.g. a pad number or an infinite stiffness).
    low, high : float
        Physical bounds; a value beyond them is refused.
    typical : float
        Size one would not be surprised by (one standard deviation of a prior about `neutral`; for an infinite
        `neutral`, a value one would not be surprised by).
    form : {"linear", "inverse", "square"}
        In which form the parameter acts nearly linearly: fits move ``to_linear(value)``.
    options : tuple of float
        For a parameter without a neutral value other than a pad number: what to try.
    """

    name: str
    unit: str
    dimension: str
    neutral: float
    low: float
    high: float
    typical: float = math.nan
    form: Literal["linear", "inverse", "square"] = "linear"
    options: tuple[float, ...] = ()

    def to_linear(self, value: float) -> float:
        """Value in the form in which the effect is nearly linear.

        Parameters
        ----------
        value : float
            Amplitude in the unit of the parameter.
        """
        if self.form == "inverse":
            return 1.0 / value
        return value**2 if self.form == "square" else value

    def from_linear(self, form: float) -> float:
        """Undo `to_linear`.

        Parameters
        ----------
        form : float
            What `to_linear` gave.
        """
        if self.form == "inverse":
            return 1.0 / form if form else math.inf
        return math.sqrt(max(form, 0.0)) if self.form == "square" else form

    @property
    def typical_step(self) -> float:
        """Size of `typical` in the nearly linear form."""
        if math.isnan(self.typical):  # not said: a tenth of the physical range, or of a unit
            ends = [self.to_linear(v) for v in (self.low, self.high)]
            return 0.1 * abs(ends[1] - ends[0]) if all(map(math.isfinite, ends)) else 0.1
        if math.isinf(self.neutral):
            return self.to_linear(self.typical)
        moved = self.neutral - self.typical if self.form == "inverse" else self.neutral + self.typical
        return abs(self.to_linear(moved) - self.to_linear(self.neutral))

    @property
    def discrete(self) -> bool:
        """Whether the parameter is a pad number."""
        return self.unit == "pad"


#: The number of a pad, for an effect on one of them.
PAD = Parameter("pad", "pad", "ratio", math.nan, 1, MAX_PADS)
#: Which way, for an effect that has no neutral direction.
DIRECTION = Parameter(
    "direction", "rad", "angle", math.nan, -7.0, 7.0, options=(0.0, math.pi / 4, math.pi / 2, 3 * math.pi / 4)
)


@dataclass(frozen=True)
class EffectWords:
    """What to say of an effect to an engineer; `finding` is one clause with parameters as fields.

    ``{delay}`` is an amount with its interval, ``{pad}`` a pad's number, ``{factor:size}`` how far a parameter is from
    neutral, ``{factor:more|less}`` on which side; ``{share:2}`` has decimals of the SI number, ``{angle:°}`` and
    ``{angle:mm/m}`` another unit; the name of a parameter that each pad has lists all pads.
    """

    finding: str
    physics: str
    on_the_rig: str  #: How it shows in measurements.
    check: str  #: Where to look first.


@dataclass(frozen=True)
class EffectKind:
    """A kind of effect, as the library holds it.

    Attributes
    ----------
    name : str
    side : {"bearing", "structure", "measurement"}
        What it acts on; measurement effects act on the records.
    parameters : tuple of Parameter
    apply : callable
        ``apply(setup, **parameters) -> Setup``; parameters in SI.
    source : str
        Where the plausible range comes from.
    per_pad : Parameter, optional
        The effect has one such parameter per pad, named ``<name>_1`` to ``<name>_n``, after `parameters`.
    obstacle : callable, optional
        ``obstacle(bearing) -> str``: why a bearing cannot have this effect; empty if it can.
    words : EffectWords, optional
        Default: verdicts give its name and the amounts of its parameters.
    """

    name: str
    side: Side
    parameters: tuple[Parameter, ...]
    apply: Callable[..., Setup]
    source: str = ""
    per_pad: Parameter | None = None
    obstacle: Callable[[Bearing], str] | None = None
    words: EffectWords | None = None

    def parameters_of(self, pads: int) -> tuple[Parameter, ...]:
        """Every parameter, for a bearing of `pads` pads.

        Parameters
        ----------
        pads : int
            Number of pads of the bearing.
        """
        if self.per_pad is None:
            return self.parameters
        return (*self.parameters, *(replace(self.per_pad, name=f"{self.per_pad.name}_{k}") for k in range(1, pads + 1)))

    def missing(self, bearing: Bearing) -> str:
        """Why a bearing cannot have this effect; empty if it can.

        Parameters
        ----------
        bearing : Bearing
            The bearing that the effect is to act on.
        """
        return self.obstacle(bearing) if self.obstacle is not None else ""

    def check(self, values: Mapping[str, Any]) -> dict[str, float]:
        """Parameters as SI numbers, complete and within their bounds.

        Parameters
        ----------
        values : mapping of str to float or quantity
            Parameters by name; a text or pint quantity carries its unit, a number is SI.

        Returns
        -------
        dict of str to float
            SI numbers by name.

        Raises
        ------
        EffectError
            Unknown, missing or impossible parameter.
        """
        numbered = sum(self.per_pad is not None and name.startswith(f"{self.per_pad.name}_") for name in values)
        by_name = {p.name: p for p in self.parameters_of(max(1, min(numbered, MAX_PADS)))}
        for name in values:
            if name not in by_name:
                raise EffectError(f"{self.name}: no parameter {name!r}. {hint(name, by_name)}")
        out = {}
        for name, parameter in by_name.items():
            if name not in values:
                raise EffectError(f"{self.name}: parameter {name!r} [{parameter.unit}] is missing.")
            out[name] = _number(values[name], parameter, f"{self.name}.{name}")
        return out


def effect_on(
    side: Side,
    *parameters: Parameter,
    source: str,
    per_pad: Parameter | None = None,
    obstacle: Callable[[Bearing], str] | None = None,
    **words: str,
) -> Callable[[Callable[..., Setup]], EffectKind]:
    """Make a function an `EffectKind` of its name; `words` are those of `EffectWords`."""

    def kind(apply: Callable[..., Setup]) -> EffectKind:
        return EffectKind(apply.__name__, side, parameters, apply, source, per_pad, obstacle, EffectWords(**words))

    return kind


def _number(value: Any, parameter: Parameter, place: str) -> float:
    try:
        value = to_si(value, parameter.dimension, place)
    except UnitError as error:
        raise EffectError(f"{error}.") from error
    if isinstance(value, bool) or not hasattr(value, "__float__"):
        raise EffectError(f"{place}: must be a number [{parameter.unit}], got {value!r}.")
    try:
        value = float(value)
    except OverflowError as error:
        raise EffectError(f"{place}: a whole number of hundreds of digits is outside any physical range.") from error
    if not parameter.low <= value <= parameter.high:
        bounds = f"{parameter.low:g} to {parameter.high:g} [{parameter.unit}]"
        raise EffectError(f"{place}: {value:g} is outside the physical range {bounds}.")
    if parameter.discrete:
        if value != int(value):
            raise EffectError(f"{place}: a pad is a whole number, got {value!r}.")
        return int(value)
    return value
