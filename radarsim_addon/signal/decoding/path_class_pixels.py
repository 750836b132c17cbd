# SPDX-License-Identifier: GPL-3.0-or-later
"""From gated renders to rows of the path table: lengths and vertices in float64.

Lengths come from vertex positions where the whole path is known and agrees with the range encoding.
For order 1 seen directly the Position pass lies on the surface to float32 of the *object's*
distance from the origin, so its range stays exact at long stand-off. Else lengths come from the
encoding, l = -k ln(encoded / plain).
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...arrays import Indices, Mask, Real, are_finite, distances, dots, largest
from ..paths import Flags, PathFlag, PathRows
from .ring_pixels import PixelRays

#: Rounding of one float32 operation, relative (one standard deviation).
_EPS32 = float(np.finfo(np.float32).eps) / 2
_TINY = float(np.finfo(np.float32).tiny)
#: Error of a length over a position, in roundings of the larger of its distances from the world's
#: origin and from the receiver: the geometric mean of what is seen, 0.4 to 4 up to 60 degrees of
#: incidence, more at grazing.
_POSITION_ROUNDINGS = 2.0
#: |G B/R^2 - 1| above which a pixel holds several paths. float32 noise is below 4e-6; 1e-5 is a
#: spread of ranges (rms, one-way) of 0.16 % of the range encoding length.
MIXED_TOLERANCE = 1e-5
#: Standard deviations within which range encoding and geometry are taken to tell the same length.
_AGREES_WITHIN = 20.0
#: Least denominator of the order-2 closed form, relative to the length: below, P1 is flagged.
_LEAST_DENOMINATOR = 1e-3


@dataclass(frozen=True)
class PathClassPixels:
    """One path class's renders, flattened to the n pixels that hold a path."""

    order: int  #: reflections
    depth: int  #: transparent surfaces passed on the receiver's side
    amplitude: Real  #: radiance [W m^-2 sr^-1], (n,)
    log_ratio: Real  #: ln(encoded / plain) = -l / k, (n,); -inf where unknown
    mixing: Real  #: G B / R^2, (n,); NaN where undefined
    position_m: Real  #: first surface seen, from the Position pass [m], (n, 3); NaN: unknown
    vertex_m: Real  #: last vertex from the transmitter's colours [m], (n, 3); NaN: unknown
    object: NDArray[np.int32]  #: number of the object at the last vertex, (n,); 0: unknown
    first_object: NDArray[np.int32]  #: the same at the first vertex
    #: Whether position_m is the first scatterer: nothing transparent lies before it, or a surface
    #: that does was passed with certainty.
    position_is_first: bool


@dataclass(frozen=True)
class TileReplicate:
    """One tile at one sub-pixel offset: numbers that all its pixels share."""

    rays: PixelRays
    transmitter_m: Real  #: in world space, (3,) [m]
    range_encoding_length_m: float  #: k of exp(-l/k) [m]
    near_clip_m: float  #: length that the near clip surface cuts from the first segment [m]
    effective_area_m2: float  #: lambda^2/(4 pi) of the receiver [m^2]
    fraction: float  #: one over the number of replicates of the tile, which share its solid angle
    tile: int
    replicate: int
    interiors_delay: bool = False  #: whether the interiors that paths pass may delay them
    #: Standard deviation of lengths that passed the interior of an object, over the length: Cycles
    #: rounds the depths inside.
    interior_sigma: float = 0.0
    #: The same for the rounding of their absorption, which the range encoding shares [m].
    interior_sigma_m: float = 0.0
    #: Whether something delays the ways from the transmitter to points (n, 3), (n,); None: nothing
    #: delays surfaces that are seen directly.
    delayed_to: Callable[[Real], Mask] | None = None


@dataclass(frozen=True)
class _Vertices:
    """Scatterers, lengths with their standard deviation, and flags of n paths."""

    first_m: Real
    last_m: Real
    length_m: Real
    sigma_m: Real
    flags: Flags


def log_encoding_ratio(encoded: Real, plain: Real) -> Real:
    """Return ln(encoded / plain) of each pixel. It is -inf where float32 cannot hold the encoded
    one.
    """
    ratio = np.zeros_like(plain)
    usable = (encoded >= _TINY) & (plain > 0)
    np.divide(encoded, plain, out=ratio, where=usable)
    with np.errstate(divide="ignore"):
        return np.log(ratio)


def first_vertex_order_2(
    receiver_m: Real, direction: Real, last_scatterer_m: Real, transmitter_m: Real, length_m: Real
) -> tuple[Real, Real]:
    """Return the first vertex of paths with two reflections, (n, 3) [m], and its conditioning,
    (n,).

    |P1 - P2| + |P1 - C| = L - |P2 - T| with P1 = C + r d gives r = (s^2 - |P2 - C|^2) / (2 (s - d .
    (P2 - C))), s = L - |P2 - T|. The conditioning is the denominator over 2 s: the result is poor
    where it is small.
    """
    to_last = last_scatterer_m - receiver_m
    s = length_m - distances(last_scatterer_m, transmitter_m)
    denominator = s - dots(direction, to_last)
    with np.errstate(divide="ignore", invalid="ignore"):
        r = (s**2 - dots(to_last, to_last)) / (2 * denominator)
        conditioning = denominator / s
    return receiver_m + r[:, None] * direction, conditioning


def assemble_rows(
    pixels: PathClassPixels, index: Indices, shared: TileReplicate, into: PathRows | None = None
) -> PathRows:
    """Return the rows (n,) of one path class. `index` has the numbers of its pixels in the tile,
    counted row by row, (n,). `into` is filled if given: rows of zeros.
    """
    rays = shared.rays
    direction = rays.direction.reshape(-1, 3).take(index, axis=0)
    origin_m = rays.origin_m
    if origin_m.ndim > 1:
        origin_m = origin_m.reshape(-1, 3).take(index, axis=0)
    solid_angle_sr = rays.solid_angle_sr.take(index) * shared.fraction
    encoded_m, sigma_m = _encoded_length(pixels, rays.near_cosine.take(index), shared)
    find = _one_reflection if pixels.order == 1 else _several_reflections
    found = find(pixels, origin_m, direction, encoded_m, sigma_m, shared)
    known = np.isfinite(pixels.log_ratio)
    flags = found.flags
    flags[~known] |= PathFlag.NO_RANGE
    with np.errstate(invalid="ignore"):
        flags[np.abs(pixels.mixing - 1) > MIXED_TOLERANCE] |= PathFlag.MIXED

    rows = PathRows.zeros(pixels.amplitude.size) if into is None else into
    measured = known | (flags & PathFlag.ENCODED_LENGTH == 0)
    columns = {
        "power_w": pixels.amplitude * solid_angle_sr * shared.effective_area_m2,
        "solid_angle_sr": solid_angle_sr,
        "length_m": np.where(measured, found.length_m, 0.0),
        "length_sigma_m": found.sigma_m,
        "order": pixels.order,
        "transparent_depth": pixels.depth,
        "first_scatterer_m": found.first_m,
        "last_scatterer_m": found.last_m,
        "direction": direction,
        "last_object": pixels.object,
        "first_object": pixels.first_object,
        "tile": shared.tile,
        "replicate": shared.replicate,
        "flags": flags,
    }
    for name, column in columns.items():
        rows[name] = column
    return rows


def _encoded_length(
    pixels: PathClassPixels, near_cosine: Real, shared: TileReplicate
) -> tuple[Real, Real]:
    """Return lengths by the range encoding, and their standard deviation from float32, (n,) each
    [m].
    """
    scale_m = shared.range_encoding_length_m
    known = np.isfinite(pixels.log_ratio)
    length_m = np.where(known, -scale_m * pixels.log_ratio, 0.0)
    length_m = np.maximum(length_m, 0.0) + shared.near_clip_m / near_cosine
    # Each segment's exponential and each product rounds once: the sum of their relative errors.
    factors = 2.0 * (pixels.order + 1)
    sigma_m = scale_m * _EPS32 * np.sqrt(factors) + length_m * _EPS32
    if pixels.depth == 0 and pixels.order == 1:  # it entered none
        return length_m, sigma_m
    inside_m = np.hypot(shared.interior_sigma * length_m, shared.interior_sigma_m)
    return length_m, np.hypot(sigma_m, inside_m)


def _one_reflection(
    pixels: PathClassPixels,
    origin_m: Real,
    direction: Real,
    encoded_m: Real,
    sigma_m: Real,
    shared: TileReplicate,
) -> _Vertices:
    """Place the scatterer of order 1 on the surface that the pixel sees, or where the range
    encoding puts it.
    """
    transmitter_m = shared.transmitter_m
    # Rounding of the world's coordinates, and of the ray, which ends near the pixel's own.
    there_m = distances(pixels.position_m, origin_m)
    scale_m = np.maximum(largest(pixels.position_m), there_m)
    position_sigma_m = np.maximum(1e-9, _POSITION_ROUNDINGS * _EPS32 * scale_m)
    geometric_m = there_m + distances(pixels.position_m, transmitter_m)
    seen = np.isfinite(geometric_m) & pixels.position_is_first
    point_m, lost = pixels.position_m, np.flatnonzero(~seen)
    if lost.size:
        start_m = origin_m if origin_m.ndim == 1 else origin_m[lost]
        ray = direction[lost]
        along_m = _range_of_length(start_m, ray, transmitter_m, encoded_m[lost])
        point_m = point_m.copy()
        point_m[lost] = start_m + along_m[:, None] * ray
    by_encoding = ~seen
    if pixels.position_is_first:
        # A dielectric on the way delays what geometry cannot see; the encoding does, down to its
        # noise. More than that noise must not be let pass: at long range it would be wavelengths.
        with np.errstate(invalid="ignore"):
            off_m = np.abs(geometric_m - encoded_m)
            agrees = off_m <= _AGREES_WITHIN * (sigma_m + position_sigma_m)
        # What was passed is known to delay, if only by less than that noise.
        agrees &= pixels.depth == 0 or not shared.interiors_delay
        unencoded = ~np.isfinite(pixels.log_ratio) & (pixels.depth == 0)
        geometric = np.flatnonzero(seen & (agrees | unencoded))
        if pixels.depth == 0 and shared.delayed_to is not None:
            geometric = geometric[~shared.delayed_to(point_m[geometric])]
        by_encoding = np.ones_like(seen)
        by_encoding[geometric] = False
    # Behind transparent surfaces a delay below the encoding's noise would go unnoticed.
    exact = ~by_encoding & (pixels.depth == 0)
    return _Vertices(
        point_m,
        point_m,
        np.where(by_encoding, encoded_m, geometric_m),
        np.where(exact, position_sigma_m, sigma_m),
        np.where(by_encoding, PathFlag.ENCODED_LENGTH, 0).astype(np.uint16),
    )


def _several_reflections(
    pixels: PathClassPixels,
    origin_m: Real,
    direction: Real,
    encoded_m: Real,
    sigma_m: Real,
    shared: TileReplicate,
) -> _Vertices:
    """Place the vertices of orders above 1: the last scatterer is rendered, the first one is seen
    or computed.
    """
    first_m = np.full(direction.shape, np.nan)
    if pixels.order == 2:
        origins_m = np.broadcast_to(origin_m, direction.shape)
        first_m, conditioning = first_vertex_order_2(
            origins_m, direction, pixels.vertex_m, shared.transmitter_m, encoded_m
        )
        first_m[~(conditioning > _LEAST_DENOMINATOR)] = np.nan
    if pixels.position_is_first:
        seen = are_finite(pixels.position_m)
        first_m = np.where(seen[:, None], pixels.position_m, first_m)
    flags = np.full(encoded_m.size, PathFlag.ENCODED_LENGTH, dtype=np.uint16)
    flags[~are_finite(first_m)] |= PathFlag.NO_FIRST_VERTEX
    return _Vertices(first_m, pixels.vertex_m, encoded_m, sigma_m, flags)


def _range_of_length(origin: Real, direction: Real, transmitter_m: Real, length_m: Real) -> Real:
    """Return the distance r along the ray at which r + |P - T| is the length (the intersection with
    an ellipsoid).
    """
    to_transmitter = transmitter_m - origin
    squared = dots(to_transmitter, to_transmitter)
    denominator = length_m - dots(direction, to_transmitter)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(length_m > 0, (length_m**2 - squared) / (2 * denominator), 0.0)
