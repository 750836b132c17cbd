# SPDX-License-Identifier: GPL-3.0-or-later
"""Amplitudes at every pulse: beams that sweep over a target during the burst, in closed form."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon import contract
from radarsim_addon.contract import MotionRecord
from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.antennas import direction_from_angles
from radarsim_addon.signal.decoding import frame_paths, open_frame
from radarsim_addon.signal.detection import FrameBudget
from radarsim_addon.signal.echoes import pulse_times_s, synthesize
from radarsim_addon.signal.motion import BodyMotion, FrameMotion, body_record
from radarsim_addon.signal.motion.body_motion import Segment, rotation
from radarsim_addon.signal.paths import (
    PathRows,
    geometry_of,
    make_paths,
    motion_of_rows,
)
from radarsim_addon.signal.pipeline import FrameResult, ProcessOptions, process_run
from radarsim_addon.signal.radar import (
    SINGLE_CHANNEL,
    Burst,
    Channel,
    Element,
    FmcwWaveform,
    Radar,
    Waveform,
    make_system,
)
from radarsim_addon.signal.scattering import Link, amplitude
from radarsim_addon.signal.scattering.amplitudes import PathEnds
from radarsim_addon.signal.spectrum import TOLERANCE
from radarsim_addon.typed_json import file_sha256, write_record
from tests.signal import path_runs as pr

#: 30 degrees in 63 pulse intervals.
BURST = Burst(1000.0, 64)
SPAN_S = 64 / 1000
SWEEP_RAD = math.radians(30) * 64 / 63
WAVEFORM = Waveform(5.3e9, 50e6, 2.5e-6, 60e6)
FMCW = FmcwWaveform(5.3e9, 50e6, 250, 1e6)
RANGE_M = 300.0
EIRP_W = 1e6
ANTENNAS = {
    "gaussian": contract.AntennaRecord(
        "gaussian", {"azimuth_beamwidth_deg": 12.0, "elevation_beamwidth_deg": 30.0}
    ),
    "array": contract.AntennaRecord("array", {"columns": 8, "rows": 2}),
}
WIDE = contract.AntennaRecord("cosine", {"exponent": 2.0})


def turning(start_azimuth_deg: float = -15.0) -> BodyMotion:
    """An antenna at the origin that turns steadily to the right, from `start_azimuth_deg`."""
    matrix = np.array(pr.pose((0, 0, 0), start_azimuth_deg))
    spin = np.array([[0.0, 0.0, -SWEEP_RAD / 2]])
    segment = Segment(0.0, SPAN_S, np.zeros((1, 3)), np.zeros(3), spin, np.eye(3))
    return BodyMotion(matrix, (segment,))


def azimuths_rad(times_s: np.ndarray) -> np.ndarray:
    """Of a target straight along +Y, seen by the antenna of `turning`."""
    return math.radians(15.0) - SWEEP_RAD * times_s / SPAN_S


def two_way_gain(system: object, times_s: np.ndarray) -> np.ndarray:
    """G_t G_r in the direction of the target at these times."""
    direction = direction_from_angles(azimuths_rad(times_s), np.zeros(times_s.size))
    return system.transmitter.gain(direction) * system.receiver.gain(direction)  # type: ignore[attr-defined,no-any-return]


def swept(name: str, count: int = 1, slower: float = 1.0) -> tuple:
    """Paths of stationary point targets about 300 m along +Y, and the link of a turning radar.

    Its pulses follow one another in so much less time, in which it turns less.
    """
    record = contract.LinkBudget(1.0, ANTENNAS[name], WIDE)
    system = make_system(record, WAVEFORM.wavelength_m)
    body = turning()
    scene = FrameMotion(SPAN_S, body, body, False, [BodyMotion(np.eye(4))])
    rows = PathRows.zeros(count)
    range_m = RANGE_M + 0.7 * np.arange(count)
    rows["length_m"], rows["order"] = 2 * range_m, 1
    rows["first_scatterer_m"][:, 1] = rows["last_scatterer_m"][:, 1] = range_m
    rows["direction"][:, 1] = 1.0
    rows["first_body"] = rows["last_body"] = 1
    paths = dataclasses.replace(
        make_paths(np.full(count, 2e-7), rows["length_m"]),
        geometry=geometry_of(rows),
        motion=motion_of_rows(rows, scene),
    )
    receiver = pr.camera(body.pose.tolist())
    emitter = contract.TransmitterRecord(body.pose.tolist(), EIRP_W)
    times_s = pulse_times_s(Radar(WAVEFORM, BURST)) / slower
    return paths, Link(system, receiver, emitter, scene, times_s), system


@pytest.mark.parametrize("name", ANTENNAS)
def test_a_turning_radar_draws_its_pattern(name: str) -> None:
    """The amplitude at every pulse is the root of G_t G_r at that pulse's angle."""
    paths, link, system = swept(name)
    times_s = pulse_times_s(Radar(WAVEFORM, BURST))
    found = amplitude(paths, SINGLE_CHANNEL, times_s, frequency_hz=5.3e9, link=link)
    assert found.shape == (1, 64) and found.dtype == np.complex128
    aperture_m2 = WAVEFORM.wavelength_m**2 / (4 * math.pi)
    power_w = 2e-7 * aperture_m2 * two_way_gain(system, times_s) / EIRP_W
    np.testing.assert_allclose(np.abs(found[0]), np.sqrt(power_w), rtol=1e-9)
    # the mean over the burst is what budgets and expected powers are made of
    assert link.apply(paths).gain[0] == pytest.approx(
        np.mean(two_way_gain(system, times_s)) / EIRP_W, rel=1e-12
    )


def test_elements_in_one_place_that_look_elsewhere_keep_their_gains() -> None:
    """An array's channels are those of a radar with each of them alone."""
    paths, link, _ = swept(next(iter(ANTENNAS)), 3)
    turn = tuple(map(tuple, rotation(np.array([0.0, 0.1, 0.0])).tolist()))
    ahead, aside = Element((0.01, 0.0, 0.0)), Element((0.01, 0.0, 0.0), turn)
    channels = Channel(ahead, ahead), Channel(ahead, aside), Channel(aside, aside)

    def samples_of(*chosen: Channel) -> np.ndarray:
        radar = Radar(WAVEFORM, BURST, chosen)
        return synthesize(paths, radar, range_limits_m=(250.0, 350.0), link=link).samples

    together = samples_of(*channels)
    for found, channel in zip(together, channels, strict=True):
        np.testing.assert_array_equal(found, samples_of(channel)[0])
    power = np.sum(np.abs(together) ** 2, axis=(1, 2))
    assert power[1] != pytest.approx(power[0], rel=1e-3)


@pytest.mark.parametrize("slower", [1.0, 10.0, 1000.0])
@pytest.mark.parametrize("name", ANTENNAS)
def test_few_pulses_tell_the_mean_of_gains_that_change_slowly(name: str, slower: float) -> None:
    paths, link, system = swept(name, slower=slower)
    asked: list[int] = []
    factors = link.factors

    def counted(ends: PathEnds, times_s: np.ndarray) -> np.ndarray:
        asked.append(times_s.size)
        return factors(ends, times_s)

    link.factors = counted
    times_s = pulse_times_s(Radar(WAVEFORM, BURST)) / slower
    mean = np.mean(two_way_gain(system, times_s)) / EIRP_W
    assert link.apply(paths).gain[0] == pytest.approx(mean, rel=1e-8)
    assert asked == ([5] if slower > 500 else [5, 64])


@pytest.mark.parametrize("waveform", [WAVEFORM, FMCW], ids=["pulse", "fmcw"])
@pytest.mark.parametrize("name", ANTENNAS)
@pytest.mark.parametrize("count", [1, 300])
def test_samples_have_the_envelope_of_the_pattern(
    name: str, waveform: Waveform | FmcwWaveform, count: int
) -> None:
    """Targets that are stationary: every pulse is the same, but for the two-way pattern."""
    paths, link, system = swept(name, count)
    radar = Radar(waveform, BURST)
    limits_m = (200.0, 600.0)
    plain = synthesize(paths, radar, range_limits_m=limits_m, tolerance=1e-10).plane[0]
    times_s = pulse_times_s(radar)
    if waveform is FMCW:
        times_s = times_s + FMCW.grid_start_s + (FMCW.grid_count // 2) * FMCW.grid_interval_s
    envelope = np.sqrt(two_way_gain(system, times_s) / EIRP_W)
    for tolerance in (1e-10, TOLERANCE):
        echoes = synthesize(
            link.apply(paths), radar, range_limits_m=limits_m, link=link, tolerance=tolerance
        )
        found = np.array([np.vdot(plain, row) for row in echoes.plane]) / np.vdot(plain, plain)
        scale = envelope if tolerance < 1e-9 else envelope.max()
        assert (np.abs(found - envelope) / scale).max() < 1e-6
        assert any("gains change" in note for note in echoes.report.notes)


def test_terms_and_pulses_agree() -> None:
    """Polynomials of slow time, by type 3 and pulse by pulse, against gains at every pulse."""
    paths, link, _ = swept("gaussian", 2000)
    radar = Radar(WAVEFORM, BURST)

    def samples(method: str) -> tuple[np.ndarray, set[str]]:
        echoes = synthesize(
            paths, radar, range_limits_m=(200.0, 1800.0), link=link, slow_time_transform=method,
            speckle_seed=1, range_folding=False,
        )  # fmt: skip
        return echoes.plane, {f"{s.motion} {s.transform}" for s in echoes.report.steps}

    exact, _ = samples("per-pulse")
    for method, way in (("type3", "linear type 3"), ("auto", "linear")):
        found, ways = samples(method)
        assert any(w.startswith(way) for w in ways)
        assert np.linalg.norm(found - exact) < 2 * TOLERANCE * np.linalg.norm(exact)


def test_nothing_changes_where_gains_do_not() -> None:
    """Isotropic antennas, or a stationary radar and targets: one column, and the same bits."""
    paths, link, _ = swept("gaussian", 5)
    radar = Radar(WAVEFORM, BURST)
    still = Link(
        link.system,
        pr.camera(turning().pose.tolist()),
        contract.TransmitterRecord(turning().pose.tolist(), EIRP_W),
    )
    resting = dataclasses.replace(paths, motion=None)
    applied = still.apply(resting)
    times_s = pulse_times_s(radar)
    assert amplitude(applied, SINGLE_CHANNEL, times_s, frequency_hz=5.3e9, link=still).shape == (
        5,
        1,
    )
    limits_m = (200.0, 400.0)
    without = synthesize(applied, radar, range_limits_m=limits_m).samples
    np.testing.assert_array_equal(
        synthesize(applied, radar, range_limits_m=limits_m, link=still).samples, without
    )
    isotropic = make_system(contract.LinkBudget(), WAVEFORM.wavelength_m)
    body = turning()
    scene = FrameMotion(SPAN_S, body, body, False, [BodyMotion(np.eye(4))])
    flat = Link(
        isotropic, pr.camera(body.pose.tolist()),
        contract.TransmitterRecord(body.pose.tolist(), EIRP_W), scene, times_s,
    )  # fmt: skip
    assert amplitude(paths, SINGLE_CHANNEL, times_s, frequency_hz=5.3e9, link=flat).shape == (5, 1)


def test_elements_of_an_array_have_their_own_patterns() -> None:
    """An element that is turned by 20 degrees sees the target 20 degrees off."""
    paths, link, system = swept("gaussian")
    turn = math.radians(20.0)
    # about the antenna's y axis (up): to the left
    axes = ((math.cos(turn), 0.0, math.sin(turn)), (0.0, 1.0, 0.0),
            (-math.sin(turn), 0.0, math.cos(turn)))  # fmt: skip
    channel = Channel(rx=Element(orientation=axes, antenna=ANTENNAS["gaussian"]))
    times_s = np.linspace(0, SPAN_S, 9)
    found = amplitude(paths, channel, times_s, frequency_hz=5.3e9, link=link)
    angle = azimuths_rad(times_s)
    flat = np.zeros(angle.size)
    pattern = system.transmitter.gain
    gain = pattern(direction_from_angles(angle, flat)) * pattern(
        direction_from_angles(angle + turn, flat)
    )
    aperture_m2 = WAVEFORM.wavelength_m**2 / (4 * math.pi)
    np.testing.assert_allclose(np.abs(found[0]) ** 2, 2e-7 * aperture_m2 * gain / EIRP_W, rtol=1e-9)
    with pytest.raises(ConfigError, match="no link budget"):
        amplitude(paths, channel, times_s, frequency_hz=5.3e9)


# -- a run folder ----------------------------------------------------------------------------------


def turning_run(folder: Path, name: str) -> Path:
    """A run whose radar turns by 30 degrees past a small plate, as Blender would write it."""
    body = turning()
    receiver = pr.camera(body.pose.tolist(), 30.0)
    emitter = contract.TransmitterRecord(body.pose.tolist(), EIRP_W)
    rows = PathRows.zeros(1)
    rows["power_w"], rows["length_m"], rows["order"] = 1e-9, 2 * RANGE_M, 1
    rows["first_scatterer_m"][:, 1] = rows["last_scatterer_m"][:, 1] = RANGE_M
    rows["direction"][:, 1] = 1.0
    rows["solid_angle_sr"] = 1e-6
    rows["first_body"] = rows["last_body"] = rows["first_object"] = rows["last_object"] = 1
    run = pr.write_run(
        folder, rows, ["Target"], receiver, emitter, range_limits_m=600.0,
        system=contract.LinkBudget(1.0, ANTENNAS[name], WIDE),
    )  # fmt: skip
    frame = run / contract.frame_dir(1)
    motion = MotionRecord(
        frame=1, time_s=0.0, duration_s=SPAN_S, samples=17, receiver_kind="perspective",
        antennas=[body_record(n, "", body, False) for n in ("Receiver", "Transmitter")],
        bodies=[body_record("Target", "", BodyMotion(np.eye(4)), False)],
        displacement_error_bound_m=0.0, displacement_error_bound_wavelengths=0.0,
        approximated_motion_fraction=0.0, unknown_motion_fraction=0.0,
        deforming_surfaces_file="", deforming_surfaces_sha256="",
    )  # fmt: skip
    write_record(frame / contract.MOTION_FILE, motion)
    from radarsim_addon.typed_json import read_record

    record = read_record(frame / contract.PATHS_FILE, contract.PathsRecord)
    record = dataclasses.replace(
        record,
        motion_file=contract.MOTION_FILE,
        motion_sha256=file_sha256(frame / contract.MOTION_FILE),
    )
    write_record(frame / contract.PATHS_FILE, record)
    return run


@pytest.mark.parametrize("name", ANTENNAS)
def test_a_run_folder_of_a_turning_radar(tmp_path: Path, name: str) -> None:
    """Through the whole chain: samples, expected power and the object's power."""
    run = turning_run(tmp_path / "run", name)
    options = ProcessOptions(products=False, plots=False, speckle_seed=None, tolerance=1e-10)
    result = next(e for e in process_run(run, options) if isinstance(e, FrameResult))
    system = make_system(contract.LinkBudget(1.0, ANTENNAS[name], WIDE), WAVEFORM.wavelength_m)
    times_s = pulse_times_s(result.echoes.radar)
    gain = two_way_gain(system, times_s) / EIRP_W
    level = np.abs(result.echoes.plane).max(axis=1)
    relative = level / level.max() / np.sqrt(gain / gain.max())
    np.testing.assert_allclose(relative, 1, rtol=1e-6)
    peak_w = np.abs(result.compressed.plane).max(axis=1) ** 2
    np.testing.assert_allclose(peak_w / peak_w.mean(), gain / gain.mean(), rtol=1e-6)
    # The path lies between two samples of the profile, a quarter of a cell away at most.
    assert 0.98 < peak_w.mean() / (1e-9 * gain.mean()) < 1.0001
    assert result.budget is not None and result.expected is not None
    assert result.budget.objects[0].power_w == pytest.approx(1e-9 * gain.mean(), rel=1e-9)
    assert result.expected.profile.max() == pytest.approx(1e-9 * gain.mean(), rel=0.05)


def test_frames_know_their_antennas_motion(tmp_path: Path) -> None:
    from radarsim_addon.signal.runs import open_run

    frame = open_run(turning_run(tmp_path / "run", "gaussian")).frame(1)
    budget = FrameBudget(open_frame(frame))
    assert budget.antennas.receiver.moving and budget.antennas.transmitter.moving
    gain = budget.apply(frame_paths(frame)).gain
    assert gain is not None and gain[0] > 0
