# SPDX-License-Identifier: GPL-3.0-or-later
"""From paths and a waveform to the complex samples that the receiver records.

In: `Paths` and a `Radar`. Out: `Echoes`, samples in sqrt(W), with receiver impairments where asked.

`synthesis` sums the paths' spectra in every channel, for pulses (`EchoSynthesizer`) or waveforms
that sample frequencies (`StretchSynthesizer`), and forms the samples. `echoes` has their record,
options and time axes, and joins the renders of a burst. `receiver` adds phase noise, thermal noise
and the rounding of an ADC. `codes` adds up transmitters that send at once, and tells them apart.
"""

from .codes import crosstalk, recorded_together, separate, shifts_doppler
from .echoes import (
    Echoes,
    EchoOptions,
    check_window,
    interpolate_renders,
    line_times_s,
    one_channel,
    only_channel,
    pulse_times_s,
    pulses_of_render,
    render_times_s,
    window_samples,
)
from .receiver import PhaseNoise, ReceivedSignal, Receiver, apply_receiver, load_phase_noise
from .synthesis import EchoSynthesizer, StretchSynthesizer, synthesize, synthesizer_for

__all__ = [
    "EchoOptions",
    "EchoSynthesizer",
    "Echoes",
    "PhaseNoise",
    "ReceivedSignal",
    "Receiver",
    "StretchSynthesizer",
    "apply_receiver",
    "check_window",
    "crosstalk",
    "interpolate_renders",
    "line_times_s",
    "load_phase_noise",
    "one_channel",
    "only_channel",
    "pulse_times_s",
    "pulses_of_render",
    "recorded_together",
    "render_times_s",
    "separate",
    "shifts_doppler",
    "synthesize",
    "synthesizer_for",
    "window_samples",
]
