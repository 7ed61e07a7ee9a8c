"""What a page shows: a campaign with what is identified from it, or a folder of results."""

from __future__ import annotations

import threading
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import TYPE_CHECKING

from tpjb_ident.arrays import FloatArray

if TYPE_CHECKING:
    import pandas as pd

    from rigdata.campaign import Campaign
    from tpjb_ident.dynamic.results.identification import Identification


@dataclass(frozen=True)
class Curve:
    """Predicted coefficients at one static load."""

    frequency: FloatArray = field(repr=False)
    k: FloatArray = field(repr=False)
    c: FloatArray = field(repr=False)
    status: str = ""


#: Static load [N], direction [rad], speed [rad/s], frequencies [Hz], name of the pivot model -> Curve.
Predictor = Callable[[float, float, float, FloatArray, str], Curve]


@dataclass
class Session:
    """Everything that the tabs share; what takes time is computed once, when it is first asked for."""

    name: str
    campaign: Campaign | None = None
    tables: Mapping[str, pd.DataFrame] = field(default_factory=dict)
    identify: Callable[[], Identification] | None = None
    predict: Predictor | None = None
    pivots: tuple[str, ...] = ()
    _found: Identification | None = None
    _lock: threading.Lock = field(default_factory=threading.Lock)

    @property
    def identification(self) -> Identification | None:
        """Identified coefficients; None if the campaign has no dynamic runs."""
        with self._lock:
            if self._found is None and self.identify is not None:
                self._found = self.identify()
            return self._found
