"""When a record counts as written."""

import os

import pytest

from tpjb_ident.watch.landing import NewFiles

DAY = 1_000_000.0
#: Age [s] and text of a file, then looks at it: how much later [s], by how much the clock of the day has jumped since,
#: what the file holds by then, whether it counts as written; files settle for 5 s.
LANDINGS = {
    "nobody has changed it for a while": (0, "1", [(0, 0, "1", False), (4.9, 0, "1", False), (0.2, 0, "1", True)]),
    "it grows and is waited for from its last change on": (
        0, "1", [(0, 0, "1", False), (4, 0, "12", False), (4, 0, "12", False), (1.1, 0, "12", True)],
    ),
    "finished long ago": (3600, "1", [(0, 0, "1", True)]),
    "only opened": (3600, "", [(0, 0, "", False)]),
    "a clock that is ahead on the share": (-3600, "1", [(0, 0, "1", False), (5.1, 0, "1", True)]),
    "being written under a clock that jumps": (
        0, "x", [(0, 0, "x", False), (2, 3600, "xx", False), (2, -86400, "xxx", False), (2, 5, "xxxx", False),
                 (2, 0, "xxxx", False), (2, 0, "xxxx", False), (2, 0, "xxxx", True)],
    ),
}  # fmt: skip


@pytest.mark.parametrize("name", LANDINGS)
def test_a_file_counts_as_written_once_it_has_settled(tmp_path, name):
    age, held, looks = LANDINGS[name]
    now = {"day": DAY, "steady": 0.0}
    watch = NewFiles(5.0, lambda: now["day"], lambda: now["steady"])
    path = tmp_path / "a.csv"
    path.write_text(held)
    os.utime(path, (DAY - age,) * 2)
    for later, jump, text, landed in looks:
        now["steady"] += later
        now["day"] += later + jump
        if text != held:
            held = text
            path.write_text(text)
            os.utime(path, (now["day"],) * 2)
        whole, waiting = watch.look([path])
        assert (list(whole), waiting) == (([path], []) if landed else ([], [path]))


def test_no_file_and_a_folder_of_its_name_are_neither(tmp_path):
    (tmp_path / "folder.csv").mkdir()
    watch = NewFiles(5.0, lambda: DAY, lambda: 0.0)
    assert watch.look([tmp_path / "none.csv", tmp_path / "folder.csv"]) == ({}, [])
