"""A turbulent film, as an option: Ng and Pan's linearised theory.

The flow through the film meets more resistance than a laminar one, along and across the motion, and the journal more
shear, all by the local Reynolds number Re = rho U h / mu:

    h^3 / (k_x mu) dp/dx,  k_x = 12 + 0.0136 Re^0.90
    h^3 / (k_z mu) dp/dz,  k_z = 12 + 0.0043 Re^0.96
    tau = C mu U / h,      C = 1 + 0.0012 Re^0.94

Below Re = 500 the film is laminar, above 1000 turbulent; between the two what the formulas add to 12 and 1 comes in
smoothly, place by place. In the perturbation the factors follow the film thickness, at frozen viscosity and density,
so that the slope of the static locus is the stiffness here too.

Across the film eddies add to the viscosity what the theory takes them to add, Reichardt's law by the nearer wall with
the wall's shear tau = C mu U / h, and mix heat as they mix momentum:

    mu_t / mu = 0.4 [y+ - 10.7 tanh(y+ / 10.7)],   y+ = y / mu sqrt(rho tau)

C. W. Ng, C. H. T. Pan, ASME J. Basic Eng. 87 (1965) 675; the fitted constants as V. N. Constantinescu, J. Galetuse,
ASME J. Lubr. Technol. 96 (1974) 109, and textbooks after them give them.
"""

import math

import numpy as np

from model.compilation import compiled, inner
from model.film.energy import dissipated
from model.film.faces import Faces
from model.film.mesh import FilmGrid, FilmWork
from rigdata.arrays import FloatArray

#: Factor and exponent of Re in k_x, k_z (beside 12) and C (beside 1).
ALONG, ACROSS, SHEAR = (0.0136, 0.90), (0.0043, 0.96), (0.0012, 0.94)
#: Local Reynolds numbers between which turbulence comes in.
_TRANSITION = (500.0, 1000.0)
#: Reichardt's constants as Ng and Pan have them, and how many points stand for a cell across the film.
_KARMAN, _SUBLAYER, _POINTS = 0.4, 10.7, 8


@compiled
def excess(reynolds: float, law: tuple[float, float]) -> tuple[float, float]:
    """What turbulence adds to a laminar coefficient, factor Re^exponent where it is whole, and d / d ln Re of it."""
    (factor, exponent), (laminar, turbulent) = law, _TRANSITION
    if not reynolds > laminar:
        return 0.0, 0.0
    share = min(1.0, (reynolds - laminar) / (turbulent - laminar))
    developed = factor * reynolds**exponent
    comes = share * share * (3.0 - 2.0 * share)
    rate = 6.0 * share * (1.0 - share) * reynolds / (turbulent - laminar)
    return developed * comes, developed * (exponent * comes + rate)


@inner
def still_shares(reynolds: float, cell: tuple[float, float], prandtl: float) -> tuple[float, float]:
    """Mean of mu / (mu + mu_t) over a cell between two heights, as shares of the film, and the same of conductivity."""
    developed = excess(reynolds, (1.0, 0.0))[0]
    if developed == 0.0:
        return 1.0, 1.0
    at_wall = math.sqrt(reynolds * (1.0 + excess(reynolds, SHEAR)[0]))
    sheared, warmed = 0.0, 0.0
    for k in range(_POINTS):
        height = cell[0] + (k + 0.5) / _POINTS * (cell[1] - cell[0])
        y = min(height, 1.0 - height) * at_wall
        eddy = developed * _KARMAN * (y - _SUBLAYER * math.tanh(y / _SUBLAYER))
        sheared += 1.0 / (1.0 + eddy) / _POINTS
        warmed += 1.0 / (1.0 + prandtl * eddy) / _POINTS
    return sheared, warmed


@inner
def resist(grid: FilmGrid, work: FilmWork, speed: float, faces: Faces) -> None:
    """Lower the conductances by 12 / k; they grow with the power 3 - dln k / dln Re of h."""
    light = (work.density / work.viscosity).reshape(-1)
    for side in range(2):
        step = grid.steps[side]
        for n in range(len(light) - step):
            reynolds = 0.5 * (light[n] + light[n + step]) * speed * faces.height[side, n]
            resistance, rate = excess(reynolds, ALONG if side == 0 else ACROSS)
            faces.conductance[side, n] *= 12.0 / (12.0 + resistance)
            faces.power[side, n] -= rate / (12.0 + resistance)


@inner
def heat_beyond(grid: FilmGrid, work: FilmWork, speed: float) -> None:
    """Heat beyond that of a laminar film in the same state, per station of length dx and control-volume height [W]."""
    heat = dissipated(grid, work, speed)
    for i in range(work.gained.shape[0]):
        for j in range(work.gained.shape[1]):
            reynolds = work.density[i, j] * speed * work.thickness[i, j] / work.viscosity[i, j]
            along, across = excess(reynolds, ALONG)[0], excess(reynolds, ACROSS)[0]
            less = along / (12.0 + along) * heat[1, i, j] + across / (12.0 + across) * heat[2, i, j]
            work.gained[i, j] = excess(reynolds, SHEAR)[0] * heat[0, i, j] - less


def shear_factor(work: FilmWork, speed: float) -> FloatArray:
    """C of the shear on the journal, (nt + 1, nz + 1)."""
    reynolds = work.density * speed * work.thickness / work.viscosity
    return np.asarray(1.0 + np.vectorize(lambda re: excess(re, SHEAR)[0])(reynolds))
