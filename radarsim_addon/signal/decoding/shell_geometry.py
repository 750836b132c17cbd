# SPDX-License-Identifier: GPL-3.0-or-later
"""Geometry of paths that a pixel's direction and a total length give: those of one reflection."""

from __future__ import annotations

import numpy as np

from ...array_types import Integers, Real
from ...contract import ReceiverRecord, TransmitterRecord
from ..paths import PathGeometry
from .ring_pixels import Decoded


def single_vertex_m(length_m: Real, direction: Real, receiver_m: Real, transmitter_m: Real) -> Real:
    """Compute the scatterer of paths with one reflection from direction and total length.

    Parameters
    ----------
    length_m
        Total lengths L, (n,) [m].
    direction
        From the receiver, unit vectors d, (n, 3).
    receiver_m, transmitter_m
        Places C and T, (3,) [m].

    Returns
    -------
    ndarray
        (n, 3) [m]; NaN where the length is below the baseline.

    Notes
    -----
    On the ray C + s d at s + |C + s d - T| = L, so s = (L^2 - b^2) / (2 (L + d.(C - T))) with the
    baseline b = |C - T|.
    """
    baseline_m = np.asarray(receiver_m - transmitter_m, dtype=np.float64)
    square = length_m**2 - baseline_m @ baseline_m
    below = 2 * (length_m + direction @ baseline_m)
    with np.errstate(divide="ignore", invalid="ignore"):
        along_m = np.where((square > 0) & (below > 0), square / below, np.nan)
    return np.asarray(receiver_m + along_m[:, None] * direction, dtype=np.float64)


def ring_geometry(
    decoded: Decoded,
    row: Integers,
    col: Integers,
    receiver: ReceiverRecord,
    transmitter: TransmitterRecord,
    single: bool,
) -> PathGeometry:
    """Geometry of some pixels (row, col) of a ring, with poses at t.

    `single`: every path has one reflection. Else vertices and orders are unknown (NaN and 0).
    """
    pose = np.asarray(receiver.matrix_world, dtype=np.float64)
    local = np.stack([decoded.u[col], decoded.v[row], np.full(row.size, -1.0)], axis=-1)
    local /= np.linalg.norm(local, axis=-1, keepdims=True)
    direction = local @ pose[:3, :3].T
    zeros = np.zeros(row.size, dtype=np.int32)
    vertex = np.full((row.size, 3), np.nan)
    if single:
        transmitter_m = np.asarray(transmitter.matrix_world, dtype=np.float64)[:3, 3]
        vertex = single_vertex_m(
            decoded.total_length_m[row, col], direction, pose[:3, 3], transmitter_m
        )
    return PathGeometry(
        order=zeros + (1 if single else 0),
        transparent_depth=zeros,
        first_scatterer_m=vertex,
        last_scatterer_m=vertex,
        direction=direction,
        first_object=zeros,
        last_object=zeros,
    )
