# SPDX-License-Identifier: GPL-3.0-or-later
"""Workers of a Dask cluster that end while they open the run."""

from __future__ import annotations

import os
import subprocess
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from radarsim_addon.errors import WorkerError
from radarsim_addon.signal.distributed import dask_workers
from radarsim_addon.signal.distributed.dask_workers import DaskWorkers

ROOT = Path(__file__).parents[3]
#: Ends its process at the first calls, as many as the file "lives" has characters.
MORTAL = """
import os
from pathlib import Path
def run_frame(folder, words, frame, command):
    lives = Path(folder, "lives")
    left = lives.read_text()
    if left:
        lives.write_text(left[1:])
        os._exit(1)
    return {"frames": [1], "pid": os.getpid()}
"""
CLUSTER = """
import sys
import dask
dask.config.set({"distributed.scheduler.allowed-failures": 1})
from distributed import LocalCluster
if __name__ == "__main__":
    with LocalCluster(
        n_workers=int(sys.argv[1]), threads_per_worker=1, dashboard_address=None, processes=True
    ) as cluster:
        print(cluster.scheduler_address, flush=True)
        sys.stdin.read()
"""


@pytest.fixture
def cluster(tmp_path: Path, request: pytest.FixtureRequest) -> Iterator[str]:
    """A scheduler and so many workers, which are started again when they end."""
    (tmp_path / "mortal.py").write_text(MORTAL, encoding="utf-8")
    (tmp_path / "cluster.py").write_text(CLUSTER, encoding="utf-8")
    paths = os.pathsep.join([str(tmp_path), str(ROOT)])
    with subprocess.Popen(
        [sys.executable, str(tmp_path / "cluster.py"), str(request.param)],
        cwd=tmp_path,
        env={**os.environ, "PYTHONPATH": paths},
        stdin=subprocess.PIPE,
        stdout=subprocess.PIPE,
        stderr=subprocess.DEVNULL,
        text=True,
    ) as process:
        assert process.stdin is not None and process.stdout is not None
        try:
            yield process.stdout.readline().strip()
        finally:
            process.stdin.close()
            process.wait(60)


@pytest.mark.parametrize("cluster", [2], indirect=True)
def test_workers_that_end_at_open(cluster: str, tmp_path: Path) -> None:
    """Another one takes over; where all end, the last one is named."""
    lives = tmp_path / "lives"
    with DaskWorkers(cluster, "mortal", str(tmp_path), ()) as workers:
        lives.write_text("x")
        assert workers.open()["frames"] == [1]
        assert lives.read_text() == ""
        lives.write_text("x" * 50)
        with pytest.raises(WorkerError, match=r"ended while they opened the run; .* was tcp://"):
            workers.open()
        assert len(lives.read_text()) < 50


@pytest.mark.parametrize("cluster", [0], indirect=True)
def test_a_cluster_without_workers_ends_the_run(
    cluster: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    (tmp_path / "lives").write_text("")
    monkeypatch.setattr(dask_workers, "_PATIENCE_S", 3.0)
    with DaskWorkers(cluster, "mortal", str(tmp_path), ()) as workers:
        with pytest.raises(WorkerError, match="had no worker for 3 s"):
            workers.open()
        workers._seen_s += 3.0
        workers.submit(1)
        with pytest.raises(WorkerError, match="had no worker for 3 s"):
            workers.wait()
