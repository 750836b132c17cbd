# SPDX-License-Identifier: GPL-3.0-or-later
"""Workers of a Dask cluster that end while they open the run."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest

pytest.importorskip("distributed")

from radarsim_addon import coordinator as worker_module
from radarsim_addon.coordinator import DaskWorkers
from radarsim_addon.errors import WorkerError
from scripts.benchmarks.worker_costs import dask_cluster

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


@pytest.fixture
def cluster(
    tmp_path: Path, request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch
) -> Iterator[str]:
    """A scheduler and so many workers, which are started again when they end."""
    (tmp_path / "mortal.py").write_text(MORTAL, encoding="utf-8")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", "1")
    with dask_cluster(tmp_path, request.param) as address:
        yield address


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
    monkeypatch.setattr(worker_module, "_PATIENCE_S", 3.0)
    with DaskWorkers(cluster, "mortal", str(tmp_path), ()) as workers:
        with pytest.raises(WorkerError, match="had no worker for 3 s"):
            workers.open()
        workers._seen_s += 3.0
        workers.submit(1)
        with pytest.raises(WorkerError, match="had no worker for 3 s"):
            workers.wait()
