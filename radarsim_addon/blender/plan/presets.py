# SPDX-License-Identifier: GPL-3.0-or-later
"""Radars to begin with: settings that make sense together. Does not import bpy."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any

from ...errors import ConfigError

#: Radar of those who choose none.
DEFAULT_PRESET = "automotive_77ghz"


@dataclass(frozen=True)
class RadarPreset:
    """A radar: waveform, link budget with antennas, range limits, field of view."""

    #: For the window.
    label: str
    description: str
    #: Full angle of the receiver's longer side.
    field_of_view_deg: float
    #: Values by the names of the settings, in SI; those of an antenna in a mapping of their own.
    #: Settings of the radar that are left out have their initial values.
    settings: Mapping[str, Any] = field(default_factory=dict)
    #: Power of the light; None: the peak EIRP of the link budget.
    eirp_w: float | None = None


def _view(width_deg: float, height_deg: float, longer_px: int) -> dict[str, Any]:
    """Return the square pixels of a field of view."""
    sides = [math.tan(math.radians(angle / 2)) for angle in (width_deg, height_deg)]
    width, height = (max(1, round(longer_px * side / max(sides))) for side in sides)
    return {"width_px": width, "height_px": height}


def _beam(azimuth_deg: float, elevation_deg: float) -> dict[str, Any]:
    widths = {"azimuth_beamwidth_deg": azimuth_deg, "elevation_beamwidth_deg": elevation_deg}
    return {"kind": "gaussian", **widths}


def _budget(power_w: float, noise_figure_db: float, antenna: Mapping[str, Any]) -> dict[str, Any]:
    """Return a link budget with the same antenna both ways."""
    return {
        "use_link_budget": True,
        "transmit_power_w": power_w,
        "noise_figure_db": noise_figure_db,
        "transmitter": antenna,
        "receiver": antenna,
    }


#: Powers, noise figures and beams are typical of their kind, not those of one product.
PRESETS: Mapping[str, RadarPreset] = MappingProxyType({
    "automotive_77ghz": RadarPreset(
        "77 GHz Automotive",
        "FMCW, 0.5 m to 120 m, 38.9 m/s, beam 60 x 12 deg, EIRP 29 dBm",
        # Power and noise figure of single-chip radars: 12 dBm and 15 dB, as in TI's AWR1843.
        90.0,
        {
            "waveform_kind": "fmcw", "carrier_hz": 77e9, "bandwidth_hz": 300e6,
            "adc_samples": 256, "adc_rate_hz": 20e6, "prf_hz": 40e3, "pulses": 256,
            "range_stop_m": 120.0, **_budget(0.016, 15.0, _beam(60.0, 12.0)),
            **_view(90.0, 24.0, 512),
        },
    ),
    "short_range_77ghz": RadarPreset(
        "77 GHz Short Range",
        "FMCW, 0.15 m to 35 m, 29 m/s, beam 100 x 20 deg, EIRP 25 dBm",
        130.0,
        {
            "waveform_kind": "fmcw", "carrier_hz": 77.5e9, "bandwidth_hz": 1e9,
            "adc_samples": 256, "adc_rate_hz": 10e6, "prf_hz": 30e3, "pulses": 256,
            "range_stop_m": 35.0, **_budget(0.016, 15.0, _beam(100.0, 20.0)),
            **_view(130.0, 40.0, 512),
        },
    ),
    "long_range_77ghz": RadarPreset(
        "77 GHz Long Range",
        "FMCW, 0.5 m to 250 m, 34 m/s, beam 20 x 6 deg, EIRP 37 dBm",
        30.0,
        {
            "waveform_kind": "fmcw", "carrier_hz": 76.5e9, "bandwidth_hz": 300e6,
            "adc_samples": 512, "adc_rate_hz": 20e6, "prf_hz": 35e3, "pulses": 512,
            "range_stop_m": 250.0, **_budget(0.016, 13.0, _beam(20.0, 6.0)),
            **_view(30.0, 10.0, 512),
        },
    ),
    "doppler_24ghz": RadarPreset(
        "24 GHz Doppler Sensor",
        "FMCW, 0.83 m to 50 m, 31 m/s at 0.06 m/s, beam 80 x 34 deg, EIRP 17 dBm",
        # Within 24.05 to 24.25 GHz and below the 20 dBm of EN 300 440.
        120.0,
        {
            "waveform_kind": "fmcw", "carrier_hz": 24.15e9, "bandwidth_hz": 180e6,
            "adc_samples": 64, "adc_rate_hz": 1e6, "prf_hz": 10e3, "pulses": 1024,
            "range_stop_m": 50.0, **_budget(0.004, 12.0, _beam(80.0, 34.0)),
            **_view(120.0, 68.0, 384),
        },
    ),
    "marine_x_band": RadarPreset(
        "X-Band Marine",
        "Solid-state pulse, 6 m to 22 km, 15.9 m/s, beam 1.2 x 25 deg, EIRP 84 dBm",
        50.0,
        {
            "waveform_kind": "lfm", "carrier_hz": 9.41e9, "bandwidth_hz": 25e6,
            "chirp_duration_s": 2e-6, "sampling_rate_hz": 30e6, "prf_hz": 2e3, "pulses": 16,
            "range_stop_m": 22e3, **_budget(200.0, 5.0, _beam(1.2, 25.0)),
            **_view(3.6, 50.0, 1024),
        },
    ),
    "surveillance_x_band": RadarPreset(
        "X-Band Surveillance",
        "Pulse-Doppler radar on the ground, 10 m to 20 km, 37 m/s, beam 2 x 8 deg, EIRP 94 dBm",
        24.0,
        {
            "waveform_kind": "lfm", "carrier_hz": 10e9, "bandwidth_hz": 15e6,
            "chirp_duration_s": 10e-6, "sampling_rate_hz": 18e6, "prf_hz": 5e3, "pulses": 128,
            "range_stop_m": 20e3, **_budget(1000.0, 4.0, _beam(2.0, 8.0)),
            **_view(6.0, 24.0, 768),
        },
    ),
    "sar_c_band": RadarPreset(
        "C-Band SAR",
        "Airborne, 1.5 m to 10 km, 14 m/s, beam 4 x 30 deg, EIRP 72 dBm",
        # A sample is 1.25 m; the antenna is 0.8 m long and sees 4 degrees along the track.
        60.0,
        {
            "waveform_kind": "lfm", "carrier_hz": 5.3e9, "bandwidth_hz": 100e6,
            "chirp_duration_s": 5e-6, "sampling_rate_hz": 120e6, "prf_hz": 1e3, "pulses": 512,
            "range_stop_m": 10e3, **_budget(50.0, 4.0, _beam(4.0, 30.0)),
            **_view(8.0, 60.0, 768),
        },
    ),
    "paper": RadarPreset(
        "Paper",
        "Pulse of Costa et al. (SBrT 2020) in all directions, 3 m, 14 m/s",
        # At 1000 pulses per second; the paper gives no power: 1 kW into an antenna of 30 dB.
        40.0,
        {
            "waveform_kind": "lfm", "carrier_hz": 5.3e9, "bandwidth_hz": 50e6,
            "chirp_duration_s": 2.5e-6, "sampling_rate_hz": 60e6, "prf_hz": 1000.0, "pulses": 128,
            **_view(40.0, 23.15, 960),
        },
        1e6,
    ),
})  # fmt: skip


def radar_preset(name: str) -> RadarPreset:
    """Return a preset by its name, a key of `PRESETS`; ConfigError if there is none."""
    if name not in PRESETS:
        raise ConfigError(f"There is no radar preset {name!r}; expected {', '.join(PRESETS)}.")
    return PRESETS[name]
