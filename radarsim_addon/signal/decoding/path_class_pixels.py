# SPDX-License-Identifier: GPL-3.0-or-later
"""From gated renders to rows of the path table: lengths and vertices in float64."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from ...array_types import Real
from ..paths import PATH_DTYPE, PathFlag, PathRows
from .cameras import PixelRays

#: Rounding of one float32 operation, relative (one standard deviation).
_EPS32 = float(np.finfo(np.float32).eps) / 2
_TINY = float(np.finfo(np.float32).tiny)
#: |G B/R^2 - 1| above which a gated pixel still holds several paths; float32 noise is below 4e-6.
MIXED_TOLERANCE = 1e-5
#: Standard deviations within which code and geometry are taken to tell the same length.
_AGREES_WITHIN = 20.0
#: Least denominator of the order-2 closed form, relative to the length: below, P1 is flagged.
_LEAST_DENOMINATOR = 1e-3


@dataclass(frozen=True)
class GatePixels:
    """One gate's renders, flattened to the pixels that hold a path.

    Attributes
    ----------
    order, depth
        Reflections, and transparent surfaces passed on the receiver's side.
    amplitude
        Radiance [W m^-2 sr^-1], (n,).
    log_ratio
        ln(coded / plain), minus the coded length in code lengths, (n,); -inf where unknown.
    mixing
        G B / R^2, (n,); NaN where undefined.
    position_m
        First surface seen, from the Position pass [m], (n, 3); NaN where unknown.
    vertex_m
        Last vertex from the emitter's colours [m], (n, 3); NaN where unknown.
    object, first_object
        Numbers of the objects at the last and at the first vertex, (n,); 0 where unknown.
    position_is_first
        Whether position_m is the first scatterer: nothing transparent lies before it, or what
        does was passed with certainty.
    """

    order: int
    depth: int
    amplitude: Real
    log_ratio: Real
    mixing: Real
    position_m: Real
    vertex_m: Real
    object: NDArray[np.int32]
    first_object: NDArray[np.int32]
    position_is_first: bool


@dataclass(frozen=True)
class Geometry:
    """What all pixels of a view share: antennas and the code."""

    emitter_m: Real
    range_encoding_length_m: float
    near_clip_m: float


def log_code_ratio(coded: Real, plain: Real) -> Real:
    """ln(coded/plain) per pixel; -inf where red is beyond what float32 carries."""
    ratio = np.zeros_like(plain)
    usable = (coded >= _TINY) & (plain > 0)
    np.divide(coded, plain, out=ratio, where=usable)
    with np.errstate(divide="ignore"):
        return np.log(ratio)


def first_vertex_order_2(
    camera_m: Real, direction: Real, last_scatterer_m: Real, emitter_m: Real, length_m: Real
) -> tuple[Real, Real]:
    """First vertex of a path with two reflections, in closed form.

    |P1 - P2| + |P1 - C| = L - |P2 - T| with P1 = C + r d gives
    r = (s^2 - |P2 - C|^2) / (2 (s - d . (P2 - C))), s = L - |P2 - T|.

    Returns
    -------
    first_scatterer_m
        (n, 3).
    conditioning
        The denominator over 2 s, (n,): the result is poor where it is small.
    """
    to_last = last_scatterer_m - camera_m
    s = length_m - np.linalg.norm(last_scatterer_m - emitter_m, axis=-1)
    denominator = s - np.sum(direction * to_last, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        r = (s**2 - np.sum(to_last**2, axis=-1)) / (2 * denominator)
        conditioning = denominator / s
    return camera_m + r[:, None] * direction, conditioning


def assemble_rows(
    pixels: GatePixels,
    rays: PixelRays,
    index: tuple[NDArray[np.intp], NDArray[np.intp]],
    geometry: Geometry,
    effective_area_m2: float,
    share: float,
    tile: int,
    shift: int,
) -> PathRows:
    """Rows of one gate.

    Lengths come from vertex positions in float64 where the whole path is known and agrees with
    the code (order 1 seen directly: the Position pass lies on the surface to float32 of the
    *object's* distance from the origin, so its range stays exact at long stand-off), else from
    the code.

    Parameters
    ----------
    pixels
        The gate's pixels with a path.
    rays
        Of the whole view.
    index
        Row and column of each pixel in the view.
    geometry
        Emitter and code.
    effective_area_m2
        lambda^2/(4 pi) of the receiver.
    share
        One over the number of shifts of this tile: replicates share the solid angle.
    """
    count = pixels.amplitude.size
    rows = np.zeros(count, dtype=PATH_DTYPE)
    direction = rays.direction[index]
    origin = rays.origin_m if rays.origin_m.ndim == 1 else rays.origin_m[index]
    solid = rays.solid_angle_sr[index] * share
    flags = np.zeros(count, dtype=np.uint16)

    known = np.isfinite(pixels.log_ratio)
    coded_m = np.where(known, -geometry.range_encoding_length_m * pixels.log_ratio, 0.0)
    coded_m = np.maximum(coded_m, 0.0) + geometry.near_clip_m / rays.near_cosine[index]
    # Each segment's exponential and each product rounds once: the sum of their relative errors.
    factors = 2.0 * (pixels.order + 1)
    sigma = geometry.range_encoding_length_m * _EPS32 * np.sqrt(factors) + coded_m * _EPS32
    flags[~known] |= PathFlag.NO_RANGE
    with np.errstate(invalid="ignore"):
        flags[np.abs(pixels.mixing - 1) > MIXED_TOLERANCE] |= PathFlag.MIXED

    length = coded_m
    if pixels.order == 1:
        scale = np.max(np.abs(pixels.position_m), axis=-1, initial=0.0)
        position_sigma = np.maximum(1e-9, scale * _EPS32)
        first, from_code = _first_order(
            pixels, origin, direction, coded_m, sigma + position_sigma, geometry
        )
        last = first
        geometric = np.linalg.norm(first - origin, axis=-1) + np.linalg.norm(
            first - geometry.emitter_m, axis=-1
        )
        length = np.where(from_code, coded_m, geometric)
        # Behind transparent surfaces a delay below the code's noise would go unnoticed.
        exact = ~from_code & (pixels.depth == 0)
        sigma = np.where(exact, position_sigma, sigma)
        flags[from_code] |= PathFlag.ENCODED_LENGTH
    else:
        last = pixels.vertex_m
        flags |= PathFlag.ENCODED_LENGTH
        first = np.full((count, 3), np.nan)
        if pixels.order == 2:
            first, conditioning = first_vertex_order_2(
                np.broadcast_to(origin, direction.shape),
                direction,
                last,
                geometry.emitter_m,
                coded_m,
            )
            first[~(conditioning > _LEAST_DENOMINATOR)] = np.nan
        if pixels.position_is_first:
            seen = np.isfinite(pixels.position_m).all(axis=-1)
            first = np.where(seen[:, None], pixels.position_m, first)
        flags[~np.isfinite(first).all(axis=-1)] |= PathFlag.NO_FIRST_VERTEX

    rows["power_w"] = pixels.amplitude * solid * effective_area_m2
    rows["length_m"] = np.where(known | (flags & PathFlag.ENCODED_LENGTH == 0), length, 0.0)
    rows["length_sigma_m"] = sigma
    rows["order"] = pixels.order
    rows["transparent_depth"] = pixels.depth
    rows["first_scatterer_m"], rows["last_scatterer_m"] = first, last
    rows["direction"] = direction
    rows["solid_angle_sr"] = solid
    rows["last_object"], rows["first_object"] = pixels.object, pixels.first_object
    rows["tile"], rows["replicate"] = tile, shift
    rows["flags"] = flags
    return rows


def _first_order(
    pixels: GatePixels,
    origin: Real,
    direction: Real,
    coded_m: Real,
    sigma: Real,
    geometry: Geometry,
) -> tuple[Real, NDArray[np.bool_]]:
    """Scatterer of order 1, and whether its length must come from the code."""
    along = _range_of_length(origin, direction, geometry.emitter_m, coded_m)
    coded_point = origin + along[:, None] * direction
    if not pixels.position_is_first:
        return coded_point, np.ones(coded_m.size, dtype=bool)
    position = pixels.position_m
    geometric = np.linalg.norm(position - origin, axis=-1) + np.linalg.norm(
        position - geometry.emitter_m, axis=-1
    )
    # A dielectric on the way delays what geometry cannot see; the code does, down to its noise.
    # More than that noise must not be let pass: at long range it would be wavelengths.
    allowed = _AGREES_WITHIN * sigma
    uncoded = ~np.isfinite(pixels.log_ratio)
    with np.errstate(invalid="ignore"):
        agrees = np.abs(geometric - coded_m) <= allowed
    seen = np.isfinite(geometric)
    point = np.where(seen[:, None], position, coded_point)
    return point, ~(seen & (agrees | (uncoded & (pixels.depth == 0))))


def _range_of_length(origin: Real, direction: Real, emitter_m: Real, length_m: Real) -> Real:
    """Distance r along the ray where r + |P - T| is the length (an ellipsoid's intersection)."""
    to_emitter = emitter_m - origin
    squared = np.sum(np.broadcast_to(to_emitter, direction.shape) ** 2, axis=-1)
    denominator = length_m - np.sum(direction * to_emitter, axis=-1)
    with np.errstate(divide="ignore", invalid="ignore"):
        return np.where(length_m > 0, (length_m**2 - squared) / (2 * denominator), 0.0)
