# SPDX-License-Identifier: GPL-3.0-or-later
"""Arrays: each channel against a direct sum over exact distances, the axis through the chain."""

from __future__ import annotations

import dataclasses
import itertools
import json
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal.detection import find_peaks
from radarsim_addon.signal.echoes import (
    Echoes,
    PhaseNoise,
    Receiver,
    apply_receiver,
    synthesizer_for,
)
from radarsim_addon.signal.echoes.echoes import EchoOptions
from radarsim_addon.signal.echoes.synthesis import StretchSynthesizer
from radarsim_addon.signal.maps import mti_cancel, range_doppler, range_process
from radarsim_addon.signal.motion import AntennaMotion, BodyMotion, FrameMotion
from radarsim_addon.signal.motion.body_motion import Segment, rotation
from radarsim_addon.signal.paths import (
    PathRows,
    geometry_of,
    make_paths,
    motion_of_rows,
)
from radarsim_addon.signal.products.frame_products import write_sigmf
from radarsim_addon.signal.radar import (
    AnyWaveform,
    Burst,
    Channel,
    Element,
    FmcwWaveform,
    PmcwWaveform,
    Radar,
    Waveform,
    replica,
)

CARRIER_HZ = 77e9
SPAN_S = 0.02
LIGHT = np.longdouble(299_792_458)
#: 77 GHz, 255 chips; four channels take turns.
PMCW = PmcwWaveform(CARRIER_HZ, 2e-9, 8, code_repeats=2)
BURST = Burst(2000.0, 16)


def body(
    place: tuple[float, float, float],
    velocity: tuple[float, float, float] = (0, 0, 0),
    spin: tuple[float, float, float] = (0, 0, 0),
    azimuth_rad: float = 0.0,
) -> BodyMotion:
    """A body that moves and turns steadily about its origin."""
    pose = np.eye(4)
    pose[:3, :3] = rotation(np.array([0.0, 0.0, azimuth_rad]))
    pose[:3, 3] = place
    if not (any(velocity) or any(spin)):
        return BodyMotion(pose)
    half = np.array(velocity) * SPAN_S / 2
    translation = np.array([np.array(place) + half, half])
    turn = np.array([np.array(spin) * SPAN_S / 2])
    return BodyMotion(pose, (Segment(0.0, SPAN_S, translation, np.zeros(3), turn, np.eye(3)),))


def at(motion: BodyMotion, point: np.ndarray, time_s: float) -> np.ndarray:
    """Where a point of a steady body is, by its definition."""
    place = motion.pose[:3, 3].astype(np.longdouble)
    if not motion.segments:
        return point.astype(np.longdouble)
    segment = motion.segments[0]
    velocity, spin = segment.translation[1] * 2 / SPAN_S, segment.rotation[0] * 2 / SPAN_S
    turned = rotation(spin * time_s).astype(np.longdouble) @ (point - place)
    return turned + place + velocity.astype(np.longdouble) * np.longdouble(time_s)


RECEIVER = body((0.1, 0, 2), (1, 15, 0), (0, 0, 3), 0.2)
TRANSMITTER = body((-0.2, 0, 2), (1, 15, 0), (0, 1, 2), 0.2)
STILL = BodyMotion(RECEIVER.pose), BodyMotion(TRANSMITTER.pose)
BODIES = [
    body((0, 0, 0)),
    body((5, 30, 1), (3, -20, 1)),
    body((-4, 25, 0), (0, 7, 0), (10, 40, -80)),
]
#: Points and the bodies that they are on: one reflection, or two.
PATHS = [
    ([(0.3, 6.0, 1.5)], [1]),
    ([(5.0, 29.0, 1.0)], [2]),
    ([(-4.0, 24.0, 0.5)], [3]),
    ([(5.0, 29.0, 1.0), (-4.0, 24.0, 0.5)], [2, 3]),
]
#: 2 x 2: transmitters 8 cm apart, receivers 4 cm, in turns within the pulse interval.
PLACES_TX = [(0.0, 0.0, 0.0), (0.08, 0.01, -0.02)]
PLACES_RX = [(-0.02, 0.0, 0.0), (0.02, -0.005, 0.01)]
CHANNELS = tuple(
    Channel(Element(tx), Element(rx), 1e-4 * number)
    for number, tx in enumerate(PLACES_TX)
    for rx in PLACES_RX
)


def paths_of(moving: bool) -> tuple:
    receiver, transmitter = (RECEIVER, TRANSMITTER) if moving else STILL
    scene = FrameMotion(SPAN_S, receiver, transmitter, False, BODIES)
    rows = PathRows.zeros(len(PATHS))
    for at, (points, numbers) in enumerate(PATHS):
        row = rows[at : at + 1]
        way = [receiver.pose[:3, 3], *map(np.array, points), transmitter.pose[:3, 3]]
        row["length_m"] = sum(np.linalg.norm(b - a) for a, b in itertools.pairwise(way))
        row["order"] = len(points)
        row["first_scatterer_m"], row["last_scatterer_m"] = points[0], points[-1]
        row["first_body"], row["last_body"] = numbers[0], numbers[-1]
        row["direction"] = (way[1] - way[0]) / np.linalg.norm(way[1] - way[0])
    aperture_m2 = (299_792_458 / CARRIER_HZ) ** 2 / (4 * math.pi)
    paths = dataclasses.replace(
        make_paths(np.array([1.0, 4.0, 2.0, 3.0]) / aperture_m2, rows["length_m"]),
        geometry=geometry_of(rows),
        motion=motion_of_rows(rows, scene),
    )
    return paths, AntennaMotion(receiver, transmitter)


def direct_sum(channel: Channel, antennas: AntennaMotion, frequency_hz: list) -> np.ndarray:
    """sum a exp(-j 2 pi f tau), exact distances, extended precision, (rows, frequencies)."""
    amplitudes = np.sqrt([1.0, 4.0, 2.0, 3.0])
    code_s = 255 / 500e6
    starts = [m / 2000.0 + n * code_s + channel.start_offset_s for m in range(16) for n in range(2)]
    result = np.zeros((len(starts), len(frequency_hz)), dtype=complex)
    for row, time_s in enumerate(starts):
        for (points, numbers), amplitude in zip(PATHS, amplitudes, strict=True):
            ends = []
            for motion, element in (
                (antennas.receiver, channel.rx),
                (antennas.transmitter, channel.tx),
            ):
                pose = motion.pose
                ends.append(at(motion, pose[:3, 3] + pose[:3, :3] @ element.position_m, time_s))
            way = [ends[0]]
            way += [
                at(BODIES[n - 1], np.array(p), time_s) for p, n in zip(points, numbers, strict=True)
            ]
            way.append(ends[1])
            length = sum(np.sqrt(np.sum((b - a) ** 2)) for a, b in itertools.pairwise(way))
            cycles = np.array(frequency_hz, dtype=np.longdouble) * (length / LIGHT)
            cycles = (cycles - np.rint(cycles)).astype(float)
            result[row] += amplitude * np.exp(-2j * np.pi * cycles)
    return result


@pytest.mark.parametrize("moving", [False, True], ids=["still radar", "moving radar"])
def test_every_channel_is_a_direct_sum(moving: bool) -> None:
    """2 x 2 elements, 77 GHz: phases within 1e-6 rad, spherical wavefronts and motion included."""
    paths, antennas = paths_of(moving)
    radar = Radar(PMCW, BURST, CHANNELS)
    synthesizer = synthesizer_for(
        radar,
        (0.0, 60.0),
        EchoOptions(tolerance=1e-9, motion_within_pulse=False),
        antennas=antennas,
    )
    assert isinstance(synthesizer, StretchSynthesizer)
    synthesizer.add(paths)
    code = np.fft.fft(replica(PMCW))
    found = np.fft.fftshift(np.fft.fft(synthesizer.result().samples) / code, axes=-1)
    assert found.shape == (4, 32, 255)
    step = 500e6 / 255
    frequencies = [CARRIER_HZ + (n - 127) * step for n in range(255)]
    for number, channel in enumerate(CHANNELS):
        want = direct_sum(channel, antennas, frequencies)
        # the weakest path has amplitude 1
        assert np.abs(found[number] - want).max() < 1e-6
    # and the channels do differ
    assert np.abs(found[0] - found[1]).max() > 0.5


def test_pulses_of_a_later_channel_meet_the_scene_later() -> None:
    """The second channel starts 250 us later: the target has gone 7.5 mm by then."""
    waveform = Waveform(5.3e9, 50e6, 2.5e-6, 60e6)

    def samples(channels: tuple[Channel, ...], range_m: float) -> np.ndarray:
        radar = Radar(waveform, Burst(1000.0, 8), channels)
        synthesizer = synthesizer_for(radar, (600.0, 800.0), EchoOptions(tolerance=1e-9))
        synthesizer.add(make_paths(1.0, 2 * range_m, 30.0))
        return np.asarray(synthesizer.result().samples)

    first, second = samples((Channel(), Channel(start_offset_s=250e-6)), 700.0)
    (later,) = samples((Channel(),), 700.0075)
    size = np.abs(first).max()
    assert np.abs(second - later).max() < 1e-7 * size
    assert np.abs(second - first).max() > size


@pytest.mark.parametrize(
    "waveform",
    [
        Waveform(5.3e9, 50e6, 2.5e-6, 60e6),
        FmcwWaveform(77e9, 300e6, 256, 10e6),
        PMCW,
    ],
    ids=lambda waveform: waveform.kind,
)
def test_only_wanted_pulses_are_formed(waveform: AnyWaveform) -> None:
    """A channel that rests, and a render that counts for four pulses: the others cost nothing."""
    active = tuple(n % 2 == 0 for n in range(16))
    channels = (Channel(active=active), Channel(start_offset_s=100e-6))
    wanted = (np.arange(16) >= 5) & (np.arange(16) < 9)
    paths = make_paths(np.array([1.0, 3.0]), np.array([30.0, 41.0]), np.array([0.0, 12.0]))

    def formed(mask: np.ndarray | None) -> Echoes:
        synthesizer = synthesizer_for(
            Radar(waveform, BURST, channels), (5.0, 30.0), EchoOptions(tolerance=1e-9), wanted=mask
        )
        synthesizer.add(paths)
        return synthesizer.result()

    every, some = formed(None), formed(wanted)
    rows = np.repeat(wanted, every.samples.shape[1] // 16)
    assert not some.samples[:, ~rows].any()
    assert not some.samples[0, ~np.repeat(active, rows.size // 16)].any()
    size = np.abs(every.samples).max()
    assert np.abs(some.samples[:, rows] - every.samples[:, rows]).max() < 1e-8 * size
    assert np.abs(some.samples[1, rows]).min(axis=0).max() > 0.1 * size
    assert some.report is not None
    assert some.report.pulses * 16 <= 4 * rows.size


def test_what_is_not_known_is_named() -> None:
    paths, antennas = paths_of(False)
    radar = Radar(PMCW, BURST, CHANNELS)

    def add(paths: object, antennas: AntennaMotion | None) -> None:
        synthesizer_for(radar, (0.0, 60.0), antennas=antennas).add(paths)  # type: ignore[arg-type]

    with pytest.raises(ConfigError, match="poses, which are unknown"):
        add(paths, None)
    geometry = dataclasses.replace(paths.geometry, last_scatterer_m=np.full((4, 3), np.nan))
    with pytest.raises(ConfigError, match="4 of 4 paths have no known first or last scatterer"):
        add(dataclasses.replace(paths, geometry=geometry), antennas)
    with pytest.raises(ConfigError, match="4 of 4 paths have no known"):
        add(dataclasses.replace(paths, geometry=None), antennas)
    rates = dataclasses.replace(paths, motion=None, range_rate_mps=np.array([0, 1.0, 0, 2.0]))
    with pytest.raises(ConfigError, match="2 paths move at a range rate alone"):
        add(rates, antennas)


def test_channels_are_checked() -> None:
    for wrong, message in (
        (lambda: Element((1.0, math.nan, 0.0)), "three finite numbers"),
        (lambda: Element(orientation=((2, 0, 0), (0, 1, 0), (0, 0, 1))), "rotation matrix"),
        (lambda: Channel(start_offset_s=-1.0), "Start offset"),
        (lambda: Radar(PMCW, BURST, ()), "no channels"),
        (lambda: Radar(PMCW, BURST, (Channel(start_offset_s=4.99e-4),)), "channel 0 ends"),
        (lambda: Radar(PMCW, BURST, (Channel(active=(True,)),)), "1 pulses"),
    ):
        with pytest.raises(ConfigError, match=message):
            wrong()


def array_echoes() -> tuple:
    """LFM pulses to two receivers, the second of which is used at every other pulse."""
    paths, antennas = paths_of(True)
    active = tuple(m % 2 == 0 for m in range(16))
    channels = (Channel(), Channel(rx=Element((0.02, 0.0, 0.0)), active=active))
    radar = Radar(Waveform(CARRIER_HZ, 50e6, 1e-6, 60e6), BURST, channels)
    synthesizer = synthesizer_for(radar, (0.0, 60.0), antennas=antennas)
    synthesizer.add(paths)
    return synthesizer.result(), paths, antennas


def test_the_axis_goes_through_the_chain(tmp_path: Path) -> None:
    echoes, paths, _ = array_echoes()
    assert echoes.samples.shape[:2] == (2, 16)
    assert not echoes.samples[1, 1::2].any() and echoes.samples[1, ::2].any(axis=1).all()
    alone = synthesizer_for(Radar(echoes.radar.waveform, BURST), (0.0, 60.0))
    alone.add(paths)
    np.testing.assert_array_equal(alone.result().plane, echoes.samples[0])
    profiles = range_process(echoes)
    rd_map = range_doppler(mti_cancel(profiles, 2))
    assert rd_map.values.shape == (2, 15, profiles.range_m.size) == rd_map.power.shape
    with pytest.raises(ConfigError, match="2 channels; expected one"):
        find_peaks(rd_map)
    for number in range(2):
        one = rd_map.channel(number)
        np.testing.assert_array_equal(one.plane, rd_map.values[number])
        assert one.radar.channels[0].rx == echoes.radar.channels[number].rx
        own = range_doppler(mti_cancel(range_process(echoes.channel(number)), 2))
        np.testing.assert_array_equal(own.values, one.values)
    with pytest.raises(ConfigError, match="Channel 2 of a radar with 2"):
        rd_map.channel(2)
    data, meta = write_sigmf(tmp_path / "array", echoes)
    stored = np.fromfile(data, "<c8").reshape(16, -1, 2)
    np.testing.assert_array_equal(np.moveaxis(stored, -1, 0), echoes.samples.astype("<c8"))
    assert json.loads(meta.read_text("utf-8"))["global"]["core:num_channels"] == 2


def test_receivers_have_noise_of_their_own_and_one_oscillator() -> None:
    echoes, _, _ = array_echoes()
    noisy = apply_receiver(echoes, Receiver(noise_figure_db=3.0)).echoes.samples - echoes.samples
    correlation = np.vdot(noisy[0], noisy[1]) / np.vdot(noisy[0], noisy[0])
    assert abs(correlation) < 5 / math.sqrt(noisy[0].size)
    same = dataclasses.replace(echoes, samples=np.stack([echoes.samples[0]] * 2))
    spectrum = PhaseNoise((1e3, 1e6), (-80.0, -80.0))
    turned = apply_receiver(same, Receiver(phase_noise=spectrum)).echoes.samples
    np.testing.assert_array_equal(turned[0], turned[1])
    assert not np.array_equal(turned[0], same.samples[0])


def test_channels_in_turns_meet_the_oscillator_at_their_times() -> None:
    """Two channels, half an interval apart, are the pulses of one at twice the PRF."""

    def received(burst: Burst, *channels: Channel) -> np.ndarray:
        radar = Radar(Waveform(CARRIER_HZ, 50e6, 1e-6, 60e6), burst, channels)
        synthesizer = synthesizer_for(radar, (0.0, 60.0))
        synthesizer.add(make_paths(1.0, 60.0))
        spectrum = PhaseNoise((1e3, 1e6), (-80.0, -80.0))
        return apply_receiver(synthesizer.result(), Receiver(phase_noise=spectrum)).echoes.samples

    in_turns = received(Burst(2000.0, 16), Channel(), Channel(start_offset_s=2.5e-4))
    (one,) = received(Burst(4000.0, 32), Channel())
    largest = abs(one).max()
    for number in range(2):
        np.testing.assert_allclose(in_turns[number], one[number::2], rtol=0, atol=1e-9 * largest)
    assert abs(one[1::2] - one[::2]).max() > 1e-3 * largest


def test_an_array_is_what_each_of_its_channels_is_alone() -> None:
    """Antennas apart whose elements are at the same places in their axes: values that channels
    share are those of the right end.
    """
    paths, antennas = paths_of(True)
    elements = [Element((0.0, 0.02, 0.0)), Element((0.04, 0.0, 0.01))]
    channels = tuple(Channel(tx, rx) for tx in elements for rx in elements)

    def samples_of(*chosen: Channel) -> np.ndarray:
        radar = Radar(PMCW, BURST, chosen)
        synthesizer = synthesizer_for(radar, (0.0, 60.0), antennas=antennas)
        synthesizer.add(paths)
        return synthesizer.result().samples

    together = samples_of(*channels)
    for found, channel in zip(together, channels, strict=True):
        np.testing.assert_array_equal(found, samples_of(channel)[0])
