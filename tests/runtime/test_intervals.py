"""Intervals are tested by their limits: in every table that a command writes, of points and of bands."""

import numpy as np
import pytest

from tests.command_line import tpjb
from tests.rigs.band_campaign import write_band_campaign
from tests.rigs.band_rig import BandRig, band_plans
from tpjb_ident.runtime.table_reader import column_of, read_table

#: Tables whose intervals are a half width to either side of the value.
SYMMETRIC = ("coefficients", "estimators", "frf", "frf_estimators", "frf_models", "frequency_fits")


def check_limits(folder) -> dict[str, int]:
    """Limits of every interval in a folder's tables, by table; the reader refuses a value outside its own."""
    counts = {}
    for path in sorted(folder.glob("*.csv")):
        frame = read_table(path)
        counts[path.stem] = 0
        for name in [name.removesuffix("_lo") for name in frame if name.endswith("_lo")]:
            assert column_of(name, path.stem)[0] is not None, name
            rows = np.isfinite(frame[[name, f"{name}_lo", f"{name}_hi"]]).all(axis=1)
            rows &= frame[f"{name}_lo"] != frame[f"{name}_hi"]  # the mass of a model without one
            value, low, high = (frame.loc[rows, name + end].to_numpy() for end in ("", "_lo", "_hi"))
            assert (low < value).all(), (path.name, name)
            assert (value < high).all(), (path.name, name)
            if path.stem in SYMMETRIC:
                assert np.allclose(value - low, high - value, rtol=1e-6, atol=1e-9 * np.abs(value).max(initial=1.0))
                standard = frame.loc[rows, f"{name}_se"].to_numpy()
                assert (high - value > standard).all(), (path.name, name)
            counts[path.stem] += int(rows.sum())
    return counts


@pytest.mark.slow
def test_limits_of_points_and_pivots(small_campaign, tmp_path):
    assert tpjb("identify", small_campaign, "--out", tmp_path / "o", "-q").exit_code == 0
    counts = check_limits(tmp_path / "o")
    assert counts["coefficients"] == 8 * 2
    assert counts["estimators"] >= 8 * 2


@pytest.mark.slow
def test_limits_of_bands(tmp_path):
    rig = BandRig(kind="multisine")
    path = tmp_path / "band.h5"
    write_band_campaign(path, rig, band_plans(), 3)
    assert tpjb("identify", path, "--out", tmp_path / "o", "-q").exit_code in (0, 3)
    counts = check_limits(tmp_path / "o")
    assert counts["frf"] >= 8 * 20
    assert counts["frf_models"] >= 16
