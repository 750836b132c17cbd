# SPDX-License-Identifier: GPL-3.0-or-later
"""ROOM."""

from .burst_interpolation import blended, shown_times_s
from .echoes import MAX_SAMPLES, Echoes, EchoOptions, check_window
from .frequency_grid import line_times_s
from .phase_noise import PhaseNoise, load_phase_noise
from .pulse_synthesis import EchoSynthesizer
from .receiver import Receiver, Reception, receive
from .synthesizer_factory import synthesize, synthesizer_for

__all__ = [
    "MAX_SAMPLES",
    "EchoOptions",
    "EchoSynthesizer",
    "Echoes",
    "PhaseNoise",
    "Receiver",
    "Reception",
    "blended",
    "check_window",
    "line_times_s",
    "load_phase_noise",
    "receive",
    "shown_times_s",
    "synthesize",
    "synthesizer_for",
]
