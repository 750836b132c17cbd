# SPDX-License-Identifier: GPL-3.0-or-later
"""What the radar is: waveforms, bursts, range tapers, codes, antennas, link budget.

In: numbers in SI, or radar and link-budget files. Out: frozen, checked records and the spectra of
their pulses. Gains are linear, angles in radians.
"""

from ...contract import AntennaRecord, LinkBudget
from .antennas import PATTERNS, ConstantGain, PeakedAntenna, make_antenna, self_contained
from .channels import SINGLE_CHANNEL, Channel, Element
from .config import MAX_SAMPLES, Burst, Radar
from .continuous_wave import FmcwWaveform, LineWaveform, PmcwWaveform, SteppedWaveform
from .coverage import (
    Coverage,
    CoverageCurve,
    CoverageSetup,
    Mount,
    compute_coverage,
    coverage_curve,
    two_ray_gain,
)
from .link_budget import RadarSystem, make_system, read_system
from .parameter_checks import find_suspicious_parameters, range_limit
from .pattern_cuts import cut_dbi, half_power_width_rad, peak_direction
from .pulse_replicas import (
    band_window,
    frequencies_hz,
    matched_filter,
    replica,
    replica_spectrum,
)
from .pulses import ArbitraryPulse, PhaseCodedPulse, Waveform
from .radar_files import (
    WAVEFORM_KINDS,
    burst_from_dict,
    load_radar,
    waveform_from_dict,
    waveform_to_dict,
)
from .waveform import AnyWaveform
from .weather import Weather
from .windows import WINDOW_NAMES, slow_time_window, window_at

__all__ = [
    "MAX_SAMPLES",
    "PATTERNS",
    "SINGLE_CHANNEL",
    "WAVEFORM_KINDS",
    "WINDOW_NAMES",
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
    "band_window",
    "burst_from_dict",
    "compute_coverage",
    "coverage_curve",
    "cut_dbi",
    "find_suspicious_parameters",
    "frequencies_hz",
    "half_power_width_rad",
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
