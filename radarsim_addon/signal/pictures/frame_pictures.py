# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of a frame: ``png``."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING

from ..maps import power_unit
from ..results import FrameResult, frame_file, result_writer
from .echo import plot_echo
from .figure import save_figure
from .map import plot_range_doppler
from .profile import plot_range_profile
from .rings import plot_rings

if TYPE_CHECKING:
    from matplotlib.figure import Figure


@result_writer("png", "_rings.png", "_echo.png", "_range_profile.png", "_range_doppler.png")
def draw_results(result: FrameResult, folder: Path) -> list[Path]:
    """Draw the pictures of a frame.

    Parameters
    ----------
    result
        Result of a frame. The images of rings are read again.
    folder
        Existing folder.

    Returns
    -------
    list of Path
        ``_echo.png``, ``_range_profile.png``, ``_range_doppler.png``; of rings ``_rings.png`` too.
    """
    return [
        save_figure(figure, frame_file(folder, result.frame, f"_{name}.png"))
        for name, figure in _figures(result)
    ]


def _figures(result: FrameResult) -> Iterator[tuple[str, Figure]]:
    """Name and figure of each picture, one at a time."""
    title = f"frame {result.frame}, t = {result.time_s:.4g} s"
    unit = power_unit(result.echoes.amplitude_model)
    if result.source.frame.sampling_mode == "rings":
        yield "rings", plot_rings(result.source.frame)
    yield "echo", plot_echo(result.echoes.channel(0), f"Raw echo, {title}")
    line = result.echoes.radar.waveform.family == "line"
    yield (
        "range_profile",
        plot_range_profile(
            result.compressed.channel(0),
            result.profile,
            result.edges,
            f"{'Range profile' if line else 'Matched filter'}, {title}",
            expected=result.expected,
            noise_power=result.profile_noise_power,
            unit=unit,
        ),
    )
    found = result.detections
    yield (
        "range_doppler",
        plot_range_doppler(
            result.rd_map.channel(0),
            result.moving_targets,
            f"Range-Doppler map, {f'{result.mti}-pulse MTI, ' if result.mti else ''}{title}",
            targets=() if found is None else found.targets,
            left_out=0 if found is None else found.left_out,
            noise_power=result.map_noise_power,
            unit=unit,
        ),
    )
