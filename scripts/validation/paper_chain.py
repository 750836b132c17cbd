# SPDX-License-Identifier: GPL-3.0-or-later
"""The paper's scene in watts: received power, noise floor and SNR of the target in the map."""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np

from radarsim_addon import blender as radarsim
from radarsim_addon.arrays import Real
from radarsim_addon.contract import AntennaRecord, LinkBudget
from radarsim_addon.signal import iter_path_chunks, range_doppler, synthesize
from radarsim_addon.signal.decoding import open_frame
from radarsim_addon.signal.detection import FrameBudget, object_echoes
from radarsim_addon.signal.echoes import Receiver, apply_receiver
from radarsim_addon.signal.maps import range_process
from radarsim_addon.signal.paths.paths import Paths
from radarsim_addon.signal.scattering import FrameSpeckle

from .case import Bench, Case, Check, Group, absolute_check, power_check

BLEND = Path(__file__).parents[2] / "blend_examples" / "paper_scene.blend"
TARGET = "Target"
#: From the scene's script: near face, edge, speed, roughness and specularity of its material.
TARGET_M, EDGE_M, SPEED_MPS = 1750.0, 24.0, 10.0
ALPHA, SPECULAR, INDEX = 0.36, 0.5, 1e4 + 1e4j
PULSES, DOPPLER_CELL = 128, 45
TRANSMIT_W, GAIN_DBI, LOSS_DB = 2e-4, 30.0, 3.0
NOISE_FIGURE_DB, ANTENNA_K = 4.0, 290.0
BOLTZMANN = 1.380649e-23
LIGHT = 299_792_458.0
SEEDS = 400
#: Field of view of the close look at the target [deg].
CLOSE_DEG = 2.5
#: Part of the echoes that is drawn again for each seed [m].
NEAR_M = 60.0


def target_power_w(wavelength_m: float) -> float:
    """Radar equation, with the face square on: half Lambert, half Kirchhoff's lobe."""
    reflectance = abs((INDEX - 1) / (INDEX + 1)) ** 2
    sigma0 = reflectance * ((1 - SPECULAR) * 4 + SPECULAR / ALPHA**2)
    rcs_m2 = sigma0 * EDGE_M**2
    gains = 10 ** ((2 * GAIN_DBI - LOSS_DB) / 10)
    return TRANSMIT_W * gains * wavelength_m**2 * rcs_m2 / ((4 * math.pi) ** 3 * TARGET_M**4)


def noise_density() -> float:
    """k T_0 F of a system whose antenna sees 290 K [W/Hz]."""
    return BOLTZMANN * ANTENNA_K * 10 ** (NOISE_FIGURE_DB / 10)


def hamming_loss_db() -> float:
    """SNR that a Hamming window costs, mean of w^2 over square of the mean: 1.34 dB."""
    w = 0.54 + 0.46 * np.cos(2 * np.pi * (np.arange(4096) + 0.5) / 4096 - np.pi)
    return float(10 * math.log10(np.mean(w**2) / np.mean(w) ** 2))


def measured_run(bench: Bench, width_px: int, replicates: int, close: bool) -> Any:
    """The scene measured by paths; the PRF puts the target's Doppler into the middle of a cell.

    close: with the camera's field of view narrowed to the target and what surrounds it.
    """
    import bpy

    bpy.ops.wm.open_mainfile(filepath=str(BLEND))
    rig = bpy.data.objects["Radar"]
    if close:
        bpy.context.scene.camera.data.angle = math.radians(CLOSE_DEG)
        rig.rotation_euler.z += math.radians(1.5)  # where the scene's script puts the target
    wavelength_m = LIGHT / radarsim.settings(rig).carrier_hz
    return radarsim.measure(
        rig,
        bench.fresh(),
        sampling_mode="paths",
        width_px=width_px,
        height_px=width_px * 9 // 16,
        replicates=replicates,
        snapshots=2,
        prf_hz=2 * SPEED_MPS / wavelength_m * PULSES / DOPPLER_CELL,
        pulses=PULSES,
    )


def system() -> LinkBudget:
    """The power budget."""
    antenna = AntennaRecord("isotropic", {"gain_dbi": GAIN_DBI})
    return LinkBudget(
        transmit_power_w=TRANSMIT_W,
        transmitter=antenna,
        receiver=antenna,
        other_loss_db=LOSS_DB,
        noise_figure_db=NOISE_FIGURE_DB,
        antenna_temperature_k=ANTENNA_K,
    )


def in_watts(bench: Bench) -> list[Check]:
    whole = measured_run(bench, 320, 2, close=False)
    run = measured_run(bench, 48, 8, close=True)
    frame, radar = run.frame(1), run.radar
    waveform = radar.waveform
    wavelength_m = LIGHT / waveform.carrier_hz
    budget = FrameBudget(open_frame(frame, link_budget=system()))
    echo = next(
        e for e in object_echoes(frame, waveform.carrier_hz, budget.link) if e.name == TARGET
    )
    expected_w = target_power_w(wavelength_m)
    spread = echo.power_error_w / echo.power_w
    power_row = power_check(
        "received power of the target",
        expected_w,
        echo.power_w,
        0.2,
        "radar equation, s0 = F (2 + 1/(2 alpha^2)) over the face",
        relative_error=spread,
    )

    noise_row, map_row, mean_map, floor_w = _maps(bench, whole, run, budget)
    # The target: the mean over the speckle, less the noise that lies under it.
    doppler = int(np.argmin(np.abs(mean_map.doppler_hz + 2 * SPEED_MPS / wavelength_m)))
    middle_m = TARGET_M + SPEED_MPS * PULSES / radar.burst.prf_hz / 2
    # At the range that is expected, not at the largest of several: that would be biased upwards.
    column = mean_map.power[:, doppler, :]
    peaks_w = column[:, int(np.argmin(np.abs(mean_map.range_m - middle_m)))]
    near = np.abs(mean_map.range_m - TARGET_M) < 6.0
    peak_at = int(np.argmax(column[:, near].mean(axis=0)))
    # The textbook: energy over noise density, all pulses, what two Hamming windows cost.
    ideal_w = noise_density() / (waveform.chirp_duration_s * PULSES)
    loss_db = 2 * hamming_loss_db()
    expected_snr = expected_w / ideal_w / 10 ** (loss_db / 10)
    measured_snr = (float(peaks_w.mean()) - floor_w) / floor_w
    speckle = float(peaks_w.std(ddof=1) / math.sqrt(SEEDS) / peaks_w.mean())
    snr_row = power_check(
        f"SNR of the target in the map, mean of {SEEDS} seeds",
        expected_snr,
        measured_snr,
        0.5,
        "P T M / (k T_0 F) less two Hamming windows",
        unit="dB",
        relative_error=speckle,
    )
    told = budget.report(echo.power_w).snr[TARGET].burst_db
    told_row = power_check(
        "SNR that the program predicts",
        expected_snr,
        10 ** (told / 10),
        0.5,
        "P T M / (k T_0 F) less two Hamming windows",
        unit="dB",
        relative_error=spread,
    )
    range_row = absolute_check(
        "range of the target's peak, middle of the burst",
        middle_m,
        float(mean_map.range_m[near][peak_at]),
        1.5,
        "the scene's near face and speed",
        unit="m",
    )
    bench.lines += _budget_lines(expected_w, waveform.sampling_rate_hz, expected_snr)
    return [power_row, noise_row, map_row, snr_row, told_row, range_row]


@dataclasses.dataclass(frozen=True)
class _Maps:
    """Maps of all seeds: (seeds, Doppler, ranges), and their axes."""

    power: Real
    doppler_hz: Real
    range_m: Real


def _maps(
    bench: Bench, scene: Any, run: Any, budget: FrameBudget
) -> tuple[Check, Check, _Maps, float]:
    """Noise of the raw samples and of the map, and the maps around the target."""
    radar = run.radar
    waveform = radar.waveform
    receiver = Receiver(noise_figure_db=NOISE_FIGURE_DB, antenna_temperature_k=ANTENNA_K)
    # Everything once, and beyond the scene: there is nothing but noise.
    whole = synthesize(
        _paths(
            scene, FrameBudget(open_frame(scene.frame(1), radar=radar, link_budget=system())), 0
        ),
        radar,
        range_limits_m=(0.0, 9000.0),
        speckle_seed=0,
    )
    noisy = apply_receiver(whole, receiver).echoes
    beyond = LIGHT / 2 * noisy.fast_time_s > 7500.0
    raw = np.abs(noisy.plane[:, beyond]) ** 2
    level_w = noise_density() * waveform.sampling_rate_hz
    noise_row = power_check(
        "noise floor of the echoes, beyond the scene",
        level_w,
        float(raw.mean()),
        0.1,
        "k T_0 B F, B the complex sampling rate",
        relative_error=1 / math.sqrt(raw.size),
    )
    compressed = range_process(noisy)
    rd_map = range_doppler(compressed)
    floor = rd_map.plane_power[:, (rd_map.range_m > 7500) & (rd_map.range_m < 8900)]
    floor_w = float(floor.mean())
    loss = 10 ** (2 * hamming_loss_db() / 10)
    map_expected = noise_density() / (waveform.chirp_duration_s * PULSES) * loss
    # Independent cells: one a range resolution, two Doppler cells under a Hamming window.
    cells = floor.size / 4
    map_row = power_check(
        "noise floor of the map, beyond the scene",
        map_expected,
        floor_w,
        0.3,
        "k T_0 F / (T M), two Hamming windows",
        relative_error=1 / math.sqrt(cells),
    )
    profile = rd_map.plane_power.max(axis=0)
    for reach_m, power_w in zip(rd_map.range_m[::8], profile[::8], strict=True):
        bench.point("paper_profile", range_m=reach_m, power_w=power_w, floor_w=floor_w)
    range_limits_m = (TARGET_M - NEAR_M, TARGET_M + NEAR_M)
    powers = []
    for seed in range(SEEDS):
        part = synthesize(
            _paths(run, budget, seed), radar, range_limits_m=range_limits_m, speckle_seed=seed
        )
        noise = dataclasses.replace(receiver, noise_seed=seed + 1)
        found = range_doppler(range_process(apply_receiver(part, noise).echoes, oversample=4))
        rows = np.abs(found.doppler_hz) < 450
        cols = np.abs(found.range_m - TARGET_M) < 30
        powers.append(found.plane_power[np.ix_(rows, cols)])
    maps = _Maps(np.array(powers), found.doppler_hz[rows], found.range_m[cols])
    return noise_row, map_row, maps, floor_w


def _paths(run: Any, budget: FrameBudget, seed: int) -> Iterator[Paths]:
    """Paths with gains and speckle."""
    frame = run.frame(1)
    speckle = FrameSpeckle(open_frame(frame), seed)
    for part in iter_path_chunks(frame):
        yield speckle.apply(budget.apply(part))


def _budget_lines(power_w: float, rate_hz: float, snr: float) -> list[str]:
    level_w = noise_density() * rate_hz
    received, noise, ratio = (10 * math.log10(x) for x in (power_w * 1e3, level_w * 1e3, snr))
    return [
        "",
        (
            f"Transmit power {1e3 * TRANSMIT_W:g} mW, gains {GAIN_DBI:g} dBi, losses {LOSS_DB:g} "
            f"dB, noise figure {NOISE_FIGURE_DB:g} dB, {PULSES} pulses: {received:.1f} dBm from "
            f"the target, {noise:.1f} dBm of noise a sample, {ratio:.1f} dB in the map. The "
            "target's echo is the mean over seeds of the speckle: a single map shows one draw from "
            "an exponential law. Transmit power was chosen so that the noise shows; the PRF so "
            "that the target lies in the middle of a Doppler cell."
        ),
    ]


GROUP = Group(
    "paper_chain",
    "The paper's scene in watts",
    "blend_examples/paper_scene.blend by paths, with link budget, speckle, thermal noise, "
    f"matched filter and range-Doppler map. The target's echo is the mean over {SEEDS} seeds.",
    (Case("watts, noise and SNR", in_watts, 240.0),),
)
