"""Units that a record states are held against the manifest: units row, metadata, time column."""

from pathlib import Path

import h5py
import numpy as np
import pytest

from rigdata import load_campaign
from rigdata.calibration import Channel
from rigdata.readers.base import RunReader
from tests.manifests import PROBES, SWEEP, manifest, write_files, write_hdf5
from tpjb_ident.check.campaign import check_campaign

TIMED = PROBES | {"Zeit": {"quantity": "time", "unit": "s"}}
OTHER = """
    displacement V mV, displacement um mm, displacement V um, force mV mV/V, force N kN, acceleration m/s^2 g,
    temperature degC K, temperature degC degF, time s ms, speed rpm Hz
"""
#: Another spelling, or what is no unit.
SAME = (
    ("displacement", "V", " V "), ("displacement", "um", "µm"), ("displacement", "um", "micron"),
    ("displacement", "V", ""), ("displacement", "V", "raw"), ("displacement", "V", "X1A of the new amplifier"),
    ("acceleration", "m/s^2", "m/s²"), ("temperature", "degC", "°C"), ("speed", "rpm", "1/min"), ("time", "s", "sec"),
    ("command", "V", "mV"),
)  # fmt: skip


@pytest.mark.parametrize(("quantity", "unit", "text"), [*(case.split() for case in OTHER.split(",")), *SAME])
def test_another_unit_is_an_error_and_another_spelling_nothing(quantity, unit, text):
    reader = RunReader(Path("c.csv"), "c.csv", "c-1", {"C": Channel("C", quantity, unit=unit)})
    problems = reader.unit_problems({"C": text})
    assert all(p.severity == "error" and p.place == "channel C" for p in problems)
    says = [] if (quantity, unit, text) in SAME else [f"the file states {text!r}, the manifest unit = {unit!r}"]
    assert [p.what for p in problems] == says


@pytest.mark.parametrize("spec", [{}, {"units_line": 3}])
def test_the_units_row_of_a_text_file(tmp_path, spec):
    head = ["X1A;X1B;Zeit", *(["of;the;logger"] if spec else []), "um;mm;ms"]
    samples = [f"{np.sin(i):.5f};{np.cos(i):.5f};{0.1 * i:.1f}" for i in range(40)]
    text = manifest(TIMED, SWEEP, **({"csv": spec} if spec else {}))
    write_files(tmp_path, text, {"runs/c-1.csv": "\n".join([*head, *samples]) + "\n"})
    errors = " ".join(str(p) for p in check_campaign(tmp_path) if p.severity == "error")
    assert "channel X1B: the file states 'mm'" in errors
    assert "channel Zeit: the file states 'ms'" in errors
    assert "channel X1A" not in errors


@pytest.mark.parametrize("kind", [str, np.bytes_])
def test_the_unit_of_a_dataset(tmp_path, kind):
    text = manifest(PROBES, SWEEP, acquisition={"sample_rate": "10 Hz"})
    path = write_hdf5(tmp_path / "c.h5", text, dict.fromkeys(PROBES, np.arange(40.0)))
    with h5py.File(path, "r+") as file:
        for name, unit in (("X1A", "um"), ("X1B", "mm")):
            file[f"runs/c-1/{name}"].attrs.update({"units": kind(unit), "comment": 3.0})
    (problem,) = load_campaign(path).run("c-1").reader.problems()
    assert str(problem).startswith("c.h5:/runs/c-1, channel X1B: the file states 'mm', the manifest unit = 'um'")
