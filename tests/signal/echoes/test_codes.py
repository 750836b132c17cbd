# SPDX-License-Identifier: GPL-3.0-or-later
"""Transmitters that send at once: against the same ones sent one by one, and their crosstalk."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal.angles import ArrayGeometry
from radarsim_addon.signal.detection import DirectedDetection, detect_in_directions
from radarsim_addon.signal.echoes import (
    ReceivedSignal,
    Receiver,
    apply_receiver,
    crosstalk,
    recorded_together,
    separate,
    shifts_doppler,
)
from radarsim_addon.signal.maps import range_doppler, range_process
from radarsim_addon.signal.radar import (
    AntennaArray,
    Burst,
    Channel,
    FmcwWaveform,
    PmcwWaveform,
    Radar,
    Waveform,
    array_from_dict,
    array_preset,
    channels_from_dict,
    channels_to_dict,
    linear_array,
)
from scripts.validation.array_scenes import (
    CARRIER_HZ,
    WAVEFORM,
    WAVELENGTH_M,
    antennas_at,
    direction_of,
    echoes_of,
)
from tests.signal.spectrum_oracle import relative

BURST = Burst(5e3, 16)


def coded(schedule: str, waveform=WAVEFORM, burst: Burst = BURST, preset: str = "3x4") -> Radar:
    array = dataclasses.replace(array_preset(preset, WAVELENGTH_M), schedule=schedule)
    return Radar(waveform, burst, array.channels(burst, waveform.duration_s))


def told_apart(radar: Radar, **scene) -> tuple[ReceivedSignal, np.ndarray]:
    """The separated signal, and the samples of each pair that sends by itself."""
    alone = echoes_of(radar, **scene)
    return separate(ReceivedSignal(recorded_together(alone, radar)), radar), alone.samples


POINTS = [12.0 * direction_of(15, 5), 20.0 * direction_of(-40, 0)]


@pytest.mark.parametrize("schedule", ["ddm", "bpm"])
@pytest.mark.parametrize(
    "waveform",
    [
        WAVEFORM,
        Waveform(CARRIER_HZ, 100e6, 1e-6, 120e6),
        PmcwWaveform(CARRIER_HZ, 4e-9, 7, code_repeats=3),
    ],
)
def test_a_scene_at_rest_is_told_apart(schedule: str, waveform) -> None:
    radar = coded(schedule, waveform)
    found, alone = told_apart(radar, points_m=POINTS, range_limits_m=(0.0, 30.0))
    rows = found.echoes.samples.shape[1]
    assert rows * radar.slots == alone.shape[1]
    assert found.recorded is not None and len(found.recorded.samples) == 4
    assert relative(found.echoes.samples.ravel(), alone[:, :rows].ravel()) < 1e-9
    # a receiver alone knows nothing of it
    assert relative(found.recorded.samples[:, :rows].ravel(), alone[:4, :rows].ravel()) > 0.5


@pytest.mark.parametrize("rate_mps", [2.0, -5.0])
def test_crosstalk_of_codes_is_that_of_theory(rate_mps: float) -> None:
    """Each transmitter by itself, through the separation of all."""
    radar = coded("bpm")
    alone = echoes_of(radar, [POINTS[0]], radial_mps=rate_mps)
    turn = -4 * math.pi * rate_mps / WAVELENGTH_M / radar.sent.burst.prf_hz
    codes = np.array([[1, 1, 1, 1], [1, -1, 1, -1], [1, 1, -1, -1]])
    leaks = np.zeros((3, 3))
    for sender in range(3):
        only = np.zeros_like(alone.samples)
        only[4 * sender : 4 * sender + 4] = alone.samples[4 * sender : 4 * sender + 4]
        one = dataclasses.replace(alone, samples=only)
        found = separate(ReceivedSignal(recorded_together(one, radar)), radar).echoes.samples
        size = np.linalg.norm(only[4 * sender, ::4])
        for heard in range(3):
            leaks[heard, sender] = np.linalg.norm(found[4 * heard]) / size
            phases = np.exp(1j * turn * np.arange(4))
            theory = abs(np.sum(codes[heard] * codes[sender] * phases)) / 4
            # the range changes within a cycle, too
            assert leaks[heard, sender] == pytest.approx(theory, abs=2e-3)
    worst = (leaks - np.diag(np.diag(leaks))).max()
    assert crosstalk(radar, rate_mps) == pytest.approx(worst, abs=2e-3)
    assert crosstalk(radar, 0.0) < 1e-12


def test_doppler_shifts_leak_beyond_their_share_alone() -> None:
    radar = coded("ddm", burst=Burst(7e3, 64))
    limit_mps = radar.max_unambiguous_velocity_mps
    assert crosstalk(radar, 0.99 * limit_mps) == 0
    assert crosstalk(radar, 1.01 * limit_mps) == 1
    found, alone = told_apart(radar, points_m=[POINTS[0]], radial_mps=0.5 * limit_mps)
    # at the first pulse of each cycle; what is left are the spectrum's sidelobes
    middle = slice(16, 48)
    away = found.echoes.samples[:, middle] - alone[:, ::3][:, middle]
    assert np.linalg.norm(away) < 0.03 * np.linalg.norm(alone[:, ::3][:, middle])


@pytest.mark.parametrize("schedule", ["ddm", "bpm"])
def test_noise_is_what_is_left_of_it(schedule: str) -> None:
    radar = coded(schedule, burst=Burst(7e3, 64))
    silent = echoes_of(radar, [POINTS[0]], powers_w=[1e-30])
    receiver = Receiver(noise_figure_db=10.0, adc_bits=12, adc_full_scale=1e-5)
    received = apply_receiver(recorded_together(silent, radar), receiver)
    found = separate(received, radar)
    power_w = float(np.mean(np.abs(found.echoes.samples) ** 2))
    assert found.noise_power_w == pytest.approx(received.noise_power_w / radar.slots)
    assert found.floor_power_w == pytest.approx(power_w, rel=0.02)


@pytest.mark.parametrize(
    ("schedule", "rate_mps", "bound_deg"),
    [("ddm", 0.0, 0.01), ("ddm", 4.0, 0.05), ("bpm", 0.0, 0.01), ("bpm", 0.3, 0.5)],
)
def test_directions_of_separated_transmitters(
    schedule: str, rate_mps: float, bound_deg: float
) -> None:
    radar = coded(schedule, burst=Burst(7e3, 64))
    found, _ = told_apart(radar, points_m=[POINTS[0]], radial_mps=rate_mps)
    rd_map = range_doppler(range_process(found.echoes, "hann"), "hann")
    rng = np.random.default_rng(3)
    noise = rng.normal(size=(2, *rd_map.values.shape)) * 1e-5 * np.abs(rd_map.values).max()
    rd_map = dataclasses.replace(rd_map, values=rd_map.values + noise[0] + 1j * noise[1])
    pose = np.eye(4)
    geometry = ArrayGeometry.of(radar, antennas_at())
    targets = detect_in_directions(rd_map, geometry, pose).targets
    strongest = max(targets, key=lambda one: one.snr_db)
    assert isinstance(strongest, DirectedDetection)
    assert strongest.azimuth_deg == pytest.approx(15, abs=bound_deg)
    assert strongest.velocity_mps == pytest.approx(rate_mps, abs=0.05)


def test_two_codes_of_180_degrees_are_doppler_shifts() -> None:
    elements = AntennaArray(linear_array(2, 0.008), linear_array(4, 0.002), schedule="bpm")
    radar = Radar(WAVEFORM, BURST, elements.channels(BURST, WAVEFORM.duration_s))
    assert shifts_doppler(radar) and radar.slots == 2
    assert not shifts_doppler(coded("bpm"))


def test_schedules_in_files() -> None:
    array = array_from_dict({"preset": "3x4", "schedule": "bpm"}, WAVELENGTH_M)
    channels = array.channels(BURST, 1e-5)
    assert channels_from_dict(channels_to_dict(channels)) == channels
    assert [channel.code_turns for channel in channels[::4]] == [
        (0.0, 0.0, 0.0, 0.0), (0.0, 0.5, 0.0, 0.5), (0.0, 0.0, 0.5, 0.5),
    ]  # fmt: skip
    with pytest.raises(ConfigError, match="Schedule of the array is 'fdm'; expected one of tdm"):
        array_from_dict({"preset": "3x4", "schedule": "fdm"}, WAVELENGTH_M)
    with pytest.raises(ConfigError, match="slot_s of the array goes with the schedule tdm alone"):
        array_from_dict({"preset": "3x4", "schedule": "ddm", "slot_s": 1e-5}, WAVELENGTH_M)


def test_codes_that_cannot_be_told_apart_are_refused() -> None:
    tx = linear_array(2, 0.01)
    same = tuple(Channel(one, code_turns=(0.0, 0.0)) for one in tx)
    with pytest.raises(ConfigError, match=r"codes of 2 transmitters .* not orthogonal"):
        Radar(WAVEFORM, BURST, same)
    mixed = (Channel(tx[0], code_turns=(0.0, 0.0)), Channel(tx[1]))
    with pytest.raises(ConfigError, match="not orthogonal"):
        Radar(WAVEFORM, BURST, mixed)
    with pytest.raises(ConfigError, match="expected finite numbers of cycles"):
        Channel(code_turns=(0.0, math.nan))
    with pytest.raises(ConfigError, match=r"A cycle of 4 slots takes 51.2 us.*at most 19531 Hz"):
        coded("bpm", burst=Burst(20e3, 8))
    real = FmcwWaveform(CARRIER_HZ, 500e6, 256, 20e6, real_adc=True)
    with pytest.raises(ConfigError, match="need a complex ADC"):
        coded("ddm", real)
