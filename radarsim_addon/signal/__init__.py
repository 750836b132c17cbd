# SPDX-License-Identifier: GPL-3.0-or-later
"""The companion module: from rendered rings to range-Doppler maps. No Blender in it.

Five lines make a map::

    from radarsim_addon import signal
    run = signal.open_run("out/paper/run")
    echoes = signal.synthesize(
        signal.iter_path_chunks(run.frame(1)), run.radar, range_limits_m=run.range_limits_m,
        speckle_seed=0)
    rd_map = signal.range_doppler(signal.range_process(echoes))
    signal.plot_range_doppler(rd_map, signal.find_peaks(rd_map, 1, min_speed_mps=1))

Conventions: SI, float64; one-way range is half the path's length; range rate is positive when
receding, and Doppler is -2 v / lambda, so what recedes is at negative Doppler.

Radar
    Waveform (LFM pulse), FmcwWaveform, SteppedWaveform, PmcwWaveform, PhaseCodedPulse,
    ArbitraryPulse, Burst, Radar; Channel, Element; AntennaArray, array_preset, linear_array;
    waveform_from_dict, waveform_to_dict, load_radar; LinkBudget, AntennaRecord
Files
    open_run -> Run, Run.frame -> RadarFrame, RadarFrame.image; Run.missing -> MissingRender;
    read_exr, write_exr
Pixels
    decode (Eq. 4) -> Decoded; pixel_grid -> PixelGrid; range_rate (Eq. 12)
Paths
    iter_path_chunks, frame_paths, make_paths, Paths.join -> Paths, PathCounts; Paths.lengths_at_m
    (at the moments pulse_times_s(radar)); path_power_w, path_amplitude, amplitude; PathFlag
Echoes (Eq. 9-14)
    synthesize -> Echoes; EchoSynthesizer, EchoOptions; path_phasors; nufft1; replica,
    replica_spectrum, matched_filter
Spectra for any waveform
    SpectrumAccumulator(FrequencyGrid, times) -> Spectrum, SynthesisReport; ReceiveWindow,
    Ramp
Receiver
    apply_receiver -> ReceivedSignal; Receiver (noise figure, ADC bits, phase noise); PhaseNoise,
    load_phase_noise; range_noise_gain, map_noise_gain: the floor that noise makes
Weather
    Weather: what rain, fog and gases take of each path
Compression
    range_process -> RangeProfiles; expected_power_profile -> PowerProfile; window_at,
    slow_time_window
Standard errors (acquisition "paths")
    expected_power -> ExpectedPower
Map
    range_doppler -> RangeDopplerMap; power_to_db; spectrogram -> Spectrogram, SpectrogramOptions
Angles
    detect_in_directions -> Detections of DirectedDetection; ArrayGeometry; covariance_of, bartlett,
    capon, music, esprit, count_sources
MTI
    mti_cancel, mti_response
Detection
    detect_targets -> Detections, Detection; Cfar, cfar_threshold -> CfarResult;
    find_peaks -> Peak; leading_edges -> LeadingEdge; peak_to_background_db
Products and pictures
    write_products; plot_rings, plot_echo, plot_range_profile, plot_range_doppler,
    plot_spectrogram, save_figure
A whole run
    process_run(path, ProcessOptions(...)) yields Progress and FrameResult;
    open_frame -> FrameInput; ProcessOptions.for_run -> ResolvedOptions; process_frame(FrameInput,
    ResolvedOptions) -> FrameResult, without a file;
    frame_statistics -> FrameStatistics

Each part is loaded when one of its names is first used.
"""

from __future__ import annotations

from importlib import import_module
from typing import TYPE_CHECKING, Any

if TYPE_CHECKING:
    from .angles import *
    from .decoding import *
    from .detection import *
    from .echoes import *
    from .maps import *
    from .paths import *
    from .pictures import *
    from .pipeline import *
    from .products import *
    from .radar import *
    from .runs import *
    from .scattering import *
    from .spectrum import *

__all__ = [
    "AntennaArray",
    "AntennaRecord",
    "ArbitraryPulse",
    "ArrayGeometry",
    "Burst",
    "Cfar",
    "CfarResult",
    "Channel",
    "Decoded",
    "Detection",
    "Detections",
    "DirectedDetection",
    "EchoOptions",
    "EchoSynthesizer",
    "Echoes",
    "Element",
    "ExpectedPower",
    "FmcwWaveform",
    "FrameInput",
    "FrameResult",
    "FrameStatistics",
    "FrequencyGrid",
    "LeadingEdge",
    "LinkBudget",
    "MissingRender",
    "PathCounts",
    "PathFlag",
    "Paths",
    "Peak",
    "PhaseCodedPulse",
    "PhaseNoise",
    "PixelGrid",
    "PmcwWaveform",
    "PowerProfile",
    "ProcessOptions",
    "Progress",
    "Radar",
    "RadarFrame",
    "Ramp",
    "RangeDopplerMap",
    "RangeProfiles",
    "ReceiveWindow",
    "ReceivedSignal",
    "Receiver",
    "ResolvedOptions",
    "Run",
    "Spectrogram",
    "SpectrogramOptions",
    "Spectrum",
    "SpectrumAccumulator",
    "SteppedWaveform",
    "SynthesisReport",
    "Waveform",
    "Weather",
    "amplitude",
    "apply_receiver",
    "array_preset",
    "bartlett",
    "capon",
    "cfar_threshold",
    "count_sources",
    "covariance_of",
    "decode",
    "detect_in_directions",
    "detect_targets",
    "esprit",
    "expected_power",
    "expected_power_profile",
    "find_peaks",
    "frame_paths",
    "frame_statistics",
    "iter_path_chunks",
    "leading_edges",
    "linear_array",
    "load_phase_noise",
    "load_radar",
    "make_paths",
    "map_noise_gain",
    "matched_filter",
    "mti_cancel",
    "mti_response",
    "music",
    "nufft1",
    "open_frame",
    "open_run",
    "path_amplitude",
    "path_phasors",
    "path_power_w",
    "peak_to_background_db",
    "pixel_grid",
    "plot_echo",
    "plot_range_doppler",
    "plot_range_profile",
    "plot_rings",
    "plot_spectrogram",
    "power_to_db",
    "process_frame",
    "process_run",
    "pulse_times_s",
    "range_doppler",
    "range_noise_gain",
    "range_process",
    "range_rate",
    "read_exr",
    "replica",
    "replica_spectrum",
    "save_figure",
    "slow_time_window",
    "spectrogram",
    "synthesize",
    "waveform_from_dict",
    "waveform_to_dict",
    "window_at",
    "write_exr",
    "write_products",
]

#: Parts with these names; those that load little come first.
_PARTS = (
    "runs",
    "radar",
    "paths",
    "scattering",
    "spectrum",
    "decoding",
    "echoes",
    "maps",
    "angles",
    "detection",
    "products",
    "pictures",
    "pipeline",
)

if not TYPE_CHECKING:

    def __getattr__(name: str) -> Any:
        if name in _PARTS:
            return import_module(f".{name}", __name__)
        for part in _PARTS if name in __all__ else ():
            home = import_module(f".{part}", __name__)
            if name in home.__all__:
                value = globals()[name] = getattr(home, name)
                return value
        raise AttributeError(f"module {__name__!r} has no attribute {name!r}")


def __dir__() -> list[str]:
    return sorted({*globals(), *__all__, *_PARTS})
