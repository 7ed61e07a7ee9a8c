"""Fixtures that several folders of tests share."""

import functools
import gc
import os
import sys
from collections import Counter
from collections.abc import Callable, Iterator
from pathlib import Path

import hypothesis
import pytest

# how long an example takes says how busy the machine is, nothing about the code
hypothesis.settings.register_profile(
    "shared machine", deadline=None, suppress_health_check=[hypothesis.HealthCheck.too_slow]
)
hypothesis.settings.load_profile("shared machine")
ROOT = Path(__file__).resolve().parent.parent
STRUCTURE = "tests/structure/"
#: One worker has these: what needs the wheel would wait for the other one, which makes it.
TOGETHER = (STRUCTURE, "tests/browser/test_report")
# every worker, and every command that tests start, imports the same thousand modules, and pytest rewrites the
# assertions of each test file: who wants no bytecode beside the sources gets it kept in .venv
if sys.dont_write_bytecode and sys.pycache_prefix is None and (ROOT / ".venv").is_dir():
    sys.dont_write_bytecode, sys.pycache_prefix = False, str(ROOT / ".venv" / "bytecode")
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    os.environ["PYTHONPYCACHEPREFIX"] = sys.pycache_prefix


@pytest.hookimpl(wrapper=True)
def pytest_collection() -> Iterator[None]:
    """What is imported and collected lives to the end: the garbage collector need not walk it time and again."""
    gc.disable()
    try:
        return (yield)
    finally:
        gc.freeze()
        gc.enable()
        gc.set_threshold(50_000)  # tests leave little behind; the default walks it every 700 objects


@pytest.hookimpl(trylast=True)
def pytest_sessionfinish() -> None:
    """What is left in circles is looked through once, not three times: pytest does so again, in what came since."""
    gc.collect()
    gc.freeze()


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_make_scheduler(config: pytest.Config, log: object) -> object:
    """A file's tests stay on one worker; those of the structure all, which parse every source once between them."""
    if config.getvalue("dist") != "loadfile":
        return None
    from xdist.scheduler import LoadFileScheduling

    class ByFile(LoadFileScheduling):
        def _split_scope(self, nodeid: str) -> str:
            return STRUCTURE if nodeid.startswith(TOGETHER) else super()._split_scope(nodeid)

    config.option.loadscopereorder = False  # the order is that of the collection, see below
    return ByFile(config, log)


def pytest_collection_modifyitems(items: list[pytest.Item]) -> None:
    """Workers begin with the structure and files of many slow tests: at last, quick files let both end together."""
    if "PYTEST_XDIST_WORKER" not in os.environ:
        return
    slow = Counter(item.path for item in items if item.get_closest_marker("slow"))
    items.sort(key=lambda item: (not item.nodeid.startswith(TOGETHER), -slow[item.path]))


def pytest_runtest_setup(item: pytest.Item) -> None:
    """What asks the sample campaigns is left out where they do not lie beside the checkout."""
    if item.get_closest_marker("samples") and not (ROOT.parent / "shared").is_dir():
        pytest.skip("no ../shared beside this checkout")


@pytest.fixture(scope="session")
def checkout() -> Path:
    """Folder of the checkout."""
    return ROOT


@pytest.fixture(scope="session")
def rocker_file() -> Path:
    """Bearing file of the reference paper's rocker-backed bearing."""
    return ROOT / "model" / "bearings" / "rocker.toml"


@pytest.fixture(scope="session")
def session_folder(tmp_path_factory) -> Path:
    """Folder that all workers of a session share: what they need alike is written there by the first that asks."""
    base = tmp_path_factory.getbasetemp()
    return base.parent if "PYTEST_XDIST_WORKER" in os.environ else base


@pytest.fixture(scope="session")
def campaign_of(session_folder) -> Callable[..., Path]:
    """Gives the read-only campaign of a virtual rig, in a layout; computed once in a run (tests/good_campaigns.py)."""
    from tests.good_campaigns import shared_campaign

    return functools.partial(shared_campaign, session_folder)


@pytest.fixture(scope="session")
def small_campaign(campaign_of) -> Path:
    """HDF5 campaign of a linear bearing: two loads, three directions, three locus runs, one sweep, no dry tests."""
    from dataclasses import replace

    from rigdata.virtual_rig import ClearanceSweep, operating_points
    from tests.good_campaigns import SMALL_PLAN, rocker_rig

    plan = replace(
        SMALL_PLAN,
        dynamic=operating_points([(2500.0, 25.0), (5000.0, 25.0)]),
        dry=(),
        clearance=(ClearanceSweep(seconds=8.0),),
    )
    text = '=HYPERLINK("http://example.invalid")<script>alert(1)</script>'
    return campaign_of(rocker_rig(3, plan=plan, campaign="small <b>&", description=text), name="small")


@pytest.fixture(scope="session")
def identified(small_campaign, session_folder) -> Path:
    """What `tpjb identify` finds of the small campaign, in peace and with one worker; for tests that only read."""
    from tests.command_line import ended
    from tests.good_campaigns import once

    words = ("identify", small_campaign, "--workers", 1)
    return once(session_folder / "identified", lambda path: ended(0, *words, "--out", path))


@pytest.fixture(scope="session")
def located(small_campaign, session_folder) -> Path:
    """What `tpjb locus` finds of it; for tests that only read."""
    from tests.command_line import ended
    from tests.good_campaigns import once

    return once(session_folder / "located", lambda path: ended(0, "locus", small_campaign, "--out", path))


@pytest.fixture
def us() -> Iterator[None]:
    """Pounds and inches, and back."""
    from tpjb_ident.columns import use_units

    use_units("us")
    yield
    use_units("si")


@pytest.fixture(scope="module")
def desk(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A folder where the checkout's relative paths hold but nothing is written into the checkout."""
    folder = tmp_path_factory.mktemp("desk")
    for name in ("rigdata", "model"):
        (folder / name).symlink_to(ROOT / name, target_is_directory=True)
    return folder
