"""A campaign and its mirror image, whose shaft turns clockwise: the same answers, in each rig's own frame."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

import rigdata
import tpjb_ident as ti
from tests.recovery.mirrored_campaign import mirror_campaign

pytestmark = pytest.mark.slow
MIRROR = np.diag([-1.0, 1.0])


DEMO = Path(rigdata.__file__).parent / "samples" / "demo.h5"


def with_mirror_image(campaign, folder):
    return ti.load_campaign(campaign), ti.load_campaign(mirror_campaign(campaign, folder / "mirrored.h5"))


def angles(campaign):
    return [pad.pivot_angle for pad in ti.load_bearing(campaign.bearing_text).pads]


def test_coefficients_are_the_mirror_image(small_campaign, tmp_path):
    right, left = (ti.identify(campaign) for campaign in with_mirror_image(small_campaign, tmp_path))
    for p, q in zip(right.points, left.points, strict=True):
        assert (p.point.rotation, q.point.rotation) == ("counter-clockwise", "clockwise")
        size = np.abs(p.stiffness.h).max()
        np.testing.assert_allclose(MIRROR @ q.stiffness.h @ MIRROR, p.stiffness.h, atol=1e-9 * size, rtol=0)
        np.testing.assert_allclose(q.stiffness.half_width(), p.stiffness.half_width(), rtol=1e-9)
        assert p.quality == q.quality
    assert set(left.to_frame()["rotation"]) == {"clockwise"}


def test_pivots_clearance_and_locus_are_the_mirror_image(tmp_path):
    campaigns = with_mirror_image(DEMO, tmp_path)
    right, left = (ti.fit_pivots(campaign, angles(campaign)) for campaign in campaigns)
    load = np.linspace(600.0, 4000.0, 9)
    for p, q in zip(right, reversed(left), strict=True):
        np.testing.assert_allclose(q.deflection(load), p.deflection(load), rtol=1e-9)
    sweep = [ti.measure_clearance(c, angles(c)) for c in campaigns]
    np.testing.assert_allclose(sweep[1].clearance[::-1], sweep[0].clearance, rtol=1e-9)
    loci = [ti.measure_locus(c, s) for c, s in zip(campaigns, sweep, strict=True)]
    places = [
        {round(math.degrees(p.point.static_load_direction)) % 360: p.position for p in locus.points} for locus in loci
    ]
    assert {(180 - angle) % 360 for angle in places[1]} == set(places[0])
    for angle, place in places[1].items():
        np.testing.assert_allclose(MIRROR @ place, places[0][(180 - angle) % 360], atol=1e-14)
