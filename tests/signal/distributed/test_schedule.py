# SPDX-License-Identifier: GPL-3.0-or-later
"""Which frame is done when: lost workers, failing frames, frames of other processes, shards."""

from __future__ import annotations

import argparse
import random
from collections import Counter

import pytest

from radarsim_addon.coordinator import Reply, as_error, scheduled
from radarsim_addon.errors import OutputError, SceneError, WorkerError
from radarsim_addon.options import Share, add_share_arguments, share_of


class Pretended:
    """Workers whose answers are scripted: a list for each frame, then "done"."""

    def __init__(self, count: int, script: dict[int, list[Reply | None]], seed: int = 0) -> None:
        self.count, self.script, self.running = count, script, list[int]()
        self.tries, self.most, self._random = Counter[int](), 0, random.Random(seed)

    def free(self) -> int:
        return self.count - len(self.running)

    def submit(self, frame: int) -> None:
        self.running.append(frame)
        self.tries[frame] += 1
        self.most = max(self.most, len(self.running))

    def wait(self) -> list[tuple[int, Reply | None]]:
        frame = self.running.pop(self._random.randrange(len(self.running)))
        answers = self.script.get(frame, [])
        return [(frame, answers.pop(0) if answers else {"frame": frame})]


def outcome(workers: Pretended, frames: list[int]) -> tuple[list[int], dict[int, str]]:
    """Frames that were done in the order of their ends, and those set aside."""
    replies = scheduled(workers, frames)
    done: list[int] = []
    while True:
        try:
            reply = next(replies)
        except StopIteration as end:
            return done, end.value
        if "set_aside" not in reply:
            done.append(reply["frame"])


FAILED: Reply = {"error": "SceneError", "message": "no antenna"}


@pytest.mark.parametrize("count", [1, 2, 7, 100])
def test_each_frame_is_done_once_by_as_many_workers_as_there_are(count: int) -> None:
    workers = Pretended(count, {})
    done, aside = outcome(workers, list(range(30)))
    assert sorted(done) == list(range(30)) and not aside
    assert workers.most == min(count, 30) and set(workers.tries.values()) == {1}


def test_lost_workers_do_not_count_against_their_frames() -> None:
    """Nine times in a row: the frame is done by the tenth."""
    workers = Pretended(2, {3: [None] * 9, 4: [FAILED, FAILED, None, None]})
    done, aside = outcome(workers, [1, 2, 3, 4, 5])
    assert sorted(done) == [1, 2, 3, 4, 5] and not aside
    assert (workers.tries[3], workers.tries[4]) == (10, 5)


def test_a_frame_that_ends_its_worker_each_time_does_not_run_for_ever() -> None:
    done, aside = outcome(Pretended(2, {3: [None] * 1000}), [1, 2, 3, 4])
    assert sorted(done) == [1, 2, 4]
    assert aside == {3: "its worker ended 10 times without an answer"}


def test_a_frame_whose_error_comes_three_times_is_set_aside() -> None:
    """After the others, so that they do not wait for it."""
    workers = Pretended(1, {2: [FAILED] * 99, 3: [FAILED] * 2})
    done, aside = outcome(workers, [1, 2, 3, 4])
    assert done == [1, 4, 3]
    assert aside == {2: "SceneError: no antenna"} and workers.tries[2] == 3


def test_frames_of_other_processes_are_waited_for() -> None:
    workers = Pretended(2, {1: [{"held": True}] * 50})
    done, aside = outcome(workers, [1, 2, 3])
    assert done[-1] == 1 and sorted(done) == [1, 2, 3] and not aside


def test_an_error_of_the_output_folder_ends_the_run() -> None:
    workers = Pretended(1, {2: [{"error": "OutputError", "message": "the disk is full"}]})
    with pytest.raises(OutputError, match="the disk is full"):
        outcome(workers, [1, 2, 3])
    assert workers.tries[3] == 0


def test_errors_of_workers_keep_their_names() -> None:
    assert isinstance(as_error(FAILED), SceneError)
    for name in ("ZeroDivisionError", "_LONGEST"):
        error = as_error({"error": name, "message": "Traceback ..."})
        assert isinstance(error, WorkerError) and f"{name}: Traceback" in str(error)


@pytest.mark.parametrize("count", [1, 3, 7])
def test_shards_part_the_frames_evenly(count: int) -> None:
    frames = list(range(10, 110))
    parts = [Share(shard=(index + 1, count)).part(frames) for index in range(count)]
    assert sorted(frame for part in parts for frame in part) == frames
    assert max(map(len, parts)) - min(map(len, parts)) <= 1
    assert Share().part(frames) == frames


def parsed(*words: str) -> Share:
    parser = argparse.ArgumentParser(exit_on_error=False)
    add_share_arguments(parser)
    return share_of(parser.parse_args(words))


def test_options_make_a_share_and_back() -> None:
    for words in (["--workers", "3", "--shard", "2/5"], ["--dask", "tcp://host:1"], []):
        assert parsed(*words).words == words
    assert parsed("--workers", "1").by_workers and not parsed("--shard", "1/2").by_workers


@pytest.mark.parametrize(
    "words",
    ["--workers 0", "--workers x", "--shard 0/2", "--shard 3/2", "--shard 2", "--shard a/b"],
)
def test_what_is_no_share_is_refused(words: str, capsys: pytest.CaptureFixture[str]) -> None:
    with pytest.raises((argparse.ArgumentError, SystemExit)):
        parsed(*words.split())
