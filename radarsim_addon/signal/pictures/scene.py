# SPDX-License-Identifier: GPL-3.0-or-later
"""Picture of the scene as the receiver sees it, with the targets of a frame marked and named."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

from ...arrays import Real
from ...contract import ReceiverRecord
from ..decoding import image_places
from ..detection import FrameBudget, PathFinder
from ..products import FrameResult
from .figure import fixed, new_figure, number_points

if TYPE_CHECKING:
    from matplotlib.figure import Figure

#: Most targets that are named.
_MOST_TARGETS = 5
#: Width of a figure, and the least and largest height of its picture [inches].
_WIDTH_IN, _HEIGHTS_IN = 8.0, (2.0, 8.0)


@dataclass(frozen=True)
class PlacedTarget:
    """A target and where its strongest path leaves the receiver for, (3,) [m]."""

    text: str
    place_m: Real


def placed_targets(result: FrameResult) -> list[PlacedTarget]:
    """Return the first targets of a frame that paths place: detections, without CFAR the objects.

    Rings place none.
    """
    source = result.source
    if not source.tables:
        return []
    finder = PathFinder(source, FrameBudget(source).link)
    placed = []
    if result.detections is not None:
        for one in result.detections.targets:
            true_mps = one.unfolded_velocity_mps
            rate_mps = one.velocity_mps if true_mps is None else true_mps
            paths = finder.of_target(one.range_m, one.velocity_mps, 1)
            placed.append((one.range_m, rate_mps, paths))
    else:
        for echo in result.budget.objects:
            paths = finder.of_object(echo.name, 1)
            placed.append((echo.range_m, echo.range_rate_mps, paths))
    return [
        PlacedTarget(
            f"{paths.name}\n{range_m:.4g} m, {fixed(rate_mps, 1, signed=True)} m/s",
            paths.seen_at_m,
        )
        for range_m, rate_mps, paths in placed
        if paths.seen_at_m is not None
    ][:_MOST_TARGETS]


def plot_scene(
    pixels: NDArray[np.uint8],
    receiver: ReceiverRecord,
    targets: Sequence[PlacedTarget] = (),
    title: str = "",
) -> Figure:
    """Draw what the receiver sees, (height, width, 3), with numbers at the targets in view."""
    aspect = pixels.shape[0] / pixels.shape[1]
    figure = new_figure(_WIDTH_IN, float(np.clip(_WIDTH_IN * aspect, *_HEIGHTS_IN)) + 0.9)
    axis = figure.add_subplot()
    axis.imshow(
        pixels,
        extent=(receiver.left, receiver.right, receiver.bottom, receiver.top),
        aspect=aspect * (receiver.right - receiver.left) / (receiver.top - receiver.bottom),
    )
    axis.set_axis_off()
    axis.set_title(title, fontsize=10)
    places = np.array([one.place_m for one in targets]).reshape(-1, 3)
    across, up = image_places(places, receiver)
    points, texts = [], []
    for u, v, target in zip(across.tolist(), up.tolist(), targets, strict=True):
        if receiver.left <= u <= receiver.right and receiver.bottom <= v <= receiver.top:
            points.append((u, v))
            texts.append(target.text)
    if points:
        axis.plot(*zip(*points, strict=True), "o", ls="", mfc="none", mec="C1", ms=9, mew=1.5)
        axis.set_xlim(receiver.left, receiver.right)
        axis.set_ylim(receiver.bottom, receiver.top)
    number_points(figure, axis, points, texts)
    return figure
