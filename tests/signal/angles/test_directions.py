# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions of point echoes through the whole chain, and estimators against their bounds."""

from __future__ import annotations

import dataclasses
import math

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal.angles import (
    ArrayGeometry,
    DirectionFinder,
    angles_deg,
    bartlett,
    capon,
    count_sources,
    covariance_of,
    esprit,
    music,
    unit_vectors,
)
from radarsim_addon.signal.detection import (
    DirectedDetection,
    detect_in_directions,
    detect_targets,
)
from radarsim_addon.signal.motion import AntennaMotion, BodyMotion, axes_of
from radarsim_addon.signal.motion.body_motion import Segment, rotation
from radarsim_addon.signal.radar import (
    AntennaArray,
    Burst,
    PmcwWaveform,
    Radar,
    Waveform,
    array_preset,
    linear_array,
)
from scripts.validation.array_scenes import (
    BURST,
    CARRIER_HZ,
    SPAN_S,
    WAVELENGTH_M,
    antennas_at,
    direction_of,
    echoes_of,
    geometry_at,
    map_of,
    radar_of,
)

#: Middle of the burst [s].
MIDDLE_S = (BURST.pulses - 1) / (2 * BURST.prf_hz)


def detected(radar: Radar, echoes: object, noise: float = 1e-4, **given: object) -> list:
    """Targets of noisy echoes; the noise makes surroundings, 80 dB below an echo."""
    rng = np.random.default_rng(7)
    samples = echoes.samples  # type: ignore[attr-defined]
    noises = rng.standard_normal((2, *samples.shape))
    noisy = dataclasses.replace(
        echoes,
        samples=samples + noise * (noises[0] + 1j * noises[1]),  # type: ignore[type-var]
    )
    geometry = geometry_at(radar, time_s=(radar.burst.pulses - 1) / (2 * radar.burst.prf_hz))
    return detect_in_directions(map_of(noisy), geometry, np.eye(4), **given).targets  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("preset", "range_m", "speed_mps"),
    [("1x8", 5.0, 0.0), ("1x8", 31.7, -30.0), ("3x4", 5.0, -30.0), ("3x4", 31.7, 3.0)],
)
def test_angles_of_points(preset: str, range_m: float, speed_mps: float) -> None:
    """Near field, between cells, Doppler that folds, and transmitters that take turns."""
    radar = radar_of(preset)
    for azimuth_deg, elevation_deg in ((10.3, 7.0), (-48.0, -3.0)):
        up = elevation_deg if preset == "3x4" else 0.0
        point = range_m * direction_of(azimuth_deg, up)
        target = detected(radar, echoes_of(radar, [point], radial_mps=speed_mps))[0]
        assert target.azimuth_deg == pytest.approx(azimuth_deg, abs=0.003)
        if preset == "3x4":
            assert target.elevation_deg == pytest.approx(up, abs=0.01)
        else:
            assert target.elevation_deg is None
        away_m = range_m + speed_mps * MIDDLE_S
        forward = [away_m * x for x in direction_of(azimuth_deg, up) * [-1, 1, -1]]
        assert [target.y_m, target.z_m, target.x_m] == pytest.approx(forward, abs=0.08)
        assert [target.world_x_m, target.world_y_m, target.world_z_m] == pytest.approx(
            [-target.y_m, target.z_m, -target.x_m]
        )


@pytest.mark.parametrize(
    "waveform",
    [Waveform(CARRIER_HZ, 200e6, 2e-6, 250e6), PmcwWaveform(CARRIER_HZ, 2e-9, 8, code_repeats=2)],
)
def test_angles_of_other_waveforms(waveform: object) -> None:
    burst = Burst(4e3, 32)
    radar = Radar(waveform, burst, array_preset("3x4", WAVELENGTH_M).channels(burst))  # type: ignore[arg-type]
    point = 21.4 * direction_of(-20.0, 4.0)
    echoes = echoes_of(radar, [point], radial_mps=1.5, range_limits_m=(5.0, 40.0))
    target = detected(radar, echoes)[0]
    assert target.azimuth_deg == pytest.approx(-20.0, abs=0.01)
    assert target.elevation_deg == pytest.approx(4.0, abs=0.02)


def test_without_the_phases_of_the_slots_the_angle_is_that_of_theory() -> None:
    """2 x 4 in a row at 30 m/s: the second transmitter's echoes lead by 2 pi f T."""
    spacing_m = WAVELENGTH_M / 2
    array = AntennaArray(linear_array(2, 4 * spacing_m), linear_array(4, spacing_m))
    radar = Radar(radar_of("1x4").waveform, BURST, array.channels(BURST))
    speed_mps, sine = 30.0, math.sin(math.radians(12.0))
    echoes = echoes_of(radar, [25.0 * direction_of(12.0)], radial_mps=speed_mps)
    right = detected(radar, echoes)[0]
    assert right.azimuth_deg == pytest.approx(12.0, abs=0.01)
    rd_map, geometry = map_of(echoes), geometry_at(radar, time_s=MIDDLE_S)
    row, col = np.unravel_index(rd_map.power[0].argmax(), rd_map.power[0].shape)
    unaware = dataclasses.replace(geometry, offset_s=np.zeros(8))
    (found,) = DirectionFinder(unaware).find(rd_map.values[:, row, col], 25.0, 0.0, 0.0, 1)
    # by theory, on a fine grid: steps of half a wavelength, and a jump between the transmitters
    step = np.arange(8) - 3.5
    jump = 2 * math.pi * (-2 * speed_mps / WAVELENGTH_M) * geometry.offset_s
    beams = np.linspace(-1, 1, 200_001)
    power = np.abs(np.exp(1j * (np.pi * np.outer(sine - beams, step) + jump)).sum(axis=1))
    wrong_deg = math.degrees(math.asin(beams[power.argmax()]))
    assert abs(wrong_deg - 12.0) > 1.0
    assert angles_deg(found.direction)[0] == pytest.approx(wrong_deg, abs=0.1)


@pytest.mark.parametrize("speed_mps", [30.0, -40.0, 60.0])
def test_slots_that_do_not_fill_the_pulse_interval(speed_mps: float) -> None:
    """Short slots tell more folds of the Doppler apart than there are transmitters."""
    preset = array_preset("3x4", WAVELENGTH_M)
    array = AntennaArray(preset.transmitters, preset.receivers, 1.4e-5)
    waveform = radar_of("1x4").waveform
    radar = Radar(waveform, BURST, array.channels(BURST, waveform.duration_s))
    point = 25.0 * direction_of(12.0, 3.0)
    target = detected(radar, echoes_of(radar, [point], radial_mps=speed_mps))[0]
    assert target.azimuth_deg == pytest.approx(12.0, abs=0.005)
    assert target.elevation_deg == pytest.approx(3.0, abs=0.01)


@pytest.mark.parametrize("apart_deg", [14.0, 6.0])
def test_two_targets_in_one_cell(apart_deg: float) -> None:
    """Down to 0.4 beam widths, each with its own level."""
    radar = radar_of("3x4")
    points = [20.0 * direction_of(angle) for angle in (3.0, 3.0 + apart_deg)]
    echoes = echoes_of(radar, points, radial_mps=3.0, powers_w=[1.0, 0.5])
    first, second = sorted(detected(radar, echoes)[:2], key=lambda one: one.azimuth_deg)
    assert first.azimuth_deg == pytest.approx(3.0, abs=0.02)
    assert second.azimuth_deg == pytest.approx(3.0 + apart_deg, abs=0.03)
    assert first.level_db == pytest.approx(0.0, abs=0.05)
    assert second.level_db == pytest.approx(10 * math.log10(0.5), abs=0.05)


@pytest.mark.parametrize("turn_deg", [0.0, 25.0])
def test_antennas_apart_and_turned(turn_deg: float) -> None:
    """Transmitters 1.5 m from the receivers, turned to the left: angles are the receiver's."""
    radar = radar_of("3x4")
    apart = antennas_at((1.0, 2.0, 3.0), (1.5, 0.0, 0.2))
    turned = apart.transmitter.pose.copy()
    turned[:3, :3] = rotation(np.array([0.0, math.radians(turn_deg), 0.0]))
    antennas = dataclasses.replace(apart, transmitter=BodyMotion(turned))
    direction = direction_of(-25.0, 5.0)
    point = np.array([1.0, 2.0, 3.0]) + 4.0 * direction
    geometry = geometry_at(radar, antennas)
    pose = np.eye(4)
    pose[:3, 3] = (1.0, 2.0, 3.0)
    rd_map = map_of(echoes_of(radar, [point], antennas=antennas))
    target = detect_in_directions(rd_map, geometry, pose, dynamics_db=40.0).targets[0]
    assert isinstance(target, DirectedDetection)
    assert target.azimuth_deg == pytest.approx(-25.0, abs=0.01)
    assert target.elevation_deg == pytest.approx(5.0, abs=0.02)
    place = [target.world_x_m, target.world_y_m, target.world_z_m]
    assert place == pytest.approx(point.tolist(), abs=0.005)


@pytest.mark.parametrize("rpm", [40.0, -40.0])
def test_a_radar_that_spins(rpm: float) -> None:
    """Directions are those half way through the burst and the slots, when it has turned 0.8 deg."""
    spin = np.array([[0.0, rpm * 2 * math.pi / 60 * SPAN_S / 2, 0.0]])
    segment = Segment(0.0, SPAN_S, np.zeros((2, 3)), np.zeros(3), spin, np.eye(3))
    body = BodyMotion(np.eye(4), (segment,))
    antennas, radar = AntennaMotion(body, body), radar_of("3x4")
    time_s = MIDDLE_S + float(np.mean([one.start_offset_s for one in radar.channels]))
    pose = np.eye(4)
    pose[:3, :3] = axes_of(body, np.array([time_s]))[0]
    point = 20.0 * pose[:3, :3] @ direction_of(12.0, 3.0)
    rd_map = map_of(echoes_of(radar, [point], antennas=antennas))
    geometry = geometry_at(radar, antennas, time_s)
    target = detect_in_directions(rd_map, geometry, pose, dynamics_db=40.0).targets[0]
    assert isinstance(target, DirectedDetection)
    assert target.azimuth_deg == pytest.approx(12.0, abs=0.003)
    assert target.elevation_deg == pytest.approx(3.0, abs=0.03)  # it turns from slot to slot
    place = [target.world_x_m, target.world_y_m, target.world_z_m]
    assert place == pytest.approx(point.tolist(), abs=0.02)


def test_an_array_detects_what_one_channel_does_not() -> None:
    """A beam of twelve channels has 10.8 dB less noise: 11 dB are 22 dB in the beam."""
    radar = radar_of("3x4")
    echoes = echoes_of(radar, [20.0 * direction_of(15.0)], radial_mps=4.0)
    # of each sample; windows over 256 samples and 64 chirps leave 1.5^2 / 16384 of it
    noise = math.sqrt(16384 / 1.5**2 / 10**1.1 / 2)
    found = detected(radar, echoes, noise=noise)
    assert found[0].azimuth_deg == pytest.approx(15.0, abs=2.0)
    assert found[0].snr_db == pytest.approx(21.8, abs=2.0)
    rng = np.random.default_rng(7)
    noises = noise * rng.standard_normal((2, *echoes.samples.shape))
    noisy = dataclasses.replace(echoes, samples=echoes.samples + noises[0] + 1j * noises[1])
    assert not detect_targets(map_of(noisy).channel(0)).targets


def test_noise_alone_gives_few_false_alarms() -> None:
    """A beam's false-alarm rate is the detector's; some beams fit into the sector."""
    radar = radar_of("1x8")
    nothing = dataclasses.replace(
        echoes_of(radar, [20 * direction_of(0.0)]), samples=np.zeros((8, 64, 256), complex)
    )
    assert len(detected(radar, nothing, noise=1.0)) <= 2


# -- estimators ------------------------------------------------------------------------------------

STEP = np.arange(8) - 3.5


def snapshots(sines: list[float], snr: float, count: int, seed: int) -> np.ndarray:
    """Independent echoes of power `snr` in noise of power 1, on eight elements, (8, count)."""
    rng = np.random.default_rng(seed)
    steering = np.exp(1j * np.pi * np.outer(STEP, sines))

    def drawn(*shape: int) -> np.ndarray:
        return (rng.standard_normal(shape) + 1j * rng.standard_normal(shape)) / math.sqrt(2)

    return math.sqrt(snr) * steering @ drawn(len(sines), count) + drawn(8, count)


def test_a_single_echo_reaches_the_cramer_rao_bound() -> None:
    """Of one snapshot var w = 6 / (SNR N (N^2 - 1)) (Rife and Boorstyn, IEEE IT 20, 591, 1974)."""
    geometry = geometry_at(radar_of("1x8"))
    finder, rng = DirectionFinder(geometry), np.random.default_rng(3)
    bound = math.sqrt(6 / (100 * 8 * 63)) / math.pi
    errors = []
    for _ in range(400):
        sine = rng.uniform(-0.8, 0.8)
        noise = (rng.standard_normal(8) + 1j * rng.standard_normal(8)) / math.sqrt(2)
        direction = unit_vectors(np.array([sine]), np.zeros(1))
        samples = 10 * geometry.steering(direction, 50.0)[0] + noise
        (found,) = finder.find(samples, 50.0, 0.0, math.inf, 1)
        errors.append(found.direction[0] - sine)
    rms = math.sqrt(np.mean(np.square(errors)))
    assert 0.9 * bound < rms < 1.1 * bound
    assert abs(np.mean(errors)) < 3 * bound / math.sqrt(400)


def test_spectra_and_esprit_of_two_sources() -> None:
    """Two sources 0.6 beam widths apart, where Bartlett sees one."""
    sines = [-0.05, 0.1]
    covariance = covariance_of(snapshots(sines, 100.0, 400, 1))
    grid = np.linspace(-1, 1, 4001)
    steering = np.exp(1j * np.pi * np.outer(grid, STEP))
    assert count_sources(covariance, 400) == 2
    assert esprit(covariance, 0.5, 2) == pytest.approx(sines, abs=0.005)

    def peaks(spectrum: np.ndarray) -> list[float]:
        tops = (spectrum[1:-1] > spectrum[:-2]) & (spectrum[1:-1] > spectrum[2:])
        places = np.flatnonzero(tops) + 1
        strong = places[spectrum[places] > spectrum.max() / 4]
        return grid[strong].tolist()

    assert peaks(music(covariance, steering, 2)) == pytest.approx(sines, abs=0.005)
    assert peaks(capon(covariance, steering)) == pytest.approx(sines, abs=0.01)
    assert len(peaks(bartlett(covariance, steering))) == 1


def test_coherent_sources_need_a_subarray() -> None:
    """Two echoes of one pulse are coherent: their covariance has rank 1."""
    sines = np.array([-0.3, 0.4])
    samples = np.exp(1j * np.pi * np.outer(STEP, sines)).sum(axis=1)[:, None]
    smooth = covariance_of(samples, subarray=5)
    assert np.linalg.matrix_rank(covariance_of(samples), tol=1e-9) == 1
    assert esprit(smooth, 0.5, 2) == pytest.approx(sines, abs=1e-9)


def test_the_power_of_a_beam_is_that_of_a_channel() -> None:
    samples = 3.0 * np.exp(1j * np.pi * 0.2 * STEP)[:, None]
    power = bartlett(covariance_of(samples), np.exp(1j * np.pi * np.outer([0.2], STEP)))
    assert power == pytest.approx([9.0])
    assert capon(covariance_of(samples), np.exp(1j * np.pi * np.outer([0.2], STEP)))[
        0
    ] == pytest.approx(9.0, rel=1e-4)


@pytest.mark.parametrize("spacing", [0.5, 0.7, 1.0, 2.0])
def test_the_unambiguous_sector(spacing: float) -> None:
    """Grating lobes are 1 / spacing apart in the sine, so half of that is told apart."""
    array = AntennaArray(linear_array(1, 1.0), linear_array(12, spacing * WAVELENGTH_M))
    radar = Radar(radar_of("1x4").waveform, BURST, array.channels(BURST))
    azimuth, elevation = geometry_at(radar).unambiguous_sines()
    assert azimuth == pytest.approx(min(0.5 / spacing, 1.0), abs=0.01)
    assert elevation == 1.0


def test_what_cannot_be_is_refused() -> None:
    geometry = geometry_at(radar_of("1x8"))
    with pytest.raises(ConfigError, match="within the array"):
        geometry.steering(direction_of(0.0), 0.003)
    with pytest.raises(ConfigError, match="8 sources of 8 channels; expected 1 to 7"):
        music(np.eye(8, dtype=complex), np.ones((1, 8), complex), 8)
    with pytest.raises(ConfigError, match="9 elements of 8"):
        covariance_of(np.ones((8, 1), complex), subarray=9)


def test_far_plane_wavefronts_are_those_of_spheres() -> None:
    """At a kilometre the curvature of a wavefront is 1e-4 of a wavelength over the array."""
    geometry: ArrayGeometry = geometry_at(radar_of("3x4"))
    directions = np.array([direction_of(20.0, 10.0), direction_of(-70.0, -20.0)])
    plane = dataclasses.replace(geometry, chirp_hz_per_m=0.0)
    apart = np.angle(plane.steering(directions, 1e3) / plane.steering(directions))
    assert np.abs(apart).max() < 2e-4


@pytest.mark.parametrize("seed", range(2))
@pytest.mark.parametrize("apart_deg", [8.0, 15.0, 25.0])
def test_two_equal_targets_keep_their_fold(seed: int, apart_deg: float) -> None:
    """Three transmitters in turn: their sum may look like one target of another fold."""
    rng = np.random.default_rng(seed)
    azimuth_deg, range_m = rng.uniform(-40, 40 - apart_deg), rng.uniform(8, 25)
    expected = [azimuth_deg, azimuth_deg + apart_deg]
    points = [range_m * direction_of(expected[0]), (range_m + 0.013) * direction_of(expected[1])]
    radar = radar_of("3x4")
    found = detected(radar, echoes_of(radar, points, radial_mps=rng.uniform(-3, 3)), 1e-3)
    near = sorted(one.azimuth_deg for one in found if one.level_db > -60)
    assert near == pytest.approx(expected, abs=0.5)
