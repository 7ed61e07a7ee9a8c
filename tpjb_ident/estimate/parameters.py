"""Values of the terms' parameters with their priors: one row that all points share, and a table of the points' own."""

from collections.abc import Mapping, Sequence

import numpy as np

from rigdata.arrays import BoolArray, FloatArray, IntArray
from tpjb_ident.estimate.arrowhead import Prior
from tpjb_ident.estimate.term import Fitted, Term

#: Standard deviation that a parameter has at least, in its unit.
_LEAST = 1e-9


class Table:
    """Parameters of some terms; where a row has none of a term, its place stays as it is.

    `row` (P,): row of every point, None where all points share one. What another solve made of terms (`held`, by
    name) stays as it is, with its error.
    """

    def __init__(
        self, terms: Sequence[Term], rows: int, row: IntArray | None = None, held: Mapping[str, Fitted] | None = None
    ) -> None:
        self.terms, self._shared = list(terms), row is None
        ends = np.cumsum([0] + [term.width for term in terms]).tolist()
        self.mean, deviation = np.zeros((rows, ends[-1])), np.ones((rows, ends[-1]))
        self.always, self.never = np.zeros((2, rows, ends[-1]), dtype=bool)
        self._place: dict[str, tuple[IntArray, slice]] = {}
        for term, first, last in zip(terms, ends, ends[1:]):
            mine = np.zeros(1, dtype=np.intp) if row is None else row[list(term.points)]
            assert len(np.unique(mine)) == len(mine), f"{term.name}: points of one group have nothing of their own"
            place = self._place[term.name] = (mine, slice(first, last))
            known = (held or {}).get(term.name)
            mean = [p.mean for p in term.parameters] if known is None else known.value
            spread = [p.deviation for p in term.parameters] if known is None else known.deviation
            self.mean[place] = np.reshape(mean, (-1, term.width))
            deviation[place] = np.maximum(np.reshape(spread, (-1, term.width)), _LEAST)
            self.always[place] = term.always_estimated and known is None
            self.never[place] = term.never_estimated or known is not None
        self.precision = 1 / deviation**2
        self.value = self.mean.copy()

    def of(self, term: Term, values: FloatArray | BoolArray) -> FloatArray:
        """A term's part of values (rows, columns), in the order of its parameters."""
        return np.asarray(values[self._place[term.name]].ravel())

    def chosen(self, term: Term) -> BoolArray:
        """Places of a term's parameters, (rows, columns)."""
        mask = np.zeros(self.mean.shape, dtype=bool)
        mask[self._place[term.name]] = True
        return mask

    def prior(self) -> Prior:
        """What is known beforehand, as far as the values are from their means; without rows where all share one."""
        parts = (self.mean - self.value, self.precision, self.always, self.never)
        return Prior(*(part[0] for part in parts)) if self._shared else Prior(*parts)
