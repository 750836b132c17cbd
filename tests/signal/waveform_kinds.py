# SPDX-License-Identifier: GPL-3.0-or-later
"""One waveform of each kind, and bursts of them, for tests."""

from radarsim_addon.signal import (
    Burst,
    FmcwWaveform,
    PhaseCodedPulse,
    PmcwWaveform,
    Radar,
    SteppedWaveform,
    Waveform,
)
from radarsim_addon.signal.radar import AnyWaveform

FMCW = FmcwWaveform(77e9, 1e9, 256, 10e6, adc_start_s=5e-6, idle_s=4e-6)
STEPPED = SteppedWaveform(10e9, 2e6, 128, 50e-6)
PMCW = PmcwWaveform(79e9, 1e-9, 8, code_repeats=4)
BARKER13 = PhaseCodedPulse(5.3e9, 50e-9, 13, 4)
ALL = [Waveform(5.3e9, 50e6, 2.5e-6, 60e6), FMCW, STEPPED, PMCW, BARKER13]


def burst_of(waveform: AnyWaveform, pulses: int) -> Radar:
    # pulses with a pause, so that no echo of these tests comes after the next pulse
    prf_hz = 1e4 if waveform.family == "pulse" else 1 / waveform.duration_s
    return Radar(waveform, Burst(prf_hz, pulses))
