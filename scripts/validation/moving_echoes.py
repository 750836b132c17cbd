# SPDX-License-Identifier: GPL-3.0-or-later
"""Echoes of moving scatterers against direct sums at retarded times; no renders."""

from __future__ import annotations

import math

import numpy as np

from radarsim_addon.arrays import Complex, Real
from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.signal import (
    Burst,
    Echoes,
    FmcwWaveform,
    PmcwWaveform,
    Radar,
    SpectrogramOptions,
    Waveform,
    make_paths,
    range_process,
    replica,
    spectrogram,
    synthesize,
)
from radarsim_addon.signal.echoes import line_times_s
from radarsim_addon.signal.maps import RangeProfiles
from radarsim_addon.signal.radar import ArbitraryPulse

from .case import Bench, Case, Check, Group, absolute_check

#: 10 us at 77 GHz, which 60 m/s turn by 2 rad.
CHIRP = Waveform(77e9, 150e6, 10e-6, 180e6)
RANGES_M = np.array([120.3, 131.77, 100.0, 140.0])
RATES_MPS = np.array([60.0, -60.0, 13.0, 0.0])
RANGE_LIMITS_M = (90.0, 150.0)


def _smooth_samples() -> Complex:
    """A chirp without edges, whose sidelobes beyond the band are below the bound."""
    time_s = (np.arange(1800) - 899.5) / 180e6
    return np.exp(1j * np.pi * 1e13 * time_s**2 - (time_s / 1.3e-6) ** 2)


def _direct(radar: Radar, echoes: Echoes) -> Complex:
    """sum_i w(u_i) exp(-j 2 pi f0 (t - u_i)): received at t, met half way, emitted at u_i."""
    pulse, received_s = replica(radar.waveform), echoes.fast_time_s
    rate_hz, middle = radar.waveform.sampling_rate_hz, (replica(radar.waveform).size - 1) / 2
    lines = np.zeros(echoes.plane.shape, dtype=np.complex128)
    for line, start_s in zip(lines, echoes.slow_time_s, strict=True):
        for range_m, rate_mps in zip(RANGES_M, RATES_MPS, strict=True):
            sent_s: Real = received_s - 2 * range_m / SPEED_OF_LIGHT_MPS
            for _ in range(8):
                met_s = start_s + (received_s + sent_s) / 2
                sent_s = received_s - 2 * (range_m + rate_mps * met_s) / SPEED_OF_LIGHT_MPS
            place = sent_s * rate_hz + middle
            carrier = np.exp(-2j * np.pi * radar.waveform.carrier_hz * (received_s - sent_s))
            line += (np.sinc(place[:, None] - np.arange(pulse.size)) @ pulse) * carrier
    return lines


def within_a_pulse(bench: Bench) -> list[Check]:
    """Relative L2 error of the samples, of a chirp with its edges and of one without."""
    checks = []
    for name, samples, bound in (
        ("LFM", replica(CHIRP), 1e-3),
        ("chirp without edges", _smooth_samples(), 1e-6),
    ):
        waveform = ArbitraryPulse(carrier_hz=77e9, sampling_rate_hz=180e6, samples=samples)
        radar = Radar(waveform, Burst(5000.0, 3))
        aperture_m2 = waveform.wavelength_m**2 / (4 * math.pi)
        paths = make_paths(np.full(4, 1 / aperture_m2), 2 * RANGES_M, RATES_MPS)
        found = synthesize(paths, radar, range_limits_m=RANGE_LIMITS_M)
        truth = _direct(radar, found)
        error = float(np.linalg.norm(found.plane - truth) / np.linalg.norm(truth))
        checks.append(
            absolute_check(
                f"relative L2 error, {name}, 10 us, up to 60 m/s, 77 GHz",
                0.0,
                error,
                bound,
                "direct sum at retarded times",
            )
        )
    return checks


def within_a_code(bench: Bench) -> list[Check]:
    """Relative L2 error of the samples of PMCW, whose code repeats without end."""
    waveform = PmcwWaveform(77e9, 100e-9, 8, 2, 1)
    radar, code = Radar(waveform, Burst(10e3, 2)), replica(waveform)
    rng = np.random.default_rng(4)
    ranges_m, rates_mps = rng.uniform(20, 2000, 20), rng.uniform(-60, 60, 20)
    aperture_m2 = waveform.wavelength_m**2 / (4 * math.pi)
    paths = make_paths(np.full(20, 1 / aperture_m2), 2 * ranges_m, rates_mps)
    found = synthesize(paths, radar, range_limits_m=(0.0, 2000.0))
    k = np.arange(code.size) - code.size // 2
    lines = np.fft.fftshift(np.fft.fft(code)) / code.size
    truth = np.zeros(found.plane.shape, dtype=np.complex128)
    received_s = line_times_s(radar)[:, None] + found.fast_time_s
    for range_m, rate_mps in zip(ranges_m, rates_mps, strict=True):
        sent_s = received_s - 2 * range_m / SPEED_OF_LIGHT_MPS
        for _ in range(8):
            met_s = (received_s + sent_s) / 2
            sent_s = received_s - 2 * (range_m + rate_mps * met_s) / SPEED_OF_LIGHT_MPS
        own_s = sent_s - line_times_s(radar)[:, None]
        emitted = np.exp(2j * np.pi * own_s[..., None] * (k / waveform.code_s)) @ lines
        truth += emitted * np.exp(-2j * np.pi * waveform.carrier_hz * (received_s - sent_s))
    error = float(np.linalg.norm(found.plane - truth) / np.linalg.norm(truth))
    name = "relative L2 error, PMCW, code of 25.5 us, 20 targets up to 60 m/s, 77 GHz"
    return [absolute_check(name, 0.0, error, 1e-6, "direct sum at retarded times")]


def fmcw_in_one_transform(bench: Bench) -> list[Check]:
    """Relative L2 error of the beats, from the phases of the ramps themselves."""
    return [
        _fmcw(FmcwWaveform(77e9, 1e9, 256, 10e6), 5.0, 35.0),
        _fmcw(FmcwWaveform(77e9, 20e6, 2048, 20e6), 9e3, 11e3),
        _fmcw(FmcwWaveform(77e9, 240e6, 512, 20e6), 2.0, 290.0, 100.0),
        _fmcw(FmcwWaveform(77e9, 1e9, 1024, 20e6), 2.0, 140.0, 100.0),
    ]


def _fmcw(
    waveform: FmcwWaveform, nearest_m: float, farthest_m: float, fastest_mps: float = 60.0
) -> Check:
    radar = Radar(waveform, Burst(1 / waveform.duration_s, 64))
    rng = np.random.default_rng(2)
    ranges_m = rng.uniform(nearest_m, farthest_m, 50)
    rates_mps = rng.uniform(-1, 1, 50) * fastest_mps
    aperture_m2 = waveform.wavelength_m**2 / (4 * math.pi)
    paths = make_paths(np.full(50, 1 / aperture_m2), 2 * ranges_m, rates_mps)
    limits_m = (0.0, 1.08 * farthest_m)
    found = synthesize(paths, radar, range_limits_m=limits_m, slow_time_transform="type3")
    start_hz = waveform.carrier_hz - waveform.slope_hz_per_s * waveform.grid_middle_s
    ramp_s = waveform.adc_start_s + np.arange(waveform.adc_samples) / waveform.sampling_rate_hz
    truth = np.zeros(found.plane.shape, dtype=np.complex128)
    received_s = found.slow_time_s[:, None] + ramp_s
    for range_m, rate_mps in zip(ranges_m, rates_mps, strict=True):
        delay_s = np.zeros_like(received_s)
        for _ in range(8):
            met_m = range_m + rate_mps * (received_s - delay_s / 2)
            delay_s = 2 * met_m / SPEED_OF_LIGHT_MPS
        cycles = -start_hz * delay_s
        cycles -= waveform.slope_hz_per_s * (ramp_s * delay_s - delay_s**2 / 2)
        truth += np.exp(2j * np.pi * cycles)
    error = float(np.linalg.norm(found.plane - truth) / np.linalg.norm(truth))
    name = f"relative L2 error, FMCW, 50 targets to {farthest_m:g} m and {fastest_mps:g} m/s"
    source = "received less transmitted phase of the ramps, at retarded times"
    return absolute_check(name, 0.0, error, 1e-6, source)


def rotating_point(bench: Bench) -> list[Check]:
    """Spectrogram of a point that turns: Doppler of its ridge, and its level where that is flat."""
    waveform, turn_rad_s, radius_m = FmcwWaveform(24e9, 180e6, 64, 5e6, 20e-6), 20 * math.pi, 0.1
    radar, single = Radar(waveform, Burst(10e3, 512)), Radar(waveform, Burst(10e3, 1))
    profiles = [
        range_process(
            synthesize(
                make_paths(
                    4 * math.pi / waveform.wavelength_m**2,
                    2 * (20.0 + radius_m * math.sin(turn_rad_s * pulse / 10e3)),
                ),
                single,
                range_limits_m=(0.0, 40.0),
            )
        )
        for pulse in range(512)
    ]
    values = np.concatenate([one.values for one in profiles], axis=1)
    whole = RangeProfiles(values, profiles[0].range_m, radar, profiles[0].range_taper)
    found = spectrogram(whole, SpectrogramOptions(32, 0.9))
    peak = found.power.argmax(axis=1)
    near = peak[:, None] + np.arange(-2, 3)
    weight = np.take_along_axis(found.power, near, axis=1)
    ridge_hz = (weight * found.doppler_hz[near]).sum(axis=1) / weight.sum(axis=1)
    truth_hz = (
        -2 / waveform.wavelength_m * radius_m * turn_rad_s * np.cos(turn_rad_s * found.time_s)
    )
    worst_cells = float(np.abs(ridge_hz - truth_hz).max() / (10e3 / 32))
    level_db = 10 * math.log10(float(found.power.max()))
    text = "f_D = -(2 / lambda) rho Omega cos(Omega t)"
    return [
        absolute_check("spectrogram, ridge, in Doppler cells", 0.0, worst_cells, 0.1, text),
        absolute_check(
            "spectrogram, level at the turning points", 0.0, level_db, 0.1, "its power", unit="dB"
        ),
    ]


GROUP = Group(
    "moving echoes",
    "Moving echoes",
    "Scatterers at up to 60 m/s in pulses of 10 us at 77 GHz: samples against the pulse "
    "emitted at the retarded time. FMCW: against the phases of the two ramps. A point on a "
    "circle, at 24 GHz: its spectrogram.",
    (
        Case("motion within a pulse", within_a_pulse, 20.0, quick=True),
        Case("motion within a code", within_a_code, 5.0, quick=True),
        Case("FMCW in one transform", fmcw_in_one_transform, 5.0, quick=True),
        Case("spectrogram of a rotating point", rotating_point, 5.0, quick=True),
    ),
)
