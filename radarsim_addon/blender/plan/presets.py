# SPDX-License-Identifier: GPL-3.0-or-later
"""Radars to begin with: settings that make sense together. Does not import bpy."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType
from typing import Any

from ...errors import ConfigError

_PATCHES = MappingProxyType(
    {"kind": "gaussian", "azimuth_beamwidth_deg": 60.0, "elevation_beamwidth_deg": 12.0}
)
_PRESETS: dict[str, dict[str, Any]] = {
    # The pulse of Costa et al. (SBrT 2020), at 1000 pulses per second.
    "paper": {
        "waveform_kind": "lfm",
        "carrier_hz": 5.3e9,
        "bandwidth_hz": 50e6,
        "chirp_duration_s": 2.5e-6,
        "sampling_rate_hz": 60e6,
        "prf_hz": 1000.0,
        "pulses": 128,
    },
    # Medium range: 0.5 m range bins to 128 m, +-38.9 m/s, 0.30 m/s per Doppler bin. Power and
    # noise figure are those of single-chip radars (12 dBm and 15 dB, as in TI's AWR1843), the
    # antennas those of patch columns: EIRP 29 dBm.
    "automotive_77ghz": {
        "waveform_kind": "fmcw",
        "carrier_hz": 77e9,
        "bandwidth_hz": 300e6,
        "adc_samples": 256,
        "adc_rate_hz": 20e6,
        "prf_hz": 40e3,
        "pulses": 256,
        "use_link_budget": True,
        "transmit_power_w": 0.016,
        "noise_figure_db": 15.0,
        "transmitter": _PATCHES,
        "receiver": _PATCHES,
    },
}


def preset_settings(name: str) -> Mapping[str, Any]:
    """Return the settings of a preset.

    Parameters
    ----------
    name
        "paper" or "automotive_77ghz".

    Returns
    -------
    mapping of str
        Values by the names of the settings, in SI; those of an antenna in a mapping of their own.

    Raises
    ------
    ConfigError
        No preset of that name.
    """
    if name not in _PRESETS:
        raise ConfigError(f"There is no radar preset {name!r}; expected {', '.join(_PRESETS)}.")
    return MappingProxyType(_PRESETS[name])
