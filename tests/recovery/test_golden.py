"""Golden results: what `tpjb identify` said of nine campaigns at a known commit, in units of its standard deviations.

This pins the code against itself, not against the truth (the other tests of this folder do that): a change of layout
must not move a coefficient, its interval or a flag. A change of method may: `python -m tests.recovery.test_golden`
writes the values anew, and the commit says why; `tests/studies/golden.py` holds fifty commands against each other.
"""

from __future__ import annotations

import csv
import json
import sys
import tempfile
from pathlib import Path

import numpy as np
import pytest

from tests.command_line import tpjb

SAMPLES = Path(__file__).parents[2].parent / "shared" / "samples"
GOLDEN = Path(__file__).parent / "data" / "golden.json"
POINT = ("static_load_N", "static_load_direction_deg", "excitation_Hz")
#: Largest shift of a coefficient over its standard error, and of an interval's half width over itself.
SHIFT, WIDTH = 1e-3, 1e-3

pytestmark = [pytest.mark.slow, pytest.mark.samples, pytest.mark.skipif(not SAMPLES.is_dir(), reason="no ../shared")]


def campaign_path(name: str) -> Path:
    return SAMPLES / name if (SAMPLES / name).is_dir() else SAMPLES / f"{name}.h5"


def identified(name: str, out: Path) -> list[dict]:
    """Coefficients, standard errors, half widths and flags of every point of a sample campaign."""
    result = tpjb("identify", campaign_path(name), "--workers", 1, "--out", out)
    assert result.exit_code in (0, 3), result.output
    points = []
    for row in csv.DictReader((out / "coefficients.csv").read_text(encoding="utf-8").splitlines()):
        columns = [column for column in row if column.endswith(("_N_per_m", "_Ns_per_m"))]
        widths = [(float(row[f"{c}_hi"]) - float(row[f"{c}_lo"])) / 2 for c in columns]
        point = {
            "point": [float(row[name]) for name in POINT],
            "value": [float(row[c]) for c in columns],
            "se": [float(row[f"{c}_se"]) for c in columns],
            "half_width": widths,
            "quality": row["quality"],
            "rejected": int(row["n_windows_rejected"]),
        }
        points.append(point)
    return points


@pytest.mark.parametrize("name", sorted(json.loads(GOLDEN.read_text(encoding="utf-8"))))
def test_coefficients_intervals_and_flags_stay(name, tmp_path):
    golden = json.loads(GOLDEN.read_text(encoding="utf-8"))[name]
    points = identified(name, tmp_path / "out")
    for part in ("point", "quality", "rejected"):
        assert [p[part] for p in points] == [p[part] for p in golden]
    for now, then in zip(points, golden, strict=True):
        shift = (np.array(now["value"]) - then["value"]) / then["se"]
        assert np.abs(shift).max() < SHIFT
        for part in ("se", "half_width"):
            np.testing.assert_allclose(now[part], then[part], rtol=WIDTH)


def rewrite() -> None:
    """Write the values of this checkout, seven digits each."""
    names = json.loads(GOLDEN.read_text(encoding="utf-8"))
    blocks = []
    for name in names:
        with tempfile.TemporaryDirectory() as folder:
            points = identified(name, Path(folder) / "out")
        for point in points:
            for part in ("value", "se", "half_width"):
                point[part] = [float(f"{number:.7g}") for number in point[part]]
        lines = ",\n".join(f"  {json.dumps(point)}" for point in points)
        blocks.append(f' "{name}": [\n{lines}\n ]')
    GOLDEN.write_text("{\n" + ",\n".join(blocks) + "\n}\n", encoding="utf-8")


if __name__ == "__main__":
    sys.exit(rewrite())
