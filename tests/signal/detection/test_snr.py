# SPDX-License-Identifier: GPL-3.0-or-later
"""The whole chain in watts: noise floor at k T F B, a target's SNR as the radar equation says."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.physics.radar_equation import monostatic_power_w
from radarsim_addon.signal.decoding import frame_paths, open_frame
from radarsim_addon.signal.detection import Cfar, FrameBudget, detect_targets, predicted_snr
from radarsim_addon.signal.echoes import Echoes, Receiver, apply_receiver, synthesize
from radarsim_addon.signal.maps import (
    RangeDopplerMap,
    map_noise_gain,
    map_noise_rows,
    mti_cancel,
    range_doppler,
    range_process,
)
from radarsim_addon.signal.radar import Burst, FmcwWaveform, Radar
from radarsim_addon.signal.runs import open_run
from tests.signal import path_runs as pr
from tests.signal.oracle import unit_paths


@pytest.mark.parametrize(("window", "antenna_k"), [("none", 290), ("hamming", 290), ("none", 2000)])
def test_targets_stand_above_the_noise_as_predicted(
    tmp_path: Path, window: str, antenna_k: float
) -> None:
    radar = Radar(pr.WAVEFORM, pr.BURST)
    # On a sample of the range axis; one pixel that the plate fills: one path of known power.
    range_m = 300 * radar.waveform.sample_spacing_m
    side_m = 0.5
    half_deg = math.degrees(math.atan(side_m / 2 / range_m))
    receiver = pr.camera(pr.pose((0, 0, 0)), half_deg)
    emitter = contract.TransmitterRecord(pr.pose((0, 0, 0)), 5.0)  # cancels
    rows = pr.trace([pr.plate("Plate", (0, range_m, 0), 1.0, 0, 0.8)], receiver, emitter, 1)
    beam = {"azimuth_beamwidth_deg": 6.0, "elevation_beamwidth_deg": 6.0}
    antenna = contract.AntennaRecord("gaussian", beam)
    system = contract.LinkBudget(
        80.0, antenna, antenna, transmit_loss_db=1.0, receive_loss_db=1.5, noise_figure_db=4.0,
        antenna_temperature_k=antenna_k,
    )  # fmt: skip
    # noise temperature of antenna and receiver together: T_a + (F - 1) T_0
    system_k = antenna_k + 290 * (10**0.4 - 1)
    folder = pr.write_run(
        tmp_path / "run", rows, ["Plate"], receiver, emitter, range_limits_m=1500.0, system=system
    )
    frame = open_run(folder).frame(1)
    budget = FrameBudget(open_frame(frame, radar=radar, link_budget=system))
    assert budget.system is not None
    echoes = synthesize(budget.apply(frame_paths(frame)), radar, range_limits_m=(0.0, 1500.0))
    gain_db = 2 * 10 * math.log10(16 * math.log(2) / math.radians(6) ** 2) - 2.5
    sigma_m2 = 4 * 0.8 * side_m**2
    power_w = float(
        monostatic_power_w(80.0, sigma_m2, range_m, radar.waveform.wavelength_m)
    ) * 10 ** (gain_db / 10)  # fmt: skip
    predicted = predicted_snr(power_w, radar, budget.system, window, window)
    assert predicted.burst_db > 25  # enough that noise does not move the peak much
    floors, peaks = [], []
    for seed in range(6):
        receiver = Receiver(
            noise_figure_db=system.noise_figure_db,
            antenna_temperature_k=system.antenna_temperature_k,
            noise_seed=seed,
        )
        noisy = apply_receiver(echoes, receiver).echoes
        rd_map = range_doppler(range_process(noisy, window), window)
        away = np.abs(rd_map.range_m - range_m) > 500
        floors.append(rd_map.plane_power[:, away].mean())
        peaks.append(rd_map.plane_power.max())
    floor_w = float(np.mean(floors))
    # k T fs, times what the two filters let through
    expected_w = 1.380649e-23 * system_k * 60e6 * map_noise_gain(radar, window, window)
    assert 10 * math.log10(floor_w / expected_w) == pytest.approx(0, abs=0.1)
    found_db = 10 * math.log10(float(np.mean(peaks)) / floor_w)
    assert found_db == pytest.approx(predicted.burst_db, abs=0.5)
    # and the textbook's sum, without windows: P T / (k T) times the pulses
    if window == "none":
        textbook = power_w * 2.5e-6 / (1.380649e-23 * system_k) * pr.BURST.pulses
        assert predicted.burst_db == pytest.approx(10 * math.log10(textbook), abs=0.3)


def _map(echoes: Echoes, mti: int) -> RangeDopplerMap:
    profiles = range_process(echoes, "hamming")
    return range_doppler(mti_cancel(profiles, mti) if mti else profiles, "hamming")


@pytest.mark.parametrize(("mti", "real_adc"), [(0, False), (0, True), (3, False)])
def test_snr_of_a_car_is_over_the_noise_not_over_the_rest_of_the_car(
    mti: int, real_adc: bool
) -> None:
    """300 scatterers within 4.5 m, 50 dB over noise whose level maps without an echo tell."""
    waveform = FmcwWaveform(77e9, 1e9, 256, 10e6, real_adc=real_adc)
    radar = Radar(waveform, Burst(1 / waveform.duration_s, 64))
    rng = np.random.default_rng(3)
    ranges_m, rates_mps = rng.uniform(8, 12.5, 300), 4 + 0.5 * rng.standard_normal(300)
    echoes = synthesize(
        unit_paths(radar, list(ranges_m), list(rates_mps)), radar, range_limits_m=(2.0, 18.0)
    )
    receivers = [Receiver(noise_figure_db=10.0, noise_seed=seed) for seed in range(9)]
    silence = dataclasses.replace(echoes, samples=np.zeros_like(echoes.samples))
    noise_w = apply_receiver(silence, receivers[0]).noise_power_w
    scale = math.sqrt(noise_w * 1e5 * map_noise_gain(radar) / np.max(_map(echoes, 0).plane_power))
    echoes = dataclasses.replace(echoes, samples=echoes.samples * scale)
    quiet = [_map(apply_receiver(silence, own).echoes, mti).plane_power for own in receivers[1:]]
    floor = np.mean(quiet, axis=(0, 2))
    received = apply_receiver(echoes, receivers[0])
    rd_map = _map(received.echoes, mti)
    noise = received.floor_power_w * map_noise_rows(rd_map, "hamming", "hamming", mti)
    # eight maps tell a row's noise to 5 %, that of all rows to 1.1 %
    np.testing.assert_allclose(noise, floor, rtol=0.2)
    assert np.mean(noise) == pytest.approx(np.mean(floor), rel=0.05)
    clean = detect_targets(_map(apply_receiver(echoes).echoes, mti)).targets
    strongest = max(clean, key=lambda item: item.level_db)
    true_db = 10 * math.log10(10 ** (strongest.level_db / 10) / floor[strongest.row] + 1)
    for kind in ("ca", "os"):
        targets = detect_targets(rd_map, Cfar(kind, 1e-6), noise_power=noise).targets
        found = max(targets, key=lambda item: item.level_db)
        assert (found.row, found.col) == (strongest.row, strongest.col)
        assert found.snr_db == pytest.approx(true_db, abs=0.5)
        assert found.surroundings_db > found.noise_db + 3  # the car's own echoes
