"""Units that a record states are held against the manifest: units row, metadata, time column."""

from __future__ import annotations

from pathlib import Path

import h5py
import numpy as np
import pytest

from rigdata import load_campaign
from rigdata.calibration import Channel
from rigdata.readers.base import RunReader
from tests.hostile.fuzz_targets import CSV_MANIFEST
from tpjb_ident.check.campaign import check_campaign


def stated(quantity: str, unit: str, text: str) -> str:
    reader = RunReader(Path("c.csv"), "c.csv", "c-1", {"C": Channel("C", quantity, unit=unit)})
    problems = reader.unit_problems({"C": text})
    assert all(p.severity == "error" and p.place == "channel C" for p in problems)
    return "; ".join(p.what for p in problems)


@pytest.mark.parametrize(
    ("quantity", "unit", "text"),
    [
        ("displacement", "V", "mV"),
        ("displacement", "um", "mm"),
        ("displacement", "V", "um"),
        ("force", "mV", "mV/V"),
        ("force", "N", "kN"),
        ("acceleration", "m/s^2", "g"),
        ("temperature", "degC", "K"),
        ("temperature", "degC", "degF"),
        ("time", "s", "ms"),
        ("speed", "rpm", "Hz"),
    ],
)
def test_another_unit_is_an_error(quantity, unit, text):
    assert stated(quantity, unit, text) == f"the file states {text!r}, the manifest unit = {unit!r}"


@pytest.mark.parametrize(
    ("quantity", "unit", "text"),
    [
        ("displacement", "V", " V "),
        ("displacement", "um", "µm"),
        ("displacement", "um", "micron"),
        ("displacement", "V", ""),
        ("displacement", "V", "raw"),
        ("displacement", "V", "X1A of the new amplifier"),
        ("acceleration", "m/s^2", "m/s²"),
        ("temperature", "degC", "°C"),
        ("speed", "rpm", "1/min"),
        ("time", "s", "sec"),
        ("command", "V", "mV"),
    ],
)
def test_the_same_unit_in_another_spelling_and_what_is_none_are_nothing(quantity, unit, text):
    assert stated(quantity, unit, text) == ""


def errors(path) -> list[str]:
    return [str(p) for p in check_campaign(path) if p.severity == "error"]


@pytest.mark.parametrize("spec", ["", "[csv]\nunits_line = 3\n"])
def test_the_units_row_of_a_text_file(tmp_path, spec):
    units = ["X1A;X1B;Zeit", "um;mm;ms"] if not spec else ["X1A;X1B;Zeit", "of;the;logger", "um;mm;ms"]
    samples = [f"{np.sin(i):.5f};{np.cos(i):.5f};{0.1 * i:.1f}" for i in range(40)]
    (tmp_path / "c-1.csv").write_text("\n".join([*units, *samples]) + "\n", encoding="utf-8")
    (tmp_path / "campaign.toml").write_text(CSV_MANIFEST.replace("[channels.X1A]", f"{spec}[channels.X1A]"), "utf-8")
    found = " ".join(errors(tmp_path))
    assert "channel X1B: the file states 'mm'" in found
    assert "channel Zeit: the file states 'ms'" in found
    assert "channel X1A" not in found


@pytest.mark.parametrize("kind", [str, np.bytes_])
def test_the_unit_of_a_dataset(tmp_path, kind):
    path = tmp_path / "c.h5"
    with h5py.File(path, "w") as file:
        file.attrs["manifest"], file.attrs["bearing"] = CSV_MANIFEST.partition("[channels.Zeit]")[0], "x = 1"
        file.attrs["manifest"] += '[[runs]]\nid = "c-1"\nkind = "clearance"\n'
        for name, unit in (("X1A", "um"), ("X1B", "mm")):
            dataset = file.create_dataset(f"runs/c-1/{name}", data=np.arange(40.0))
            dataset.attrs["units"] = kind(unit)
            dataset.attrs["comment"] = 3.0
    (problem,) = load_campaign(path).run("c-1").reader.problems()
    assert str(problem).startswith("c.h5:/runs/c-1, channel X1B: the file states 'mm', the manifest unit = 'um'")
