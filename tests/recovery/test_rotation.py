"""A campaign and its mirror image, whose shaft turns clockwise: the same answers, in each rig's own frame.

And campaigns that turn both ways, with pivots off the middle: the leading edge is where each run's shaft comes from.
"""

import re
import shutil
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np
import pandas as pd
import pytest

import rigdata
import tpjb_ident as ti
from model.bearing import BearingError
from model.bearing_file import parse_bearing
from model.effects import Effect, known_effects
from rigdata.operating_point import ROTATIONS
from rigdata.virtual_rig import ClearanceSweep, Instruments, RigPlan, VirtualRig, locus_points, operating_points
from tests.command_line import tpjb
from tests.good_campaigns import BEARINGS, directions
from tpjb_ident.compare.predictions import ModelSettings
from tpjb_ident.compare.rig_from_model import rig_truth
from tpjb_ident.diagnosis.comparison.settings import DiagnoseSettings
from tpjb_ident.schema import COEFFICIENT_COLUMNS

pytestmark = pytest.mark.slow
MIRROR = np.diag([-1.0, 1.0])
DEMO = Path(rigdata.__file__).parent / "samples" / "demo.h5"
#: A campaign is mirrored along the y axis as a person would do it, texts and numbers, with nothing of the toolkit:
#: cells and accelerometers along x keep their axis, and their readings change sign; the others turn.
_ANGLES = re.compile(r'^(axis|static_load_direction|excitation_direction) = "([-+.\d]+) deg"', re.MULTILINE)
_SENSE = re.compile(r'^rotation = "(.*)"', re.MULTILINE)
_CHANNEL = re.compile(r"^\[channels\.(\w+)\]$", re.MULTILINE)


def _turned(degrees: str) -> str:
    return f"{(360.0 - float(degrees)) % 360.0 - 180.0:.12g}"


def _turning_back(text: str) -> str:
    return _SENSE.sub(lambda found: f'rotation = "{"counter-" if found[1] == "clockwise" else ""}clockwise"', text)


def mirrored_manifest(text: str, pads: int) -> tuple[str, set[str]]:
    """The manifest, and the channels whose readings change sign."""
    negated = set()
    blocks = re.split(r"^(?=\[)", text, flags=re.MULTILINE)
    for i, block in enumerate(blocks):
        channel = _CHANNEL.match(block)
        if channel and 'axis = "0 deg"' in block:
            negated.add(channel[1])
        else:
            block = _ANGLES.sub(lambda found: f'{found[1]} = "{_turned(found[2])} deg"', block)
        blocks[i] = re.sub(
            r"^pad = (\d+)", lambda found: f"pad = {pads + 1 - int(found[1])}", block, flags=re.MULTILINE
        )
    text = _turning_back("".join(blocks))
    if "[shaft]" not in text:
        text = text.replace("[", '[shaft]\nrotation = "clockwise"\n\n[', 1)
    return text, negated


def mirrored_bearing(text: str) -> tuple[str, int]:
    """The bearing file, and its number of pads: angles in the mirror, lists in reverse order."""
    pads = 0

    def turn(found: re.Match[str]) -> str:
        nonlocal pads
        entries = [entry.strip() for entry in found[2].split(",")][::-1]
        if found[1] == "pivot_angles":
            pads = len(entries)
            entries = [f'"{_turned(entry.strip(chr(34)).removesuffix(" deg"))} deg"' for entry in entries]
        return f"{found[1]} = [{', '.join(entries)}]"

    return _turning_back(re.sub(r"^(\w+) = \[(.*?)\]", turn, text, flags=re.MULTILINE)), pads


def mirror_campaign(source: Path, target: Path) -> Path:
    """Write the mirror image of a campaign, one HDF5 file."""
    shutil.copy(source, target)
    with h5py.File(target, "r+") as file:
        bearing, pads = mirrored_bearing(str(file.attrs["bearing"]))
        manifest, negated = mirrored_manifest(str(file.attrs["manifest"]), pads)
        file.attrs["bearing"], file.attrs["manifest"] = bearing, manifest
        for run in file["runs"].values():
            for name in negated & set(run):
                run[name][...] = -run[name][...]
    return target


def angles(campaign):
    return [pad.pivot_angle for pad in ti.load_bearing(campaign.bearing_text).pads]


def test_pivots_clearance_and_locus_are_the_mirror_image(tmp_path):
    campaigns = [ti.load_campaign(path) for path in (DEMO, mirror_campaign(DEMO, tmp_path / "mirrored.h5"))]
    right, left = (ti.fit_pivots(campaign, angles(campaign)) for campaign in campaigns)
    load = np.linspace(600.0, 4000.0, 9)
    for p, q in zip(right, reversed(left), strict=True):
        np.testing.assert_allclose(q.deflection(load), p.deflection(load), rtol=1e-9)
    sweep = [ti.measure_clearance(c, angles(c)) for c in campaigns]
    np.testing.assert_allclose(sweep[1].clearance[::-1], sweep[0].clearance, rtol=1e-9)
    loci = [ti.measure_locus(c, s) for c, s in zip(campaigns, sweep, strict=True)]
    places = [{round(p.point.static_load_direction_deg) % 360: p.position for p in locus.points} for locus in loci]
    assert {(180 - angle) % 360 for angle in places[1]} == set(places[0])
    for angle, place in places[1].items():
        np.testing.assert_allclose(MIRROR @ place, places[0][(180 - angle) % 360], atol=1e-14)


OFFSET = (BEARINGS / "rocker.toml").read_text("utf-8").replace("pivot_offset = 0.5", "pivot_offset = 0.6")
STATED = OFFSET.replace("[bearing]", '[bearing]\nrotation = "counter-clockwise"')
RIGID = ti.CompareSettings(variants=("rigid",), thermal="isothermal")
ONE_WAY = RigPlan(
    dynamic=operating_points([(3000.0, 25.0), (6000.0, 25.0)]), directions=directions(3), locus=locus_points(4)
)


def both_ways(plan):
    back = plan.turning(rotation="clockwise")
    return replace(
        plan, dynamic=plan.dynamic + back.dynamic, locus=plan.locus + back.locus, clearance=(ClearanceSweep(),)
    )


def offset_rig(text, plan, model=None):
    truth = rig_truth(parse_bearing(text, "b.toml"), model or ModelSettings("rigid", "isothermal"), text)
    return VirtualRig(truth, plan, Instruments.like_paper(5, 3), seed=11)


@pytest.fixture(scope="module")
def both(campaign_of):
    return campaign_of(offset_rig(STATED, both_ways(ONE_WAY)), name="both")


def comparison_of(path):
    campaign = ti.load_campaign(path)
    return ti.compare_campaign(campaign, ti.load_bearing(campaign.bearing_text), RIGID)


@pytest.fixture(scope="module")
def compared(both):
    return comparison_of(both)


def rewritten(campaign, target, attribute, change):
    """A copy whose manifest or bearing file is another text."""
    shutil.copy(campaign, target)
    target.chmod(0o644)
    with h5py.File(target, "r+") as file:
        file.attrs[attribute] = change(str(file.attrs[attribute]))
    return target


def rigid(comparison):
    """K and C with rigid pivots at every point."""
    return comparison.predictions["rigid"][list(COEFFICIENT_COLUMNS)].to_numpy().reshape(-1, 2, 2, 2)


def test_each_sense_of_one_campaign_has_its_own_leading_edge(both, compared):
    truth = rig_truth(parse_bearing(STATED, "b.toml"), ModelSettings("rigid", "isothermal"))
    for measured, (k, c) in zip(compared.identification.points, rigid(compared), strict=True):
        h = truth.stiffness(measured.point)
        size = np.abs(h).max()
        np.testing.assert_allclose(k + 1j * measured.point.excitation * c, h, atol=1e-9 * size)
        np.testing.assert_allclose(measured.stiffness.h, h, atol=0.01 * size)
    kxx = {p.point.key: p.stiffness.h[0, 0].real for p in compared.identification.points}
    assert len(kxx) == 4
    for (*point, rotation), k in kxx.items():
        assert rotation == "clockwise" or k > 5.0 * kxx[(*point, "clockwise")]
    places = {rotation: compared.locus.to_frame().query("rotation == @rotation") for rotation in ROTATIONS}
    assert [len(frame) for frame in places.values()] == [4, 4]
    predicted, measured = (compared.loci[[f"x_m{end}", f"y_m{end}"]].to_numpy() for end in ("_predicted", ""))
    np.testing.assert_allclose(predicted, measured, atol=5e-7)


def test_identify_marks_the_points_that_turn_clockwise(both, tmp_path):
    lines = tpjb("identify", both, "--out", tmp_path / "out").stdout.splitlines()
    rows = [line.split() for line in lines if re.match(r" *[36] +-90 ", line)]
    table = pd.read_csv(tmp_path / "out" / "coefficients.csv")
    assert sorted(table["rotation"]) == sorted(2 * ROTATIONS)
    assert ["clockwise" in row for row in rows] == list(table["rotation"] == "clockwise")


def test_the_mirror_image_of_both_senses(both, compared, tmp_path):
    image = rewritten(both, tmp_path / "copy.h5", "manifest", str)
    mirrored = comparison_of(mirror_campaign(image, tmp_path / "mirrored.h5"))
    image_of = {p.point.key: (p, q) for p, q in zip(mirrored.identification.points, rigid(mirrored), strict=True)}
    for p, (k, c) in zip(compared.identification.points, rigid(compared), strict=True):
        *point, rotation = p.point.key
        measured, predicted = image_of[(*point, ROTATIONS[rotation == ROTATIONS[0]])]
        size = np.abs(p.stiffness.h).max()
        assert measured.quality == p.quality
        np.testing.assert_allclose(measured.stiffness.half_width(), p.stiffness.half_width(), rtol=1e-9)
        np.testing.assert_allclose(MIRROR @ measured.stiffness.h @ MIRROR, p.stiffness.h, atol=1e-9 * size)
        np.testing.assert_allclose(MIRROR @ predicted[0] @ MIRROR, k, atol=1e-9 * size)
        np.testing.assert_allclose(MIRROR @ predicted[1] @ MIRROR, c, atol=1e-9 * size / p.point.excitation)


def test_runs_that_all_state_the_sense_are_the_shaft_that_states_it(campaign_of, tmp_path):
    stated = campaign_of(offset_rig(OFFSET, ONE_WAY.turning(rotation="clockwise")), name="clockwise")

    def run_by_run(text):
        without = text.replace('[shaft]\nrotation = "clockwise"\n', "")
        assert len(without) < len(text)
        return re.sub(r'^(kind = "(?:dynamic|locus)")', r'\1\nrotation = "clockwise"', without, flags=re.MULTILINE)

    by_run = rewritten(stated, tmp_path / "runs.h5", "manifest", run_by_run)
    one, many = (comparison_of(path).to_dataframe() for path in (stated, by_run))
    assert set(many["rotation"]) == {"clockwise"}
    np.testing.assert_allclose(many["kxx_N_per_m_predicted"], many["kxx_N_per_m"], rtol=0.01)
    predicted = [f"{name}_predicted" for name in ("kxx_N_per_m", "kxy_N_per_m", "cyy_Ns_per_m")]
    np.testing.assert_allclose(many[predicted], one[predicted], rtol=1e-9)


def test_an_edge_that_nothing_states_is_asked_for(both, tmp_path):
    unstated = rewritten(both, tmp_path / "unstated.h5", "bearing", lambda text: OFFSET)
    points = [run.point for run in ti.load_campaign(both).of_kind("dynamic")]
    for command in (
        lambda: comparison_of(unstated),
        lambda: ti.diagnose(unstated),
        lambda: ti.plan(ti.load_bearing(OFFSET), points),
    ):
        with pytest.raises(BearingError, match=r"\[bearing\] rotation: the shaft turns both ways.* Write rotation = "):
            command()
    central = rewritten(both, tmp_path / "central.h5", "bearing", lambda text: OFFSET.replace("0.6", "0.5"))
    assert len(comparison_of(central).to_dataframe()) == 4


def test_a_diagnosis_of_both_senses_names_what_is_there(campaign_of):
    soft = ModelSettings("kirk", "isothermal", (Effect("soft_pivot", pad=1, stiffness_factor=0.4),))
    plan = replace(both_ways(ONE_WAY), locus=())
    campaign = campaign_of(offset_rig(STATED, plan, soft), name="soft")
    others = frozenset(known_effects()) - {"pivot_flexibility", "soft_pivot"}
    result = ti.diagnose(campaign, thermal="isothermal", settings=DiagnoseSettings(skip=others))
    verdict = result.diagnosis.verdict
    assert verdict.verdict == "named"
    (effect,) = verdict.effects
    assert effect.name == "soft_pivot"
    assert effect.parameters["pad"].value == 1
    assert effect.parameters["stiffness_factor"].value == pytest.approx(0.4, abs=0.05)
