"""Many operating points through the model: one equilibrium per static point, neighbours start one another."""

from __future__ import annotations

import math
from collections import defaultdict
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from model.bearing import Bearing
from model.conditions import pads_of
from model.effects import Effect
from model.mirror import as_it_turns
from model.options import Options
from model.pivots import BEYOND_TEST, PivotLaw, measured_pivots, pivot_laws
from model.predict import predict
from model.prediction import Prediction
from rigdata.operating_point import OperatingPoint
from rigdata.problem import parse_toml
from tpjb_ident.columns import amount
from tpjb_ident.errors import BadInputError
from tpjb_ident.schema import COEFFICIENT_COLUMNS, POINT_KEY

if TYPE_CHECKING:
    from tpjb_ident.pivot.curve import PivotCurve
    from tpjb_ident.pivot.tables import Formula


def measured_laws(curves: Sequence[PivotCurve], n_pads: int, source: str) -> tuple[PivotLaw, ...]:
    """Turn measured curves into pivot laws, pad #1 first."""
    from tpjb_ident.pivot.tables import pad_table

    return measured_pivots([pad_table(curve) for curve in curves], source, n_pads)


#: Effects that say how far pivots give way under load: a dry test measures just that.
_PIVOT_EFFECTS = frozenset({"pivot_flexibility", "soft_pivot"})


def counted_twice(effects: Sequence[Effect]) -> tuple[str, ...]:
    """Names of the effects that measured pivots hold already."""
    return tuple(dict.fromkeys(e.name for e in effects if e.name in _PIVOT_EFFECTS))


def counts_from_measured(path: Path | None) -> bool:
    """Whether an effects file says that its sizes are meant beside measured pivots, as a diagnosis from there does."""
    entries = {} if path is None else parse_toml(path.read_text("utf-8-sig"))
    return entries.get("counted_from") == "measured pivots"


def refuse_counted_twice(pivots: Any, effects: Sequence[Effect], path: Path) -> None:
    """Refuse measured pivots together with effects that count from the printed formula."""
    twice = counted_twice(effects)
    is_measured = isinstance(pivots, Path) or pivots == "measured"
    if is_measured and twice and not counts_from_measured(path):
        raise BadInputError(
            f"--effects {path.name}: {', '.join(twice)} would count twice: measured pivots give way as far as they do "
            "already. Use --pivots kirk with these effects, or take them out of the file with measured pivots."
        )


#: Called with what is being done, how many are done, of how many.
Progress = Callable[[str, int, int], None]


@dataclass(frozen=True)
class ModelSettings:
    """Which model is asked."""

    pivots: Any = "kirk"
    thermal: str = "adiabatic"
    effects: tuple[Effect, ...] = ()
    options: Options = field(default_factory=Options)


def predict_points(
    bearing: Bearing, points: Iterable[OperatingPoint], settings: ModelSettings, progress: Progress | None = None
) -> list[dict[str, Any]]:
    """Predict every operating point: rows of ``prediction.csv``, and whether a pivot is pressed beyond its dry test."""
    excited = list(map(_excited, points))
    bearing = as_it_turns(bearing, {point.rotation for point in excited})
    groups = defaultdict(list)
    for point in dict.fromkeys(excited):
        groups[replace(point, excitation=0.0)].append(point)
    rows = {}
    before = None
    for done, (static, group) in enumerate(sorted(groups.items()), start=1):
        prediction = predict(
            bearing,
            static.static_load,
            static.static_load_direction,
            static.shaft_speed,
            np.array([point.excitation for point in group]),
            pivots=settings.pivots,
            thermal=settings.thermal,
            effects=settings.effects,
            start=before if before is not None and before.rotation == static.rotation else None,
            options=settings.options,
            rotation=static.rotation,
        )
        before = prediction if prediction.converged else None
        for index, point in enumerate(group):
            rows[point] = _row(point, prediction, index)
        if progress is not None:
            progress(amount(static.static_load, "load"), done, len(groups))
    return [rows[point] for point in excited]


def _excited(point: OperatingPoint) -> OperatingPoint:
    """The point, excited at the running speed where it states no excitation."""
    return point if point.excitation > 0 else replace(point, excitation=point.shaft_speed)


def point_columns(point: OperatingPoint) -> dict[str, float | str]:
    """Key columns of every table over operating points (outputs.md)."""
    return dict(zip(POINT_KEY, _excited(point).key, strict=True))


def _row(point: OperatingPoint, p: Prediction, index: int) -> dict[str, Any]:
    """Row of one point, of whose frequencies in a prediction it is the one of this index."""
    row = {**point_columns(point)}
    row.update(zip(COEFFICIENT_COLUMNS, np.stack([p.k[index], p.c[index]]).ravel(), strict=True))
    row.update(x_m=p.position[0], y_m=p.position[1])
    for number in range(1, len(p.pad_load) + 1):
        row.update(_pad_columns(p, number))
    row.update(
        max_pressure_Pa=p.max_pressure,
        max_temperature_degC=p.max_temperature,
        min_film_m=p.min_film,
        power_loss_W=p.power_loss,
        reynolds=p.reynolds,
        sommerfeld=p.sommerfeld,
        eccentricity_ratio=p.eccentricity_ratio,
        attitude_angle_deg=math.degrees(p.attitude_angle),
        converged=p.converged,
        idle_pads=" ".join(str(n) for n in p.idle_pads),
        mesh_error=p.mesh_error,
        status="; ".join(p.status),
        pivot_extrapolated=bool(pads_of(BEYOND_TEST, p.status)),
    )
    return row


def _pad_columns(p: Prediction, number: int) -> dict[str, float]:
    i, pad = number - 1, f"pad{number}"
    idle, flow = number in p.idle_pads, p.pad_flow[i]
    return {
        f"{pad}_load_N": p.pad_load[i],
        f"{pad}_tilt_rad": p.tilt[i],
        f"{pad}_deflection_m": p.deflection[i],
        f"{pad}_max_pressure_Pa": 0.0 if idle else p.pressure[i].max(),
        f"{pad}_max_temperature_degC": math.nan if idle else p.temperature[i].max(),
        f"{pad}_min_film_m": math.nan if idle else p.film[i].min(),
        f"{pad}_inflow_m3_per_s": flow.inflow,
        f"{pad}_outflow_m3_per_s": flow.outflow,
        f"{pad}_leakage_m3_per_s": flow.leakage,
        f"{pad}_inlet_temperature_degC": flow.inlet,
        f"{pad}_outlet_temperature_degC": flow.outlet,
    }


def printed_formula(bearing: Bearing | None) -> Formula | None:
    """Kirk and Reedy's formula for a bearing's pivots, Eq. (16) or (17); None if its pivots are rigid, or unknown."""
    if bearing is None or bearing.pivot.kind == "rigid":
        return None
    laws = pivot_laws("kirk-secant", bearing)
    return lambda pad, load: (laws[pad - 1].vibration_stiffness(load), laws[pad - 1].stiffness(load))
