"""Where the film's heat goes besides downstream: into the pads, through the journal, on to the next pad.

The baseline is adiabatic, as the paper's model. Three options couple the films' temperatures:

- `conduction`: a pad's face has its film's temperature; what the pad conducts to its back and edges, the film loses.
- `isothermal_journal`: a turning journal has one temperature; it takes up heat where the film is hotter and gives it
  back where it is colder, and keeps none. A film with a parabolic temperature profile over its thickness, flat at the
  pad, passes q = 3 k / h (T_mean - T_journal).
- `carryover`: of the oil that leaves a pad, a share lambda enters the next one as far as that takes it in; the groove
  makes up the rest: T_in = T_supply + s (T_out before - T_supply), s = min(1, lambda Q_out before / Q_in).

For given flows all of them are linear: every film's temperature is that of fresh oil at zero, plus its answer to its
inlet, plus its answer to the journal. So the inlets and the journal follow from one small system, however much of the
heat goes round. What a pad conducts depends on all of its film; that is solved by a few Krylov steps.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from model.film.energy import dissipation, march
from model.film.oil_state import Running
from model.pad.bending import PadDeformation
from model.setup import Setup
from model.statics.compiled.constants import BOUNDLESS
from model.statics.pad_film import PadFilm, oil_constants
from model.statics.pad_flow import flow_weighted, outlet_temperature, through_flow
from rigdata.arrays import FloatArray

#: q h / k (T_mean - T_wall) of a parabolic profile, flat at the other wall.
_NUSSELT = 3.0
#: Conduction is solved to this share in every step of the equilibrium; what is left contracts with the rest.
_CONDUCTION_TOLERANCE = 0.01
_KRYLOV_STEPS = 12
#: Share of the oil in the grooves that is fresh after a turn, at least.
_LEAST_FRESH = 1e-3


def couples_heat(setup: Setup) -> bool:
    """Whether the films' temperatures depend on more than their own inlets."""
    return setup.thermal != "isothermal" and bool(
        setup.thermal == "thd" or setup.mixing or setup.options.conduction or setup.options.isothermal_journal
    )


def settle_temperatures(
    setup: Setup, films: list[PadFilm], surface_speed: float, journal: float, limits: tuple[float, float]
) -> tuple[float, float, float]:
    """Temperatures of all films for their present flows; writes them, and the inlets."""
    order = sorted(films, key=lambda f: f.pad.pivot_angle % (2 * math.pi))
    heat = _FilmHeat(setup, surface_speed, journal if math.isfinite(journal) else setup.inlet_temperature)
    parts = [heat.answers(film) for film in order]
    answers = [None if p is None else _film_answer(setup, f, p) for f, p in zip(order, parts, strict=True)]
    inlets, journal = balance_heat(setup, order, answers)
    change = 0.0
    for film, part, inlet in zip(order, parts, inlets.tolist(), strict=True):
        film.inlet = inlet
        film.temperature_change = 0.0
        if part is None:
            continue
        fresh, by_inlet, by_journal = part
        asked = fresh + inlet * by_inlet + journal * by_journal - film.work.temperature
        film.temperature_change = float(np.abs(asked).max())
        film.work.temperature[:] += limits[0] * min(1.0, limits[1] / max(film.temperature_change, 1e-30)) * asked
        change = float(np.maximum(change, film.temperature_change))  # a NaN is not to be lost
    return change, heat.limited, journal if setup.options.isothermal_journal else math.nan


@dataclass
class _FilmHeat:
    """The energy equation of one film after the other, with its pad and journal."""

    setup: Setup
    surface_speed: float
    journal: float
    limited: float = 0.0

    def answers(self, film: PadFilm) -> FloatArray | None:
        """Temperature of a film with all else at zero, per kelvin of its inlet, and per kelvin of the journal.

        Shape (3, nt + 1, nz + 1); None if the film carries nothing.
        """
        if film.forces is None:
            return None
        work = film.work
        work.exchange[:] = _journal_exchange(self.setup, film)
        fields = np.zeros((3, *work.temperature.shape))
        sources = np.zeros_like(fields)
        fields[1, 0] = 1.0
        sources[0] = film.kept * (dissipation(film.grid, work, self.surface_speed) + work.gained)
        sources[2] = work.exchange
        pad = film.deformation
        if not self.setup.options.conduction or pad is None:
            self._march(film, fields, sources)
            return fields
        if not np.abs(work.temperature).max() < BOUNDLESS:
            return np.full_like(fields, math.nan)
        # what the pad takes at the present temperature is known; its answer to the change is solved for
        station = film.grid.dx * film.grid.height[None, :]
        present, supply = work.temperature, self.setup.inlet_temperature
        sources[0] -= (pad.flux @ (pad.to_coarse @ (present - supply).ravel())).reshape(present.shape) * station
        self._march(film, fields, sources)
        if not np.abs(fields).max() < BOUNDLESS:
            return fields
        # as a correction, which vanishes at the equilibrium, and with it what the Krylov steps leave unsolved
        missing = fields[0] + film.inlet * fields[1] + self.journal * fields[2] - present
        for m in (1, 2):
            fields[m] = self._with_pad(film, fields[m], pad, station)
        correction = self._with_pad(film, missing, pad, station)
        fields[0] = present + correction - film.inlet * fields[1] - self.journal * fields[2]
        return fields

    def _with_pad(self, film: PadFilm, alone: FloatArray, pad: PadDeformation, station: FloatArray) -> FloatArray:
        """Temperature with the heat that the pad takes from it, given the one without: (I + A^-1 F) T = T_alone."""
        if not alone.any():
            return alone
        shape = alone.shape

        def coupled(t: FloatArray) -> FloatArray:
            fields = np.zeros((1, *shape))
            taken = (pad.flux @ (pad.to_coarse @ t)).reshape(shape) * station
            self._march(film, fields, -taken[None])
            return np.asarray(t - fields[0].ravel())

        return np.asarray(minimal_residual(coupled, alone.ravel(), _CONDUCTION_TOLERANCE)).reshape(shape)

    def _march(self, film: PadFilm, fields: FloatArray, sources: FloatArray) -> None:
        oil = self.setup.bearing.oil
        running = Running(self.surface_speed, oil_constants(oil), (oil.specific_heat, oil.conductivity))
        limited = march(film.grid, film.work, running, film.work.exchange, fields, sources)
        self.limited = max(self.limited, limited)


def minimal_residual(apply: Callable[[FloatArray], FloatArray], right: FloatArray, tolerance: float) -> FloatArray:
    """Solve apply(x) = right by GMRES, in at most `_KRYLOV_STEPS` steps, to a share `tolerance` of the right-hand side.

    NaN where `apply` grows beyond `BOUNDLESS`.
    """
    size = float(np.linalg.norm(right))
    basis, images = [right / size], []
    for _ in range(_KRYLOV_STEPS):
        image = apply(basis[-1])
        if not np.abs(image).max() < BOUNDLESS:
            return np.full_like(right, math.nan)
        images.append(image)
        columns = np.array(images)
        gram = columns @ columns.T
        gram[np.diag_indices_from(gram)] *= 1.0 + 1e-13  # images that hardly differ are of no use to each other
        weights = np.linalg.solve(gram, columns @ right)
        if np.linalg.norm(weights @ columns - right) < tolerance * size:
            break
        new = image.copy()
        for old in basis:
            new -= (old @ new) * old
        length = float(np.linalg.norm(new))
        if not length > 1e-12 * size:
            break
        basis.append(new / length)
    return np.asarray(np.column_stack(basis[: len(images)]) @ weights)


def _journal_exchange(setup: Setup, film: PadFilm) -> FloatArray:
    """What a kelvin of film temperature over the journal's passes into it, per station [W/K]."""
    if not setup.options.isothermal_journal:
        return np.zeros_like(film.work.thickness)
    station = film.grid.dx * film.grid.height[None, :]
    return np.asarray(_NUSSELT * setup.bearing.oil.conductivity / film.work.thickness * station)


class FilmAnswer(NamedTuple):
    """What a film passes on: with all else at zero, per kelvin of its inlet, per kelvin of the journal."""

    outlet: Sequence[float] | FloatArray
    taken: Sequence[float] | FloatArray


def _film_answer(setup: Setup, film: PadFilm, part: FloatArray) -> FilmAnswer:
    """What a film of one temperature across passes on."""
    if not setup.options.isothermal_journal:
        return FilmAnswer(flow_weighted(film, part), (0.0, 0.0, 0.0))
    weight = film.work.exchange.copy()  # all of it is the journal's, see `FilmHeat.answers`
    weight[[0, -1]] *= 0.5
    taken = np.tensordot(part, weight, 2)
    return FilmAnswer(flow_weighted(film, part), (taken[0], taken[1], taken[2] - weight.sum()))


def balance_heat(setup: Setup, order: list[PadFilm], parts: Sequence[FilmAnswer | None]) -> tuple[FloatArray, float]:
    """Inlet temperature of every pad, and the journal's that keeps no heat: gives inlets (n,) [degC]."""
    n, supply = len(order), setup.inlet_temperature
    shares = _mixing_shares(order, setup.mixing)
    matrix, right = np.eye(n + 1), np.full(n + 1, supply)
    kept = np.zeros(3)  # what the journal takes up: by fresh oil, by its own temperature
    by_inlet = np.zeros(n)
    for k, (film, part) in enumerate(zip(order, parts, strict=True)):
        rest = outlet_temperature(film) - film.inlet if part is None else 0.0
        outlet: Sequence[float] | FloatArray = [rest, 1.0, 0.0]  # an idle pad passes its inlet on, somewhat warmer
        if part is not None:
            outlet = part.outlet
            kept += np.array([part.taken[0], 0.0, part.taken[2]])
            by_inlet[k] = part.taken[1]
        after = (k + 1) % n
        share = shares[after]
        right[after] = supply * (1.0 - share) + share * outlet[0]
        matrix[after, k] -= share * outlet[1]
        matrix[after, n] -= share * outlet[2]
    if kept[2] != 0.0:
        scale = -kept[2]
        matrix[n, :n], matrix[n, n], right[n] = -by_inlet / scale, 1.0, kept[0] / scale
    answer = np.linalg.solve(matrix, right)
    return answer[:n], float(answer[n])


def _mixing_shares(order: list[PadFilm], fraction: float) -> list[float]:
    """Share s of what a pad drinks that comes from the pad before it, for the pads in the order of rotation."""
    if fraction == 0.0:
        return [0.0] * len(order)
    flows = [through_flow(film) for film in order]
    shares = []
    for k, (entering, _) in enumerate(flows):
        hot = fraction * flows[k - 1][1]
        shares.append(1.0 if not hot < entering else max(0.0, hot / entering))
    # where nothing leaks (all pads idle, on the way) heat would go round for ever
    most = (1.0 - _LEAST_FRESH) ** (1.0 / len(shares))
    return [min(s, most) for s in shares] if math.prod(shares) > 1.0 - _LEAST_FRESH else shares
