# SPDX-License-Identifier: GPL-3.0-or-later
"""From the colours of one render to range and radiance per pixel (Eq. 2-4 of the paper).

The render holds B = L, R = L exp(-l/k), G = L exp(-2 l/k) for a path of total length l; so
l = -k ln(R/B) (Eq. 4), and G B / R^2 is 1 where a pixel holds one path.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from ...array_types import Mask, Real, Single
from ...contract import (
    AMPLITUDE_CHANNEL,
    CHECK_CHANNEL,
    RANGE_CHANNEL,
    ReceiverRecord,
    RenderRecord,
)
from ...errors import SchemaError
from .cameras import pixel_centres, solid_angles_sr

#: Below this a float32 is denormal: its last digits are gone, and the range with them.
_SMALLEST_NORMAL = float(np.finfo(np.float32).tiny)
#: R may exceed B by this factor through float32 rounding at zero length; beyond, it is not encoded.
_ROUNDING = 1e-5


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
        Of the frame.
    width_px, height_px
        Pixels of the image.

    Returns
    -------
    PixelGrid
        Of all pixels.

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
        Of the pixels, see :class:`PixelGrid`.
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
