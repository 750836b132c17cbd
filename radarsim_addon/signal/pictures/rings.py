# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture of all rings of a frame."""

from __future__ import annotations

import math
from typing import TYPE_CHECKING

from ..decoding import decode
from ..maps import power_to_db
from ..runs import RadarFrame
from .figure import new_figure

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Widest picture of one ring in the montage [px].
_THUMBNAIL_PX = 480


def plot_rings(frame: RadarFrame, snapshot_index: int = 0, floor_db: float = -60.0) -> Figure:
    """Draw a montage of all rings of a frame: radiance in decibels (the paper's Fig. 6).

    Parameters
    ----------
    frame
        Radar frame with the sampling mode "rings".
    snapshot_index
        Snapshot, from 0.
    floor_db
        Level of the lowest colour, relative to the strongest pixel [dB].

    Returns
    -------
    matplotlib.figure.Figure
        The picture.
    """
    step_m = frame.record.ring_step_m
    thumbnails, tops = [], []
    for ring in range(frame.rings):
        record, channels = frame.image(ring, snapshot_index)
        radiance = decode(record, channels).radiance
        skip = max(1, -(-radiance.shape[1] // _THUMBNAIL_PX))
        rows, cols = (n - n % skip for n in radiance.shape)
        blocks = radiance[:rows, :cols].reshape(rows // skip, skip, cols // skip, skip)
        thumbnails.append(blocks.max(axis=(1, 3)))  # maximum: a small target stays visible
        tops.append(float(radiance.max()))
    reference = max(tops) or 1.0
    columns = min(7, frame.rings)
    lines = math.ceil(frame.rings / columns)
    aspect = frame.record.height_px / frame.record.width_px
    # at least as high as the label of the colour bar
    height_in = max((1.83 * aspect + 0.22) * lines + 0.4, 2.2)
    figure = new_figure(2.0 * columns + 0.8, height_in)
    figure.set_layout_engine("compressed")  # pictures keep their shape, without gaps between them
    axes = figure.subplots(lines, columns, squeeze=False)
    for ring, axis in enumerate(axes.ravel()):
        axis.set_axis_off()
        if ring < frame.rings:
            if tops[ring] <= 0:
                axis.text(
                    0.5, 0.5, "no echo", color="0.6", fontsize=7, ha="center", va="center",
                    transform=axis.transAxes,
                )  # fmt: skip
            level = power_to_db(thumbnails[ring], reference, floor_db)
            axis.imshow(level, vmin=floor_db, vmax=0, cmap="magma")
            axis.set_title(f"{ring * step_m:g}-{(ring + 1) * step_m:g} m", fontsize=7, pad=2)
    bar = figure.colorbar(axes.flat[0].images[0], ax=axes, fraction=0.02)
    bar.set_label("radiance\n[dB re strongest pixel]", fontsize=8)
    later = (
        ""
        if snapshot_index == 0
        else f", second snapshot, {frame.record.snapshot_interval_s:g} s later"
    )
    figure.suptitle(f"Rings, frame {frame.number}, t = {frame.time_s:.4g} s{later}", fontsize=10)
    return figure
