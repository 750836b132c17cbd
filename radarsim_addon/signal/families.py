# SPDX-License-Identifier: GPL-3.0-or-later
"""Which engine makes the raw samples of which waveform."""

from __future__ import annotations

from .config import Radar
from .echoes import EchoSynthesizer
from .linesynthesis import LineSynthesizer
from .nufft import TOLERANCE, Backend
from .paths import Weighting


def synthesizer_for(
    radar: Radar,
    window_m: tuple[float, float],
    *,
    weighting: Weighting = "radar-equation",
    receiver_gain: float = 1.0,
    method: Backend = "auto",
    tolerance: float = TOLERANCE,
    chunk: int = 1 << 18,
    speckle_seed: int | None = None,
) -> EchoSynthesizer | LineSynthesizer:
    """The synthesizer for the waveform's family; arguments as :func:`.echoes.synthesize`."""
    engine = LineSynthesizer if radar.waveform.family == "line" else EchoSynthesizer
    return engine(
        radar,
        window_m,
        weighting=weighting,
        receiver_gain=receiver_gain,
        method=method,
        tolerance=tolerance,
        chunk=chunk,
        speckle_seed=speckle_seed,
    )
