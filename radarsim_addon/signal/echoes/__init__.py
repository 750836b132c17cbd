# SPDX-License-Identifier: GPL-3.0-or-later
"""From paths and a waveform to the complex samples that the receiver records.

In: `Paths` and a `Radar`. Out: `Echoes`, samples in sqrt(W), with receiver impairments where asked.
"""

from .burst_interpolation import interpolate_renders, pulses_of_render, render_times_s
from .echoes import (
    Echoes,
    EchoOptions,
    check_window,
    one_channel,
    only_channel,
    pulse_times_s,
    window_samples,
)
from .frequency_grid import line_times_s
from .phase_noise import PhaseNoise, load_phase_noise
from .pulse_synthesis import EchoSynthesizer
from .receiver import ReceivedSignal, Receiver, apply_receiver
from .synthesizer_factory import synthesize, synthesizer_for

__all__ = [
    "EchoOptions",
    "EchoSynthesizer",
    "Echoes",
    "PhaseNoise",
    "ReceivedSignal",
    "Receiver",
    "apply_receiver",
    "check_window",
    "interpolate_renders",
    "line_times_s",
    "load_phase_noise",
    "one_channel",
    "only_channel",
    "pulse_times_s",
    "pulses_of_render",
    "render_times_s",
    "synthesize",
    "synthesizer_for",
    "window_samples",
]
