# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the receiver's and the transmitter's antenna are, and where they look, during a burst."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from ...array_types import Real
from .body_motion import BodyMotion


@dataclass(frozen=True)
class AntennaMotion:
    """Poses of both antennas over a burst.

    Attributes
    ----------
    receiver, transmitter
        Motion of the antennas' origins and axes (x right, y up, z back).
    orthographic
        Whether all rays leave the receiver along its boresight.
    """

    receiver: BodyMotion
    transmitter: BodyMotion
    orthographic: bool = False


def axes_of(body: BodyMotion, times_s: Real) -> Real:
    """Return unit vectors of an antenna's axes in world space as columns.

    Parameters
    ----------
    body
        An antenna; its scale has no effect.
    times_s
        (times,) [s].

    Returns
    -------
    ndarray
        (times, 3, 3).
    """
    start = body.pose[:3, :3]
    axes = start + body.change(times_s)[0] @ start
    return np.asarray(axes / np.linalg.norm(axes, axis=1, keepdims=True))


def places_m(body: BodyMotion, times_s: Real, offset_m: Real | None = None) -> Real:
    """Return where a point of an antenna is in world space.

    Parameters
    ----------
    body
        The antenna.
    times_s
        (times,) [s].
    offset_m
        The point in the antenna's axes, (3,) [m]; None: its origin.

    Returns
    -------
    ndarray
        (times, 3) [m].
    """
    origin_m = body.pose[:3, 3]
    place: Real = origin_m + body.displacement(origin_m[None], times_s)[0]
    return place if offset_m is None else place + axes_of(body, times_s) @ offset_m
