# SPDX-License-Identifier: GPL-3.0-or-later
"""Phases of an array's channels, and the directions found from them; no renders."""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from radarsim_addon.arrays import Complex, Real
from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.signal.angles import DirectionFinder, angles_deg, covariance_of, esprit, music
from radarsim_addon.signal.detection import DirectedDetection, detect_in_directions
from radarsim_addon.signal.echoes import (
    Echoes,
    ReceivedSignal,
    Receiver,
    recorded_together,
    separate,
)
from radarsim_addon.signal.motion import FrameMotion
from radarsim_addon.signal.paths import (
    PathRows,
    channel_lengths,
    geometry_of,
    make_paths,
    motion_of_rows,
)
from radarsim_addon.signal.pipeline import FrameResult, ProcessOptions, process_run
from radarsim_addon.signal.radar import AntennaArray, Radar, Schedule, array_preset, linear_array

from . import array_scenes as scenes
from . import scenes as rendered
from .case import Bench, Case, Check, Group, absolute_check, relative_check, worst_of

#: Directions off all axes (azimuth, elevation) [degrees].
_DIRECTIONS = ((0.0, 0.0), (10.3, 4.0), (-34.7, 7.0), (57.0, -3.0))
_MIDDLE_S = (scenes.BURST.pulses - 1) / (2 * scenes.BURST.prf_hz)
_TRIALS = 1000
_WAVE_M = scenes.WAVELENGTH_M


def phases(_: Bench) -> list[Check]:
    """Eight elements, antennas and a point that move, against distances in extended precision."""
    times_s = np.array([0.0, 1.3e-3, 6.1e-3])
    velocity = np.array([2.0, 0.5, -14.0])
    antennas = scenes.antennas_at((0.3, 1.2, -0.4), velocity_mps=tuple(velocity.tolist()))
    radar = scenes.radar_of("1x8")
    checks = []
    for range_m in (5.0, 80.0, 1e3, 1e4):
        worst = 0.0
        for azimuth_deg, elevation_deg in _DIRECTIONS:
            start_m = np.array([0.3, 1.2, -0.4])
            point_m = start_m + range_m * scenes.direction_of(azimuth_deg, elevation_deg)
            speed = np.array([-3.0, 1.0, 22.0])
            body = scenes.moving(point_m, speed)
            row = PathRows.zeros(1)
            row["length_m"], row["order"] = 2 * np.linalg.norm(point_m - start_m), 1
            row["first_scatterer_m"] = row["last_scatterer_m"] = point_m
            row["first_body"] = row["last_body"] = 1
            row["direction"] = (point_m - start_m) / np.linalg.norm(point_m - start_m)
            motion = FrameMotion(
                scenes.SPAN_S, antennas.receiver, antennas.transmitter, False, [body]
            )
            paths = dataclasses.replace(
                make_paths(np.ones(1), row["length_m"]),
                geometry=geometry_of(row),
                motion=motion_of_rows(row, motion),
            )
            for channel in radar.channels:
                ours = channel_lengths(paths, channel, antennas).lengths_m(times_s, slice(None))[0]
                exact = [
                    sum(
                        np.linalg.norm(
                            (point_m - start_m - np.array(element.position_m)).astype(np.longdouble)
                            + (speed - velocity).astype(np.longdouble) * np.longdouble(time_s)
                        )
                        for element in (channel.tx, channel.rx)
                    )
                    for time_s in times_s.tolist()
                ]
                apart = float(np.abs(ours - np.array(exact, dtype=np.longdouble)).max())
                worst = max(worst, 360 * apart / scenes.WAVELENGTH_M)
        checks.append(
            absolute_check(f"{range_m:g} m", 0.0, worst, 0.1, "exact distances", unit="degrees")
        )
    return checks


def points(_: Bench) -> list[Check]:
    """A point alone through the whole chain: near field, folded Doppler, TDM."""
    checks = []
    for preset in ("1x8", "3x4"):
        radar = scenes.radar_of(preset)
        found: list[Check] = []
        for range_m in (5.0, 17.3, 31.0):
            for speed_mps in (0.0, 3.0, 30.0):
                for azimuth_deg, elevation_deg in _DIRECTIONS:
                    up = elevation_deg if preset == "3x4" else 0.0
                    name = f"{range_m:g} m, {speed_mps:g} m/s, {azimuth_deg:g} degrees"
                    error = _error_deg(radar, range_m, speed_mps, azimuth_deg, up)
                    found.append(absolute_check(name, 0.0, error, 0.01, "geometry", unit="degrees"))
        checks.append(worst_of(f"{preset}: azimuth, elevation of", found))
    return checks


def _error_deg(
    radar: Radar, range_m: float, speed_mps: float, azimuth_deg: float, elevation_deg: float
) -> float:
    """Larger error of azimuth and elevation; noise is 80 dB below the echo."""
    point = range_m * scenes.direction_of(azimuth_deg, elevation_deg)
    echoes = scenes.echoes_of(radar, [point], radial_mps=speed_mps)
    noise = np.random.default_rng(1).standard_normal((2, *echoes.samples.shape)) * 1e-5
    echoes = dataclasses.replace(echoes, samples=echoes.samples + noise[0] + 1j * noise[1])
    geometry = scenes.geometry_at(radar, time_s=_MIDDLE_S)
    targets = detect_in_directions(
        scenes.map_of(echoes), geometry, np.eye(4), dynamics_db=60.0
    ).targets
    azimuth, elevation = scenes.angles_of(targets[0])
    if not geometry.measures[1]:
        return abs(azimuth - azimuth_deg)
    return max(abs(azimuth - azimuth_deg), abs(elevation - elevation_deg))


def noise(_: Bench) -> list[Check]:
    """Eight elements at 20 dB, one snapshot of a cell, against the Cramer-Rao bound."""
    geometry, rng = scenes.geometry_at(scenes.radar_of("1x8")), np.random.default_rng(11)
    finder, step = DirectionFinder(geometry), np.arange(8) - 3.5
    errors: dict[str, list[float]] = {"beam": [], "MUSIC": [], "ESPRIT": []}
    for _trial in range(_TRIALS):
        sine = float(rng.uniform(-0.7, 0.7))
        samples = 10 * np.exp(1j * np.pi * sine * step) + _noise(rng, 8)
        (source,) = finder.find(samples, 1e3, 0.0, math.inf, 1)
        smooth = covariance_of(samples[:, None], subarray=6)
        errors["beam"].append(source.direction[0] - sine)
        errors["ESPRIT"].append(float(esprit(smooth, 0.5, 1)[0]) - sine)
        errors["MUSIC"].append(_music_peak(smooth, sine) - sine)
    # variance of the phase step: 6 / (SNR N (N^2 - 1))
    bound = math.sqrt(6 / (100 * 8 * 63)) / math.pi
    return [
        absolute_check(
            f"rms over the bound, {name}",
            1.0,
            math.sqrt(np.mean(np.square(found))) / bound,
            0.6,
            "Rife and Boorstyn 1974; at most 1.6",
            standard_error=1 / math.sqrt(2 * _TRIALS),
        )
        for name, found in errors.items()
    ]


def _noise(rng: np.random.Generator, count: int) -> Complex:
    values = rng.standard_normal((2, count)) / math.sqrt(2)
    return np.asarray(values[0] + 1j * values[1])


def _music_peak(covariance: Complex, near: float) -> float:
    """Place of the spectrum's peak, by three grids of which each is finer."""
    place, reach = near, 0.1
    for _grid in range(3):
        grid = np.linspace(place - reach, place + reach, 201)
        steering = np.exp(1j * np.pi * np.outer(grid, np.arange(len(covariance))))
        place, reach = float(grid[music(covariance, steering, 1).argmax()]), reach / 50
    return place


def turns(_: Bench) -> list[Check]:
    """Two transmitters in turn at 30 m/s: with the phases of their slots, and without."""
    spacing_m = scenes.WAVELENGTH_M / 2
    array = AntennaArray(linear_array(2, 4 * spacing_m), linear_array(4, spacing_m))
    radar = Radar(scenes.WAVEFORM, scenes.BURST, array.channels(scenes.BURST))
    checks = []
    for speed_mps in (30.0, -13.0):
        for azimuth_deg in (12.0, -40.0):
            name = f"{speed_mps:g} m/s, {azimuth_deg:g} degrees"
            error = _error_deg(radar, 25.0, speed_mps, azimuth_deg, 0.0)
            checks.append(
                absolute_check(f"compensated, {name}", 0.0, error, 0.01, "geometry", unit="degrees")
            )
            point = 25.0 * scenes.direction_of(azimuth_deg)
            rd_map = scenes.map_of(scenes.echoes_of(radar, [point], radial_mps=speed_mps))
            row, col = np.unravel_index(rd_map.power[0].argmax(), rd_map.power[0].shape)
            geometry = scenes.geometry_at(radar, time_s=_MIDDLE_S)
            unaware = DirectionFinder(dataclasses.replace(geometry, offset_s=np.zeros(8)))
            (source,) = unaware.find(rd_map.values[:, row, col], 25.0, 0.0, math.inf, 1)
            jump = 4 * math.pi * speed_mps / scenes.WAVELENGTH_M * geometry.offset_s
            sines = np.linspace(-1, 1, 100_001)
            ahead = math.sin(math.radians(azimuth_deg)) - sines
            beams = np.exp(1j * (np.pi * np.outer(ahead, np.arange(8)) - jump)).sum(axis=1)
            theory_deg = math.degrees(math.asin(sines[np.abs(beams).argmax()]))
            checks.append(
                absolute_check(
                    f"not compensated, {name}",
                    theory_deg,
                    angles_deg(source.direction)[0],
                    0.1,
                    "sum of the phases",
                    unit="degrees",
                )
            )
    return checks


def at_once(_: Bench) -> list[Check]:
    """Three transmitters at once against the same ones sent one by one, and their crosstalk."""
    checks = []
    schedules: tuple[Schedule, ...] = ("ddm", "bpm")
    for schedule in schedules:
        array = dataclasses.replace(array_preset("3x4", scenes.WAVELENGTH_M), schedule=schedule)
        channels = array.channels(scenes.BURST, scenes.WAVEFORM.duration_s)
        radar = Radar(scenes.WAVEFORM, scenes.BURST, channels)
        name = schedule.upper()
        points_m = [12 * scenes.direction_of(15, 5), 23.7 * scenes.direction_of(-38)]
        alone = scenes.echoes_of(radar, points_m).samples[:, : scenes.BURST.pulses]
        away = _told_apart(radar, scenes.echoes_of(radar, points_m)) - alone
        error = float(np.linalg.norm(away) / np.linalg.norm(alone))
        checks.append(absolute_check(f"{name}, stationary", 0.0, error, 1e-6, "sent one by one"))
        for speed_mps in (0.5, 3.0, -7.0):
            echoes = scenes.echoes_of(radar, points_m[:1], radial_mps=speed_mps)
            only = np.zeros_like(echoes.samples)
            only[4:8] = echoes.samples[4:8]  # the second transmitter alone
            found = _told_apart(radar, dataclasses.replace(echoes, samples=only))[:4]
            step = len(only[0]) // scenes.BURST.pulses
            leak = float(np.linalg.norm(found) / np.linalg.norm(only[4:8, ::step]))
            # a target turns by w from pulse to pulse, at each frequency of the ramp by another
            ramp_hz = scenes.CARRIER_HZ + scenes.WAVEFORM.bandwidth_hz * np.linspace(-0.5, 0.5, 65)
            turn = -4 * math.pi * speed_mps * ramp_hz / SPEED_OF_LIGHT_MPS
            pulse = np.arange(radar.sent.burst.pulses)
            heard = np.exp(1j * np.outer(turn / radar.sent.burst.prf_hz, pulse))
            heard *= np.tile(channels[4].code, scenes.BURST.pulses)
            if schedule == "ddm":
                power = np.abs(np.fft.fft(heard)) ** 2
                half = scenes.BURST.pulses // 2
                theory = (power[:, :half].sum() + power[:, -half:].sum()) / power.sum()
            else:
                blocks = heard.reshape(len(ramp_hz), -1, radar.slots).mean(axis=2)
                theory = np.mean(np.abs(blocks) ** 2)
            theory = math.sqrt(theory)
            label = f"{name}, crosstalk at {speed_mps:g} m/s"
            checks.append(absolute_check(label, theory, leak, 2e-3, "phases of the pulses"))
    return checks


def _told_apart(radar: Radar, echoes: Echoes) -> Complex:
    """Samples of each pair after all have sent at once."""
    together = ReceivedSignal(recorded_together(echoes, radar))
    return np.asarray(separate(together, radar).echoes.samples)


def pairs(_: Bench) -> list[Check]:
    """Two points of 0 and -3 dB in one cell, 12 and 6 degrees apart (0.8 and 0.4 beam widths)."""
    radar, checks = scenes.radar_of("3x4"), []
    geometry = scenes.geometry_at(radar, time_s=_MIDDLE_S)
    for apart_deg in (12.0, 6.0):
        places = [20 * scenes.direction_of(angle) for angle in (3.0, 3.0 + apart_deg)]
        echoes = scenes.echoes_of(radar, places, radial_mps=3.0, powers_w=[1.0, 0.5])
        rd_map = scenes.map_of(echoes)
        targets = detect_in_directions(rd_map, geometry, np.eye(4), dynamics_db=40.0).targets
        targets = sorted(targets, key=lambda one: scenes.angles_of(one)[0])
        for target, azimuth_deg, power in zip(
            targets, (3.0, 3.0 + apart_deg), (1, 0.5), strict=True
        ):
            name = f"{apart_deg:g} degrees apart, at {azimuth_deg:g}"
            checks += [
                absolute_check(
                    f"azimuth, {name}", azimuth_deg, scenes.angles_of(target)[0], 0.05, "geometry",
                    unit="degrees",
                ),
                relative_check(
                    f"power, {name}", power, 10 ** (target.level_db / 10), 0.02, "given"
                ),
            ]  # fmt: skip
    return checks


def equal_pairs(_: Bench) -> list[Check]:
    """Two equal points in one cell at random places: the sum may look like one of another fold."""
    radar, rng, checks = scenes.radar_of("3x4"), np.random.default_rng(8), []
    for apart_deg in (8.0, 15.0, 25.0):
        worst = max(_pair_error_deg(radar, apart_deg, rng) for _ in range(20))
        name = f"azimuths of 20 pairs, {apart_deg:g} degrees apart"
        checks.append(absolute_check(name, 0.0, worst, 0.5, "geometry", unit="degrees"))
    return checks


def _pair_error_deg(radar: Radar, apart_deg: float, rng: np.random.Generator) -> float:
    """Larger error of two equal targets at 40 dB anywhere, whose phases add up by chance; infinite
    where they are not two.
    """
    azimuth_deg, range_m = rng.uniform(-40, 40 - apart_deg), rng.uniform(8, 25)
    expected = [azimuth_deg, azimuth_deg + apart_deg]
    places = [
        (range_m + later) * scenes.direction_of(angle)
        for later, angle in zip((0.0, rng.uniform(0, 0.05)), expected, strict=True)
    ]
    echoes = scenes.echoes_of(radar, places, radial_mps=rng.uniform(-3, 3))
    noise = rng.standard_normal((2, *echoes.samples.shape)) * 1e-2
    echoes = dataclasses.replace(echoes, samples=echoes.samples + noise[0] + 1j * noise[1])
    geometry = scenes.geometry_at(radar, time_s=_MIDDLE_S)
    targets = detect_in_directions(scenes.map_of(echoes), geometry, np.eye(4), dynamics_db=30.0)
    near = [one for one in targets.targets if one.level_db > -30]
    if len(near) != 2:
        return math.inf
    found = sorted(scenes.angles_of(one)[0] for one in near)
    return max(abs(one - other) for one, other in zip(found, expected, strict=True))


def ghosts(_: Bench) -> list[Check]:
    """A point at 20 m before a wall at 6 m to the right: paths over it on one way, or on both."""
    one_way, both = [(0, 1), (1, 0)], [(1, 1)]
    checks: dict[str, list[Check]] = {}

    def check(name: str, point: Real, expected_deg: float, found_deg: float) -> None:
        at = f"{angles_deg(point / np.linalg.norm(point))[0]:.3g} degrees"
        one = absolute_check(at, expected_deg, found_deg, 0.05, "images", unit="degrees")
        checks.setdefault(name, []).append(one)

    def found(radar: Radar, point: Real, over: list[tuple[int, int]]) -> list[float]:
        rd_map = scenes.map_of(scenes.echoes_of(radar, [point] * len(over), over=over))
        geometry = scenes.geometry_at(radar, time_s=_MIDDLE_S)
        found = detect_in_directions(rd_map, geometry, np.eye(4), dynamics_db=40.0).targets
        return sorted(scenes.angles_of(target)[0] for target in found)

    receivers = scenes.radar_of("1x8")
    virtual = AntennaArray(linear_array(2, 2 * _WAVE_M), linear_array(4, _WAVE_M / 2))
    turns = Radar(scenes.WAVEFORM, scenes.BURST, virtual.channels(scenes.BURST))
    for azimuth_deg in (0.0, -12.0, 8.0):
        point = 20.0 * scenes.direction_of(azimuth_deg)
        image = scenes.mirrored(point)
        image_deg = angles_deg(image / np.linalg.norm(image))[0]
        (alone,) = found(receivers, point, one_way[:1])
        check("1x8, over the wall on transmit", point, azimuth_deg, alone)
        first, second = found(receivers, point, one_way)
        check("1x8, both one-way paths: the direct leg", point, azimuth_deg, first)
        check("1x8, both one-way paths: the leg over the wall", point, image_deg, second)
        for name, radar in (("1x8", receivers), ("2x4", turns)):
            check(
                f"{name}, over the wall on both ways", point, image_deg, *found(radar, point, both)
            )
        beam_deg = _beam_of(turns, point, one_way)
        tops_deg = _tops_of_ghost(turns, point)
        nearest = min(tops_deg, key=lambda top, beam_deg=beam_deg: abs(top - beam_deg))
        check("2x4, both one-way paths in one beam", point, nearest, beam_deg)
    return [worst_of(name, each) for name, each in checks.items()]


def _beam_of(radar: Radar, point: Real, over: list[tuple[int, int]]) -> float:
    """Azimuth of the one direction that fits the channels best [degrees]."""
    rd_map = scenes.map_of(scenes.echoes_of(radar, [point] * len(over), over=over))
    row, col = np.unravel_index(rd_map.power[0].argmax(), rd_map.power[0].shape)
    finder = DirectionFinder(scenes.geometry_at(radar, time_s=_MIDDLE_S))
    range_m, values = float(rd_map.range_m[col]), rd_map.values[:, row, col]
    (source,) = finder.find(values, range_m, float(rd_map.doppler_hz[row]), math.inf, 1)
    return angles_deg(source.direction)[0]


def _tops_of_ghost(radar: Radar, point: Real) -> list[float]:
    """Azimuths of the beams with the largest sum of both one-way paths over the wall [degrees].

    Paths there and back give two, equally high. The Doppler may be folded: the second transmitter
    sends half an interval later, and so its phases have either sign.
    """
    image, sines, tops = scenes.mirrored(point), np.linspace(-1, 1, 100_001), []
    for sign in (1.0, -1.0):
        beams = np.zeros(sines.size, dtype=complex)
        for channel in radar.channels:
            tx, rx = (np.array(one.position_m) for one in (channel.tx, channel.rx))
            for there, back in ((image, point), (point, image)):
                length_m = np.linalg.norm(there - tx) + np.linalg.norm(back - rx)
                towards_m = length_m + sines * (tx + rx)[0]
                phases = np.exp(-2j * np.pi * towards_m / _WAVE_M)
                beams += phases * (sign if channel.start_offset_s else 1.0)
        power = np.abs(beams) ** 2
        peaks = np.flatnonzero((power[1:-1] > power[:-2]) & (power[1:-1] >= power[2:])) + 1
        tops += [(float(power[n]), math.degrees(math.asin(sines[n]))) for n in peaks.tolist()]
    return [angle for power, angle in tops if power > 0.99 * max(tops)[0]]


_BALLS, _BALL_M = 12, 0.01


def balls(bench: Bench) -> list[Check]:
    """Balls of 1 cm at random places, from the render to the list of targets."""
    rng, cell_m = np.random.default_rng(5), scenes.WAVEFORM.range_resolution_m
    worst: dict[str, list[Check]] = {}
    named = judged = 0
    for preset in ("1x8", "3x4", "1x8", "3x4"):
        radar = scenes.radar_of(preset)
        # the least that the array tells apart, in the sines of azimuth and elevation
        with np.errstate(divide="ignore"):
            beams = 1 / scenes.geometry_at(radar).extent_wavelengths
        rendered.new_scene(80.0)
        steps = (np.arange(_BALLS) + rng.uniform(0.2, 0.8, _BALLS)) / _BALLS
        places_m = {}
        for number, range_m in enumerate(rng.permutation(6 + 26 * steps).tolist()):
            up_deg = rng.uniform(-10, 10) if preset == "3x4" else 0.0
            right, up, back = range_m * scenes.direction_of(rng.uniform(-35, 35), up_deg)
            places_m[f"Ball {number}"] = np.array([right, -back, up])
            rendered.add_sphere(
                f"Ball {number}", (right, -back, up), _BALL_M, rendered.lambert(0.8), 4
            )
        run = rendered.acquire(
            bench, 128, 2, carrier_hz=scenes.CARRIER_HZ, array=preset, max_standard_error=0.2,
            refine_for="objects",
        )  # fmt: skip
        # signal-to-noise ratios of 40 dB and more, and of 5 to 40 dB
        for seed, figure_db in enumerate((30.0, 55.0, 55.0)):
            options = ProcessOptions(
                plots=False, products=False, radar=radar, speckle_seed=seed,
                range_taper="taylor:4:-60", doppler_taper="taylor:4:-60",
                receiver=Receiver(figure_db, noise_seed=seed),
            )  # fmt: skip
            results = [*process_run(run.folder, options)]
            (result,) = (event for event in results if isinstance(event, FrameResult))
            assert result.detections is not None
            for target in result.detections.targets:
                assert isinstance(target, DirectedDetection)
                if target.snr_db < 10:
                    continue
                found_m = np.array([target.world_x_m, target.world_y_m, target.world_z_m])
                name = min(
                    places_m, key=lambda n: abs(np.linalg.norm(places_m[n]) - target.range_m)
                )
                away_m = float(np.linalg.norm(places_m[name]))
                is_there = abs(away_m - target.range_m) < cell_m
                judged, named = judged + 1, named + (target.name == (name if is_there else ""))
                if seed or target.name != name:
                    continue
                sines = np.abs(found_m / target.range_m - places_m[name] / away_m)[[0, 2]]
                cells = sines / beams
                axes = ["azimuth", "elevation"][: 1 if preset == "1x8" else 2]
                errors = {"range": abs(target.range_m - away_m) / cell_m, **dict(zip(axes, cells))}
                for axis, error in errors.items():
                    worst.setdefault(axis, []).append(
                        absolute_check(preset, 0.0, float(error), 0.1, "ground truth", unit="cells")
                    )
    found = len(worst["range"])
    checks = [worst_of(f"place: {axis}", each) for axis, each in worst.items()]
    checks.append(absolute_check("balls that are found", 4 * _BALLS, found, 0, "ground truth"))
    labels = absolute_check("right labels above 10 dB", 1, named / judged, 0.01, "ground truth")
    return [*checks, dataclasses.replace(labels, points=judged)]


def hidden(bench: Bench) -> list[Check]:
    """A wall half behind a screen: an element at d to the side loses d (10 / 2 - 1) m of it."""
    edge_m, near_m, far_m, left_m, half_m = 0.4, 2.0, 10.0, -1.0, 1.0
    wave_m, checks = rendered.wavelength(), []
    for preset in ("1x8", "3x4", "8x8"):
        rendered.new_scene(40.0)
        screen = [(edge_m, near_m, -3.0), (3.0, near_m, -3.0), (3.0, near_m, 3.0),
                  (edge_m, near_m, 3.0)]  # fmt: skip
        wall = [(left_m, far_m, -half_m), (5.0, far_m, -half_m), (5.0, far_m, half_m),
                (left_m, far_m, half_m)]  # fmt: skip
        for name, corners, albedo in (("Screen", screen, 0.01), ("Wall", wall, 0.5)):
            rendered.add_mesh(name, corners, [(0, 1, 2, 3)], rendered.lambert(albedo))
        run = rendered.acquire(bench, 512, array=preset)
        elements = array_preset(preset, wave_m)
        side_m = max(abs(e.position_m[0]) for e in elements.transmitters + elements.receivers)
        last_m = edge_m * far_m / near_m

        def power(from_m: float, to_m: float, last_m: float = last_m) -> float:
            # of a Lambert surface: cosine^2 / r^4, by r = far_m / cosine
            x, z = np.meshgrid(np.linspace(from_m, to_m, 401), np.linspace(0, half_m, 401))
            return float((1 / (x**2 + z**2 + far_m**2) ** 3).mean() * (to_m - from_m))

        lost = side_m * (far_m / near_m - 1)
        share = power(last_m - lost, last_m) / power(left_m, last_m)
        whole = share * run.power_w("Wall")[0] / run.power_w()[0]
        for code, expected in (("array-hides-object", share), ("array-hides-power", whole)):
            (found,) = (item for item in run.record.findings if item.code == code)
            assert found.subjects == ("Wall",)
            measured = float(str(found.numbers["fraction"]))
            checks.append(
                absolute_check(
                    f"{preset}: {code}", expected, measured, 0.01, "similar triangles",
                    standard_error=math.sqrt(share * (1 - share) / 8192) * expected / share,
                )
            )  # fmt: skip
    return checks


GROUP = Group(
    "angles",
    "Angles",
    "Arrays of 1 x 8, 2 x 4 and 3 x 4 elements at 77 GHz, 500 MHz, bursts of 64 chirps. Points "
    "through synthesis, map, detection and direction; balls and the wall are rendered.",
    (
        Case("phases of eight elements", phases, 10.0),
        Case("a point alone", points, 60.0),
        Case("noise of 20 dB", noise, 20.0, quick=True),
        Case("transmitters in turn", turns, 20.0),
        Case("transmitters at once", at_once, 10.0),
        Case("two points in one cell", pairs, 10.0),
        Case("two equal points in one cell", equal_pairs, 120.0),
        Case("balls at random places", balls, 200.0),
        Case("ghosts over a wall", ghosts, 20.0),
        Case("a wall that an edge hides", hidden, 60.0),
    ),
)
