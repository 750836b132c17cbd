# SPDX-License-Identifier: GPL-3.0-or-later
"""Where the paths of a view lie on its grid of pixels, told from their directions."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray

from ...array_types import Integers, Real
from ...contract import ReceiverRecord
from .table import PathRows

#: Angles between rays of a sphere that are rounding, as a fraction of a pixel's side.
_SAME = 1e-3
#: Pixels whose median tells the pitch, which is the same for all.
_ENOUGH = 1 << 12
#: Most pixels of a grid: a table that says otherwise is not one of a grid.
MOST_PX = 1 << 25


def placed(rows: PathRows, receiver: ReceiverRecord) -> NDArray[np.bool_]:
    """Return which rows have a known pixel, (n,).

    Parallel rays are told by where they end, others by their direction.
    """
    if receiver.kind == "orthographic":
        return np.asarray(np.isfinite(rows["first_scatterer_m"]).all(axis=1))
    if receiver.kind == "perspective":
        backwards = np.array(receiver.matrix_world, dtype=np.float64)[:3, 2]
        return np.asarray(rows["direction"] @ backwards < 0)
    return np.asarray(np.any(rows["direction"] != 0, axis=1))


def grid_places(rows: PathRows, receiver: ReceiverRecord, count: int) -> tuple[Integers, Integers]:
    """Return column and row of each path's pixel, counted from the first ones that are met, (n,).

    The rows are of one tile at one of `count` replicates, one at least, all of them `placed`.
    """
    pose = np.array(receiver.matrix_world, dtype=np.float64)
    # A column of its own: in a table they lie far apart. And no BLAS, whose threads wait for one
    # another longer than three columns take.
    local = np.einsum("ni,ij->nj", np.array(rows["direction"]), pose[:3, :3])
    area = count * rows["solid_angle_sr"]
    if receiver.kind == "equirectangular":
        u = np.arctan2(local[:, 0], -local[:, 2])
        u = (u - u[0] + math.pi) % (2 * math.pi)
        v = np.arctan2(local[:, 1], np.hypot(local[:, 0], local[:, 2]))
        # Pixels may be wider than high, but the mean of both sides tells what is rounding.
        level = np.maximum(np.hypot(local[:, 0], local[:, 2]), 1e-12)
        side = math.sqrt(float(np.median(area / level)))
        step_u, step_v = (_least_step(places, _SAME * side) for places in (u, v))
    elif receiver.kind == "perspective":
        u, v = local[:, 0] / -local[:, 2], local[:, 1] / -local[:, 2]
        few = slice(None, None, -(-u.size // _ENOUGH))
        step_u = step_v = math.sqrt(
            float(np.median(area[few] * (1 + u[few] ** 2 + v[few] ** 2) ** 1.5))
        )
    else:
        flat = (rows["first_scatterer_m"] - pose[:3, 3]) @ pose[:3, :3]
        u, v = flat[:, 0], flat[:, 1]
        step_u = step_v = math.sqrt(float(np.median(area)))
    col, row = (np.rint((x - x.min()) / s).astype(np.int64) for x, s in ((u, step_u), (v, step_v)))
    return col, row


def _least_step(places: Real, same: float) -> float:
    steps = np.diff(np.sort(places))
    steps = steps[steps > same]
    return float(steps.min()) if steps.size else math.inf
