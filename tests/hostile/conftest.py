"""What several tests of disturbed commands hold their results against."""

import json

import pytest

from tests.command_line import tpjb
from tests.good_campaigns import once


@pytest.fixture(scope="session")
def undisturbed(small_campaign, session_folder) -> dict[str, str]:
    """SHA-256 of each table that `identify` writes of the small campaign, with one worker and in peace."""
    folder = session_folder / "identified"
    once(folder, lambda path: tpjb("identify", small_campaign, "--workers", 1, "--out", path))
    return json.loads((folder / "run.json").read_text())["commands"]["identify"]["outputs_sha256"]
