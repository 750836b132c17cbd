# SPDX-License-Identifier: GPL-3.0-or-later
"""Folded Doppler: what a map shows modulo lambda PRF / 2, and what the paths know."""

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.arrays import Real
from radarsim_addon.signal import (
    Burst,
    Cfar,
    Detection,
    FmcwWaveform,
    FrameResult,
    Paths,
    Peak,
    ProcessOptions,
    Radar,
    Waveform,
    detect_targets,
    process_run,
    range_doppler,
    range_process,
    synthesize,
)
from radarsim_addon.signal.detection import (
    DopplerFolds,
    find_moving_targets,
    velocity_before_folding_mps,
)
from radarsim_addon.signal.motion import PathMotion, Rows
from radarsim_addon.signal.pipeline.cli import Digits
from tests.signal.oracle import unit_paths
from tests.signal.pointscenes import WAVEFORMS
from tests.signal.synthetic import Setup, points, write_run

AUTOMOTIVE = FmcwWaveform(77e9, 300e6, 256, 20e6)


def found_in(radar: Radar, *parts: Paths, window: str = "hamming") -> list[Peak]:
    """Moving targets of paths, with their true range rates."""
    paths, folds = Paths.join(parts), DopplerFolds(radar)
    for part in parts:
        folds.add(part)
    echoes = synthesize(paths, radar, range_limits_m=(0.0, 900.0 if len(parts) == 1 else 120.0))
    rd_map = range_doppler(range_process(echoes, window), window)
    return folds.unfolded(find_moving_targets(echoes, rd_map, folds=folds))


@pytest.mark.parametrize("name", list(WAVEFORMS))
@pytest.mark.parametrize("turns", [-2.3, -1.4, -0.2, 0.7])
def test_a_target_has_the_range_rate_of_its_paths(name: str, turns: float) -> None:
    """The peak is at the range rate modulo lambda PRF / 2; range grows by v t meanwhile."""
    radar = Radar(WAVEFORMS[name], Burst(1000.0, 64))
    interval_mps = 299792458.0 / 5.3e9 * 1000.0 / 2
    rate_mps = turns * interval_mps
    start_m = 400.0 - rate_mps * 63 / 2 / 1000.0
    (target,) = found_in(radar, unit_paths(radar, [start_m], [rate_mps]))
    shown_mps = (turns - round(turns)) * interval_mps
    # within a ramp the delay changes, too: some 5e-5 of the rate
    within_mps = 0.02 * radar.velocity_resolution_mps + 1e-4 * abs(rate_mps)
    assert target.velocity_mps == pytest.approx(shown_mps, abs=within_mps)
    assert target.unfolded_velocity_mps == pytest.approx(rate_mps, abs=0.1)
    folded = abs(turns) > 0.5
    assert velocity_before_folding_mps(target) == (target.unfolded_velocity_mps if folded else None)
    assert ("folded, true range rate" in Digits().motion_text(target)) == folded


class Accelerated:
    """8 m/s^2 in addition to constant range rates."""

    def __init__(self, start: PathMotion) -> None:
        self.start = start

    def __getattr__(self, name: str) -> Any:
        return getattr(self.start, name)

    def lengths_m(self, times_s: Real, rows: Rows) -> Real:
        return self.start.lengths_m(times_s, rows) + 8.0 * np.asarray(times_s) ** 2

    def select(self, rows: Rows) -> PathMotion:
        return Accelerated(self.start.select(rows))


def test_an_accelerating_target_has_the_range_rate_of_the_middle_of_the_burst() -> None:
    """0.1 s: the rate grows by 0.8 m/s, 13 Doppler rows of the map; without it no path is near."""
    radar = Radar(FmcwWaveform(24e9, 300e6, 128, 2e6), Burst(5000.0, 512))
    paths = unit_paths(radar, [50.0], [5.0])
    paths = dataclasses.replace(paths, motion=Accelerated(paths.lengths))
    burst_s = 511 / 5000.0
    (target,) = found_in(radar, paths)
    assert target.unfolded_velocity_mps == pytest.approx(5.0 + 8.0 * burst_s / 2, abs=0.05)


def test_a_folded_target_has_no_sidelobes_among_the_targets() -> None:
    """77 GHz and 1 kHz hold +-0.97 m/s: 15 m/s fold 8 times, and migrate over 8 range cells."""
    radar = Radar(AUTOMOTIVE, Burst(1000.0, 256))
    paths = unit_paths(radar, [50.0], [15.0])
    assert len(found_in(radar, paths)) == 1
    echoes = synthesize(paths, radar, range_limits_m=(0.0, 120.0))
    rd_map = range_doppler(range_process(echoes, "hamming"), "hamming")
    assert len(find_moving_targets(echoes, rd_map)) > 1  # the rate is needed to tell


@pytest.mark.parametrize("prf_hz", [1000.0, 40e3])
@pytest.mark.parametrize("window", ["hamming", "hann", "taylor:4:-35"])
def test_the_sidelobes_of_many_scatterers_are_no_targets(prf_hz: float, window: str) -> None:
    """A car of 400 scatterers; a walker 40 dB below it, at another range and speed, stays."""
    radar = Radar(AUTOMOTIVE, Burst(prf_hz, 128))
    for seed in range(3):
        rng = np.random.default_rng(seed)
        car = unit_paths(radar, list(50.0 + rng.uniform(-2.2, 2.2, 400)), 15.0)
        car = dataclasses.replace(car, radiance=rng.exponential(1.0, 400))
        walker = unit_paths(radar, [80.0], [-1.6])
        walker = dataclasses.replace(walker, radiance=np.array([400e-4]))
        aperture = radar.waveform.wavelength_m**2 / (4 * np.pi)
        walker, car = (
            dataclasses.replace(part, radiance=part.radiance / aperture) for part in (walker, car)
        )
        middle_s = 127 / 2 / prf_hz
        targets = found_in(radar, car, walker, window=window)
        # half the car, its migration, and two range cells of 0.5 m
        reach_m = 2.2 + 15.0 * middle_s + 1.0
        near = [abs(target.range_m - 50.0 - 15.0 * middle_s) < reach_m for target in targets]
        assert any(near), seed
        others = [t for t, inside in zip(targets, near, strict=True) if not inside]
        assert [t.range_m for t in others] == [pytest.approx(80.0 - 1.6 * middle_s, abs=0.1)], seed
        assert others[0].unfolded_velocity_mps == pytest.approx(-1.6, abs=0.1), seed


def test_files_of_a_frame_tell_the_true_rate(tmp_path: Path) -> None:
    """1 kHz at 5.3 GHz hold +-14.1 m/s."""
    radar = Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 64))
    setup = Setup(rings=4, radar=radar)
    folder = write_run(tmp_path / "run", setup, points(setup, [(5, 6, 600.0, 40.0, 1e-5)]))
    options = ProcessOptions(products=False, plots=False, cfar=Cfar(pfa=1e-4))
    (result,) = (e for e in process_run(folder, options) if isinstance(e, FrameResult))
    assert result.detections is not None
    targets: list[Peak | Detection] = [*result.moving_targets, result.detections.targets[0]]
    for target in targets:
        assert target.velocity_mps == pytest.approx(40.0 - 28.28, abs=0.1)
        assert target.unfolded_velocity_mps == pytest.approx(40.0, abs=0.1)
    (found,) = (f for f in result.findings if f.code == "doppler-ambiguous-paths")
    assert "at least 2.83 kHz" in found.remedy  # 4 x 40 / lambda, rounded up
    table = (tmp_path / "run/products/frame_0001_detections.csv").read_text().splitlines()
    assert float(table[1].split(",")[table[0].split(",").index("unfolded_velocity_mps")]) > 39.9
    bare = detect_targets(result.rd_map, Cfar(pfa=1e-4)).targets[0]
    assert bare.unfolded_velocity_mps is None  # the map alone does not tell
