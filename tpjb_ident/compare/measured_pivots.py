"""Measured pivots as the model takes them, and effects beside them that must not count twice what dry tests hold."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

from model.effects import Effect
from model.pivots import PivotLaw, measured_pivots
from model.toml_text import parse_toml
from tpjb_ident.errors import BadInputError

if TYPE_CHECKING:
    from tpjb_ident.pivot import PivotCurve


def measured_laws(curves: Sequence[PivotCurve], n_pads: int, source: str = "") -> tuple[PivotLaw, ...]:
    """Turn measured curves into pivot laws, pad #1 first."""
    from tpjb_ident.pivot.tables import pad_table

    if not curves:
        raise ValueError("curves must hold at least one PivotCurve")
    return measured_pivots([pad_table(curve) for curve in curves], source or "the dry tests", n_pads)


#: Effects that say how far pivots give way under load: a dry test measures just that.
_PIVOT_EFFECTS = frozenset({"pivot_flexibility", "soft_pivot"})
#: Key of an effects file whose pivot effects are sizes beside measured pivots, as a diagnosis that began there writes.
_COUNTED_FROM = "counted_from"
_MEASURED = "measured pivots"


def counted_twice(effects: Sequence[Effect]) -> tuple[str, ...]:
    """Names of the effects that measured pivots hold already."""
    return tuple(dict.fromkeys(e.name for e in effects if e.name in _PIVOT_EFFECTS))


def beside_measured(effects: Sequence[Effect]) -> tuple[Effect, ...]:
    """Effects without those that measured pivots hold already."""
    return tuple(e for e in effects if e.name not in _PIVOT_EFFECTS)


def counts_from_measured(path: Path | None) -> bool:
    """Whether an effects file says that its sizes are meant beside measured pivots."""
    if path is None:
        return False
    return bool(parse_toml(path.read_text(encoding="utf-8-sig")).get(_COUNTED_FROM) == _MEASURED)


def refuse_counted_twice(pivots: Any, effects: Sequence[Effect], path: Path | None) -> None:
    """Refuse measured pivots together with effects that count from the printed formula."""
    twice = counted_twice(effects)
    if not (isinstance(pivots, Path) or pivots == "measured") or not twice or counts_from_measured(path):
        return
    raise BadInputError(
        f"--effects {path.name if path else ''}: {', '.join(twice)} would count twice: measured pivots give way as far "
        "as they do already. Use --pivots kirk with these effects, or take them out of the file with measured pivots."
    )
