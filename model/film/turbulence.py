"""A turbulent film, as an option: Ng and Pan's linearised theory.

The flow through the film meets more resistance than a laminar one, along and across the motion, and the journal more
shear, all by the local Reynolds number Re = rho U h / mu:

    h^3 / (k_x mu) dp/dx,  k_x = 12 + 0.0136 Re^0.90
    h^3 / (k_z mu) dp/dz,  k_z = 12 + 0.0043 Re^0.96
    tau = C mu U / h,      C = 1 + 0.0012 Re^0.94

Below Re = 500 the film is laminar, above 1000 turbulent; between the two what the formulas add to 12 and 1 comes in
smoothly, place by place. In the perturbation the factors follow the film thickness, at frozen viscosity and density,
so that the slope of the static locus is the stiffness here too.

C. W. Ng, C. H. T. Pan, ASME J. Basic Eng. 87 (1965) 675; the fitted constants as V. N. Constantinescu, J. Galetuse,
ASME J. Lubr. Technol. 96 (1974) 109, and textbooks after them give them.
"""

from __future__ import annotations

import numpy as np

from model.compilation import compiled, inner
from model.film.energy import squared_slopes
from model.film.matrix import add_diagonal, assemble, factorise
from model.film.mesh import FilmGrid, FilmWork
from model.film.reynolds import FilmForces, _active_set, _integrate, _source, _thickness, conductances
from model.film.slopes import derivatives, rupture_line
from rigdata.arrays import FloatArray

#: Factor and exponent of Re in k_x, k_z (beside 12) and C (beside 1).
ALONG, ACROSS, SHEAR = (0.0136, 0.90), (0.0043, 0.96), (0.0012, 0.94)
#: Local Reynolds numbers between which turbulence comes in.
_TRANSITION = (500.0, 1000.0)


@compiled
def excess(reynolds: float, factor: float, exponent: float) -> tuple[float, float]:
    """What turbulence adds to a laminar coefficient, factor Re^exponent where it is whole, and d / d ln Re of it."""
    if not reynolds > _TRANSITION[0]:
        return 0.0, 0.0
    share = min(1.0, (reynolds - _TRANSITION[0]) / (_TRANSITION[1] - _TRANSITION[0]))
    developed = factor * reynolds**exponent
    comes = share * share * (3.0 - 2.0 * share)
    rate = 6.0 * share * (1.0 - share) * reynolds / (_TRANSITION[1] - _TRANSITION[0])
    return developed * comes, developed * (exponent * comes + rate)


@compiled
def solve_turbulent_film(
    grid: FilmGrid, work: FilmWork, wedge: tuple[float, float, float], speed: float, sharp: bool
) -> FilmForces:
    """Pressure of one film and its derivatives; as `model.film.reynolds.solve_film`.

    `work.gained` is set to the heat that is made beyond that of a laminar film in the same state [W].
    """
    clearance, a, b = wedge
    min_film = _thickness(grid, work, clearance, a, b)
    if not min_film > 0.0:
        return FilmForces(np.zeros(2), np.zeros((2, 2)), np.zeros((2, 2)), min_film, -1)
    gx, gz = conductances(grid, work, clearance, a, b)
    powers = _resist(grid, work, wedge, speed, (gx, gz))
    source = _source(grid, work, clearance, a, b, speed)
    steps = _active_set(grid, work, gx, gz, source)
    weight = grid.area
    if steps > 0:
        if sharp:
            diagonal, weight = rupture_line(grid, work, gx, gz, source)
            assemble(work.band, gx, gz, work.ruptured, grid.first)
            add_diagonal(work.band, diagonal, grid.first)
            factorise(work.band)
        derivatives(grid, work, wedge, (gx, gz), powers)
        _heat_beyond(grid, work, speed)
    force, stiffness, damping = _integrate(grid, work, weight)
    return FilmForces(force, stiffness, damping, min_film, steps)


@inner
def _resist(
    grid: FilmGrid,
    work: FilmWork,
    wedge: tuple[float, float, float],
    speed: float,
    conductance: tuple[FloatArray, FloatArray],
) -> tuple[FloatArray, FloatArray]:
    """Lower the conductances by 12 / k; returns with which power of h they grow, 3 - dln k / dln Re."""
    gx, gz = conductance
    px, pz = np.empty(gx.shape), np.empty(gz.shape)
    h = work.thickness
    for i in range(gx.shape[0]):
        base = wedge[0] - wedge[1] * grid.cos_face[i] - wedge[2] * grid.sin_face[i]
        for j in range(gx.shape[1]):
            thick = base + 0.5 * (work.extra[i, j] + work.extra[i + 1, j])
            light = 0.5 * (
                work.density[i, j] / work.viscosity[i, j] + work.density[i + 1, j] / work.viscosity[i + 1, j]
            )
            more, rate = excess(light * speed * thick, ALONG[0], ALONG[1])
            gx[i, j] *= 12.0 / (12.0 + more)
            px[i, j] = 3.0 - rate / (12.0 + more)
    for i in range(gz.shape[0]):
        for j in range(gz.shape[1]):
            thick = 0.5 * (h[i, j] + h[i, j + 1])
            light = 0.5 * (
                work.density[i, j] / work.viscosity[i, j] + work.density[i, j + 1] / work.viscosity[i, j + 1]
            )
            more, rate = excess(light * speed * thick, ACROSS[0], ACROSS[1])
            gz[i, j] *= 12.0 / (12.0 + more)
            pz[i, j] = 3.0 - rate / (12.0 + more)
    return px, pz


@inner
def _heat_beyond(grid: FilmGrid, work: FilmWork, speed: float) -> None:
    """Heat beyond that of a laminar film per station of length dx and control-volume height [W]."""
    h, mu = work.thickness, work.viscosity
    for i in range(h.shape[0]):
        for j in range(h.shape[1]):
            reynolds = work.density[i, j] * speed * h[i, j] / mu[i, j]
            along, across = excess(reynolds, ALONG[0], ALONG[1])[0], excess(reynolds, ACROSS[0], ACROSS[1])[0]
            downstream, sideways = squared_slopes(grid, work.pressure, i, j)
            shear = mu[i, j] * speed**2 / h[i, j] * excess(reynolds, SHEAR[0], SHEAR[1])[0]
            less = along / (12.0 + along) * downstream + across / (12.0 + across) * sideways
            pressed = -(h[i, j] ** 3) / (12.0 * mu[i, j]) * less
            work.gained[i, j] = (shear + pressed) * grid.dx * grid.height[j]


def shear_factor(work: FilmWork, speed: float) -> FloatArray:
    """C of the shear on the journal, (nt + 1, nz + 1)."""
    reynolds = work.density * speed * work.thickness / work.viscosity
    return np.asarray(1.0 + np.vectorize(lambda re: excess(re, *SHEAR)[0])(reynolds))
