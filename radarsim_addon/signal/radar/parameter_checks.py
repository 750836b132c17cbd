# SPDX-License-Identifier: GPL-3.0-or-later
"""Radars that can be built but are of no use for what they look at: mostly a slip of a unit.

Nothing here is refused: low frequencies, narrow bands and slow pulses may be meant. Numbers that
contradict one another are refused where they are made (:mod:`.radar.config`). Standard library
only.
"""

from __future__ import annotations

from .config import Radar
from .pulses import Waveform
from .waveform import AnyWaveform

#: A sweep that fills less than this share of the band 1/T that the pulse's length alone takes.
_LEAST_TIME_BANDWIDTH = 0.9
#: A burst up to this is nobody's slip, however short the animation is [s].
_USUAL_BURST_S = 10.0
_SCALE = "If the ranges are wrong, set Scene > Units > Unit Scale."
#: What makes the bandwidth, how to have more of it, and its units in files and panel, by kind.
_BANDWIDTH = ("", "Raise the bandwidth", "hertz in radar files, MHz in the panel")
_BANDWIDTH_OF = {
    "stepped": (
        " (steps x step)",
        "Take larger or more steps",
        "the step is in hertz in radar files, in kHz in the panel",
    ),
    **dict.fromkeys(
        ("pmcw", "barker"),
        (
            " (1 / chip length)",
            "Take shorter chips",
            "a chip is in seconds in radar files, in ns in the panel",
        ),
    ),
}


def length_text(metres: float) -> str:
    """A length with a unit that suits it."""
    return f"{metres / 1e3:.5g} km" if metres >= 1e4 else f"{metres:.5g} m"


def frequency_text(hertz: float) -> str:
    """A frequency with a unit that suits it."""
    for unit, scale in (("GHz", 1e9), ("MHz", 1e6), ("kHz", 1e3)):
        if hertz >= scale:
            return f"{hertz / scale:.5g} {unit}"
    return f"{hertz:.5g} Hz"


def find_suspicious_parameters(
    radar: Radar, reach_m: float | None = None, animation_s: float | None = None
) -> list[str]:
    """What makes a radar useless for what it looks at, in whole sentences; empty when all is well.

    Parameters
    ----------
    radar
        Waveform and burst.
    reach_m
        Farthest range that is of interest, of the scene or the range window [m], if known.
    animation_s
        Length of the scene's animation [s], if known.
    """
    waveform, found = radar.waveform, []
    if reach_m is not None and 0 < reach_m < waveform.range_resolution_m:
        found.append(_one_cell(waveform, reach_m))
    elif (
        isinstance(waveform, Waveform)
        and waveform.bandwidth_hz * waveform.chirp_duration_s < _LEAST_TIME_BANDWIDTH
    ):
        found.append(_short_sweep(waveform))
    if reach_m is not None and 0 < reach_m < waveform.wavelength_m:
        found.append(
            f"A carrier of {frequency_text(waveform.carrier_hz)} has a wavelength of "
            f"{length_text(waveform.wavelength_m)}, but ranges end at {length_text(reach_m)}: rays "
            "describe no wave longer than the scene. Raise the carrier, and check its unit: hertz "
            f"in radar files, GHz in the panel and --carrier-ghz. {_SCALE}"
        )
    burst_s = radar.burst.pulses / radar.burst.prf_hz
    if animation_s is not None and burst_s > max(animation_s, _USUAL_BURST_S):
        found.append(
            f"A burst of {radar.burst.pulses} pulses at a PRF of "
            f"{frequency_text(radar.burst.prf_hz)} lasts {burst_s:.4g} s, the animation "
            f"{animation_s:.4g} s; range rates beyond "
            f"{radar.max_unambiguous_velocity_mps:.3g} m/s fold. "
            "Raise the PRF or send fewer pulses, and check the PRF's unit: hertz everywhere."
        )
    return found


def _one_cell(waveform: AnyWaveform, reach_m: float) -> str:
    formula, remedy, units = _BANDWIDTH_OF.get(waveform.kind, _BANDWIDTH)
    return (
        f"A bandwidth{formula} of {frequency_text(waveform.bandwidth_hz)} resolves ranges to "
        f"c / 2B = {length_text(waveform.range_resolution_m)}, but ranges end at "
        f"{length_text(reach_m)}: all echoes lie in one range cell. {remedy}, and check the unit: "
        f"{units}. {_SCALE}"
    )


def _short_sweep(waveform: Waveform) -> str:
    product = waveform.bandwidth_hz * waveform.chirp_duration_s
    own_hz = 1 / waveform.chirp_duration_s
    return (
        f"Bandwidth times chirp length is {frequency_text(waveform.bandwidth_hz)} x "
        f"{waveform.chirp_duration_s:.4g} s = {product:.3g}: a pulse so short fills about 1 / T = "
        f"{frequency_text(own_hz)} whatever it sweeps, and the matched filter keeps the bandwidth "
        f"alone. Give a bandwidth from {frequency_text(own_hz)} or a longer chirp, and check the "
        "units: hertz and seconds in radar files, MHz and us in the panel."
    )
