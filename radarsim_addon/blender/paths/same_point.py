# SPDX-License-Identifier: GPL-3.0-or-later
"""Both ways of a point that one pixel sees, over mirrors or not. Does not import bpy.

A radar that sees a point also receives it over every mirror that lights it, and both ways add up in
phase. Renders give the way there: direct, d, and over mirror k, m_k (powers). Of a radar with both
antennas in one place the reverse path has the same power, and over mirrors on both ways it is
m_k m_l / d: exact where the surface scatters alike in all directions (Lambert), and nearly so where
its lobe is much wider than the angle between the two directions. All these paths are of one point
then, so their phases are those of their lengths and mirrors. The point that another pixel sees in
the mirror is left out: it would be the same path a second time.
"""

from __future__ import annotations

import math

import numpy as np

from ...array_types import Mask, Real
from ...contract import ReceiverRecord
from ...signal.motion import PathImages
from ...signal.paths import PathRows, has_curved_images, planes_of, read_columns
from ...vectors import distances, dots, norms

#: Distance of the antennas over that of a scatterer up to which both ways are one.
ONE_PLACE = 0.01
#: Error of the power over mirrors on both ways that is accepted, as a fraction: 0.2 dB.
_LOBE_ERROR = 0.05


def add_reverse_paths(
    rows: PathRows,
    images: PathImages,
    receiver_m: Real,
    transmitter_m: Real,
    reflections: int,
) -> PathRows:
    """Return rows of a tile replicate with the paths that come back over mirrors.

    Those with a `point` are of one scattering at it: the direct one, and those with an image of the
    transmitter. Points without a direct path become 0. Paths of more than `reflections` are left
    out.
    """
    read = read_columns(rows, ("point", "transmitter_image", "last_body"))
    point, body, to_image = read["point"], read["last_body"], read["transmitter_image"]
    direct = np.flatnonzero((point > 0) & (to_image == 0))
    over = np.flatnonzero((point > 0) & (to_image != 0))
    direct = direct[np.argsort(point[direct], kind="stable")]
    points = point[direct]
    place = np.minimum(np.searchsorted(points, point[over]), max(points.size - 1, 0))
    paired = np.zeros(over.size, dtype=bool)
    if points.size:
        paired = points[place] == point[over]
        paired &= body[direct[place]] == body[over]
    rows["point"][over[~paired]] = 0
    over, base = over[paired], direct[place[paired]]
    both = [rows]
    if reflections >= 2:
        back = rows[over]
        _come_back(back, back)
        back["transmitter_image"] = 0
        both.append(measured(back, images, receiver_m, transmitter_m))
    to_image = to_image[over]
    # numpy's own `unique` takes long for many numbers
    numbers = np.arange(to_image.min(initial=0), to_image.max(initial=0) + 1)
    for image in numbers.tolist() if reflections >= 3 else []:
        # All paths to this image, with every mirror on the way back.
        first = np.flatnonzero(to_image == image)
        if not first.size:
            continue
        own = np.full(int(rows["point"].max()) + 1, -1)
        own[rows["point"][over[first]]] = over[first]
        to = own[rows["point"][over]]
        known = np.flatnonzero(to >= 0)
        back, there = rows[over[known]], rows[to[known]]
        there["power_w"] *= back["power_w"] / rows["power_w"][base[known]]
        _come_back(there, back)
        for name in ("mirror_phase_rad", "mirrors"):
            there[name] += back[name]
        there["order"] += back["mirrors"]
        kept = there["order"] <= reflections
        both.append(measured(there[kept], images, receiver_m, transmitter_m))
    alone = np.zeros(rows.size, dtype=bool)
    alone[direct] = True
    alone[base] = False
    rows["point"][alone] = 0
    return np.concatenate(both)


def _come_back(rows: PathRows, over: PathRows) -> None:
    """Let paths come back to the receiver over the mirrors that others take to the transmitter."""
    rows["receiver_image"] = over["transmitter_image"]
    if has_curved_images(rows):
        rows["receiver_plane"] = over["transmitter_plane"]


def measured(rows: PathRows, images: PathImages, receiver_m: Real, transmitter_m: Real) -> PathRows:
    """Put lengths and directions of paths with one scattering into rows that are images' own."""
    numbers = np.stack([rows["receiver_image"], rows["transmitter_image"]], axis=-1)
    over = images.of_paths(numbers, planes_of(rows))
    point_m = read_columns(rows, ("last_scatterer_m",))["last_scatterer_m"]
    length_m = distances(point_m, over.places(0, receiver_m))
    length_m += distances(point_m, over.places(1, transmitter_m))
    rows["length_m"] = length_m
    direction = over.unfolded(0, point_m) - receiver_m
    rows["direction"] = direction / norms(direction)[:, None]
    return rows


def alike_in_both(points_m: Real, antenna_m: Real, image_m: Real, lobe: Real) -> Mask:
    """Return whether points scatter nearly alike towards an antenna and its image, (n,).

    `lobe` is the width alpha of the narrowest lobe of each point's surface: infinite for Lambert,
    0 where unknown. A Gaussian lobe of facets has the error exp(angle^2 / (2 alpha^2)) at most.
    """
    to_antenna, to_image = antenna_m - points_m, image_m - points_m
    cosine = dots(to_antenna, to_image) / (norms(to_antenna) * norms(to_image))
    angle = np.arccos(np.clip(cosine, -1.0, 1.0))
    with np.errstate(divide="ignore"):
        return np.asarray(angle**2 / (2 * lobe**2) <= _LOBE_ERROR)


def in_view(points_m: Real, receiver: ReceiverRecord) -> Mask:
    """Return whether points (n, 3) [m] lie in the directions that a receiver renders, (n,)."""
    pose = np.asarray(receiver.matrix_world, dtype=np.float64)
    x, y, z = ((points_m - pose[:3, 3]) @ pose[:3, :3]).T
    if receiver.kind == "equirectangular":
        u, v = np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))
        middle = (receiver.left + receiver.right) / 2
        u = middle + (u - middle + math.pi) % (2 * math.pi) - math.pi
    else:
        with np.errstate(divide="ignore", invalid="ignore"):
            u, v = np.where(z < 0, x / -z, np.nan), y / -z
    across = (u >= receiver.left) & (u <= receiver.right)
    return np.asarray(across & (v >= receiver.bottom) & (v <= receiver.top))
