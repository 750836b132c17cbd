# SPDX-License-Identifier: GPL-3.0-or-later
"""Power of the orders above the limit, from one render. Does not import bpy."""

from __future__ import annotations

from collections.abc import Generator
from dataclasses import dataclass

from ...array_types import Real
from .path_classes import TraceLimits, amplitude_of
from .requests import PathClass, RenderRequest, View, variance_of_sum

#: Orders above the limit whose power is measured, without following their paths.
_PROBED_ORDERS = 4


@dataclass(frozen=True)
class PowerBeyond:
    """Power of the orders above the limit: W per square Blender unit.

    Attributes
    ----------
    power, variance
        Their power, and the square of its standard error.
    strongest_ray
        Most power that one ray brought.
    pixels_per_ray
        Pixels of the frame that share a ray.
    """

    power: float = 0.0
    variance: float = 0.0
    strongest_ray: float = 0.0
    pixels_per_ray: float = 1.0


def look_beyond(
    limits: TraceLimits, weight: Real, pixels_per_ray: float, coloured: bool
) -> Generator[RenderRequest, View, PowerBeyond]:
    """Measure the power of the next `_PROBED_ORDERS` orders, whose paths are not followed.

    Parameters
    ----------
    limits
        As for `trace_replicate`.
    weight
        As for `trace_replicate`.
    pixels_per_ray
        Pixels of the frame for each pixel of this view.
    coloured
        Whether `trace_replicate` found colours in the scene.

    Yields
    ------
    RenderRequest
        Its only render.

    Returns
    -------
    PowerBeyond
    """
    view = yield RenderRequest(orders_beyond(limits), encoded=not limits.world_encoding)
    return power_seen_beyond(limits, view, weight, pixels_per_ray, coloured)


def orders_beyond(limits: TraceLimits) -> PathClass:
    """Return the orders whose power is measured.

    Parameters
    ----------
    limits
        As for `trace_replicate`.

    Returns
    -------
    PathClass
    """
    return PathClass(limits.max_reflections + 1, limits.max_reflections + _PROBED_ORDERS)


def power_seen_beyond(
    limits: TraceLimits, view: View, weight: Real, pixels_per_ray: float, coloured: bool
) -> PowerBeyond:
    """Return the power in a view of `orders_beyond`.

    Parameters
    ----------
    limits, weight, pixels_per_ray, coloured
        As for `look_beyond`.
    view
        What was rendered.

    Returns
    -------
    PowerBeyond
    """
    power = amplitude_of(view, limits.amplitude_channel if coloured else "B") * weight
    strongest = float(power.max(initial=0.0))
    return PowerBeyond(float(power.sum()), variance_of_sum(power), strongest, pixels_per_ray)
