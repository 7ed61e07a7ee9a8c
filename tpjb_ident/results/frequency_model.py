"""Models over frequency: K-C (h = K + i omega C) and K-C-M (h = K - omega^2 M + i omega C), for sines and for bands.

Chi-square says which of them the data support. A tilting-pad bearing owes neither: its pads are dynamic, and when
K-C-M is refused too the raw H is the answer.

Runs of one point that are wrong alike agree with one another; other frequencies tell, where the film is near K-C-M. A
point stands apart where its own H, left free, makes far more of what K-C-M leaves go than one more power of frequency
in every entry does, which has as many numbers: H of a film runs smoothly. Where pads bend it, little is told this way.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from typing import Any

import numpy as np
from scipy.special import chdtrc

from rigdata.arrays import ComplexArray, FloatArray
from rigdata.near_names import unknown_name
from tpjb_ident.conditions import Condition, merged
from tpjb_ident.errors import ArgumentError
from tpjb_ident.estimate.arrowhead import MODELS, NUMBERS, power_columns, remainder
from tpjb_ident.estimate.statistics import half_width
from tpjb_ident.estimate.term import CHANGE_AS_DEVIATION
from tpjb_ident.estimators.stiffness import DynamicStiffness
from tpjb_ident.results.point_result import PointResult, by_static_point
from tpjb_ident.schema import COEFFICIENT_COLUMNS, MASS

#: Method of points of a band where nothing tells noise from motion.
BLIND = "band-hv"
#: A model is refused below this probability of its chi-square.
REFUSED = 0.01
#: Draws of a chi-square with measured covariances, and their seed; above so many degrees of freedom one is known.
_DRAWN, _LARGE_DOF = (4000, 5), 1e4
_FIGURES = (
    "n_frequencies",
    "excitation_lowest_Hz",
    "excitation_highest_Hz",
    "chi_square",
    "dof",
    "probability",
    "largest_misfit",
)
_VALUES = (*COEFFICIENT_COLUMNS, *MASS.columns)
_ENDINGS = ("", "_lo", "_hi", "_se", "_dof")
#: Columns of a model in the tables.
MODEL_COLUMNS = [*_FIGURES]
for _value in _VALUES:
    MODEL_COLUMNS += [_value + ending for ending in _ENDINGS]


@dataclass(frozen=True)
class FrequencyModel:
    """One model over the frequencies of one static point; p numbers: K [N/m], C [N s/m], M [kg], entry by entry."""

    model: str
    parameters: FloatArray  #: (p,)
    covariance: FloatArray = field(repr=False)  #: (p, p): random part
    dof: FloatArray = field(repr=False)  #: (p,): degrees of freedom of its variances
    systematic: FloatArray = field(repr=False)  #: (p, p): what all frequencies share
    chi_square: float
    spare: int
    probability: float  #: of a chi-square this large if the model were true; NaN without spare data
    misfit: float
    band: tuple[float, float]  #: Hz
    n_frequencies: int

    @property
    def refused(self) -> bool:
        """Whether the data refuse the model."""
        return self.spare > 0 and self.probability < REFUSED

    @property
    def standard_error(self) -> FloatArray:
        """Random standard errors (p,); inflated by the reduced chi-square where the data refuse the model."""
        inflation = max(self.chi_square / self.spare, 1.0) if self.refused else 1.0
        return np.sqrt(inflation * np.diag(self.covariance))

    def half_width(self, level: float = 0.95) -> FloatArray:
        """Half the interval of every parameter: Student's t of the random part and normal of the shared one."""
        return half_width(level, self.standard_error, self.dof, np.sqrt(np.maximum(np.diag(self.systematic), 0.0)))

    def h(self, omega: float | FloatArray) -> ComplexArray:
        """Dynamic stiffness of the model, (2, 2) or (n, 2, 2) [N/m]; `omega` (n,) [rad/s]."""
        K, C, M = (*self.parameters.reshape(-1, 2, 2), np.zeros((2, 2)))[:3]
        w = np.asarray(omega, dtype=float)[..., None, None]
        return K - w**2 * M + 1j * w * C

    def columns(self) -> dict[str, Any]:
        """What the tables say of the model, under its name and `MODEL_COLUMNS`; zero what it does not have."""
        figures = (self.n_frequencies, *self.band, self.chi_square, self.spare, self.probability, self.misfit)
        value, half = self.parameters, self.half_width()
        numbers = np.zeros((len(_VALUES), len(_ENDINGS)))
        numbers[:, -1] = np.inf
        numbers[: len(value)] = np.stack([value, value - half, value + half, self.standard_error, self.dof], axis=1)
        return {"model": self.model, **dict(zip(MODEL_COLUMNS, (*figures, *numbers.ravel())))}


def chance_of(chi_square: float, dof: int, noise_dof: Sequence[float]) -> float:
    """Probability of a larger chi-square whose covariances are themselves measured, point by point.

    A covariance from few repeats is too small as often as too large, and where it is too small its share of the
    chi-square is huge. Each share is a chi-square over a mean square of its own; the sum is drawn, with a fixed seed.
    A 2x2 complex covariance of nu degrees of freedom, inverted, is too large by nu / (nu - 4) on average: as a single
    variance of nu / 2 is.
    """
    plain = float(chdtrc(dof, chi_square)) if dof > 0 else np.nan
    if not min(noise_dof) < _LARGE_DOF or not plain <= 0.5:
        return plain
    rng = np.random.default_rng(_DRAWN[1])
    degrees = dof / len(noise_dof)
    total = np.zeros(_DRAWN[0])
    for nu in noise_dof:
        share = rng.chisquare(degrees, _DRAWN[0])
        half = max(nu / 2, 1.0)
        total += share / (rng.chisquare(half, _DRAWN[0]) / half) if nu < _LARGE_DOF else share
    above = float((total >= chi_square).mean())
    return max(above, plain)


def fit_over_frequency(
    estimates: Sequence[DynamicStiffness], model: str, changes: FloatArray | None = None
) -> FrequencyModel:
    """Fit one model to the dynamic stiffnesses of one static point by generalised least squares.

    `changes` (q, 8 n) [N/m]: what every source that the n estimates share does to their entries, mean of products.
    """
    if model not in MODELS:
        raise ArgumentError(unknown_name("model", model, MODELS))
    usable = [i for i, e in enumerate(estimates) if np.isfinite(e.h).all() and np.isfinite(e.covariance).all()]
    chosen = [estimates[i] for i in usable]
    omega = np.array([e.omega for e in chosen])
    needed = MODELS[model] - 1
    if len(np.unique(omega)) < needed:
        raise ArgumentError(f"{model} needs {needed} frequencies with an answer, got {len(np.unique(omega))}")
    # Natural scales keep the normal equations well conditioned: per omega, per omega^2.
    middle = np.sqrt(omega.min() * omega.max())
    design = power_columns(omega / middle, MODELS[model])
    y, covariance = np.array([e.vector for e in chosen]), np.array([e.covariance for e in chosen])
    weight = np.linalg.inv(covariance)
    weighted = design.transpose(0, 2, 1) @ weight
    inverse = np.linalg.inv((weighted @ design).sum(axis=0))
    scale = np.repeat(middle ** -np.arange(MODELS[model], dtype=float), 4)
    gains = scale[:, None] * (inverse @ weighted)  # (n, p, 8): change of the parameters with every estimate
    x = np.einsum("npa,na->p", gains, y)
    residual = y - design @ (x / scale)
    chi_square = float(np.einsum("na,nab,nb->", residual, weight, residual))
    random = gains @ covariance @ gains.transpose(0, 2, 1)
    variances = np.einsum("npp->np", random)
    spare, noise_dof = 8 * len(chosen) - len(x), [float(np.median(e.dof)) for e in chosen]
    lengths = np.linalg.norm(residual, axis=1) / np.linalg.norm(y, axis=1)
    spread = np.sum(variances**2 / np.array(noise_dof)[:, None], axis=0)  # Welch and Satterthwaite
    with np.errstate(divide="ignore"):  # covariances may be known
        dof = variances.sum(axis=0) ** 2 / spread
    shared = np.zeros((1, len(chosen), 8))
    if changes is not None:
        shared = changes.reshape(len(changes), -1, 8)[:, usable]
    return FrequencyModel(
        model,
        x,
        random.sum(axis=0),
        dof,
        _systematic(gains, np.array([e.systematic for e in chosen]), shared),
        chi_square,
        spare,
        chance_of(chi_square, spare, noise_dof),
        float(lengths.max()),
        (float(omega.min()) / (2 * np.pi), float(omega.max()) / (2 * np.pi)),
        len(chosen),
    )


def _systematic(gains: FloatArray, systematic: FloatArray, changes: FloatArray) -> FloatArray:
    """Covariance (p, p) that systematic errors (n, 8, 8) leave.

    `gains` (n, p, 8), `changes` (q, n, 8): what every source does that all share.
    """
    together = np.einsum("npa,qna->qp", gains, changes)
    # what no source explains is the point's own: of its baseline, of mains on the cells
    separate = systematic - np.einsum("qna,qnb->nab", changes, changes) / len(changes)
    single = (gains @ separate @ gains.transpose(0, 2, 1)).sum(axis=0)
    return together.T @ together / len(changes) + single


@dataclass(frozen=True)
class StaticFits:
    """All models of one static point."""

    points: tuple[PointResult, ...] = field(repr=False)
    places: tuple[int, ...]  #: of the points among all of them
    fits: dict[str, FrequencyModel]

    @property
    def supported(self) -> str:
        """The simplest model that the data do not refuse, or ``"raw H"``."""
        return next((name for name, model in self.fits.items() if not model.refused), "raw H")


def fits_over_frequency(points: Sequence[PointResult], changes: FloatArray | None = None) -> list[StaticFits]:
    """Fit every static point that was run at two excitation frequencies or more; `changes` (q, 8 P) [N/m].

    Points with mains on the excitation line take part: their intervals say what they are worth. Without an instrument
    the bias of h looks like a misfit: nothing is refused then.
    """
    fits = []
    for places in by_static_point(points):
        members = tuple(points[i] for i in places)
        estimates = [p.stiffness for p in members]
        if len({round(e.omega, 6) for e in estimates}) > 1:
            rows = None if changes is None else changes.reshape(len(changes), -1, 8)[:, places]
            models = {model: fit_over_frequency(estimates, model, rows) for model in MODELS}
            if any(est.method == BLIND for est in estimates):
                for name, model in models.items():
                    models[name] = replace(model, chi_square=np.nan, probability=np.nan, misfit=np.nan)
            fits.append(StaticFits(members, tuple(places), models))
    return fits


#: Frequencies from which K-C-M leaves something over when one of them is free.
_FREQUENCIES = 4
#: Powers of frequency with one more than K-C-M in the real entries and in the imaginary ones.
_SMOOTH = 5
#: Share of H by which a point stands apart, at least: pads and pivots bend H over frequency by less.
_NOTABLE = 0.03
#: Distance from the nearest frequency up to which the others tell of a point, over their span.
_REACH = 0.6
#: Times as much as another power of frequency that the point's own H must make go, and as any other point's does.
_CLEARLY, _ALONE = 25.0, 5.0


def with_frequency_outliers(points: Sequence[PointResult]) -> tuple[PointResult, ...]:
    """The points, each that stands apart from the other frequencies of its load with a condition and a wider interval.

    Which of them is right nothing tells: a gain or a range that is off, or a film that does so.
    """
    result = list(points)
    for places in by_static_point(points):
        outlier = frequency_outlier([points[i].stiffness for i in places])
        if outlier is not None:
            k, distance = outlier
            share = np.linalg.norm(distance) / np.linalg.norm(points[places[k]].stiffness.h)
            neighbours = f"the other {len(places) - 1} frequencies of this load"
            doubt = Condition("frequency-outlier", f"h is {100 * share:.0f} % from what {neighbours} let expect")
            result[places[k]] = _widened(points[places[k]], CHANGE_AS_DEVIATION * distance, doubt)
    return tuple(result)


def _widened(point: PointResult, deviation: FloatArray, doubt: Condition) -> PointResult:
    """The point, h by every method uncertain by a further source of one deviation (8,) [N/m]."""
    covariance = np.outer(deviation, deviation)
    by_method = dict(point.by_method)
    for name, estimate in point.by_method.items():
        by_method[name] = replace(estimate, systematic=estimate.systematic + covariance)
    default = next(name for name, estimate in point.by_method.items() if estimate is point.stiffness)
    quality, budget = merged(point.quality, (doubt,)), {**point.budget, "other frequencies": covariance}
    return replace(point, stiffness=by_method[default], by_method=by_method, quality=quality, budget=budget)


def frequency_outlier(estimates: Sequence[DynamicStiffness]) -> tuple[int, FloatArray] | None:
    """Place of the estimate that stands apart, and its distance (8,) from the others' curve; None where none does."""
    omega = np.array([e.omega for e in estimates])
    if len(np.unique(omega)) < _FREQUENCIES:
        return None
    size = np.array([np.linalg.norm(e.h) for e in estimates])
    y, root = np.array([e.vector for e in estimates])[:, :, None], np.eye(NUMBERS) / size[:, None, None]
    noise = sum(np.trace(e.covariance) / s**2 for e, s in zip(estimates, size))
    w = omega / np.exp(np.log(omega).mean())
    smooth = np.sum(remainder(power_columns(w, _SMOOTH), y, root, slice(None)) ** 2) + noise
    distance, misfit = np.zeros((len(w), NUMBERS)), np.full(len(w), np.inf)
    for k in range(len(w)):
        neighbours = np.arange(len(w)) != k
        if np.abs(w[neighbours] - w[k]).min() > _REACH * np.ptp(w[neighbours]):
            continue  # the others are too far off to tell
        residuals = remainder(power_columns(w, MODELS["K-C-M"]), y, root, neighbours)[:, :, 0]
        distance[k], misfit[k] = residuals[k], np.sum(residuals[neighbours] ** 2) + noise
    place, second = np.argsort(misfit)[:2].tolist()
    is_clear = _CLEARLY * misfit[place] < smooth and _ALONE * misfit[place] < misfit[second]
    is_apart = np.linalg.norm(distance[place]) > _NOTABLE and is_clear
    return (place, distance[place] * size[place]) if is_apart else None
