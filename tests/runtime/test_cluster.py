"""The same campaign on a Dask cluster: the same bits, even if a worker is killed half-way."""

import os
import signal
import subprocess
import sys
import time
from pathlib import Path

import pytest

from rigdata.campaign import load_campaign
from tests.command_line import ended, tpjb
from tests.good_campaigns import written
from tests.identification.test_identify import rig
from tests.runtime.test_executors import dies_once
from tpjb_ident.cli.commands.identify import KEPT
from tpjb_ident.identification.identify import identify
from tpjb_ident.identification.settings import IdentifySettings
from tpjb_ident.runs.run_jobs import RunStore
from tpjb_ident.runtime import executors
from tpjb_ident.runtime.executors import ClusterError, LostJobsError, dask_workers, local_workers

pytestmark = pytest.mark.slow

ROOT = Path(__file__).resolve().parents[2]


class Cluster:
    """A scheduler and two workers on this machine, as ``dask scheduler`` and ``dask worker`` start them."""

    def __init__(self, folder: Path) -> None:
        self.file = folder / "scheduler.json"
        self.log = (folder / "dask.log").open("w")
        self.scheduler = self._start("scheduler", "--host", "127.0.0.1", "--port", "0")
        self.workers = [self._start("worker", "--nthreads", "1", "--no-nanny") for _ in range(2)]
        until = time.monotonic() + 60
        while not self.file.exists() and time.monotonic() < until:
            time.sleep(0.1)

    def _start(self, role: str, *options: str) -> subprocess.Popen:
        command = [sys.executable, "-m", f"distributed.cli.dask_{role}", "--no-dashboard", *options]
        environment = {**os.environ, "OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"}
        return subprocess.Popen(
            [*command, "--scheduler-file", str(self.file)],
            cwd=ROOT,
            env=environment,
            stdout=self.log,
            stderr=subprocess.STDOUT,
        )

    def close(self) -> None:
        for process in (*self.workers, self.scheduler):
            process.kill()
            process.wait()
        self.log.close()


@pytest.fixture(scope="module")
def cluster(tmp_path_factory):
    started = Cluster(tmp_path_factory.mktemp("cluster"))
    yield started
    started.close()


@pytest.fixture(scope="module")
def campaign_file(tmp_path_factory):
    return written(tmp_path_factory.mktemp("rig") / "campaign.h5", rig([(2500.0, 25.0), (5000.0, 25.0)], seed=7))


def wait_for(address: str, count: int) -> None:
    from distributed import Client

    with Client(scheduler_file=address, set_as_default=False) as client:
        client.wait_for_workers(count, timeout=60)


def test_a_worker_killed_half_way_changes_no_bit(cluster, campaign_file, tmp_path):
    wait_for(str(cluster.file), 2)
    campaign = load_campaign(campaign_file)
    settings = IdentifySettings(methods=("ols", "mm"))
    seen = []

    def kill_half_way(text, done, total):
        seen.append((done, total))
        if done == total // 2 and cluster.workers[0].poll() is None:
            cluster.workers[0].kill()

    with dask_workers(str(cluster.file)) as workers:
        assert workers.count == 2
        spread = identify(campaign, settings, kill_half_way, workers)
        # and with a job in its hands: the second worker kills itself, nobody is left, a new one takes over
        cluster.workers.append(cluster._start("worker", "--nthreads", "1", "--no-nanny"))
        jobs = [(str(tmp_path), i) for i in range(6)]
        assert list(workers.map(dies_once, jobs)) == [3 * i for i in range(6)]
    assert cluster.workers[0].poll() is not None
    assert (6, 12) in seen
    with local_workers(2) as processes:
        local = identify(campaign, settings, workers=processes)
    alone = identify(campaign, settings)
    for other in (spread, local):
        assert other.estimators_frame().equals(alone.estimators_frame())
        assert other.windows_frame().equals(alone.windows_frame())
        assert (other.systematic == alone.systematic).all()


def tables(out: Path) -> list[bytes]:
    return [(out / f"{name}.csv").read_bytes() for name in ("coefficients", "estimators", "windows")]


def test_a_client_killed_half_way_is_taken_up_where_it_stopped(cluster, campaign_file, tmp_path, monkeypatch):
    wait_for(str(cluster.file), 1)
    out = tmp_path / "out"
    words = ["identify", str(campaign_file), "--scheduler", str(cluster.file), "--out", str(out)]
    client = subprocess.Popen(
        [sys.executable, "-m", "tpjb_ident", *words], cwd=ROOT, stdout=subprocess.DEVNULL, stderr=cluster.log
    )
    until = time.monotonic() + 120
    whole = "[!.]*.npz"  # a file that is being written has a dot in front
    while not list((out / KEPT).glob(whole)) and client.poll() is None and time.monotonic() < until:
        time.sleep(0.001)
    client.send_signal(signal.SIGSTOP)  # so that nothing is finished between the look and the kill
    finished = {path.name for path in (out / KEPT).glob(whole)}
    client.kill()
    assert client.wait() == -signal.SIGKILL
    assert 0 < len(finished) < 12
    assert not list(out.glob("*.csv"))

    kept: list[str] = []
    plain = RunStore.keep

    def keep(store, mark, result):
        kept.append(store._file(result.run).name)
        plain(store, mark, result)

    monkeypatch.setattr(RunStore, "keep", keep)
    ended(0, *words)
    assert len(kept) == len(set(kept)) == 12 - len(finished)  # the others, and each of them once
    assert not finished & set(kept)
    assert not (out / KEPT).exists()

    alone = tmp_path / "alone"
    tpjb("identify", campaign_file, "--workers", "1", "--out", alone)
    assert tables(out) == tables(alone)


def test_a_scheduler_that_is_lost_half_way_is_the_end_and_is_named(tmp_path, monkeypatch, caplog):
    monkeypatch.setattr(executors, "_STALLED", 2.0)
    cluster = Cluster(tmp_path)

    def lose() -> None:
        with dask_workers(str(cluster.file), 5.0) as workers:
            for _ in workers.map(time.sleep, [(0.1,)] * 200):
                cluster.scheduler.kill()

    try:
        wait_for(str(cluster.file), 2)
        with pytest.raises(LostJobsError, match="workers"):
            lose()
    finally:
        cluster.close()
    assert "exception calling callback" not in caplog.text


def test_a_scheduler_that_is_not_there_is_named():
    answer = r"no Dask scheduler answers at tcp://127\.0\.0\.1:9 .*dask scheduler"
    with pytest.raises(ClusterError, match=answer), dask_workers("tcp://127.0.0.1:9", patience=1.0):
        pass
