"""Dynamic coefficients: Eq. (9)-(12) against a dense solution of the whole system, what each pad entry does, and at
rest the slope of the static locus."""

import math

import numpy as np
import pytest

from model.bearing import Bearing
from model.dynamics import mass_centre_offset
from model.effects import Effect
from model.options import Options
from model.prediction import Prediction
from tests.model.points import DOWN, LOAD, SPEED, close, run, slopes
from tests.rigs.bearings import changed_oil, changed_pads


def dense(p: Prediction, omega: float) -> np.ndarray:
    """Housing force per journal displacement from the equations of motion of every pad, one system for all.

    Unknowns (tilt, outward deflection) per pad. Film forces follow from (a, b); Newton per pad: film moment and force
    against inertia, k_theta, c_eta, and the pivot.
    """
    setup, films = p.setup, [f for f in p.equilibrium.films if f.forces is not None]
    n = len(films)
    a = np.zeros((2 + 2 * n, 2 + 2 * n), complex)
    for m, film in enumerate(films):
        z = film.forces.stiffness + 1j * omega * film.forces.damping
        pad, arm = film.pad, setup.bearing.pivot_radius(film.pad)
        # columns: x, y, tilt, eta -> a, b, by the film thickness formula of docs/theory.md
        chain = np.array([[*film.normal, 0.0, -1.0], [*film.tangent, arm, 0.0]])
        force = z @ chain  # radial (outward on the pad) and tangential film force per unknown
        columns = [0, 1, 2 + 2 * m, 3 + 2 * m]
        a[0:2, columns] += np.column_stack([film.normal, film.tangent]) @ force
        # the mass centre lies b ahead of the pivot and moves outward by eta - b tilt
        b = mass_centre_offset(setup, film)
        radial = np.array([0.0, 0.0, -b, 1.0]) * pad.mass * -(omega**2)
        law = setup.pivots[film.number - 1]
        pivot = law.vibration_stiffness(float(film.forces.force[0])) + 1j * omega * setup.pivot_damping
        a[3 + 2 * m, columns] = -force[0] + radial + np.array([0.0, 0.0, 0.0, pivot])
        inertia = np.array([0.0, 0.0, -(omega**2) * pad.moment_of_inertia + setup.rotational_stiffness, 0.0])
        inertia[3] = -(omega**2) * pad.mass * -b
        a[2 + 2 * m, columns] = arm * force[1] + inertia
    inner = np.linalg.solve(a[2:, 2:], a[2:, :2])
    return a[:2, :2] - a[:2, 2:] @ inner


@pytest.mark.parametrize("hz", [5.0, 25.0, 120.0])
@pytest.mark.parametrize("offset", [0.5, 0.6])
def test_reduction_is_the_dense_solution(rocker, hz, offset):
    heavy = changed_pads(rocker, pivot_offset=offset, mass=5.0, moment_of_inertia=2e-2)
    effects = [Effect("pivot_damping", damping=4e5), Effect("pivot_rotation", rotational_stiffness=3e4)]
    p = run(heavy, *effects, direction=-1.2, excitation=2 * math.pi * hz)
    close(p.h, dense(p, 2 * math.pi * hz), 1e-9)


def test_coupling_of_an_offset_mass_lowers_what_moves_together(rocker):
    # kinetic energy 1/2 m (eta' - b t')^2 + 1/2 (I - m b^2) t'^2 with tilt and b counter-clockwise, eta outward
    p = run(changed_pads(rocker, pivot_offset=0.6))
    film = p.equilibrium.films[0]
    b = mass_centre_offset(p.setup, film)
    assert b < 0.0  # the pivot stands behind the middle, so that the centre is upstream (clockwise)
    mass = p.pad_matrices[0].pad_mass
    for tilt, eta in ((1.0, 0.3), (-2.0, 1.0)):
        energy = film.pad.mass * (eta - b * tilt) ** 2 + (film.pad.moment_of_inertia - film.pad.mass * b**2) * tilt**2
        assert np.array([tilt, eta]) @ mass @ np.array([tilt, eta]) == pytest.approx(energy, rel=1e-12)
    central = run(rocker)
    assert mass_centre_offset(central.setup, central.equilibrium.films[0]) == 0.0


def test_one_static_solution_serves_all_frequencies_and_one_is_synchronous(rocker):
    excitation = np.array([2 * math.pi * 10.0, SPEED, 2 * math.pi * 50.0])
    p = run(rocker, excitation=excitation)
    assert p.h.shape == (3, 2, 2)
    for h, omega in zip(p.h, excitation.tolist(), strict=True):
        close(h, run(rocker, excitation=omega).h, 1e-12)
    synchronous = run(rocker)
    assert synchronous.excitation == SPEED
    close(synchronous.h, p.h[1], 1e-12)
    assert synchronous.cyy == pytest.approx(synchronous.h[1, 1].imag / SPEED)


@pytest.mark.slow
@pytest.mark.parametrize(
    ("point", "limit"),
    [
        # 5 kHz: a hundred times faster than oil passes a pad
        ({"excitation": np.array([2 * math.pi * 5e3]), "pivots": "rigid"}, 2e-3),
        ({"thermal": "isothermal"}, 0.0),
    ],
    ids=["far above the oil's passage", "isothermal"],
)
def test_perturbed_heat_changes_nothing_where_heat_cannot_follow(rocker, point, limit):
    frozen, moved = (run(rocker, options=Options(perturbed_heat=on), **point).h for on in (False, True))
    close(moved, frozen, limit)


ISOTHERMAL = {"thermal": "isothermal"}
FAST, HALF_FED = {"speed": 2 * math.pi * 150.0, "load": 2000.0}, {"speed": 2 * math.pi * 60.0, "mesh": (40, 4)}
LEANING = [Effect("misalignment", angle=6e-4, direction=0.4)]
HELD = [*LEANING, Effect("pivot_rotation", rotational_stiffness=2e4)]
BENDING = [Effect("pad_bending", compliance_factor=1.0)]
TILTED = {"effects": [Effect("misalignment", angle=6e-4, direction=DOWN), *BENDING]}
HEATED = {"thermal": "adiabatic", "pivots": "rigid", "options": Options(perturbed_heat=True)}
PLAIN = {"options": Options()}
#: Bearing, point, how close, and what the point is without: then the slope is off by more than this share.
CASES = {
    "rigid pivots": ("rocker", {"pivots": "rigid"}, 2e-3, None),
    "Kirk's pivots": ("rocker", {}, 2e-3, None),
    "pivots that roll": ("rocker", {"effects": [Effect("pivot_rolling", factor=2.0)]}, 5e-3, None),
    "turbulence": ("thin", FAST | {"options": Options(turbulence="ng-pan")}, 5e-3, None),
    "mass conserved": ("spherical", {"load": 8750.0, "options": Options(cavitation="jfo")}, 2e-3, None),
    "short of oil": ("fed", HALF_FED | {"options": Options(cavitation="jfo")}, 0.03, None),
    "axial tilt": ("spherical", {"effects": LEANING, "options": Options(axial_tilt=True)}, 1e-3, (PLAIN, 5e-3)),
    "axial tilt, held": ("spherical", {"effects": HELD, "options": Options(axial_tilt=True)}, 1e-3, (PLAIN, 5e-3)),
    "axial tilt, bending": (
        "spherical",
        TILTED | {"options": Options(axial_tilt=True, perturbed_bending=True)},
        2e-3,
        None,
    ),
    "bending": ("rocker", {"effects": BENDING, "options": Options(perturbed_bending=True)}, 2e-4, (PLAIN, 0.01)),
    "heat": ("rocker", HEATED, 2e-4, (PLAIN, 0.02)),
    "heat, heavy load": ("rocker", HEATED | {"load": 8750.0}, 3e-3, (PLAIN, 0.02)),
}


@pytest.fixture
def bearings(rocker, spherical) -> dict[str, Bearing]:
    thin = changed_oil(rocker, viscosity_40=0.02 * rocker.oil.viscosity_40)
    fed = changed_oil(rocker, supply_flow=18.0 / 60e3)
    return {"rocker": rocker, "spherical": spherical, "thin": thin, "fed": fed}


@pytest.mark.slow
@pytest.mark.parametrize("name", CASES)
def test_at_rest_the_stiffness_is_the_slope_of_the_static_locus(bearings, name):
    which, point, limit, other = CASES[name]
    bearing, point = bearings[which], ISOTHERMAL | point
    load = point.pop("load", LOAD)

    def position(push: np.ndarray) -> np.ndarray:
        place = {"load": float(np.hypot(*push)), "direction": math.atan2(push[1], push[0])}
        return run(bearing, **point, **place).bearing_position

    compliance = slopes(position, np.array([0.0, -load]), 0.004 * load)
    k = run(bearing, load=load, excitation=1e-3, **point).k
    np.testing.assert_allclose(k @ compliance, np.eye(2), atol=limit)
    if other is not None:
        without = run(bearing, load=load, excitation=1e-3, **point | other[0]).k
        assert np.abs(without @ compliance - np.eye(2)).max() > other[1]
