"""The commands as a user calls them: results, messages, exit codes."""

import csv
import hashlib
import json
import os
import re
import shlex
import shutil
from collections import Counter

import h5py
import numpy as np
import pandas as pd
import pytest

from model.growth import Growth
from model.options import Options
from rigdata.campaign import load_campaign
from tests.command_line import ended, tpjb
from tpjb_ident.cli.commands.app import app
from tpjb_ident.cli.commands.predict import parse_physics
from tpjb_ident.diagnosis import plan as planning
from tpjb_ident.runtime import executors


def test_help_lists_every_command():
    result = ended(0, "--help")
    listed = [line.split()[0] for line in result.stdout.partition("Commands:")[2].splitlines() if line.strip()]
    assert {command.name for command in app.registered_commands} <= set(listed)


def test_version():
    assert tpjb("--version").stdout.startswith("tpjb-ident 0.")


@pytest.mark.slow
def test_check_writes_its_findings(small_campaign, tmp_path):
    ended(0, "check", small_campaign, "--out", tmp_path / "out")
    found = json.loads((tmp_path / "out" / "check.json").read_text(encoding="utf-8"))
    assert found["ok"] is True
    assert found["runs"] == {"dynamic": 6, "dry_pivot": 0, "locus": 3, "clearance": 1, "baseline": 0}
    assert found["counts"]["error"] == 0


@pytest.mark.slow
def test_check_lists_every_error_and_exits_2(small_campaign, tmp_path):
    broken = tmp_path / "broken.h5"
    shutil.copy(small_campaign, broken)
    with h5py.File(broken, "r+") as file:
        del file["runs/d-02500-25-01/X1A"]
        del file["runs/d-05000-25-02/L1H"]
        file.attrs["bearing"] = file.attrs["bearing"].replace("\nlength", "\nlenght", 1)
    result = ended(2, "check", broken, "--out", tmp_path / "out")
    problems = json.loads((tmp_path / "out" / "check.json").read_text(encoding="utf-8"))["problems"]
    errors = {(p["run"], p["severity"]) for p in problems}
    assert {("d-02500-25-01", "error"), ("d-05000-25-02", "error")} <= errors
    assert "X1A" in result.stdout
    assert "L1H" in result.stdout
    assert "lenght: unknown key. Did you mean 'length'? Or give --bearing" in " ".join(result.stdout.split())
    assert result.stdout.strip().splitlines()[-1] == f"Next: tpjb show {broken}"


def test_identify_finds_what_was_put_in(identified):
    frame = pd.read_csv(identified / "coefficients.csv")
    assert frame["static_load_N"].tolist() == [2500.0, 5000.0]
    assert np.allclose(frame["kxx_N_per_m"], 1.0e8, rtol=0.01)
    assert np.allclose(frame["cyy_Ns_per_m"], 7e5, rtol=0.01)
    assert (frame["kyy_N_per_m_lo"] < 2.0e8).all()
    assert (frame["kyy_N_per_m_hi"] > 2.0e8).all()
    parquet = pd.read_parquet(identified / "coefficients.parquet")
    assert parquet["kxx_N_per_m"].tolist() == pytest.approx(
        frame["kxx_N_per_m"].tolist(), rel=1e-15
    )  # old pandas: last bit
    assert "rlm:huber" in set(pd.read_csv(identified / "estimators.csv")["method"])


def test_identify_leaves_a_record_of_what_it_did(identified, small_campaign):
    entry = json.loads((identified / "run.json").read_text(encoding="utf-8"))["commands"]["identify"]
    assert entry["settings"]["method"] == "mm-eiv"
    assert hashlib.sha256(small_campaign.read_bytes()).hexdigest() in entry["inputs_sha256"].values()
    tables = ("coefficients", "estimators", "windows", "frequency_fits", "budget")
    assert set(entry["outputs"]) == {f"{table}.{end}" for table in tables for end in ("csv", "parquet")}


def test_one_direction_is_no_answer_and_exits_3(small_campaign, tmp_path):
    narrow = tmp_path / "narrow.h5"
    shutil.copy(small_campaign, narrow)
    with h5py.File(narrow, "r+") as file:
        head, *runs = file.attrs["manifest"].split("[[runs]]")
        kept = [r for r in runs if 'kind = "dynamic"' in r and 'excitation_direction = "0 deg"' in r]
        assert len(kept) == 2
        file.attrs["manifest"] = "[[runs]]".join([head, *kept])
    result = ended(3, "identify", narrow, "--out", tmp_path / "out")
    assert "not to be trusted" in result.stderr
    assert (tmp_path / "out" / "coefficients.csv").exists()
    assert result.stdout.splitlines()[-1] == shlex.join(["Next:", "tpjb", "check", str(narrow)])  # the records first


@pytest.mark.slow
def test_locus_and_clearance(located):
    clearance = pd.read_csv(located / "clearance.csv")
    assert clearance["clearance_pushed_m"].notna().all()
    assert (clearance["clearance_m"] - 80e-6).abs().max() < 2e-6
    assert len(pd.read_csv(located / "locus.csv")) == 3


def test_predict_every_combination(rocker_file, tmp_path):
    ended(0, "predict", rocker_file, "--load", "2.5, 5 kN", "--excitation", "20, 25 Hz", "--pivots", "6e8 N/m",
                  "--thermal", "isothermal", "--out", tmp_path / "out")  # fmt: skip
    frame = pd.read_csv(tmp_path / "out" / "prediction.csv")
    assert list(zip(frame["static_load_N"], frame["excitation_Hz"], strict=True)) == [
        (2500.0, 20.0), (2500.0, 25.0), (5000.0, 20.0), (5000.0, 25.0)
    ]  # fmt: skip
    # what each pad deflects is its load over the spring that was asked for
    assert np.allclose(frame["pad1_deflection_m"], frame["pad1_load_N"] / 6e8, rtol=1e-6)
    assert frame["converged"].all()


@pytest.mark.parametrize("command", ["predict", "simulate", "compare", "diagnose"])
def test_an_effect_that_the_bearing_cannot_have_is_refused_with_its_file(
    command, rocker_file, small_campaign, tmp_path
):
    effects = tmp_path / "nine.toml"
    effects.write_text('schema = "tpjb-effects/1"\n[[effects]]\nname = "soft_pivot"\npad = 9\nstiffness_factor = 0.3\n')
    source = (rocker_file,) if command in ("predict", "simulate") else (small_campaign, "--bearing", rocker_file)
    result = ended(2, command, *source, "--effects", effects, "--out", tmp_path / "o")
    assert "--effects nine.toml: soft_pivot: pad 9 does not exist; the bearing has 5 pads." in result.stderr
    assert not (tmp_path / "o").exists()


def test_predict_takes_an_effects_file(rocker_file, tmp_path):
    effects = tmp_path / "e.toml"
    effects.write_text('[[effects]]\nname = "probe_gain"\nfactor = 1.25\n')
    for name, more in (("a", ()), ("b", ("--effects", effects))):
        ended(0, "predict", rocker_file, "--thermal", "isothermal", *more, "--out", tmp_path / name)
    a, b = (pd.read_csv(tmp_path / name / "prediction.csv")["kyy_N_per_m"][0] for name in "ab")
    assert b == pytest.approx(a / 1.25, rel=1e-9)


COMPARE = ("--pivots", "rigid, kirk, measured", "--thermal", "isothermal")


@pytest.fixture(scope="module")
def compared(small_campaign, tmp_path_factory):
    out = tmp_path_factory.mktemp("compare") / "out"
    return tpjb("compare", small_campaign, *COMPARE, "--out", out, cores=2, sharp=True), out


@pytest.mark.slow
def test_compare_writes_a_report(compared):
    result, out = compared
    assert result.exit_code == 0, result.output
    frame = pd.read_csv(out / "comparison.csv")
    assert frame.groupby("pivots").size().to_dict() == {"kirk": 2, "rigid": 2}
    ratio = frame["kxx_N_per_m_predicted"] / frame["kxx_N_per_m"]
    assert np.allclose(frame["kxx_N_per_m_ratio"], ratio)
    assert "Measured pivots are left out" in result.stdout
    assert (out / "report.html").exists()
    assert (out / "figures" / "kxx-over-load.svg").exists()
    assert (out / "figures" / "kxx-over-load.png").stat().st_size > 5000


@pytest.mark.slow
def test_compare_writes_the_same_where_the_background_job_is_lost(compared, small_campaign, tmp_path, monkeypatch):
    def written(folder):
        return sorted(f.relative_to(folder) for f in folder.rglob("*") if f.is_file())

    monkeypatch.setattr(executors, "_received_value", lambda receiver: None)
    result = tpjb("compare", small_campaign, *COMPARE, "--out", tmp_path / "lost", cores=2)
    assert result.exit_code == 0, result.output
    assert written(tmp_path / "lost") == written(compared[1])
    for name in (name for name in written(compared[1]) if name.suffix in (".csv", ".parquet")):
        read = pd.read_csv if name.suffix == ".csv" else pd.read_parquet
        # to rounding: where arrays lie in a process's memory decides the order of a library's sums
        pd.testing.assert_frame_equal(read(tmp_path / "lost" / name), read(compared[1] / name), rtol=1e-9)


@pytest.mark.slow
def test_a_campaign_that_is_not_to_be_trusted_leads_with_that(small_campaign, tmp_path):
    turned = shutil.copy(small_campaign, tmp_path / "turned.h5")
    with h5py.File(turned, "r+") as file:
        for name in (name for name in file["runs"] if name.startswith("d-")):
            file[f"runs/{name}/X1A"][...] *= -1.0
    result = ended(3, "compare", turned, *COMPARE, "--out", tmp_path / "out")
    page = (tmp_path / "out" / "report.html").read_text(encoding="utf-8")
    lead = "NOT to be trusted: 2 of 2 points (negative-damping, "
    assert result.stdout.startswith(lead)
    assert f'<p class="first">{lead}' in page
    following = f"tpjb check {turned}"
    assert result.stdout.splitlines()[-1] == f"Next: {following}"
    assert f"Next: <code>{following}</code>" in page
    (name,) = re.findall(
        r"with .*? pivots.*? (?:in|measured) ([kc][xy]{2}) \(median\)", " ".join(result.stdout.split())
    )
    assert f'<figure id="{name}-over-load"' in page.partition("<nav")[0]
    assert f'<a href="#{name}-over-load">' in page


@pytest.mark.parametrize("form", ["ross", "csv", "mat"])
def test_export_from_results(identified, tmp_path, form):
    ended(0, "export", identified, "--to", form, "--out", tmp_path / "out")
    assert len(list((tmp_path / "out").iterdir())) >= 2


@pytest.mark.slow
def test_simulate_tests_every_pad_at_the_speed_and_load_asked_for(rocker_file, tmp_path):
    text = rocker_file.read_text(encoding="utf-8")
    angles = 'pivot_angles = ["-135 deg", "-45 deg", "45 deg", "135 deg"]'
    four = tmp_path / "four.toml"
    four.write_text(
        re.sub("pivot_angles = .*", angles, text).replace('arc = "60 deg"', 'arc = "72 deg"'), encoding="utf-8"
    )
    words = ("--plan", "short", "--speed", "3000 rpm", "--load", "20 kN", "--thermal", "isothermal", "--seed", "5")
    ended(0, "simulate", four, *words, "-q", "--out", tmp_path / "o")
    campaign = load_campaign(tmp_path / "o" / "campaign.h5")
    kinds = Counter(run.kind for run in campaign.runs)
    assert kinds["dry_pivot"] == 4
    turning = {round(run.point.shaft_speed_hz, 9) for run in campaign.runs if run.kind in ("dynamic", "locus")}
    assert turning == {50.0}
    assert json.loads((tmp_path / "o" / "truth.json").read_text())["seed"] == 5
    assert tpjb("check", tmp_path / "o", "--out", tmp_path / "c").exit_code == 0  # no cell at its limit
    again = ended(0, "simulate", four, *words[:-2], "--seed", "6", "-q", "--out", tmp_path / "o")
    assert "the campaign that is there is replaced" in again.stderr


BAD = [
    (("check", "nowhere.h5"), "no such file or folder"),
    (("identify", "nowhere.h5"), "no such file or folder"),
    (("identify", "{campaign}", "--method", "mm-eif"), "Did you mean 'mm-eiv'"),
    (("identify", "{campaign}", "--delay", "forces=1 ms"), "Did you mean 'force'"),
    (("identify", "{campaign}", "--delay", "force=1 mm"), "--delay force: unit 'mm'"),
    (("identify", "{campaign}", "--lines", "25"), "--lines"),
    (("identify", "{campaign}", "--workers", "2", "--scheduler", "tcp://127.0.0.1:9"), "exclude each other"),
    (("identify", "{campaign}", "--norm", "huber"), "belongs to --method rlm"),
    (("identify", "{campaign}", "--method", "rlm", "--norm", "hubr"), "Did you mean 'huber'"),
    (("pivot", "{campaign}"), "dry"),
    (("predict", "nowhere.toml"), "no such file"),
    (("predict", "{bearing}", "--pivots", "krik"), "Did you mean 'kirk'"),
    (("predict", "{bearing}", "--pivots", "-5 N/m"), "--pivots"),
    (("predict", "{bearing}", "--thermal", "adiabatc"), "Did you mean 'adiabatic'"),
    (("predict", "{bearing}", "--load", "-5 kN"), "must be positive"),
    (("predict", "{bearing}", "--speed", "0 Hz"), "must be positive"),
    (("predict", "{bearing}", "--excitation", "1e9 Hz"), "excitation must be"),
    (("predict", "{bearing}", "--speed", "1e300 Hz"), "excitation must be"),
    (("predict", "{bearing}", "--load", "1..9:0.001 kN", "--speed", "1..90:0.1 Hz"), "operating points"),
    (("predict", "{bearing}", "--effects", "nowhere.toml"), "no such file"),
    (("predict", "{bearing}", "--physics", "conducton"), "Did you mean 'conduction'"),
    (("predict", "{bearing}", "--physics", "zzz"), "Use one of conduction"),
    (("predict", "{bearing}", "--housing-temperature", "48 degC"), "without growth"),
    (("predict", "{bearing}", "--physics", "growth", "--housing-temperature", "48 bar"), "housing-temperature"),
    (("predict", "{bearing}", "--physics", "growth", "--housing-temperature", "900 degC"), "between -50 and 300"),
    (("compare", "{campaign}", "--pivots", "kirck"), "Did you mean 'kirk'"),
    (("diagnose", "{campaign}", "--tolerance", "viscosity=4"), "50 % and more"),
    (("diagnose", "{campaign}", "--tolerance", "viscosity=400 %"), "50 % and more"),
    (("diagnose", "{campaign}", "--model-tolerance", "1.5"), "50 % and more"),
    (("diagnose", "{campaign}", "--model-tolerance", "1,5 %"), "write a decimal point"),
    (("diagnose", "{campaign}", "--model-tolerance", "1.5 %", "--pivots", "krik"), "Did you mean 'kirk'"),
    (("compare", "{campaign}", "--bearing", "nowhere.toml"), "no such file"),
    (("plan", "{bearing}", "--load", "abc"), "not a number with a unit"),
    (("simulate", "{bearing}", "--plan", "long"), "is not known"),
    (("simulate", "{bearing}", "--fault", "dead chanel=X1A"), "Did you mean 'channel'"),
    (("simulate", "{bearing}", "--fault", "dead channel=X9"), "no channel matches"),
    (("simulate", "{bearing}", "--fault", "glitch channel=X1A value=big"), "not a number"),
    (("simulate", "{bearing}", "--format", "xlsx"), "xlsx"),
    (("export", "{campaign}", "--to", "exel"), "is not known"),
    (("export", "nowhere", "--to", "csv"), "no such file"),
]


@pytest.mark.parametrize(("arguments", "says"), BAD, ids=[" ".join(a)[:60] for a, _ in BAD])
def test_bad_input_is_one_message_and_exit_2(arguments, says, small_campaign, rocker_file, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    before = small_campaign.read_bytes()
    filled = [a.format(campaign=small_campaign, bearing=rocker_file) for a in arguments]
    result = ended(2, *filled, "--out", tmp_path / "out")
    assert says in result.stderr
    assert "Traceback" not in result.output
    assert list(tmp_path.iterdir()) == []
    assert small_campaign.read_bytes() == before


@pytest.mark.skipif(not hasattr(os, "mkfifo"), reason="no pipes in the file system")
@pytest.mark.parametrize("command", ["identify", "check", "predict", "simulate", "export"])
def test_a_pipe_is_refused_not_waited_for(command, tmp_path):
    pipe = tmp_path / "pipe.h5"
    os.mkfifo(pipe)
    extra = ("--to", "csv") if command == "export" else ()
    result = ended(2, command, pipe, *extra, "--out", tmp_path / "out")
    assert "a pipe" in result.stderr


#: A part of the library, so that a plan takes seconds; `ti.plan` asks all of it (tests/structure/test_examples.py).
PLANNED = {"oil_viscosity", "supply_temperature", "thermal_growth", "pivot_flexibility", "probe_gain", "loadcell_gain"}


@pytest.mark.slow
def test_plan_tells_floor_and_look_alikes_of_a_thin_campaign(rocker_file, tmp_path, monkeypatch):
    everything = planning.candidates
    monkeypatch.setattr(planning, "candidates", lambda setup: [c for c in everything(setup) if c.name in PLANNED])
    result = ended(
        0, "plan", rocker_file, "--load", "5 kN", "--excitation", "25 Hz", "--locus", 0, "--no-dry", "--push", 0,
        "--no-temperatures", "--data-sets", "--out", tmp_path / "out",
    )  # fmt: skip
    first, *_, last = result.stdout.strip().splitlines()
    assert "would be seen" in first
    assert last.startswith("Next: tpjb ")
    assert str(rocker_file) in last
    data = json.loads((tmp_path / "out" / "plan.json").read_text(encoding="utf-8"))
    assert data["schema"] == "tpjb-plan/1"
    assert ["oil_viscosity", "supply_temperature"] in data["confusable"]
    assert {"effect", "parameter", "unit", "seen_from", "mistaken_for"} <= set(data["effects"][0])
    with (tmp_path / "out" / "isolability.csv").open(encoding="utf-8", newline="") as file:
        rows = list(csv.reader(file))
    assert rows[0][1:] == [row[0] for row in rows[1:]]
    with (tmp_path / "out" / "data_sets.csv").open(encoding="utf-8", newline="") as file:
        sets = list(csv.DictReader(file))
    assert [row["data_set"] for row in sets] == list("ABCDE")
    for name in ("isolability", *(f"isolability_{x}" for x in "ABCDE")):
        assert (tmp_path / "out" / f"{name}.parquet").exists()
        assert (tmp_path / "out" / "figures" / f"{name.replace('_', '-')}.svg").exists()
    numbers = [int(row["numbers"]) for row in sets]
    assert numbers == [4, 8, 8, 8, 16]  # two direct coefficients of K and C; all of h; nothing static; a second speed
    assert int(sets[4]["detectable_nuisances_free"]) >= int(sets[0]["detectable_nuisances_free"])
    assert int(sets[0]["detectable_nuisances_free"]) <= int(sets[0]["detectable_nuisances_known"])


def test_physics_by_names_and_the_papers_model_without_a_word():
    assert parse_physics(None, None) == Options()
    found = parse_physics("conduction, journal,growth", "48 degC")
    assert found == Options(conduction=True, isothermal_journal=True, growth=Growth(housing=48.0))
