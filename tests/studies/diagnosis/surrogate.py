"""Surrogate: the model's answers along every effect, tabled once, for evidence from many campaigns.

The change of the observation vector is a cubic spline in the amplitude of each effect (its nearly linear form);
several effects add up. It answers to the same calls as `Forward`, so that screening, fits and verdict run unchanged.
"""

from __future__ import annotations

import functools
from collections.abc import Sequence
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from model.effects import Effect
from tpjb_ident.diagnose.forward.candidates import Candidate
from tpjb_ident.diagnose.forward.forward import Change, Forward, NoEquilibriumError
from tpjb_ident.diagnose.observations.observe import Element

FloatArray = NDArray[np.float64]
#: Nodes of a table on either side of zero, as shares of its range.
SHARES = (0.12, 0.35, 0.65, 1.0)


@dataclass(frozen=True)
class EffectTable:
    """Change of the observation vector along one effect.

    Attributes
    ----------
    amplitudes : (m,) ndarray
        Increasing, in the nearly linear form; the neutral one is among them.
    changes : (m, n) ndarray
    """

    amplitudes: FloatArray
    changes: FloatArray = field(repr=False)

    @functools.cached_property
    def _spline(self) -> CubicSpline:
        ends = "natural" if len(self.amplitudes) < 4 else "not-a-knot"
        return CubicSpline(self.amplitudes, self.changes, bc_type=ends)

    def at(self, amplitude: float) -> FloatArray:
        """Change at an amplitude; a straight line beyond the table, (n,)."""
        if len(self.amplitudes) == 1:
            return np.zeros(self.changes.shape[1])
        spline = self._spline
        inside = float(np.clip(amplitude, self.amplitudes[0], self.amplitudes[-1]))
        return np.asarray(spline(inside) + (amplitude - inside) * spline(inside, 1))


@dataclass
class Surrogate:
    """Tabled answers of a model.

    Attributes
    ----------
    elements : tuple of Element
    base : (n,) ndarray
        Without effects.
    candidates : tuple of Candidate
    tables : tuple of EffectTable
        One per candidate.
    """

    elements: tuple[Element, ...] = field(repr=False)
    base: FloatArray = field(repr=False)
    candidates: tuple[Candidate, ...]
    tables: tuple[EffectTable, ...] = field(repr=False)

    def __post_init__(self) -> None:
        self._index = {(c.name, tuple(sorted(c.fixed.items()))): i for i, c in enumerate(self.candidates)}

    def __call__(self, effects: Sequence[Effect] = (), change: Change | None = None) -> FloatArray:
        """Predict; see `Forward`.

        Raises
        ------
        ValueError
            A change of the `Setup` was asked for, or an effect that was not tabled.
        """
        if change is not None:
            raise ValueError("a surrogate knows effects only, no changes of the setup")
        total = self.base.copy()
        for effect in effects:
            total += self._change(effect)
        return total

    def fresh(self) -> Surrogate:
        """Return itself: it remembers nothing."""
        return self

    def _change(self, effect: Effect) -> FloatArray:
        for i, c in enumerate(self.candidates):
            if c.name != effect.name or any(effect.parameters[k] != v for k, v in c.fixed.items()):
                continue
            return self.tables[i].at(c.parameter.to_linear(effect.parameters[c.parameter.name]))
        raise ValueError(f"{effect!r} was not tabled")

    def save(self, path: Path) -> None:
        """Write the tables to a file that `load_tables` reads."""
        arrays: dict[str, Any] = {f"a{i}": t.amplitudes for i, t in enumerate(self.tables)}
        arrays |= {f"c{i}": t.changes for i, t in enumerate(self.tables)}
        temporary = path.with_name(f".{path.stem}.partial.npz")
        np.savez(temporary, base=self.base, labels=np.array([c.label for c in self.candidates]), **arrays)
        temporary.replace(path)


def load_tables(path: Path, elements: tuple[Element, ...], pool: Sequence[Candidate]) -> Surrogate | None:
    """Read a surrogate; None where the file is missing or belongs to another library or layout."""
    if not path.exists():
        return None
    with np.load(path, allow_pickle=False) as data:
        labels = [str(label) for label in data["labels"]]
        if labels != [c.label for c in pool] or len(data["base"]) != len(elements):
            return None
        tables = tuple(EffectTable(data[f"a{i}"], data[f"c{i}"]) for i in range(len(pool)))
        return Surrogate(elements, data["base"], tuple(pool), tables)


def tabulate(forward: Forward, base: FloatArray, candidate: Candidate, factor: FloatArray, reach: float) -> EffectTable:
    """Table one effect out to a whitened size.

    Parameters
    ----------
    forward : Forward
    base : (n,) ndarray
    candidate : Candidate
    factor : (n, n) ndarray
        Cholesky factor of the covariance.
    reach : float
        Whitened size at which the table ends, unless a bound or the model's own limits come first.
    """
    nodes: dict[float, FloatArray] = {0.0: np.zeros_like(base)}
    for sign in (-1.0, 1.0):
        end = _end(forward, base, candidate, factor, sign * reach)
        for share in SHARES if end else ():
            change = _change(forward, base, candidate, share * end)
            if change is None:
                break
            nodes[share * end] = change
    moved = sorted(nodes)
    return EffectTable(candidate.neutral + np.array(moved), np.array([nodes[m] for m in moved]))


def _end(forward: Forward, base: FloatArray, candidate: Candidate, factor: FloatArray, reach: float) -> float:
    """Signed distance from neutral at which the whitened size is about `reach`; 0 on a side with no room."""
    low, high = candidate.bounds
    sign = float(np.sign(reach))
    room = (high - candidate.neutral) if sign > 0 else (candidate.neutral - low)
    if room <= 1e-9 * candidate.step:
        return 0.0
    end = min(0.3 * candidate.step, room)
    for _ in range(5):
        change = _change(forward, base, candidate, sign * end)
        if change is None:
            end *= 0.4
            continue
        size = float(np.linalg.norm(np.linalg.solve(factor, change)))
        ratio = abs(reach) / max(size, 1e-9)
        new = min(end * min(ratio, 20.0), room)
        if 0.75 < ratio < 1.35 or new == end:
            break
        end = new
    return sign * end


def _change(forward: Forward, base: FloatArray, candidate: Candidate, moved: float) -> FloatArray | None:
    try:
        return forward.fresh()((candidate.effect(candidate.neutral + moved),)) - base
    except NoEquilibriumError:
        return None
