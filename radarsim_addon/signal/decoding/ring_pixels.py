# SPDX-License-Identifier: GPL-3.0-or-later
"""Rays of pixels, and from the colours of a ring to range, radiance and range rate (Eq. 2-4, 12).

**Rays** (`pixel_rays`), in float64. Camera space is Blender's: x to the right, y up, the boresight
along -z. Row 0 of an image is the top row. Each pixel's ray leaves through the centre of the pixel.

**Range** (`decode`). A render holds B = L, R = L exp(-l/k), G = L exp(-2 l/k) for a path of total
length l; so l = -k ln(R/B) (Eq. 4), and G B / R^2 is 1 where a pixel holds one path.

**Range rate** (`range_rate`), from two snapshots (Eq. 12, with this project's sign):

    v = (r(t + dt) - r(t)) / dt,      f_D = -2 v / lambda

v is positive when the range grows: a receding target has negative Doppler, as in the paper's
Fig. 9; Eq. 12 as printed has the other sign. Differencing along a fixed ray gives the range rate of
the material only where the surface moves along the ray: a sphere spinning in place reads zero, and
so does flat ground below a moving radar.
"""

from __future__ import annotations

import functools
import math
from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np

from ...arrays import Integers, Mask, Real, Single
from ...contract import (
    AMPLITUDE_CHANNEL,
    CHECK_CHANNEL,
    RANGE_CHANNEL,
    ReceiverRecord,
    RenderRecord,
    TransmitterRecord,
)
from ...errors import ConfigError, SchemaError
from ..paths import Flags, PathFlag, PathGeometry

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
    """Return the camera coordinates of the pixel centres: u (w,), and v (h,), which falls with the
    row. They are tangents (perspective), metres (orthographic), or longitude and latitude in
    radians.
    """
    u = receiver.left + (np.arange(width_px) + 0.5) * ((receiver.right - receiver.left) / width_px)
    v = receiver.top - (np.arange(height_px) + 0.5) * ((receiver.top - receiver.bottom) / height_px)
    return np.asarray(u, dtype=np.float64), np.asarray(v, dtype=np.float64)


def solid_angles_sr(receiver: ReceiverRecord, width_px: int, height_px: int) -> Real:
    """Return the solid angle of every pixel (h, w). Orthographic: its area [m^2].

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
    """Return the rays of all pixels. Arrays of small images are read only, since they are kept."""
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


def image_places(points_m: Real, receiver: ReceiverRecord) -> tuple[Real, Real]:
    """Return where points (n, 3) [m] are in the coordinates of a receiver's edges, (n,) each.

    They are NaN for points behind the receiver, unless it is equirectangular.
    """
    pose = np.asarray(receiver.matrix_world, dtype=np.float64)
    x, y, z = ((points_m - pose[:3, 3]) @ pose[:3, :3]).T
    if receiver.kind == "equirectangular":
        u, v = np.arctan2(x, -z), np.arctan2(y, np.hypot(x, z))
        middle = (receiver.left + receiver.right) / 2
        return middle + (u - middle + math.pi) % (2 * math.pi) - math.pi, v
    depth = np.where(z < 0, 1.0 if receiver.kind == "orthographic" else -z, np.nan)
    return x / depth, y / depth


def in_view(points_m: Real, receiver: ReceiverRecord) -> Mask:
    """Whether points (n, 3) [m] lie in the directions that a receiver renders, (n,)."""
    u, v = image_places(points_m, receiver)
    across = (u >= receiver.left) & (u <= receiver.right)
    return np.asarray(across & (v >= receiver.bottom) & (v <= receiver.top))


def _unknown(kind: str) -> SchemaError:
    return SchemaError(
        f"Camera of kind {kind!r}; this version knows {', '.join(KINDS)}. "
        "Use one of these in Blender, or update radarsim."
    )


#: Below this a float32 is denormal: its last digits are gone, and the range with them.
_SMALLEST_NORMAL = float(np.finfo(np.float32).tiny)
#: R may exceed B by this factor through float32 rounding at zero length; beyond, it is not encoded.
_ROUNDING = 1e-5
#: Default limit of a believable |range rate| [m/s]. Above it, the pixel saw another surface in the
#: second snapshot: the background appearing behind a target's edge.
MAX_RANGE_RATE_MPS = 300.0


@dataclass(frozen=True)
class PixelGrid:
    """Directions and solid angles of a perspective camera's pixels.

    Attributes
    ----------
    u, v
        Tangents to the right, (width,), and upwards, (height,), at pixel centres; row 0 is on top.
    solid_angle_sr
        Solid angle of each pixel, (height, width) [sr].
    """

    u: Real
    v: Real
    solid_angle_sr: Real


def pixel_grid(receiver: ReceiverRecord, width_px: int, height_px: int) -> PixelGrid:
    """Compute directions and solid angles of all pixels of a perspective camera.

    Parameters
    ----------
    receiver
        Receiver of the frame.
    width_px, height_px
        Pixels of the image.

    Returns
    -------
    PixelGrid
        Tangents and solid angles of all pixels.

    Raises
    ------
    SchemaError
        The camera is of another kind, or its frame has no extent.
    """
    if receiver.kind != "perspective":
        raise SchemaError(
            f"Camera of kind {receiver.kind!r}; this version decodes 'perspective' only. "
            "Update radarsim, or render with a perspective camera."
        )
    if not (receiver.right > receiver.left and receiver.top > receiver.bottom):
        raise SchemaError(
            f"Camera frame from {receiver.left} to {receiver.right} and {receiver.bottom} to "
            f"{receiver.top}; expected left < right and bottom < top. Render the run again."
        )
    u, v = pixel_centres(receiver, width_px, height_px)
    return PixelGrid(u, v, solid_angles_sr(receiver, width_px, height_px))


@dataclass(frozen=True)
class Decoded:
    """One render, pixel by pixel; all arrays (height, width), float64.

    Attributes
    ----------
    total_length_m
        Length l of the path from receiver over the scatterers to the transmitter [m]; 0 where
        masked.
    radiance
        L in W per m^2 per sr; 0 where masked.
    mask
        True where there is an echo with a range.
    mixing
        G B / R^2: 1 for one path, 1 + (spread of l / k)^2 for several; NaN where undefined.
    solid_angle_sr, u, v
        As in :class:`PixelGrid`.
    range_encoding_underflow
        Pixels with an echo whose R is denormal or zero: too far for this range encoding length.
        Masked.
    no_range_encoding
        Pixels with R above B: light that does not carry the range encoding. Masked.
    """

    total_length_m: Real
    radiance: Real
    mask: Mask
    mixing: Real
    solid_angle_sr: Real
    u: Real
    v: Real
    range_encoding_underflow: int
    no_range_encoding: int

    @property
    def range_m(self) -> Real:
        """One-way range l/2 [m]; 0 where masked."""
        return self.total_length_m / 2


def decode(
    record: RenderRecord, channels: Mapping[str, Single], grid: PixelGrid | None = None
) -> Decoded:
    """Decode one render to lengths and radiances (Eq. 4 of Costa et al.).

    Parameters
    ----------
    record
        Its sidecar: range encoding length, scale and camera.
    channels
        Float32 arrays (height, width) "R", "G", "B", in W per (Blender unit)^2 per sr.
    grid
        The camera's pixels, where they are already known.

    Returns
    -------
    Decoded
        Lengths [m] and radiances [W m^-2 sr^-1] of all pixels.

    Notes
    -----
    The near clip plane cuts near_clip_m * sqrt(1+u^2+v^2) from the first segment; it is added
    back. Where float32 rounding gives R slightly above B, the coded length is taken as 0.
    """
    red, green, blue = (
        np.asarray(channels[name], dtype=np.float64)
        for name in (RANGE_CHANNEL, CHECK_CHANNEL, AMPLITUDE_CHANNEL)
    )
    height, width = blue.shape
    grid = grid or pixel_grid(record.receiver, width, height)
    echo = blue > 0
    reached = red >= _SMALLEST_NORMAL
    coded = red <= blue * (1 + _ROUNDING)
    mask = echo & reached & coded

    length = np.zeros_like(blue)
    mixing = np.full_like(blue, np.nan)
    np.divide(red, blue, out=length, where=mask)
    np.log(length, out=length, where=mask)
    length *= -record.range_encoding_length_m
    np.maximum(length, 0.0, out=length)
    cosine_inverse = np.sqrt(1 + grid.u[None, :] ** 2 + grid.v[:, None] ** 2)
    length += record.receiver.near_clip_m * cosine_inverse
    length[~mask] = 0.0

    check = mask & (green >= _SMALLEST_NORMAL)
    # as (G/R) (B/R): both factors stay near one another, R^2 need not be formed
    np.divide(green, red, out=mixing, where=check)
    mixing[check] *= blue[check] / red[check]

    return Decoded(
        total_length_m=length,
        radiance=np.where(mask, blue, 0.0) / record.metres_per_unit**2,
        mask=mask,
        mixing=mixing,
        solid_angle_sr=grid.solid_angle_sr,
        u=grid.u,
        v=grid.v,
        range_encoding_underflow=int(np.count_nonzero(echo & ~reached)),
        no_range_encoding=int(np.count_nonzero(echo & reached & ~coded)),
    )


def range_rate(
    first: Decoded,
    second: Decoded,
    snapshot_interval_s: float,
    neighbours: Sequence[tuple[Decoded, Decoded]] = (),
    max_range_rate_mps: float = MAX_RANGE_RATE_MPS,
) -> tuple[Real, Flags]:
    """Compute the range rate of every pixel of one ring (Eq. 12).

    Parameters
    ----------
    first, second
        The ring at t and at t + delta t.
    snapshot_interval_s
        Time between the snapshots [s].
    neighbours
        The rings before and behind, each at both times. An echo that has none of its own ring in
        the second snapshot (or an unbelievable one) is looked for there, among echoes that were not
        there at t.
    max_range_rate_mps
        Largest |range rate| that is accepted [m/s].

    Returns
    -------
    rate_mps, flags
        Arrays (height, width). The rate is positive when receding, and 0 where a flag says that
        it is unknown (`PathFlag.SINGLE_SNAPSHOT`, `PathFlag.RANGE_RATE_REJECTED`); such echoes
        count as stationary.

    Raises
    ------
    ConfigError
        The time or the limit is not positive.
    """
    if not snapshot_interval_s > 0:
        raise ConfigError(
            f"Time between the snapshots is {snapshot_interval_s!r} s; expected a positive time."
        )
    if not max_range_rate_mps > 0:
        raise ConfigError(f"Speed limit is {max_range_rate_mps!r} m/s; expected a positive number.")
    limit_m = max_range_rate_mps * snapshot_interval_s
    start = first.range_m
    step = np.full(start.shape, np.inf)
    same = first.mask & second.mask
    step[same] = (second.range_m - start)[same]
    unsure: Mask = first.mask & (np.abs(step) > limit_m)
    nearest = np.full(start.shape, np.inf)
    for before, after in neighbours:
        arrived = unsure & after.mask & ~before.mask
        candidate = np.where(arrived, after.range_m - start, np.inf)
        nearest = np.where(np.abs(candidate) < np.abs(nearest), candidate, nearest)
    crossed = unsure & (np.abs(nearest) <= limit_m)
    step[crossed] = nearest[crossed]

    seen = same | np.isfinite(nearest)
    flags = np.zeros(start.shape, dtype=np.uint16)
    flags[crossed] |= PathFlag.CROSSED_SHELL
    flags[first.mask & ~seen] |= PathFlag.SINGLE_SNAPSHOT
    flags[first.mask & seen & (np.abs(step) > limit_m)] |= PathFlag.RANGE_RATE_REJECTED
    known = first.mask & (np.abs(step) <= limit_m)
    rate = np.zeros(start.shape)
    rate[known] = step[known] / snapshot_interval_s
    return rate, flags


def single_vertex_m(length_m: Real, direction: Real, receiver_m: Real, transmitter_m: Real) -> Real:
    """Return the scatterers of paths with one reflection, (n, 3) [m], from total lengths L (n,) and
    unit vectors d from the receiver, (n, 3). NaN: the length is below the baseline.

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
    """Return the geometry of some pixels (row, col) of a ring, with poses at t. `single`: every
    path has one reflection. Otherwise vertices and orders are unknown (NaN and 0).
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
