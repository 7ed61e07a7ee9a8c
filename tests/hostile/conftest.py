"""What several tests of disturbed commands hold their results against."""

import json

import pytest


@pytest.fixture(scope="session")
def undisturbed(identified) -> dict[str, str]:
    """SHA-256 of each table that `identify` writes of the small campaign, with one worker and in peace."""
    return json.loads((identified / "run.json").read_text())["commands"]["identify"]["outputs_sha256"]
