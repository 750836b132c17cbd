# SPDX-License-Identifier: GPL-3.0-or-later
"""Which engine makes the raw samples of which waveform."""

from __future__ import annotations

from collections.abc import Iterable

from ...contract import AmplitudeModel
from ..paths import Paths
from ..radar import Radar
from ..spectrum import TOLERANCE, Backend, Method
from .echoes import DEFAULT_OPTIONS, Echoes, EchoOptions
from .frequency_synthesis import StretchSynthesizer
from .phase_noise import LineOscillator, PhaseNoise, takes_phase_noise_by_path
from .pulse_synthesis import EchoSynthesizer


def synthesizer_for(
    radar: Radar,
    range_limits_m: tuple[float, float],
    options: EchoOptions = DEFAULT_OPTIONS,
    *,
    phase_noise: PhaseNoise | None = None,
    phase_noise_seed: int = 0,
) -> EchoSynthesizer | StretchSynthesizer:
    """The synthesizer for the waveform's family.

    Parameters
    ----------
    radar
        Waveform and burst.
    range_limits_m
        One-way ranges (start, stop) whose echoes are recorded whole [m].
    options
        See :class:`.echoes.pulse_synthesis.EchoOptions`.
    phase_noise, phase_noise_seed
        FMCW and stepped frequency take their phase noise here, path by path; for the others it is
        put on the samples afterwards, see :func:`.echoes.receiver.receive`.

    Raises
    ------
    ConfigError
        The window is empty or reversed, or the matrix of echoes too large.
    """
    if radar.waveform.family == "pulse":
        return EchoSynthesizer(radar, range_limits_m, options)
    oscillator = None
    if phase_noise is not None and takes_phase_noise_by_path(radar):
        oscillator = LineOscillator(radar, phase_noise, phase_noise_seed)
    return StretchSynthesizer(radar, range_limits_m, options, oscillator=oscillator)


def synthesize(
    paths: Paths | Iterable[Paths],
    radar: Radar,
    *,
    range_limits_m: tuple[float, float],
    amplitude_model: AmplitudeModel = "radar-equation",
    receiver_gain: float = 1.0,
    nufft_backend: Backend = "auto",
    tolerance: float = TOLERANCE,
    slow_time_transform: Method = "auto",
    range_folding: bool = True,
    chunk: int = 1 << 17,
    speckle_seed: int | None = None,
) -> Echoes:
    """Echoes of a burst from paths (Eq. 9-14).

    Parameters
    ----------
    paths
        Paths, or several tables of them (a generator will do:
        :func:`.paths.paths.iter_path_chunks`).
    radar
        Waveform and burst.
    range_limits_m
        One-way ranges (start, stop) whose echoes are recorded whole [m]; ``run.range_limits_m`` is
        what the rings cover. Echoes that reach in from outside are cut at the edge, not folded.
    amplitude_model
        "radar-equation" or "paper", see :func:`.paths.paths.path_amplitude`.
    receiver_gain
        G_r, linear.
    nufft_backend
        "auto" (finufft where installed), "finufft", "numpy" or "direct" (sum over all frequencies
        term by term: slow, for checks).
    tolerance
        Relative L2 error of the spectrum S(f) against the direct sum, see
        :mod:`.spectrum.accumulator`.
    slow_time_transform
        "auto", "type3", "per-pulse" or "direct", see
        :class:`.spectrum.accumulator.SpectrumAccumulator`.
    range_folding
        Whether echoes later than the pulse interval fall into the window of a later pulse, as in
        a radar that sends equal pulses all the time. False: they stand at their true delay.
    chunk
        Paths transformed at a time; the result does not depend on it beyond rounding.
    speckle_seed
        Give each path a random phase, see :func:`.scattering.random_phases.path_phasors`: then the
        mean coherent power is the sum of the powers. None: the plain sum, in which pixels of a
        smooth face add up in phase, so that levels grow with the number of pixels.

    Notes
    -----
    Stop and go: a path's delay is that of the time of the pulse in whose window it is heard.
    A folded echo has the carrier phase of its true delay, for the oscillator runs on.
    """
    options = EchoOptions(
        amplitude_model=amplitude_model,
        receiver_gain=receiver_gain,
        nufft_backend=nufft_backend,
        tolerance=tolerance,
        slow_time_transform=slow_time_transform,
        range_folding=range_folding,
        chunk=chunk,
        speckle_seed=speckle_seed,
    )
    synthesizer = synthesizer_for(radar, range_limits_m, options)
    for part in [paths] if isinstance(paths, Paths) else paths:
        synthesizer.add(part)
    return synthesizer.result()
