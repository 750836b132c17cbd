# SPDX-License-Identifier: GPL-3.0-or-later
"""A burst of several renders: each with its own antennas, all with the same options."""

from __future__ import annotations

import dataclasses
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.contract import AntennaRecord, LinkBudget, PathsRecord
from radarsim_addon.signal import (
    Burst,
    FrameInput,
    ProcessOptions,
    Radar,
    Waveform,
    open_run,
    process_frame,
)
from radarsim_addon.signal.echoes import Echoes
from radarsim_addon.signal.echoes.echoes import interpolate_renders
from radarsim_addon.signal.motion import BodyMotion, FrameMotion
from radarsim_addon.signal.radar import Channel, Weather
from tests.signal import path_runs as pr
from tests.signal import unequal as u

SPAN_S = 14 / 1000.0
BUDGET = LinkBudget(1.0, AntennaRecord("isotropic", {}), AntennaRecord("cosine", {"exponent": 2.0}))


def opened(folder: Path, later: Callable[[PathsRecord], PathsRecord], **changes: object) -> tuple:
    """The unequal echoes, stationary, rendered at both ends of the burst, and the options."""
    run = open_run(u.write_run(folder / "run", moving=False))
    options = dataclasses.replace(
        ProcessOptions(radar=u.FMCW, speckle_seed=None, range_taper="none"), **changes
    ).for_run(run)
    once = options.open(run.frame(1))

    def table(epoch_s: float, record: PathsRecord) -> object:
        receiver, transmitter = (
            BodyMotion(np.array(one.matrix_world)) for one in (record.receiver, record.transmitter)
        )
        motion = FrameMotion(SPAN_S, receiver, transmitter, False, [], epoch_offset_s=epoch_s)
        return dataclasses.replace(once.table, record=record, motion=motion)

    tables = table(0.0, once.table.record), table(SPAN_S, later(once.table.record))
    burst = dataclasses.replace(once, tables=tables)
    return burst.of_update(0), burst, options


def samples(frame_input: FrameInput, options: object) -> np.ndarray:
    return process_frame(frame_input, options).echoes.samples[0]


@pytest.mark.parametrize(
    "changes",
    [{}, {"weather": Weather(rain_mm_per_h=80.0)}, {"link_budget": BUDGET}, {"speckle_seed": 3}],
    ids=["alone", "rain", "link budget", "speckle"],
)
def test_renders_that_see_the_same_are_as_one(tmp_path: Path, changes: dict) -> None:
    once, burst, options = opened(tmp_path, lambda record: record, **changes)
    alone = samples(once, options)
    np.testing.assert_allclose(samples(burst, options), alone, rtol=0, atol=1e-9 * abs(alone).max())


def test_each_render_has_the_antennas_of_its_time(tmp_path: Path) -> None:
    """The receiver looks the other way at the end: a cosine antenna receives nothing behind it."""

    def turned(record: PathsRecord) -> PathsRecord:
        camera = dataclasses.replace(record.receiver, matrix_world=pr.pose((0, 0, 0), 180.0))
        return dataclasses.replace(record, receiver=camera)

    once, burst, options = opened(tmp_path, turned, link_budget=BUDGET)
    fades = 1 - np.arange(15) / 14
    alone = samples(once, options)
    np.testing.assert_allclose(
        samples(burst, options), fades[:, None] * alone, rtol=0, atol=1e-9 * abs(alone).max()
    )


def test_channels_that_begin_later_are_further_in_the_burst() -> None:
    """From echoes of 1 to echoes of 3 in 10 ms, linearly over the time of each pulse."""
    channels = (Channel(), Channel(start_offset_s=4e-4))
    radar = Radar(Waveform(5.3e9, 50e6, 1e-6, 60e6), Burst(1000.0, 11), channels)
    one = Echoes(np.ones((2, 11, 4), complex), 0.0, (0.0, 10.0), radar, "radar-equation", 0.0)
    both = interpolate_renders([one, dataclasses.replace(one, samples=3 * one.samples)], [0, 0.01])
    times_s = np.arange(11) / 1000.0 + np.array([[0.0], [4e-4]])
    expected = np.minimum(1 + 2 * times_s / 0.01, 3.0)
    np.testing.assert_allclose(both.samples, expected[..., None] * np.ones(4), rtol=1e-12)
