# SPDX-License-Identifier: GPL-3.0-or-later
"""Which engine makes the raw samples of which waveform."""

from __future__ import annotations

from .config import Radar
from .echoes import EchoSynthesizer
from .linesynthesis import LineSynthesizer
from .nufft import Backend
from .paths import Weighting
from .phasenoise import LineOscillator, PhaseNoise, takes_phase_noise_by_path
from .synthesis import TOLERANCE, Method


def synthesizer_for(
    radar: Radar,
    window_m: tuple[float, float],
    *,
    weighting: Weighting = "radar-equation",
    receiver_gain: float = 1.0,
    method: Backend = "auto",
    tolerance: float = TOLERANCE,
    synthesis: Method = "auto",
    range_folding: bool = True,
    chunk: int = 1 << 17,
    speckle_seed: int | None = None,
    phase_noise: PhaseNoise | None = None,
    phase_noise_seed: int = 0,
) -> EchoSynthesizer | LineSynthesizer:
    """The synthesizer for the waveform's family; arguments as :func:`.echoes.synthesize`.

    FMCW and stepped frequency take their phase noise here, path by path; for the others it is put
    on the samples afterwards, see :func:`.receiver.receive`.
    """
    if radar.waveform.family == "pulse":
        return EchoSynthesizer(
            radar,
            window_m,
            weighting=weighting,
            receiver_gain=receiver_gain,
            method=method,
            tolerance=tolerance,
            synthesis=synthesis,
            range_folding=range_folding,
            chunk=chunk,
            speckle_seed=speckle_seed,
        )
    oscillator = None
    if phase_noise is not None and takes_phase_noise_by_path(radar):
        oscillator = LineOscillator(radar, phase_noise, phase_noise_seed)
    return LineSynthesizer(
        radar,
        window_m,
        weighting=weighting,
        receiver_gain=receiver_gain,
        method=method,
        tolerance=tolerance,
        synthesis=synthesis,
        chunk=chunk,
        speckle_seed=speckle_seed,
        oscillator=oscillator,
    )
