"""`tpjb identify`: its options, its tables and what it says about them."""

import json

import h5py
import numpy as np
import pandas as pd
import pytest

from rigdata.virtual_rig import write_campaign
from tests.command_line import ended, tpjb
from tests.identification.test_identify import rig

DISTURBED = "d-05000-25-02"


@pytest.fixture(scope="module")
def disturbed(tmp_path_factory):
    """One load at three frequencies; at 25 Hz a probe glitches in the last window of all runs, in three more of one."""
    folder = tmp_path_factory.mktemp("disturbed")
    write_campaign(folder / "campaign.h5", rig([(5000.0, 20.0), (5000.0, 25.0), (5000.0, 31.0)], seed=5))
    with h5py.File(folder / "campaign.h5", "r+") as file:
        for number, name in enumerate(n for n in file["runs"] if n.startswith("d-05000-25")):
            probe = file[f"runs/{name}/X1A"]
            time = np.arange(len(probe)) / file[f"runs/{name}"].attrs["sample_rate_hz"]
            length = 2.0 / 6  # of a window
            early = (time < 3 * length) & (name == DISTURBED)
            size = np.where(time >= 5 * length, 0.1, np.where(early, 0.012, 0.0))
            probe[...] += size * np.cos(2 * np.pi * 25 * time + number)
    result = tpjb("identify", folder / "campaign.h5", "--out", folder / "out")
    return result, folder / "out"


@pytest.mark.slow
def test_rejected_windows_and_what_they_mean_are_told(disturbed):
    result, out = disturbed
    windows = pd.read_csv(out / "windows.csv")
    hit = windows[windows["run"] == DISTURBED]
    assert len(hit) >= 4
    assert not hit["time_s"].between(0.95, 1.5).any()
    assert hit["reason"].str.contains("displacement").all()
    assert "directional-rejection" in result.stdout
    assert f"{DISTURBED} at 30 deg" in result.stdout
    assert "flags: ok" not in result.stdout


@pytest.mark.slow
def test_methods_that_disagree_are_named_on_screen_in_the_table_and_in_the_record(disturbed):
    result, out = disturbed
    quality = pd.read_csv(out / "coefficients.csv").set_index("excitation_Hz")["quality"]
    assert "methods-disagree" in quality[25.0]
    assert "methods-disagree" not in quality[31.0]
    assert ": methods-disagree at 5 kN, 25 Hz: " in result.stdout
    entry = json.loads((out / "run.json").read_text(encoding="utf-8"))["commands"]["identify"]
    (remark,) = [r for r in entry["remarks"] if r.startswith("methods-disagree")]
    assert "times the interval) away from mm-eiv" in remark


@pytest.mark.slow
def test_every_figure_of_the_best_rigs_is_a_column(disturbed):
    frame = pd.read_csv(disturbed[1] / "coefficients.csv")
    for name in ("kxx_N_per_m_random95", "cyy_Ns_per_m_systematic95", "n_windows", "n_windows_rejected", "coherence",
                 "condition_number", "amplitude_m", "frequency_model", "inertia_corrected", "baseline_subtracted",
                 "attenuation"):  # fmt: skip
        assert frame[name].notna().all(), name
    half = np.hypot(frame["kyy_N_per_m_random95"], frame["kyy_N_per_m_systematic95"])
    np.testing.assert_allclose(frame["kyy_N_per_m_hi"] - frame["kyy_N_per_m"], half, rtol=1e-9)
    assert frame["inertia_corrected"].all()
    assert set(frame["frequency_model"]) == {"K-C"}  # which it is


@pytest.mark.slow
def test_models_over_frequency_are_written_and_shown(disturbed):
    result, out = disturbed
    fits = pd.read_csv(out / "frequency_fits.csv")
    assert fits["model"].tolist() == ["K-C", "K-C-M"]
    assert fits["dof"].tolist() == [16, 12]
    assert (fits["supported"] == "K-C").all()
    assert fits["kyy_N_per_m"][0] == pytest.approx(1.8e8, rel=0.01)
    assert pd.read_parquet(out / "frequency_fits.parquet")["chi_square"].tolist() == fits["chi_square"].tolist()
    assert "over frequency" in result.stdout
    assert "supported" in result.stdout


@pytest.fixture(scope="module")
def plain(small_campaign, tmp_path_factory):
    """Folder with what least squares say of the small campaign."""
    out = tmp_path_factory.mktemp("plain") / "out"
    ended(0, "identify", small_campaign, "--method", "ols", "--out", out)
    return out


def test_one_frequency_leaves_an_empty_table_with_its_names(plain):
    assert pd.read_csv(plain / "frequency_fits.csv").columns[4] == "model"
    frame = pd.read_csv(plain / "coefficients.csv")
    assert (frame["frequency_model"] == "single line").all()


@pytest.mark.slow
def test_several_excitation_lines_of_each_record(tmp_path):
    points = [(5000.0, f) for f in (15.0, 25.0, 36.0)]
    write_campaign(tmp_path / "c.h5", rig(points, seed=3, joint_frequencies=True))
    lines = ("--lines", "15, 25, 36 Hz")
    result = ended(3, "identify", tmp_path / "c.h5", *lines, "--out", tmp_path / "thrice")
    assert "holds the very samples of run" in result.stderr
    with h5py.File(tmp_path / "c.h5", "r+") as file:
        for run in [name for name in file["runs"] if "-15-" not in name]:
            del file["runs"][run]
    ended(0, "identify", tmp_path / "c.h5", *lines, "--out", tmp_path / "out")
    frame = pd.read_csv(tmp_path / "out" / "coefficients.csv")
    assert frame["excitation_Hz"].tolist() == [15.0, 25.0, 36.0]
    np.testing.assert_allclose(frame["kyy_N_per_m"], 1.8e8, rtol=0.01)


@pytest.mark.slow
def test_a_known_delay_turns_the_phases(small_campaign, plain, tmp_path):
    """A force that was recorded late leads what it seems to be: h turns ahead by omega times the delay."""
    h, delays = [], ("--delay", "force=1 ms", "--delay", "acceleration=1 ms")
    ended(0, "identify", small_campaign, "--method", "ols", "--out", tmp_path / "out", *delays)
    for out in (plain, tmp_path / "out"):
        row = pd.read_csv(out / "coefficients.csv").iloc[0]
        h.append(row["kyy_N_per_m"] + 2j * np.pi * 25 * row["cyy_Ns_per_m"])
    # what the runs' missed set points do is learnt for k and c apart, and differs a little between the two
    assert np.angle(h[1] / h[0]) == pytest.approx(2 * np.pi * 25 * 1e-3, rel=0.015)
