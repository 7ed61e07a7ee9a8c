"""Progress where there is no terminal: a line now and then, with the time left once it can be told."""

from __future__ import annotations

import pytest

from tests.command_line import tpjb
from tpjb_ident.cli.common import terminal as show


@pytest.fixture
def lines(monkeypatch):
    clock, said = [0.0], []
    monkeypatch.setattr(show.time, "monotonic", lambda: clock[0])
    monkeypatch.setattr(show, "note_line", lambda kind, text: said.append(text))
    told = show._Lines("identifying")

    def at(seconds: float, done: int, total: int) -> list[str]:
        clock[0] = seconds
        told("d-1", done, total)
        return said

    return at


def test_what_is_quickly_done_says_nothing(lines):
    for done in range(1, 20):
        assert lines(done, done, 20) == []


def test_time_left_is_told_from_the_speed_of_this_step(lines):
    lines(0.0, 0, 1000)
    assert lines(40.0, 100, 1000) == ["identifying: 100 of 1000, about 6 min left (d-1)"]
    lines(400.0, 0, 100)  # the next step
    assert lines(440.0, 80, 100)[-1] == "identifying: 80 of 100, about 10 s left (d-1)"


def test_the_first_of_many_foretells_nothing(lines):
    lines(0.0, 0, 334)
    assert lines(100.0, 1, 334) == ["identifying: 1 of 334 (d-1)"]


def test_what_the_first_one_had_to_compile_is_not_foretold_of_the_rest(lines):
    lines(0.0, 0, 14)
    assert lines(60.0, 1, 14) == ["identifying: 1 of 14 (d-1)"]
    assert lines(92.0, 5, 14)[-1] == "identifying: 5 of 14, about 1 min left (d-1)"


@pytest.mark.slow
def test_a_check_tells_how_many_runs_it_has_read(small_campaign, tmp_path, monkeypatch):
    monkeypatch.setattr(show, "LINE_EVERY", 0.0)
    result = tpjb("check", small_campaign, "--out", tmp_path / "out")
    assert result.exit_code == 0
    assert "tpjb: doing: reading small.h5: 9 of 10" in result.stderr
