# SPDX-License-Identifier: GPL-3.0-or-later
"""The user's waveform, part of ``scene.radarsim``, in the units of the panel."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any

import bpy

from ...errors import ConfigError
from ...signal.radar import (
    AnyWaveform,
    Burst,
    FmcwWaveform,
    PhaseCodedPulse,
    PmcwWaveform,
    SteppedWaveform,
    Waveform,
    load_radar,
)

#: Settings that a kind of waveform uses beside the carrier, in the order of the panel; those of
#: the LFM pulse hang on `sweep_by`.
WAVEFORM_SETTINGS: dict[str, tuple[str, ...]] = {
    "lfm": ("chirp_duration_us", "sampling_rate_mhz"),
    "fmcw": ("bandwidth_mhz", "adc_samples", "adc_rate_mhz", "adc_start_us", "idle_us", "real_adc"),
    "stepped": ("step_khz", "steps", "step_time_us"),
    "pmcw": ("chip_ns", "code_degree", "code_repeats"),
    "barker": ("chip_ns", "barker_length"),
    "file": ("radar_file",),
}
#: Numbers of the command line that belong to the LFM pulse.
_OF_PULSE = ("bandwidth_mhz", "chirp_duration_us", "sampling_rate_mhz")


class WaveformSettings:
    """Settings of the waveform, mixed into the scene's."""

    waveform_kind: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Waveform",
        items=(
            ("lfm", "LFM pulse", "Linear chirp, one echo a pulse"),
            ("fmcw", "FMCW", "Linear chirps with de-chirp: the ADC samples the beat"),
            ("stepped", "Stepped frequency", "One sample at each of many tones"),
            ("pmcw", "PMCW", "m-sequence of phases, sent without a pause"),
            ("barker", "Barker pulse", "Pulse with a Barker code of phases"),
            ("file", "File", "Waveform and burst from a radar file (JSON)"),
        ),
        description="What is transmitted; a finished run can be processed with another one",
    )
    sweep_by: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Sweep by",
        items=(
            ("BANDWIDTH", "Bandwidth", "Give the swept bandwidth"),
            ("FM_RATE", "FM rate", "Give the chirp rate; bandwidth = FM rate x chirp length"),
        ),
        description="Which of the two is given",
    )
    bandwidth_mhz: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Bandwidth [MHz]",
        default=50.0,
        min=1e-6,
        precision=4,
        description="Swept bandwidth B; range resolution is c / 2B",
    )
    fm_rate_mhz_per_us: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="FM rate [MHz/us]",
        default=20.0,
        min=1e-6,
        precision=4,
        description="Chirp rate K; 20 MHz/us are 20e12 Hz/s",
    )
    chirp_duration_us: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Chirp length [us]",
        default=2.5,
        min=1e-6,
        precision=4,
        description="Length of a pulse; at most the pulse interval 1 / PRF",
    )
    sampling_rate_mhz: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Sampling rate [MHz]",
        default=60.0,
        min=1e-6,
        precision=4,
        description="Complex samples a second; at least the bandwidth",
    )
    adc_samples: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="ADC samples", default=256, min=2, soft_max=4096,
        description="Samples of each chirp",
    )  # fmt: skip
    adc_rate_mhz: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="ADC rate [MHz]", default=10.0, min=1e-6, precision=4,
        description="Samples a second; the chirp lasts samples / rate",
    )  # fmt: skip
    adc_start_us: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="ADC start [us]", default=0.0, min=0.0, precision=4,
        description="From the start of the ramp to the first sample",
    )  # fmt: skip
    idle_us: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Idle time [us]", default=0.0, min=0.0, precision=4,
        description="Least pause between two chirps; ramp and pause fit into 1 / PRF",
    )  # fmt: skip
    real_adc: bpy.props.BoolProperty(  # type: ignore[valid-type]
        name="Real ADC",
        default=False,
        description="One channel instead of I and Q: half the range, 3 dB less SNR",
    )
    step_khz: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Step [kHz]", default=500.0, min=1e-6, precision=4,
        description="Between two tones; the range repeats with c / 2 step",
    )  # fmt: skip
    steps: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Steps", default=128, min=2, soft_max=4096,
        description="Number of tones; the bandwidth is steps x step",
    )  # fmt: skip
    step_time_us: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Time per step [us]", default=5.0, min=1e-6, precision=4,
        description="Over which the receiver averages; all steps fit into 1 / PRF",
    )  # fmt: skip
    chip_ns: bpy.props.FloatProperty(  # type: ignore[valid-type]
        name="Chip [ns]", default=20.0, min=1e-6, precision=4,
        description="Length of one phase; the bandwidth is its inverse",
    )  # fmt: skip
    code_degree: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Code degree", default=10, min=2, max=16,
        description="The code has 2^degree - 1 chips; the range repeats with its length",
    )  # fmt: skip
    code_repeats: bpy.props.IntProperty(  # type: ignore[valid-type]
        name="Repeats", default=8, min=1, soft_max=1024,
        description="Codes that are added up for one pulse of the burst",
    )  # fmt: skip
    barker_length: bpy.props.EnumProperty(  # type: ignore[valid-type]
        name="Code",
        items=tuple(
            (str(n), f"Barker {n}", f"Sidelobes of 1/{n}") for n in (2, 3, 4, 5, 7, 11, 13)
        ),
        default="13",
        description="Barker code by its length",
    )
    radar_file: bpy.props.StringProperty(  # type: ignore[valid-type]
        name="Radar file", subtype="FILE_PATH", default="",
        description="JSON with waveform and burst, see docs/waveforms.md",
    )  # fmt: skip


def read_radar(
    settings: Any,
    given: Mapping[str, Any],
    number: Callable[..., float],
    whole: Callable[[str], int],
) -> tuple[AnyWaveform, Burst]:
    """Waveform and burst that the settings or the command line ask for.

    Parameters
    ----------
    settings
        ``scene.radarsim``.
    given
        Of the command line; ``radar_file`` names a radar file.
    number, whole
        Read one number by its name: in SI from a power of ten, and a whole one.

    Raises
    ------
    ConfigError
        Numbers that do not fit together; options of a pulse beside another waveform.
    FrameFileError
        The radar file cannot be read.
    """
    burst = Burst(prf_hz=number("prf_hz"), pulses=whole("pulses"))
    if "radar_file" in given:
        radar = load_radar(given["radar_file"], burst)
        return radar.waveform, radar.burst
    kind = settings.waveform_kind
    of_pulse = [name for name in _OF_PULSE if name in given]
    if kind != "lfm" and of_pulse:
        raise ConfigError(
            f"{', '.join(of_pulse)} given for an LFM pulse; the scene's waveform is {kind!r}. "
            "Give a radar file, or choose the LFM pulse in the scene."
        )
    if kind == "file":
        if not settings.radar_file.strip():
            raise ConfigError("No radar file is chosen. Choose one in Radar > Waveform.")
        radar = load_radar(Path(bpy.path.abspath(settings.radar_file)), burst)
        return radar.waveform, radar.burst
    return _waveform(kind, settings, given, number, whole), burst


def _waveform(
    kind: str,
    settings: Any,
    given: Mapping[str, Any],
    number: Callable[..., float],
    whole: Callable[[str], int],
) -> AnyWaveform:
    carrier_hz = number("carrier_ghz", 9)
    if kind == "fmcw":
        return FmcwWaveform(
            carrier_hz,
            number("bandwidth_mhz", 6),
            whole("adc_samples"),
            number("adc_rate_mhz", 6),
            number("adc_start_us", -6),
            None,
            number("idle_us", -6),
            bool(settings.real_adc),
        )
    if kind == "stepped":
        return SteppedWaveform(
            carrier_hz, number("step_khz", 3), whole("steps"), number("step_time_us", -6)
        )
    if kind == "pmcw":
        return PmcwWaveform(
            carrier_hz, number("chip_ns", -9), whole("code_degree"), whole("code_repeats")
        )
    if kind == "barker":
        return PhaseCodedPulse(carrier_hz, number("chip_ns", -9), int(settings.barker_length))
    by_rate = settings.sweep_by == "FM_RATE" and "bandwidth_mhz" not in given
    return Waveform(
        carrier_hz=carrier_hz,
        bandwidth_hz=(
            # MHz/us times us are MHz: no rounding by 1e12 and 1e-6.
            round(number("fm_rate_mhz_per_us") * number("chirp_duration_us") * 1e6, 3)
            if by_rate
            else number("bandwidth_mhz", 6)
        ),
        chirp_duration_s=number("chirp_duration_us", -6),
        sampling_rate_hz=number("sampling_rate_mhz", 6),
    )
