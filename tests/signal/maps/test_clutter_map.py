# SPDX-License-Identifier: GPL-3.0-or-later
"""Clutter alone in expected power, against sums over pulses, and next to targets and noise."""

from __future__ import annotations

import json
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.physics.clutter import clutter_velocities
from radarsim_addon.signal import Burst, Radar, Waveform, open_run
from radarsim_addon.signal.decoding import FrameInput, open_frame
from radarsim_addon.signal.detection import FrameBudget
from radarsim_addon.signal.maps import ExpectedPower, expected_power
from radarsim_addon.signal.pipeline import FrameResult, ProcessOptions, process_frame, process_run
from radarsim_addon.signal.radar import Weather
from tests.signal import path_runs as pr

PRF_HZ, PULSES = 400.0, 32
RADAR = Radar(Waveform(5.3e9, 10e6, 4e-6, 12e6), Burst(PRF_HZ, PULSES))
WAVELENGTH_M = RADAR.waveform.wavelength_m
LIMITS_M = (500.0, 1500.0)
GROUND_M, TARGET_M, TARGET_MPS = 900.0, 1200.0, 2.0
BIN_MPS = WAVELENGTH_M / 2 * PRF_HZ / PULSES
#: Symmetric about the middle of the burst, of the period of the burst.
HAMMING = 0.54 - 0.46 * np.cos(2 * np.pi * (np.arange(PULSES) + 0.5) / PULSES)
BUDGET = contract.LinkBudget(transmit_power_w=1e3, noise_figure_db=3.0)


def scene(
    folder: Path,
    fluctuation: contract.FluctuationRecord | None = None,
    *,
    clutter: str | None = "nrl_sea",
    system: contract.LinkBudget | None = None,
    target_m: float = TARGET_M,
    ground_mps: float = 0.0,
) -> FrameInput:
    """A square of clutter to the left, and a target to the right that recedes by 2 m/s."""
    receiver = pr.camera(pr.pose((0, 0, 0)), 8.0)
    emitter = contract.TransmitterRecord(receiver.matrix_world, 1e6)
    ground = pr.plate("Ground", (-60.0, GROUND_M, 0), 40.0)
    target = pr.plate("Target", (60.0, target_m, 0), 40.0, albedo=0.5)
    rows = pr.trace([ground, target], receiver, emitter, 64, 2)
    rows["range_rate_mps"] = np.where(rows["last_object"] == 2, TARGET_MPS, ground_mps)
    items = [
        contract.ObjectRecord(
            "Ground", GROUND_M, GROUND_M, None, fluctuation=fluctuation, clutter=clutter
        ),
        contract.ObjectRecord("Target", target_m, target_m, None),
    ]
    pr.write_run(
        folder, rows, ["Ground", "Target"], receiver, emitter, range_limits_m=2000.0,
        replicates=2, system=system, scene=contract.GroundTruthRecord(1, 0.0, items),
    )  # fmt: skip
    return open_frame(
        open_run(folder).frame(1), radar=RADAR, range_limits_m=LIMITS_M, link_budget=system
    )


def power_by_doppler(expected: ExpectedPower, centre_m: float, power: np.ndarray) -> np.ndarray:
    """Sum over the ranges of one of both surfaces, (pulses,)."""
    here = np.abs(expected.range_m - centre_m) < 100
    return np.asarray(power[:, here].sum(axis=1))


def test_clutter_and_targets_add_up_to_all_power(tmp_path: Path) -> None:
    found = expected_power(scene(tmp_path / "run"))
    plain = expected_power(scene(tmp_path / "plain", clutter=None))
    assert plain.clutter_map is None and plain.clutter_profile is None
    assert found.clutter_map is not None and found.clutter_profile is not None
    assert found.clutter_map_error is not None and found.clutter_profile_error is not None
    # which of it is clutter changes nothing of the sum
    np.testing.assert_allclose(found.map, plain.map, atol=1e-12 * plain.map.max())
    np.testing.assert_allclose(found.profile, plain.profile, atol=1e-12 * plain.profile.max())
    near, far = (np.abs(found.range_m - centre_m) < 100 for centre_m in (GROUND_M, TARGET_M))
    # but for sidelobes of the target in range
    slack_w = 4e-4 * found.map.max()
    for clutter, every in (
        (found.clutter_map[:, near], found.map[:, near]),
        (found.clutter_profile_error[near], found.profile_error[near]),
    ):
        np.testing.assert_allclose(clutter, every, rtol=1e-3, atol=slack_w)
    # sidelobes in range of the ground, and the target itself
    assert found.clutter_profile[far].max() < 0.02 * found.profile[far].max()


@pytest.mark.parametrize(
    "fluctuation",
    [
        contract.FluctuationRecord(motion="gaussian", motion_speed_mps=0.6),
        contract.FluctuationRecord(motion="exponential", motion_speed_mps=0.4, motion_fraction=0.3),
        contract.FluctuationRecord(motion="sea", motion_speed_mps=0.2, motion_fraction=0.8),
    ],
    ids=lambda one: one.motion,
)
def test_clutter_has_the_width_of_its_motion(
    tmp_path: Path, fluctuation: contract.FluctuationRecord
) -> None:
    """Against the mean spectrum of scatterers with drawn velocities, pulse by pulse."""
    found = expected_power(scene(tmp_path / "run", fluctuation), doppler_taper="hamming")
    assert found.clutter_map is not None
    rng, count = np.random.default_rng(1), 200_000
    speeds = clutter_velocities(
        fluctuation.motion,
        fluctuation.motion_speed_mps,
        fluctuation.motion_fraction,
        (rng.uniform(size=count), rng.uniform(size=count)),
        np.ones(count),
        WAVELENGTH_M,
    )
    weight = HAMMING
    doppler_hz = np.fft.fftshift(np.fft.fftfreq(PULSES, 1 / PRF_HZ))
    # |sum of w exp|^2 of one scatterer, over a fine grid of velocities
    counts, edges = np.histogram(-2 * speeds / WAVELENGTH_M, 4000)
    own_hz = (edges[1:] + edges[:-1]) / 2
    turns = np.arange(PULSES)[:, None] / PRF_HZ
    response = np.array([
        np.abs(weight @ np.exp(2j * np.pi * turns * (own_hz - cell_hz))) ** 2
        for cell_hz in doppler_hz
    ])  # fmt: skip
    truth = response @ counts / count / weight.sum() ** 2
    got = power_by_doppler(found, GROUND_M, found.clutter_map)
    still = power_by_doppler(
        (plain := expected_power(scene(tmp_path / "still"))), GROUND_M, plain.map
    )
    # the unit: a stationary scatterer on a cell peaks at 1. Bragg lines are
    # between two of four cells to a bin.
    slack = 0.006 if fluctuation.motion == "sea" else 0.003
    np.testing.assert_allclose(got / still.max(), truth, atol=slack)
    assert truth.max() < 0.7
    # the target keeps its own
    target = power_by_doppler(found, TARGET_M, found.map)
    assert target.max() == pytest.approx(
        power_by_doppler(plain, TARGET_M, plain.map).max(), rel=1e-3
    )


def processed(folder: Path, **options: object) -> FrameResult:
    run = open_run(folder)
    resolved = ProcessOptions(radar=RADAR, range_limits_m=LIMITS_M, **options).for_run(run)  # type: ignore[arg-type]
    return process_frame(resolved.open(run.frame(1)), resolved)


def test_target_over_clutter_over_noise(tmp_path: Path) -> None:
    """A target in the clutter's own range cell: both ratios from sums over the rows by hand."""
    scene(tmp_path / "run", system=BUDGET, target_m=GROUND_M, ground_mps=BIN_MPS / 4)
    result = processed(tmp_path / "run")
    report = result.budget
    assert report.clutter is not None and report.clutter.surfaces == {"Ground"}
    assert set(report.clutter.objects) == {"Target"}
    cell = report.clutter.objects["Target"]
    # the ground drifts by a quarter of a Doppler cell, so its sidelobes reach the target's cell
    echoes = {echo.name: echo for echo in report.objects}
    away = round(TARGET_MPS / BIN_MPS) - 0.25
    turn = np.exp(2j * np.pi * away * np.arange(PULSES) / PULSES)
    sidelobe = abs(HAMMING @ turn) ** 2 / HAMMING.sum() ** 2
    # the square reaches into neighbouring range cells
    assert result.expected is not None and result.expected.clutter_profile is not None
    column = np.argmin(np.abs(result.expected.range_m - echoes["Target"].range_m))
    ground_w = result.expected.clutter_profile[column]
    assert ground_w == pytest.approx(echoes["Ground"].power_w, rel=0.15)
    expected_db = 10 * math.log10(echoes["Target"].power_w / ground_w / sidelobe)
    assert cell.signal_to_clutter_db == pytest.approx(expected_db, abs=0.01)
    assert cell.clutter_to_noise_db is not None and cell.signal_to_clutter_db is not None
    assert cell.signal_to_clutter_db + cell.clutter_to_noise_db == pytest.approx(
        report.snr["Target"].burst_db, abs=0.05
    )
    # a quarter of a cell off its middle, and spread over range
    ratio = result.clutter_to_noise
    assert ratio is not None
    quarter = np.exp(2j * np.pi * 0.25 * np.arange(PULSES) / PULSES)
    lost = abs(HAMMING @ quarter) ** 2 / HAMMING.sum() ** 2
    lost *= result.expected.clutter_profile.max() / echoes["Ground"].power_w
    assert 10 * math.log10(ratio.max() / lost) == pytest.approx(
        report.snr["Ground"].burst_db, abs=0.01
    )
    assert report.clutter.strongest_w == pytest.approx(lost * echoes["Ground"].power_w, rel=1e-6)
    assert report.clutter.range_m == pytest.approx(GROUND_M, abs=10)
    text = "\n".join(report.lines())
    assert f"{cell.signal_to_clutter_db:.1f} dB over clutter" in text
    assert "clutter (Ground) up to" in text and "dB over noise" in text


def test_receiver_gain_cancels_in_the_ratio_to_clutter(tmp_path: Path) -> None:
    scene(tmp_path / "run", target_m=GROUND_M, ground_mps=BIN_MPS / 4)
    reports = [
        processed(tmp_path / "run", receive_antenna_gain_dbi=gain).budget.clutter
        for gain in (0.0, 20.0)
    ]
    ratios = [one.objects["Target"].signal_to_clutter_db for one in reports if one is not None]
    assert ratios[1] == pytest.approx(ratios[0], abs=1e-9)


def test_no_ratios_where_they_would_be_wrong(tmp_path: Path) -> None:
    """Behind a canceller clutter is another; without a model there is none."""
    scene(tmp_path / "run", system=BUDGET)
    cancelled = processed(tmp_path / "run", mti=2)
    assert cancelled.budget.clutter is None
    # the expected map is that without a canceller, and so is its noise
    ratio = processed(tmp_path / "run").clutter_to_noise
    assert ratio is not None and ratio.max() > 0
    np.testing.assert_allclose(cancelled.clutter_to_noise, ratio, rtol=1e-12)
    scene(tmp_path / "plain", clutter=None)
    plain = processed(tmp_path / "plain")
    assert plain.budget.clutter is None and plain.clutter_to_noise is None
    assert "clutter" not in "\n".join(plain.budget.lines())


def test_rain_is_clutter(tmp_path: Path) -> None:
    """What rain adds to all power is the clutter."""
    scene(tmp_path / "run", clutter=None, system=BUDGET)
    wet, damp = (
        processed(tmp_path / "run", weather=Weather(rain_mm_per_h=50.0, rain_echo=echo))
        for echo in (True, False)
    )
    assert damp.budget.clutter is None and wet.budget.clutter is not None
    assert wet.budget.clutter.surfaces == set()
    assert "clutter (rain) up to" in "\n".join(wet.budget.lines())
    assert wet.expected is not None and wet.expected.clutter_profile is not None
    assert damp.expected is not None
    rain_w = wet.expected.profile - damp.expected.profile
    slack_w = 1e-9 * damp.expected.profile.max()
    np.testing.assert_allclose(wet.expected.clutter_profile, rain_w, rtol=1e-9, atol=slack_w)
    assert rain_w.max() > 100 * slack_w


def test_products_hold_clutter(tmp_path: Path) -> None:
    scene(tmp_path / "run", system=BUDGET, ground_mps=BIN_MPS / 4)
    options = ProcessOptions(radar=RADAR, range_limits_m=LIMITS_M, products=False)
    list(process_run(tmp_path / "run", options))
    folder = tmp_path / "run" / "products"
    with np.load(folder / "frame_0001_expected.npz") as arrays:
        held = arrays["clutter_to_noise"] > 0
        ratio = arrays["clutter_map"][held] / arrays["clutter_to_noise"][held]
        assert np.ptp(ratio) < 1e-9 * ratio.max()
        assert np.isfinite(arrays["clutter_profile_error"]).all()
    summary = json.loads((folder / "frame_0001_summary.json").read_text())
    budget = summary["link_budget"]
    assert budget["clutter"]["surfaces"] == ["Ground"]
    clutter = {item["name"]: item["clutter"] for item in budget["objects"]}
    assert clutter["Ground"] is None and clutter["Target"]["clutter_w"] > 0
    assert (folder / "frame_0001_clutter.png").stat().st_size > 5000


@pytest.mark.parametrize("tapers", [("hamming", "hamming"), ("none", "hann")])
def test_budget_of_the_noise_agrees_with_the_predicted_snr(
    tmp_path: Path, tapers: tuple[str, str]
) -> None:
    """A point of the strongest cell's power has the SNR that the cell's ratio says."""
    frame = scene(tmp_path / "run", system=BUDGET)
    expected = expected_power(frame, range_taper=tapers[0], doppler_taper=tapers[1])
    report = FrameBudget(frame).report(1.0, *tapers, expected=expected)
    assert report.clutter is not None and report.clutter.noise_w is not None
    echo = next(echo for echo in report.objects if echo.name == "Target")
    assert 10 * math.log10(echo.power_w / report.clutter.noise_w) == pytest.approx(
        report.snr["Target"].burst_db, abs=1e-6
    )
