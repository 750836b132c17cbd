# SPDX-License-Identifier: GPL-3.0-or-later
"""From samples to range profiles, range-Doppler maps, noise floors and expected power.

`range_compression` turns echoes into range profiles that peak at the power of a path, and paths
into the profile that is expected on average over the speckle. `range_doppler_map` transforms
profiles over the pulses, with an MTI canceller before, and has the noise of a cell.
`expected_power_map` estimates the map's expected power and its standard error from replicates,
`single_echo` gives the exact response of a map to one echo, `time_frequency` spectrograms. Powers
are in W, or relative to a unit amplitude.
"""

from .expected_power_map import ExpectedPower, expected_power
from .range_compression import (
    PowerProfile,
    ProfileAccumulator,
    RangeProfiles,
    expected_power_profile,
    line_weights,
    range_process,
)
from .range_doppler_map import (
    RangeDopplerMap,
    coherent_samples,
    dynamics_db,
    level_unit,
    map_noise_gain,
    map_noise_rows,
    mti_cancel,
    mti_response,
    power_to_db,
    power_unit,
    range_doppler,
    range_noise_gain,
)
from .single_echo import PointResponse, Recording, cut_range_m, fit_point, point_response
from .time_frequency import Spectrogram, SpectrogramOptions, spectrogram

__all__ = [
    "ExpectedPower",
    "PointResponse",
    "PowerProfile",
    "ProfileAccumulator",
    "RangeDopplerMap",
    "RangeProfiles",
    "Recording",
    "Spectrogram",
    "SpectrogramOptions",
    "coherent_samples",
    "cut_range_m",
    "dynamics_db",
    "expected_power",
    "expected_power_profile",
    "fit_point",
    "level_unit",
    "line_weights",
    "map_noise_gain",
    "map_noise_rows",
    "mti_cancel",
    "mti_response",
    "point_response",
    "power_to_db",
    "power_unit",
    "range_doppler",
    "range_noise_gain",
    "range_process",
    "spectrogram",
]
