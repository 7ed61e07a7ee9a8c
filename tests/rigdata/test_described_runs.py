"""Keys of shaft, housing, planes and temperatures; one column described otherwise for some runs."""

import h5py
import numpy as np
import pytest

from rigdata import RigDataError, load_campaign
from rigdata.manifest.manifest import Manifest, parse_manifest
from tests.manifests import PROBES, SET_POINT, manifest, write_files, write_hdf5

PROBE = {"quantity": "displacement", "axis": "45 deg", "unit": "V", "sensitivity": "7.78 mV/um", "uncertainty": "1 %"}
CHANNELS = {"X1A": PROBE, "X1B": PROBE | {"axis": "135 deg"}, "T1": {"quantity": "temperature", "unit": "degC"}}
PLACE = {"kind": "dynamic", "excitation_frequency": "25 Hz", **SET_POINT, "file": "x.csv"}
RUNS = [{"id": name, **PLACE} for name in ("d-1", "p-1", "p-2", "c-1")]
FOR = "\n[[channels.X1A.for]]\n"


def parsed(extra: str = "", channels: object = CHANNELS, **tables: object) -> Manifest:
    return parse_manifest(manifest(channels, *RUNS, **tables) + extra)


def refused(*says: str, extra: str = "", channels: object = CHANNELS, **tables: object) -> RigDataError:
    with pytest.raises(RigDataError) as caught:
        parsed(extra, channels, **tables)
    for part in says:
        assert part in str(caught.value)
    return caught.value


def test_shaft_housing_planes_and_temperatures(tmp_path):
    probe = PROBE | {
        "plane": "12 mm",
        "temperature_coefficient": "-0.02 %/K",
        "temperature_coefficient_uncertainty": "1e-4 1/K",
        "temperature_reference": "20 degC",
    }
    runs = [RUNS[0], RUNS[1] | {"rotation": "counter-clockwise", "temperature": "46 degC"}]
    tables = {"shaft": {"rotation": "clockwise"}, "housing": {"mass": "30 kg", "mount": "floating"}}
    rows = "X1A,X1B,T1\n" + "0.5,0.5,40\n" * 5 + "0.5,0.5,\n" + "0.5,0.5,41\n" * 5
    text = manifest(CHANNELS | {"X1A": probe}, *runs, **tables)
    campaign = load_campaign(write_files(tmp_path, text, {"x.csv": rows}))
    assert (campaign.rotation, campaign.mount) == ("clockwise", "floating")
    assert [run.rotation for run in campaign.runs] == ["clockwise", "counter-clockwise"]
    first, second = campaign.runs
    assert (first.temperature, second.temperature) == (None, pytest.approx(319.15))
    assert second.mean_temperature() == second.temperature
    with pytest.raises(RigDataError, match="sample rate"):
        first.record("T1")
    assert first.mean_temperature() is None  # no rate, no records
    channel = campaign.channels["X1A"]
    assert (channel.plane, channel.temperature_reference) == (0.012, pytest.approx(293.15))
    assert channel.temperature_coefficient == pytest.approx(-2e-4)
    assert channel.temperature_coefficient_uncertainty == pytest.approx(1e-4)
    text = manifest(CHANNELS, *runs, acquisition={"sample_rate": "1 kHz"}, **tables)
    assert load_campaign(write_files(tmp_path, text)).run("d-1").mean_temperature() == pytest.approx(313.65)


def test_defaults():
    read = parsed()
    assert (read.rotation, read.mount, read.described) == ("counter-clockwise", None, {})
    channel = read.channels["X1A"]
    assert (channel.plane, channel.temperature_coefficient, channel.temperature_reference) == (0.0, 0.0, None)
    assert (channel.sample_rate, channel.clock) == (None, "")


@pytest.mark.parametrize(
    ("table", "keys", "says"),
    [
        ("shaft", {"rotation": "clockwize"}, "Did you mean 'clockwise'?"),
        ("shaft", {"rotations": "clockwise"}, "Did you mean 'rotation'?"),
        ("housing", {"mass": "1 kg", "mount": "floats"}, "Did you mean 'floating'?"),
        ("X1A", {"plane": "12 N"}, "not one of length"),
        ("X1A", {"plane": 12}, "no unit"),
        ("X1A", {"plan": "12 mm"}, "Did you mean 'plane'?"),
        ("X1A", {"temperature_coefficient": "0.02 %"}, "not one of per kelvin"),
        ("X1A", {"temperature_coeficient": "0.02 %/K"}, "Did you mean 'temperature_coefficient'?"),
        ("X1A", {"temperature_coefficient_uncertainty": "-0.01 %/K"}, "not below 0"),
        ("X1A", {"temperature_reference": "-300 degC"}, "not below 0"),
        ("X1A", {"sample_rate": "0 Hz"}, "above 0"),
        ("X1A", {"sample_rat": "1 Hz"}, "Did you mean 'sample_rate'?"),
        ("X1A", {"for": "p-*"}, "not a list of tables"),
        ("X1A", {"for": [3]}, "not a table"),
    ],
)
def test_wrong_entries_are_named_with_their_table_and_the_nearest(table, keys, says):
    if table != "X1A":
        refused(f"[{table}]", says, **{table: keys})
    else:
        refused("channels.X1A", says, channels=CHANNELS | {"X1A": PROBE | keys})


def test_two_planes_are_taken_and_three_are_not():
    two = CHANNELS | {"X2A": PROBE | {"plane": "50 mm"}}
    assert parsed(channels=two).channels["X2A"].plane == 0.05
    three = two | {"X3A": PROBE | {"plane": "-50 mm"}}
    refused("displacement channels are in 3 planes (0 mm, 50 mm, -50 mm)", "two planes at most", channels=three)
    refused("in 3 planes", extra=f'{FOR}runs = ["p-1"]\nplane = "-50 mm"\n', channels=two)


@pytest.mark.parametrize(
    ("letters", "says"),
    [
        (("B", ""), "no channel has the clock 'B' of this time column"),
        (("B", "B"), "clock 'B' has 2 time columns"),
    ],
)
def test_clocks_that_cannot_be(letters, says):
    times = {f"Time {i}": {"quantity": "time", "unit": "s", "clock": c} for i, c in enumerate(letters) if c}
    refused(says, "[channels.Time", channels=CHANNELS | times)


def test_the_last_entry_counts_key_by_key():
    read = parsed(
        f'{FOR}runs = ["p-*", "c-1"]\nsensitivity = "7.87 mV/um"\naxis = "40 deg"\n'
        f'{FOR}runs = ["p-2"]\naxis = "50 deg"\n'
        '[[channels.X1B.for]]\nruns = ["d-1"]\nquantity = "ignore"\n'
    )
    axes = {run: round(np.degrees(channels["X1A"].axis)) for run, channels in read.described.items()}
    assert axes == {"p-1": 40, "p-2": 50, "c-1": 40, "d-1": 45}
    gains = {run: 1e-3 / channels["X1A"].gain for run, channels in read.described.items()}
    assert gains == pytest.approx({"p-1": 7.87, "p-2": 7.87, "c-1": 7.87, "d-1": 7.78})
    assert read.described["d-1"]["X1B"].quantity == "ignore"
    assert read.described["p-1"] is read.described["c-1"]
    assert read.channels["X1A"].axis == pytest.approx(np.radians(45))


def test_another_sensitivity_or_uncertainty_and_another_channel_are_another_calibration():
    read = parsed(
        f'{FOR}runs = ["p-1"]\nsensitivity = "7.87 mV/um"\n'
        f'{FOR}runs = ["p-2"]\nuncertainty = "2 %"\n'
        f'{FOR}runs = ["c-1"]\naxis = "40 deg"\nunit = "mV"\n'
    )
    own = read.channels["X1A"].calibration
    assert own == read.described["c-1"]["X1A"].calibration
    others = {read.described[run]["X1A"].calibration for run in ("p-1", "p-2")}
    assert len(others | {own, read.channels["X1B"].calibration}) == 4
    in_micrometres = parsed(channels=PROBES).channels
    assert in_micrometres["X1A"].calibration != in_micrometres["X1B"].calibration


@pytest.mark.parametrize(
    ("entry", "says"),
    [
        ('runs = ["q-*"]', "no run is named by 'q-*'"),
        ('runs = ["p-3"]', "Did you mean 'p-"),
        ('runs = ["P-1"]', "no run is named by 'P-1'"),
        ('runs = ["p-?"]', "no run is named by"),
        ('runs = ["p-[12]"]', "no run is named by"),
        ('runs = ["p-[12]*"]', "no run is named by"),
        ('runs = ["p?*"]', "no run is named by"),
        ("runs = []", "no list of texts"),
        ('runs = "p-1"', "no list of texts"),
        ('axis = "40 deg"', "runs is missing"),
        ('runs = ["p-1"]\naxes = "40 deg"', "Did you mean 'axis'?"),
        ('runs = ["p-1"]\nlike = "X1B"', "unknown key 'like'"),
        ('runs = ["p-1"]\naxis = "40 N"', "not one of angle"),
        ('runs = ["p-1"]\nsensitivity = "0 V/m"', "above zero"),
    ],
)
def test_wrong_entries_are_named_with_their_line(entry, says):
    extra = f"{FOR}{entry}\n"
    last = (manifest(CHANNELS, *RUNS) + extra).count("\n")
    (first, *_) = refused(says, "[[channels.X1A.for]] no. 1", extra=extra).problems
    assert first.place.partition(",")[0] in (f"line {last}", f"line {last - 1}")


@pytest.mark.slow
def test_patterns_without_end_are_refused():
    stars = ", ".join(f'"*{i}"' for i in range(2000))
    refused("more than 1000 patterns", extra=f"{FOR}runs = [{stars}]\n")
    refused("more than 1000 patterns", extra=f'{FOR}runs = ["*-1"]\n' * 2000)


@pytest.mark.parametrize("stored", [False, True])
def test_a_run_reads_as_it_is_described(tmp_path, stored):
    channels = {name: CHANNELS[name] for name in PROBES}
    text = manifest(channels, *RUNS[:2], acquisition={"sample_rate": "1 kHz"})
    text += f'{FOR}runs = ["p-*"]\nsensitivity = "1 mV/um"\naxis = "90 deg"\n'
    text += '[[channels.X1B.for]]\nruns = ["p-1"]\nquantity = "ignore"\n'
    path = write_files(tmp_path, text, {"x.csv": "X1A,X1B\n" + "1.0,2.0\n" * 5})
    if stored:
        path = write_hdf5(tmp_path / "c.h5", text, {"X1A": np.ones(5), "X1B": np.full(5, 2.0)}, run="d-1")
        with h5py.File(path, "r+") as file:
            file["runs/p-1"] = file["runs/d-1"]
    read = load_campaign(path)
    plain, other = read.runs
    assert plain.record("X1A").values[0] == pytest.approx(1.0 / 7780.0)
    assert other.record("X1A").values[0] == pytest.approx(1e-3)
    assert other.record("X1A").axis == pytest.approx(np.pi / 2)
    assert (list(plain.channels), list(other.channels)) == (["X1A", "X1B"], ["X1A"])
    assert [device.channels for device in other.devices] == [("X1A",)]
    own = read.channels["X1A"].calibration
    assert other.channels["X1A"].calibration != own == plain.channels["X1A"].calibration


def test_a_channel_that_is_like_another_has_its_own_runs_and_plane():
    model = PROBE | {"plane": "12 mm", "for": [{"runs": ["p-1"], "axis": "1 deg"}]}
    copy = {"like": "X1A", "quantity": "displacement", "axis": "135 deg"}
    read = parsed(channels={"X1B": copy, "X1A": model})
    assert (read.channels["X1A"].plane, read.channels["X1B"].plane) == (0.012, 0.0)
    assert read.described["p-1"]["X1A"].axis == pytest.approx(np.radians(1.0))
    assert read.described["p-1"]["X1B"].axis == pytest.approx(np.radians(135.0))
