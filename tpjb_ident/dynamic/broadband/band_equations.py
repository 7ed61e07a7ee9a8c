"""Normal equations of a model over a band, line by line, free of the bias that noise on the displacements brings.

F = Theta phi with phi = D times powers of i omega, and Theta real. Averaging the lines' own h would weight those up
whose displacement noise came out large; so the model is fitted to the rows themselves, with an instrument zeta in place
of phi on one side: other periods of the same excitation, or what the command explains of the displacements.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from rigdata.arrays import ComplexArray, FloatArray
from tpjb_ident.dynamic.broadband.line_rows import LineRows
from tpjb_ident.dynamic.broadband.local_regression import ends_columns, remainder

#: What multiplies the displacements: (n, m) from the rows' angular frequencies (n,) in units of the band's middle.
Basis = Callable[[FloatArray], ComplexArray]


def k_c(w: FloatArray) -> ComplexArray:
    """Stiffness and damping; `w` (n,)."""
    return np.stack([np.ones_like(w), 1j * w], axis=1)


def k_c_m(w: FloatArray) -> ComplexArray:
    """Stiffness, damping and mass; `w` (n,)."""
    return np.stack([np.ones_like(w), 1j * w, -(w**2)], axis=1)


def complex_h(w: FloatArray) -> ComplexArray:
    """One complex h for all rows: its real and its imaginary part; `w` (n,)."""
    return np.stack([np.ones_like(w), 1j * np.ones_like(w)], axis=1)


@dataclass(frozen=True)
class RunSums:
    """One run at one line, summed over its rows.

    Q = 2 m columns of phi, the two displacements of each power together.
    """

    A: ComplexArray  #: (q, q) complex: sum of zeta* phi^T
    B: ComplexArray  #: (2, q) complex: sum of F zeta^H
    A0: ComplexArray  #: (q, 2) complex: sum of zeta* D^T: what a change of h does to B
    Z: ComplexArray  #: (q, q) complex: sum of zeta* zeta^T, in the weight that the noise of one row has
    residual: Callable[[FloatArray], ComplexArray]
    dof: float


def line_sums(rows: LineRows, middle: float, basis: Basis, instrument: str) -> list[RunSums]:
    """Sums of every run at one line."""
    phi = _phi(rows, rows.D, middle, basis)
    if instrument == "periods":
        return [_repeated(rows.F[rows.run == r], phi[rows.run == r], rows.D[rows.run == r]) for r in range(rows.n_runs)]
    flat = [_flat(rows, r) for r in range(rows.n_runs)]
    source = _explained(rows, flat) if instrument == "command" else rows.command
    assert source is not None
    zeta = _phi(rows, source, middle, basis)
    sums = []
    for r, q in enumerate(flat):
        selected = rows.run == r
        spare = len(q) - (np.linalg.matrix_rank(ends_columns(rows.one_run(r))) if rows.ends else 0)
        sums.append(
            _of_rows(q @ rows.F[selected], q @ phi[selected], q @ rows.D[selected], q @ zeta[selected], float(spare))
        )
    return sums


def _phi(rows: LineRows, source: ComplexArray, middle: float, basis: Basis) -> ComplexArray:
    powers = basis((rows.omega + rows.step * rows.place) / middle)
    return np.asarray((powers[:, :, None] * source[:, None, :]).reshape(len(source), -1))


def _flat(rows: LineRows, r: int) -> ComplexArray:
    """What takes off the ends of a run's record from its rows."""
    run_rows = rows.one_run(r)
    return remainder(ends_columns(run_rows)) if rows.ends else np.eye(len(run_rows.D), dtype=complex)


def _explained(rows: LineRows, flat: list[ComplexArray]) -> ComplexArray:
    """Displacements as the command explains them; each row by the rows of other parity, so not by its own noise."""
    assert rows.command is not None
    D = np.concatenate([q @ rows.D[rows.run == r] for r, q in enumerate(flat)])
    u = np.concatenate([q @ rows.command[rows.run == r] for r, q in enumerate(flat)])
    raw = np.concatenate([rows.command[rows.run == r] for r in range(rows.n_runs)])
    order = np.concatenate([np.flatnonzero(rows.run == r) for r in range(rows.n_runs)])
    parity = np.arange(len(D)) % 2
    out = np.empty_like(D)
    for half in (0, 1):
        gain = np.linalg.lstsq(u[parity != half], D[parity != half], rcond=None)[0]
        out[order[parity == half]] = raw[parity == half] @ gain
    return out


def _of_rows(F: ComplexArray, phi: ComplexArray, D: ComplexArray, zeta: ComplexArray, spare: float) -> RunSums:
    def residual(theta: FloatArray) -> ComplexArray:
        remaining = F - phi @ theta.T
        return np.einsum("ni,nk->ik", remaining, remaining.conj()) / max(spare, 1.0)

    return RunSums(
        np.einsum("na,nb->ab", zeta.conj(), phi),
        np.einsum("ni,na->ia", F, zeta.conj()),
        np.einsum("na,nj->aj", zeta.conj(), D),
        np.einsum("na,nb->ab", zeta.conj(), zeta),
        residual,
        spare,
    )


def _repeated(F: ComplexArray, phi: ComplexArray, D: ComplexArray) -> RunSums:
    """Products of different periods only: their noise has nothing in common."""
    n = len(F)
    pairs = n * (n - 1)

    def crossed(left: ComplexArray, right: ComplexArray) -> ComplexArray:
        every = np.outer(left.sum(axis=0), right.sum(axis=0))
        return np.asarray((every - np.einsum("na,nb->ab", left, right)) / pairs)

    mean_phi, centred_phi, centred_F = phi.mean(axis=0), phi - phi.mean(axis=0), F - F.mean(axis=0)

    def residual(theta: FloatArray) -> ComplexArray:
        left = centred_F - centred_phi @ theta.T
        return np.einsum("ni,nk->ik", left, left.conj()) / (n - 1)

    return RunSums(
        crossed(phi.conj(), phi),
        crossed(F, phi.conj()),
        crossed(phi.conj(), D),
        np.asarray(np.outer(mean_phi.conj(), mean_phi) / n, dtype=complex),
        residual,
        float(n - 1),
    )
