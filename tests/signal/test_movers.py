# SPDX-License-Identifier: GPL-3.0-or-later
"""Movers that a summary lists: none that is the sidelobe of something outside the window."""

from pathlib import Path

import pytest

from radarsim_addon.signal import (
    Burst,
    FmcwWaveform,
    FrameResult,
    PmcwWaveform,
    ProcessOptions,
    Radar,
    Waveform,
    process_run,
)
from radarsim_addon.signal.findings import find_movers
from tests.signal.synthetic import Setup, points, write_run

CHIRP = Waveform(5.3e9, 50e6, 2.5e-6, 60e6)
SETUP = Setup(rings=4, radar=Radar(CHIRP, Burst(1000.0, 64)))
ECHOES = [(5, 6, 600.0, 5.0, 1e-6), *((2, c, 300.0, 0.0, 1e-5) for c in range(10))]
SLOWEST_MPS = 3 * SETUP.radar.velocity_resolution_mps


def result_of(folder: Path, options: ProcessOptions) -> FrameResult:
    return next(e for e in process_run(folder, options) if isinstance(e, FrameResult))


@pytest.mark.parametrize(
    "waveform",
    [
        CHIRP,
        FmcwWaveform(5.3e9, 50e6, 512, 1e6),
        FmcwWaveform(5.3e9, 50e6, 1024, 2e6, real_adc=True),
        PmcwWaveform(5.3e9, 20e-9, 9, repeats=8),
    ],
    ids=["chirp", "fmcw", "fmcw real", "pmcw"],
)
@pytest.mark.parametrize("window_m", [(0.0, 500.0), (0.0, 590.0), (610.0, 900.0), (650.0, 990.0)])
def test_a_mover_outside_the_window_has_no_sidelobes_in_it(
    tmp_path: Path, waveform: object, window_m: tuple[float, float]
) -> None:
    if isinstance(waveform, PmcwWaveform) and not (window_m[1] < 550 or window_m[0] > 640):
        pytest.skip("the interpolation between unwindowed chips reaches 40 m far, in any window")
    folder = write_run(tmp_path / "run", SETUP, points(SETUP, ECHOES))
    radar = Radar(waveform, Burst(1000.0, 64))  # type: ignore[arg-type]
    options = ProcessOptions(products=False, plots=False, radar=radar, window_m=window_m)
    result = result_of(folder, options)
    assert result.movers == []
    if isinstance(waveform, FmcwWaveform):
        # without what lies beyond the window its sidelobes are taken for movers
        assert find_movers(result.rd_map, SLOWEST_MPS, 1e-6)


def test_a_mover_in_the_window_stays_beside_one_outside(tmp_path: Path) -> None:
    echoes = [*ECHOES, (8, 3, 450.0, -3.0, 1e-7)]
    folder = write_run(tmp_path / "run", SETUP, points(SETUP, echoes))
    options = ProcessOptions(products=False, plots=False, window_m=(0.0, 550.0))
    (mover,) = result_of(folder, options).movers
    assert mover.velocity_mps == pytest.approx(-3.0, abs=0.02)
