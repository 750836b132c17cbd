# SPDX-License-Identifier: GPL-3.0-or-later
"""The radar: waveforms, bursts, channels, windows, antennas, link budget and weather.

In: numbers in SI, or radar and link-budget files. Out: frozen records that were checked when they
were made, and the spectra of their pulses. Gains are linear, angles in radians.

`config` has the radar and the protocol of its waveforms, `arrays` the elements of several antennas,
`waveforms` their kinds, the spectra of
pulses, matched filters and windows, `radar_files` reads and writes them. `link_budget` has
antennas, powers, losses, noise and weather, `coverage` the diagram of a radar over a smooth ground.
"""

from ...contract import AntennaRecord, LinkBudget
from .arrays import (
    ARRAY_PRESETS,
    MAX_CHANNELS,
    AntennaArray,
    array_from_dict,
    array_preset,
    channels_from_dict,
    channels_to_dict,
    linear_array,
)
from .config import MAX_SAMPLES, SINGLE_CHANNEL, AnyWaveform, Burst, Channel, Element, Radar
from .coverage import (
    Coverage,
    CoverageCurve,
    CoverageSetup,
    Mount,
    compute_coverage,
    coverage_curve,
    two_ray_gain,
)
from .link_budget import (
    PATTERNS,
    ConstantGain,
    PeakedAntenna,
    RadarSystem,
    Weather,
    cut_dbi,
    half_power_width_rad,
    make_antenna,
    make_system,
    peak_direction,
    read_system,
    self_contained,
)
from .radar_files import (
    WAVEFORM_KINDS,
    burst_from_dict,
    find_suspicious_parameters,
    load_radar,
    range_limit,
    waveform_from_dict,
    waveform_to_dict,
)
from .waveforms import (
    WINDOW_NAMES,
    ArbitraryPulse,
    FmcwWaveform,
    LineWaveform,
    PhaseCodedPulse,
    PmcwWaveform,
    SteppedWaveform,
    Waveform,
    band_window,
    frequencies_hz,
    matched_filter,
    replica,
    replica_spectrum,
    slow_time_window,
    window_at,
)

__all__ = [
    "ARRAY_PRESETS",
    "MAX_CHANNELS",
    "MAX_SAMPLES",
    "PATTERNS",
    "SINGLE_CHANNEL",
    "WAVEFORM_KINDS",
    "WINDOW_NAMES",
    "AntennaArray",
    "AntennaRecord",
    "AnyWaveform",
    "ArbitraryPulse",
    "Burst",
    "Channel",
    "ConstantGain",
    "Coverage",
    "CoverageCurve",
    "CoverageSetup",
    "Element",
    "FmcwWaveform",
    "LineWaveform",
    "LinkBudget",
    "Mount",
    "PeakedAntenna",
    "PhaseCodedPulse",
    "PmcwWaveform",
    "Radar",
    "RadarSystem",
    "SteppedWaveform",
    "Waveform",
    "Weather",
    "array_from_dict",
    "array_preset",
    "band_window",
    "burst_from_dict",
    "channels_from_dict",
    "channels_to_dict",
    "compute_coverage",
    "coverage_curve",
    "cut_dbi",
    "find_suspicious_parameters",
    "frequencies_hz",
    "half_power_width_rad",
    "linear_array",
    "load_radar",
    "make_antenna",
    "make_system",
    "matched_filter",
    "peak_direction",
    "range_limit",
    "read_system",
    "replica",
    "replica_spectrum",
    "self_contained",
    "slow_time_window",
    "two_ray_gain",
    "waveform_from_dict",
    "waveform_to_dict",
    "window_at",
]
