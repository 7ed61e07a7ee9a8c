"""Trials whose rows are kept: what is done is not done again, what is torn is."""

import json
from dataclasses import asdict

from tests.studies.diagnosis.kept_trials import kept_trials
from tests.studies.diagnosis.trials import Trial
from tpjb_ident.runtime.workers import open_workers

TRIALS = [Trial("none", number=k) for k in range(3)]


def row_of(shared, trial):
    return {**asdict(trial), "verdict": "consistent", "labels": (), "shared": shared}


def made(trials, file=None):
    told = []
    with open_workers(1, None, ()) as team:
        rows = kept_trials(team, row_of, trials, "bench", file, told.append)
    return rows, [row["number"] for row in told]


def test_rows_are_the_same_kept_or_not(tmp_path):
    assert made(TRIALS)[0] == made(TRIALS, tmp_path / "rows.jsonl")[0]
    assert made(TRIALS)[0][0]["labels"] == ()


def test_an_evaluation_that_was_killed_goes_on_where_it_stopped(tmp_path):
    file = tmp_path / "rows.jsonl"
    made(TRIALS[:2], file)
    with file.open("a", encoding="utf-8") as out:
        out.write('{"code": "')
    rows, numbers = made([*TRIALS, Trial("none", number=3)], file)
    assert numbers == [2, 3]
    assert [row["number"] for row in rows] == [0, 1, 2, 3]
    assert made(TRIALS, file)[1] == []


def test_rows_of_other_code_are_made_again(tmp_path):
    file = tmp_path / "rows.jsonl"
    made(TRIALS, file)
    lines = [json.loads(line) for line in file.read_text(encoding="utf-8").splitlines()]
    file.write_text("".join(json.dumps({**line, "code": "old"}) + "\n" for line in lines), encoding="utf-8")
    assert made(TRIALS, file)[1] == [0, 1, 2]
