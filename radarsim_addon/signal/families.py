# SPDX-License-Identifier: GPL-3.0-or-later
"""Which engine makes the raw samples of which waveform."""

from __future__ import annotations

from .config import Radar
from .echoes import AS_USUAL, EchoOptions, EchoSynthesizer
from .linesynthesis import LineSynthesizer
from .phasenoise import LineOscillator, PhaseNoise, takes_phase_noise_by_path


def synthesizer_for(
    radar: Radar,
    window_m: tuple[float, float],
    options: EchoOptions = AS_USUAL,
    *,
    phase_noise: PhaseNoise | None = None,
    phase_noise_seed: int = 0,
) -> EchoSynthesizer | LineSynthesizer:
    """The synthesizer for the waveform's family.

    Parameters
    ----------
    radar
        Waveform and burst.
    window_m
        One-way ranges (start, stop) whose echoes are recorded whole [m].
    options
        See :class:`.echoes.EchoOptions`.
    phase_noise, phase_noise_seed
        FMCW and stepped frequency take their phase noise here, path by path; for the others it is
        put on the samples afterwards, see :func:`.receiver.receive`.

    Raises
    ------
    ConfigError
        The window is empty or reversed, or the matrix of echoes too large.
    """
    if radar.waveform.family == "pulse":
        return EchoSynthesizer(radar, window_m, options)
    oscillator = None
    if phase_noise is not None and takes_phase_noise_by_path(radar):
        oscillator = LineOscillator(radar, phase_noise, phase_noise_seed)
    return LineSynthesizer(radar, window_m, options, oscillator=oscillator)
