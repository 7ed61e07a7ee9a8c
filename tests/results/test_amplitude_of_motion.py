"""A film that was shaken too hard: what its second harmonic says of one amplitude, what several amplitudes mend."""

from dataclasses import replace

import numpy as np
import pytest

from rigdata import load_campaign
from tests.phasors.phasor_cases import FILM_H as H
from tests.results.test_figures import stiff
from tests.rigs.acquisition import EXACT, Acquisition
from tests.rigs.closed_form import USUAL, Rig, write_rig
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.results.linearity import MAX_AMPLITUDE, NEVER_LINEAR, FilmChange, change_conditions


@pytest.mark.parametrize(
    ("change", "size", "named"),
    [
        (FilmChange(0.0, hidden=1e-4), 0.29, ()),
        (FilmChange(0.0, hidden=0.02), 0.29, ("large-amplitude",)),
        (FilmChange(0.0, hidden=0.02), MAX_AMPLITUDE, ()),
        (FilmChange(0.02, hidden=1e-4), 0.08, ()),
        (FilmChange(0.06, hidden=1e-4), 0.08, ("film-not-linear",)),
        (FilmChange(0.0, hidden=1e-4), NEVER_LINEAR * 1.01, ("large-amplitude",)),
    ],
)
def test_a_large_motion_is_flagged_only_where_the_harmonics_do_not_show_a_linear_film(change, size, named):
    est = stiff(H, 0.003 * np.abs(H[0, 0]))
    assert change_conditions(change, {}, est, size * 80e-6, 80e-6) == named
    assert change_conditions(FilmChange(), {}, est, 1.0, None) == ()


@pytest.mark.slow
def test_three_amplitudes_are_right_where_one_is_refused(tmp_path):
    film = replace(USUAL, square=3.0, cube=5.0)
    rig = Rig(film=film, frequencies=(25.0,), amplitude=0.12, seconds=2.0)
    for sizes, refused in (((1.0,), True), ((0.3, 0.6, 1.0), False)):
        path = write_rig(tmp_path, replace(rig, sizes=sizes), setup=Acquisition(rate=1000.0, uncertainty=EXACT))
        (point,) = identify(load_campaign(path), IdentifySettings(clearance=80e-6)).points
        assert ("film-not-linear" in point.quality) is refused
        if not refused:
            truth = film.h(25.0, 5000.0)
            off = point.stiffness.vector - np.concatenate([truth.real.ravel(), truth.imag.ravel()])
            assert (np.abs(off) < 1.5 * point.stiffness.half_width()).all()
            assert "amplitude" in point.budget
