"""`tpjb init` beyond the first draft: columns without names, edited manifests, the bearing's draft."""

import numpy as np
import pytest

from model.bearing import BearingError
from model.bearing_file import load_bearing
from rigdata import RigDataError, load_campaign
from rigdata.manifest.manifest import parse_manifest
from tests.command_line import ended, tpjb
from tests.manifests import PROBE, SWEEP, manifest

TIME = np.arange(2000) / 1000.0


def record(path, names=("Time", "X1", "X2", "FH [N]", "FV [N]"), frequency=25.0):
    """Two probes in volts and two cells in newtons; the cells swing at a frequency."""
    swing = np.cos(2 * np.pi * frequency * TIME)
    columns = [TIME, 0.1 * swing, 0.2 * swing + 0.02 * np.sin(2 * np.pi * 22 * TIME), 300 * swing, 400 * swing - 5e3]
    rows = [";".join(f"{v:.6f}" for v in row) for row in np.stack(columns, axis=1)]
    head = [";".join(names)] if names else []
    path.write_text("\n".join([*head, *rows]) + "\n", encoding="utf-8")


@pytest.fixture
def folder(tmp_path):
    (tmp_path / "a").mkdir()
    return tmp_path / "a"


def drafted(folder, name, *names):
    """Manifest that `init` drafts of one record."""
    record(folder / name, *names)
    ended(0, "init", folder)
    return folder / "campaign.toml"


def edit(path, *pairs):
    text = path.read_text("utf-8")
    for old, new in pairs:
        assert old in text, old
        text = text.replace(old, new)
    path.write_text(text, "utf-8")


def test_columns_without_names_are_named_by_hand_and_guessed_anew(folder):
    manifest = drafted(folder, "test-5kN-1320rpm.csv", ())
    text = manifest.read_text("utf-8")
    assert 'names = ["column1", "column2", "column3", "column4", "column5"]' in text
    assert '[channels.column1]\nquantity = "time"' in text
    edit(manifest, ('"column1", "column2", "column3", "column4", "column5"', '"t", "X1", "X2", "FH", "FV"'))
    edit(manifest, ("[channels.column1]", "[channels.t]"))
    for number in (2, 3, 4, 5):
        start = manifest.read_text("utf-8").index(f"[channels.column{number}]")
        end = manifest.read_text("utf-8").index("[", start + 5)
        manifest.write_text(manifest.read_text("utf-8")[:start] + manifest.read_text("utf-8")[end:], "utf-8")
    ended(0, "init", folder, "--update")
    after = manifest.read_text("utf-8")
    assert '[channels.X1]\nquantity = "displacement"' in after
    assert '[channels.FV]\nquantity = "force"' in after
    assert (folder / "campaign.toml.bak").read_text("utf-8") != after
    edit(manifest, ('axis = "?? deg"', 'axis = "45 deg"'), ('"?? kg"', '"30 kg"'), ('unit = "??"', 'unit = "V"'),
         ('sensitivity = "??"   # such as "7.78', 'sensitivity = "8 V/mm"   # such as "7.78'),
         ('sensitivity = "??"', 'sensitivity = "1 V/N"'))  # fmt: skip
    assert load_campaign(folder).runs[0].record("X1").rate == pytest.approx(1000.0)


def test_a_channel_that_was_given_its_quantity_gets_the_entries_that_it_lacks(folder):
    manifest = drafted(folder, "test-5kN.csv", ("Time", "Dev1_ai0", "Dev1_ai1", "FH [N]", "FV [N]"))
    why = 'quantity = "??"   # name and unit are not known: displacement, force, .. or ignore'
    edit(manifest, (why, 'quantity = "displacement"'), ('quantity = "??"', 'quantity = "displacement"'))
    result = tpjb("init", folder, "--update")
    assert "channel Dev1_ai0: axis '?? deg' added" in result.stdout
    text = manifest.read_text("utf-8")
    assert '[channels.Dev1_ai0]\nquantity = "displacement"\naxis = "?? deg"' in text
    assert 'like = "Dev1_ai0"' in text
    assert "nothing to change" in tpjb("init", folder, "--update").stdout


def test_axes_by_a_name_stay_guesses_until_they_are_confirmed(folder):
    """LC_H is a hint, and what is concluded from such cells no better than it, also when a draft is carried on."""
    manifest = drafted(folder, "d-5kN-25Hz.csv", ("Time", "Probe 45", "Probe 135", "LC_H [mV]", "LC_V [mV]"))
    guesses = ('axis = "0 deg"   # (guess) its name', 'axis = "90 deg"   # (guess) its name', "if their axes hold")
    text = manifest.read_text("utf-8")
    assert all(guess in text for guess in guesses)
    assert "its name hints at 45 deg" in text
    assert "its name hints at 135 deg" in text
    edit(manifest, ('sensitivity = "??"   # such as "1 mV/N"', 'sensitivity = "1 mV/N"   # "1 mV/N"'))
    assert tpjb("init", folder, "--update").exit_code == 0
    text = manifest.read_text("utf-8")
    assert all(guess in text for guess in guesses)
    edit(manifest, ("   # (guess) its name\nunit", "\nunit"), ('"90 deg"   # (guess) its name', '"90 deg"'))
    result = tpjb("init", folder, "--update")
    assert "if their axes hold" not in manifest.read_text("utf-8"), result.stdout


def test_what_was_changed_by_hand_stays_and_new_records_become_runs(folder):
    manifest = drafted(folder, "dyn-5kN-25Hz.csv")
    load = 'static_load = "5 kN"'  # read from the file's name: no mark
    edit(manifest, (load, 'static_load = "4.9 kN"'),
         ('mass = "?? kg"   # stator mass between oil film and load cells', 'mass = "31 kg"  # weighed'))  # fmt: skip
    record(folder / "dyn-5kN-30Hz.csv", frequency=30.0)
    result = tpjb("init", folder, "--update")
    text = manifest.read_text("utf-8")
    assert "run dyn-5kN-30Hz.csv: new" in result.stdout
    assert 'mass = "31 kg"  # weighed' in text
    assert text.count('static_load = "4.9 kN"') == 1
    assert 'excitation_frequency = "30 Hz"' in text


def test_filling_in_a_unit_leaves_what_is_like_it_and_a_valid_manifest_valid(folder):
    manifest = drafted(folder, "dyn-5kN-1320rpm.csv", ("Time", "Prox A", "Prox B", "FH [N]", "FV [N]"))
    edit(manifest, ('"?? kg"', '"30 kg"'), ('unit = "??"', 'unit = "um"'), ('sensitivity = "??"', "# typed"))
    text = manifest.read_text("utf-8").replace('axis = "?? deg"', 'axis = "45 deg"', 1)
    manifest.write_text(text.replace('axis = "?? deg"', 'axis = "135 deg"   # by the drawing'), "utf-8")
    assert len(load_campaign(folder).runs) == 1
    result = ended(0, "init", folder, "--update")
    assert "; no place is open; bearing.toml: 12 places open (??)." in " ".join(result.stdout.split())
    after = manifest.read_text("utf-8")
    assert 'like = "Prox A"' in after
    assert 'axis = "135 deg"   # by the drawing' in after
    assert "# typed" in after
    assert load_campaign(folder).runs[0].channels["Prox B"].unit == "um"


def test_a_sensitivity_that_a_unit_makes_needless_is_open_no_more(folder):
    manifest = drafted(folder, "dyn-5kN-1320rpm.csv", ("Time", "Prox A", "Temp 1", "FH [N]", "FV [N]"))
    start = manifest.read_text("utf-8").index('[channels."Temp 1"]')
    head, tail = manifest.read_text("utf-8")[:start], manifest.read_text("utf-8")[start:]
    assert 'sensitivity = "??"' in tail.partition("[[")[0]
    manifest.write_text(head + tail.replace('unit = "??"', 'unit = "degC"', 1), "utf-8")
    result = ended(0, "init", folder, "--update")
    assert "channel Temp 1: sensitivity is not needed" in result.stdout
    assert "sensitivity" not in manifest.read_text("utf-8").partition('[channels."Temp 1"]')[2].partition("[")[0]


def test_files_of_two_devices_are_said_to_be_halves_of_runs(folder):
    record(folder / "d-5kN_daq1.csv")
    assert "no channel is in all files" not in tpjb("init", folder, "--out", folder.parent / "one").stderr
    record(folder / "d-5kN_daq2.csv", ("Time", "A1", "A2", "A3", "A4"))
    assert "join the two of a run in one first" in " ".join(tpjb("init", folder).stderr.split())


def test_open_places_are_one_line_and_the_last_one_the_next_command(folder):
    record(folder / "dyn-5kN-1320rpm.csv", ("Time", "Prox A", "Prox B", "FH [N]", "FV [N]"))
    first, *_, last = tpjb("init", folder).stdout.strip().splitlines()
    assert "2 axis" in first
    assert "1 mass" in first
    assert last == f"Next: tpjb init {folder} --update"
    assert "; bearing.toml: 12 places open (??)." in first
    result = ended(2, "check", folder, "--out", folder.parent / "out")
    assert sum("open (??)" in line for line in result.stdout.splitlines()) == 1
    assert "0 errors" not in result.stdout


def test_update_without_a_manifest_says_so(folder):
    record(folder / "a.csv")
    result = ended(2, "init", folder, "--update")
    assert "nothing to carry on" in result.stderr


def test_the_draft_of_the_bearing_explains_every_entry_and_is_refused_by_name_until_it_is_filled_in(folder):
    draft = drafted(folder, "a.csv").with_name("bearing.toml")
    with pytest.raises(BearingError, match=r"bearing\.toml.*diameter"):
        load_bearing(draft)
    values = {"diameter": "100", "length": "70", "assembled_clearance": "0.08", "pad_clearance": "0.13",
              "thickness": "16", "arc": "60", "mass": "0.5", "moment_of_inertia": "2e-4", "viscosity_40C": "0.04",
              "viscosity_exponent": "0.03"}  # fmt: skip
    for key, value in values.items():
        edit(draft, (f'{key} = "??', f'{key} = "{value}'))
    edit(draft, ('["?? deg"]', '["-90 deg", "0 deg", "90 deg", "180 deg"]'), ('kind = "??"', 'kind = "rigid"'))
    assert len(load_bearing(draft).pads) == 4


def test_the_pads_angles_are_drafted_where_dry_steps_tell_them(folder):
    steps = np.floor(4 * TIME) * 500.0
    for pad, angle in ((1, -90.0), (2, 0.0), (3, 90.0), (4, 180.0)):
        x, y = np.cos(np.radians(angle)), np.sin(np.radians(angle))
        rows = [f"{t:.4f};{0.001 * s * x:.5f};{0.001 * s * y:.5f};{s * x:.2f};{s * y:.2f}" for t, s in zip(TIME, steps)]
        (folder / f"pad{pad}-steps.csv").write_text("\n".join(["Time;X1;X2;FH [N];FV [N]", *rows]), "utf-8")
    tpjb("init", folder)
    assert 'pivot_angles = ["-90 deg", "0 deg", "90 deg", "180 deg"]' in (folder / "bearing.toml").read_text("utf-8")


ALIKE = {
    "A": PROBE | {"axis": "45 deg", "unit": "V", "sensitivity": "8 V/mm", "polarity": -1},
    "B": {"like": "A", "axis": "135 deg"},
}
MANIFEST = manifest(ALIKE, SWEEP)


def test_a_sensor_that_is_like_another_has_its_calibration_and_its_own_place():
    a, b = parse_manifest(MANIFEST, "campaign.toml").channels.values()
    assert (b.quantity, b.gain, b.polarity, b.unit) == (a.quantity, a.gain, -1, "V")
    assert np.degrees(b.axis) == pytest.approx(135.0)


def test_what_a_sensor_is_like_must_be_described_in_full():
    with pytest.raises(RigDataError, match=r"like.*no channel that is described in full.*Known: A"):
        parse_manifest(MANIFEST.replace('like = "A"', 'like = "AA"'), "campaign.toml")
    with pytest.raises(RigDataError, match="described in full"):
        parse_manifest(MANIFEST.replace('like = "A"', 'like = "B"'), "campaign.toml")
    with pytest.raises(RigDataError) as one:  # a fault of the model is told once
        parse_manifest(MANIFEST.replace("8 V/mm", "??"), "campaign.toml")
    assert len(one.value.problems) == 1
