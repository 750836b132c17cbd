# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of a frame."""

from __future__ import annotations

from pathlib import Path

from ..detection import FrameResult, ProcessOptions
from ..maps import power_unit
from ..runs import RadarFrame
from .echo import plot_echo
from .figure import save_figure
from .map import plot_range_doppler
from .profile import plot_range_profile
from .rings import plot_rings


def draw_results(
    frame: RadarFrame, result: FrameResult, folder: Path, options: ProcessOptions
) -> list[Path]:
    """Pictures of a frame; returns their files."""

    def name(what: str) -> Path:
        return folder / f"frame_{result.frame:04d}_{what}.png"

    title = f"frame {result.frame}, t = {result.time_s:.4g} s"
    line = result.echoes.radar.waveform.family == "line"
    profile_name = "Range profile" if line else "Matched filter"
    unit = power_unit(result.echoes.amplitude_model)
    mti = f"{options.mti}-pulse MTI, " if options.mti else ""
    rings = []
    if frame.sampling_mode == "rings":
        rings.append(save_figure(plot_rings(frame), name("rings")))
    return [
        *rings,
        save_figure(plot_echo(result.echoes, f"Raw echo, {title}"), name("echo")),
        save_figure(
            plot_range_profile(
                result.compressed,
                result.profile,
                result.edges,
                f"{profile_name}, {title}",
                expected=result.expected,
                noise_power=result.profile_noise_power,
                unit=unit,
            ),
            name("range_profile"),
        ),
        save_figure(
            plot_range_doppler(
                result.rd_map,
                result.moving_targets,
                f"Range-Doppler map, {mti}{title}",
                targets=() if result.detections is None else result.detections.targets,
                left_out=0 if result.detections is None else result.detections.left_out,
                noise_power=result.map_noise_power,
                unit=unit,
            ),
            name("range_doppler"),
        ),
    ]
