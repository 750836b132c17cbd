# SPDX-License-Identifier: GPL-3.0-or-later
"""Radars that can be built but are of no use for what they look at: mostly a slip of a unit.

Nothing here is refused: low frequencies, narrow bands and slow pulses may be meant. Numbers that
contradict one another are refused where they are made (:mod:`.radar.config`). Standard library
only.
"""

from __future__ import annotations

from ...findings import Finding, finding
from .config import Radar
from .pulses import Waveform
from .waveform import AnyWaveform

#: A sweep that fills less than this fraction of the band 1/T that the pulse's duration alone takes.
_LEAST_TIME_BANDWIDTH = 0.9
#: A burst up to this is plausible, however short the animation is [s].
_USUAL_BURST_S = 10.0
#: What bounds the unambiguous range, by kind of waveform.
_RANGE_LIMITS = {"stepped": "frequency step", "pmcw": "code length", "fmcw": "sampling rate"}


def range_limit(waveform: AnyWaveform) -> str:
    """Return which setting bounds the unambiguous range, such as "PRF".

    Parameters
    ----------
    waveform
        Any waveform.

    Returns
    -------
    str
        Name of the setting, for messages.
    """
    return _RANGE_LIMITS.get(waveform.kind, "PRF")


def find_suspicious_parameters(
    radar: Radar, reach_m: float | None = None, animation_s: float | None = None
) -> list[Finding]:
    """Find parameters that make a radar useless for its scene.

    Parameters
    ----------
    radar
        Waveform and burst.
    reach_m
        Farthest range that is of interest, of the scene or the range limits [m], if known.
    animation_s
        Duration of the scene's animation [s], if known.

    Returns
    -------
    list of Finding
        Empty where all parameters suit the scene.
    """
    waveform, found = radar.waveform, []
    if reach_m is not None and 0 < reach_m < waveform.range_resolution_m:
        found.append(
            finding(
                "one-range-cell",
                bandwidth_hz=waveform.bandwidth_hz,
                range_resolution_m=waveform.range_resolution_m,
                farthest_m=reach_m,
            )
        )
    elif (
        isinstance(waveform, Waveform)
        and waveform.bandwidth_hz * waveform.chirp_duration_s < _LEAST_TIME_BANDWIDTH
    ):
        found.append(
            finding(
                "low-time-bandwidth-product",
                bandwidth_hz=waveform.bandwidth_hz,
                duration_s=waveform.chirp_duration_s,
                product=waveform.bandwidth_hz * waveform.chirp_duration_s,
                own_hz=1 / waveform.chirp_duration_s,
            )
        )
    if reach_m is not None and 0 < reach_m < waveform.wavelength_m:
        found.append(
            finding(
                "wavelength-exceeds-scene",
                carrier_hz=waveform.carrier_hz,
                wavelength_m=waveform.wavelength_m,
                farthest_m=reach_m,
            )
        )
    burst_s = radar.burst.pulses / radar.burst.prf_hz
    if animation_s is not None and burst_s > max(animation_s, _USUAL_BURST_S):
        found.append(
            finding(
                "burst-exceeds-animation",
                pulses=radar.burst.pulses,
                prf_hz=radar.burst.prf_hz,
                burst_s=burst_s,
                animation_s=animation_s,
                max_unambiguous_velocity_mps=radar.max_unambiguous_velocity_mps,
            )
        )
    return found
