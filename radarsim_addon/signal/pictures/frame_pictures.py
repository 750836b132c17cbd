# SPDX-License-Identifier: GPL-3.0-or-later
"""The pictures of a frame: ``png``."""

from __future__ import annotations

from pathlib import Path

from ..maps import power_unit
from ..results import FrameResult, frame_file, result_writer
from .clutter import plot_clutter
from .echo import draw_echo, plot_echo
from .figure import save_figure
from .map import draw_range_doppler
from .profile import draw_range_profile
from .rings import plot_rings
from .sheet import save_picture
from .spectrogram import plot_spectrogram

_NAMES = ("rings", "echo", "range_profile", "range_doppler", "clutter", "spectrogram")


@result_writer("png", *(f"_{name}.png" for name in _NAMES))
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
        ``_echo.png``, ``_range_profile.png``, ``_range_doppler.png``; of rings ``_rings.png``, with
        clutter ``_clutter.png``, where there is a spectrogram ``_spectrogram.png``, too.
    """
    title = f"frame {result.frame}, t = {result.time_s:.4g} s"
    if uncertain := result.budget.uncertain_text:
        title += f", {uncertain}"
    unit = power_unit(result.echoes.amplitude_model)

    def file(name: str) -> Path:
        return frame_file(folder, result.frame, f"_{name}.png")

    files = []
    if result.source.frame.sampling_mode == "rings":
        files.append(save_figure(plot_rings(result.source.frame), file("rings")))
    echoes, echo_title = result.echoes.channel(0), f"Raw echo, {title}"
    pixels = draw_echo(echoes, echo_title)
    if pixels is None:
        files.append(save_figure(plot_echo(echoes, echo_title), file("echo")))
    else:
        files.append(save_picture(pixels, file("echo")))
    line = result.echoes.radar.waveform.family == "line"
    pixels = draw_range_profile(
        result.compressed.channel(0),
        result.profile,
        result.edges,
        f"{'Range profile' if line else 'Matched filter'}, {title}",
        expected=result.expected,
        noise_power=result.profile_noise_power,
        unit=unit,
    )
    files.append(save_picture(pixels, file("range_profile")))
    found = result.detections
    pixels = draw_range_doppler(
        result.rd_map.channel(0),
        result.moving_targets,
        f"Range-Doppler map, {f'{result.mti}-pulse MTI, ' if result.mti else ''}{title}",
        targets=() if found is None else found.targets,
        left_out=0 if found is None else found.left_out,
        noise_power=result.map_noise_power,
        unit=unit,
    )
    files.append(save_picture(pixels, file("range_doppler")))
    if result.spectrogram is not None:
        name = result.spectrogram.options.object_name
        figure = plot_spectrogram(
            result.spectrogram, f"Spectrogram{f' of {name}' if name else ''}, {title}", unit
        )
        files.append(save_figure(figure, file("spectrogram")))
    expected = result.expected
    if expected is not None and expected.clutter_map is not None:
        noise_power = result.noise_of_budget or 0.0
        figure = plot_clutter(
            expected,
            result.source.radar,
            f"Expected clutter, {title}",
            noise_power=noise_power,
            unit=unit,
        )
        files.append(save_figure(figure, file("clutter")))
    return files
