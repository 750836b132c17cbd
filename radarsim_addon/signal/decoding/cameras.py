# SPDX-License-Identifier: GPL-3.0-or-later
"""Directions and solid angles of a receiver's pixels, in float64.

Camera space is Blender's: x to the right, y up, the boresight along -z. Row 0 of an image is the
top row. Each pixel's ray leaves through the centre of the pixel.
"""

from __future__ import annotations

import functools
import math
from dataclasses import dataclass, field

import numpy as np

from ...arrays import Mask, Real
from ...contract import ReceiverRecord
from ...errors import SchemaError

KINDS = ("perspective", "orthographic", "equirectangular")

#: Images up to so many pixels, and how many of them, whose rays are kept: 5 MB. A stationary radar
#: has the same rays in all frames.
_KEPT_PX, _KEPT_IMAGES = 1 << 14, 8
#: Pixels whose solid angles are computed at once: their numbers stay in the processor's cache.
_TOGETHER = 1 << 13


@dataclass(frozen=True)
class PixelRays:
    """Rays of an image of h x w pixels, in world space."""

    origin_m: Real  #: start of the rays [m]; (3,) or, orthographic, (h, w, 3)
    direction: Real  #: unit vectors, (h, w, 3)
    #: Cosine between each ray and the normal of the near clip surface, a plane across the boresight
    #: or, equirectangular, a sphere; (h, w).
    near_cosine: Real
    #: Solid angle of each pixel [sr]; (h, w). Orthographic: the area over 1 m^2; multiply by
    #: (1 m / r)^2 to compare.
    solid_angle_sr: Real


def pixel_centres(receiver: ReceiverRecord, width_px: int, height_px: int) -> tuple[Real, Real]:
    """Camera coordinates u (w,) and v (h,), falling with the row, of the pixel centres: tangents
    (perspective), metres (orthographic) or longitude and latitude in radians.
    """
    u = receiver.left + (np.arange(width_px) + 0.5) * ((receiver.right - receiver.left) / width_px)
    v = receiver.top - (np.arange(height_px) + 0.5) * ((receiver.top - receiver.bottom) / height_px)
    return np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64)


def solid_angles_sr(receiver: ReceiverRecord, width_px: int, height_px: int) -> Real:
    """Solid angle of every pixel (h, w); orthographic: the area [m^2].

    Perspective: the integral of (1 + u^2 + v^2)^-3/2 du dv by 3 x 3 point Gauss-Legendre, exact to
    1e-9 for pixels up to two degrees wide; the closed form cancels for pixels of a microradian.
    """
    u, v = pixel_centres(receiver, width_px, height_px)
    du = abs(receiver.right - receiver.left) / width_px
    dv = abs(receiver.top - receiver.bottom) / height_px
    if receiver.kind == "perspective":
        nodes = math.sqrt(0.15) * np.array([-1.0, 0.0, 1.0])
        weights = np.array([5.0, 8.0, 5.0]) / 18
        across = [1 + (u + du * node) ** 2 for node in nodes]
        solid = np.zeros((height_px, width_px))
        rows = max(1, _TOGETHER // width_px)
        for start in range(0, height_px, rows):
            part = solid[start : start + rows]
            square, root = np.empty_like(part), np.empty_like(part)
            for node_v, weight_v in zip(nodes, weights, strict=True):
                down = (v[start : start + rows, None] + dv * node_v) ** 2
                for one, weight_u in zip(across, weights, strict=True):
                    np.add(one, down, out=square)
                    np.sqrt(square, out=root)
                    root *= square
                    np.divide(weight_u * weight_v, root, out=root)
                    part += root
        return solid * (du * dv)
    if receiver.kind == "equirectangular":
        strip = 2 * np.sin(dv / 2) * np.cos(v) * du
        return np.asarray(np.broadcast_to(strip[:, None], (height_px, width_px)))
    if receiver.kind == "orthographic":
        return np.full((height_px, width_px), du * dv)
    raise _unknown(receiver.kind)


def pixel_rays(receiver: ReceiverRecord, width_px: int, height_px: int) -> PixelRays:
    """Rays of all pixels; those of small images may not be changed."""
    if width_px * height_px > _KEPT_PX:
        return _rays(receiver, width_px, height_px)
    edges = receiver.left, receiver.right, receiver.bottom, receiver.top
    numbers = np.array([*np.ravel(receiver.matrix_world), *edges], dtype=np.float64)
    return _kept_rays(_Image(receiver.kind, numbers.tobytes(), width_px, height_px, receiver))


@dataclass(frozen=True)
class _Image:
    """An image, distinguished from others by the bits of all that its rays are made of."""

    kind: str
    numbers: bytes
    width_px: int
    height_px: int
    receiver: ReceiverRecord = field(compare=False)


@functools.lru_cache(maxsize=_KEPT_IMAGES)
def _kept_rays(image: _Image) -> PixelRays:
    rays = _rays(image.receiver, image.width_px, image.height_px)
    for values in (rays.origin_m, rays.direction, rays.near_cosine, rays.solid_angle_sr):
        values.flags.writeable = False
    return rays


def _rays(receiver: ReceiverRecord, width_px: int, height_px: int) -> PixelRays:
    u, v = pixel_centres(receiver, width_px, height_px)
    uu, vv = np.broadcast_arrays(u[None, :], v[:, None])
    pose = np.asarray(receiver.matrix_world, dtype=np.float64)
    rotation, position = pose[:3, :3], pose[:3, 3]
    origin = position
    if receiver.kind == "perspective":
        local = np.stack([uu, vv, np.full_like(uu, -1.0)], axis=-1)
        local = local / np.sqrt(1 + uu**2 + vv**2)[..., None]
    elif receiver.kind == "equirectangular":
        cos_lat = np.cos(v)[:, None]
        local = np.empty((*uu.shape, 3))
        local[..., 0], local[..., 2] = np.sin(u) * cos_lat, -np.cos(u) * cos_lat
        local[..., 1] = np.sin(v)[:, None]
    elif receiver.kind == "orthographic":
        local = np.zeros((*uu.shape, 3))
        local[..., 2] = -1.0
        origin = position + np.stack([uu, vv, np.zeros_like(uu)], axis=-1) @ rotation.T
    else:
        raise _unknown(receiver.kind)
    return PixelRays(
        origin_m=origin,
        direction=local @ rotation.T,
        near_cosine=np.ones_like(uu) if receiver.kind == "equirectangular" else -local[..., 2],
        solid_angle_sr=solid_angles_sr(receiver, width_px, height_px),
    )


def in_view(points_m: Real, receiver: ReceiverRecord) -> Mask:
    """Whether points (n, 3) [m] lie in the directions that a receiver renders, (n,)."""
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


def _unknown(kind: str) -> SchemaError:
    return SchemaError(
        f"Camera of kind {kind!r}; this version knows {', '.join(KINDS)}. "
        "Use one of these in Blender, or update radarsim."
    )
