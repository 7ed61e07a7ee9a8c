"""When a record counts as written."""

from __future__ import annotations

import os

import pytest

from tpjb_ident.watch.landing import NewFiles


class Clock:
    def __init__(self, now: float) -> None:
        self.now = now

    def __call__(self) -> float:
        return self.now


def landings(settle: float = 5.0) -> tuple[NewFiles, Clock]:
    clock = Clock(1_000_000.0)
    return NewFiles(settle, clock, clock), clock


def touched(path, text: str, at: float):
    path.write_text(text)
    os.utime(path, (at, at))
    return path


def test_a_file_is_written_when_nobody_has_changed_it_for_a_while(tmp_path):
    watch, clock = landings()
    path = touched(tmp_path / "a.csv", "1", clock.now)
    assert watch.look([path]) == ({}, [path])
    clock.now += 4.9
    assert watch.look([path]) == ({}, [path])
    clock.now += 0.2
    assert list(watch.look([path])[0]) == [path]


def test_one_that_grows_is_waited_for_from_its_last_change_on(tmp_path):
    watch, clock = landings()
    path = touched(tmp_path / "a.csv", "1", clock.now)
    watch.look([path])
    clock.now += 4.0
    touched(path, "12", clock.now)
    assert watch.look([path])[1] == [path]
    clock.now += 4.0
    assert watch.look([path])[1] == [path]
    clock.now += 1.1
    assert list(watch.look([path])[0]) == [path]


@pytest.mark.parametrize(("text", "landed"), [("1", True), ("", False)], ids=["finished long ago", "only opened"])
def test_an_old_file_is_not_waited_for_unless_it_is_empty(tmp_path, text, landed):
    watch, clock = landings()
    path = touched(tmp_path / "a.csv", text, clock.now - 3600.0)
    whole, waiting = watch.look([path])
    assert (list(whole), waiting) == (([path], []) if landed else ([], [path]))


def test_a_clock_that_is_ahead_on_the_share_makes_nobody_wait_for_ever(tmp_path):
    watch, clock = landings()
    path = touched(tmp_path / "a.csv", "1", clock.now + 3600.0)
    assert watch.look([path])[1] == [path]
    clock.now += 5.1
    assert list(watch.look([path])[0]) == [path]


def test_no_file_and_a_folder_of_its_name_are_neither(tmp_path):
    watch, _ = landings()
    (tmp_path / "folder.csv").mkdir()
    assert watch.look([tmp_path / "none.csv", tmp_path / "folder.csv"]) == ({}, [])
