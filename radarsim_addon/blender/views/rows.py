# SPDX-License-Identifier: GPL-3.0-or-later
"""From the renders of one view to rows of the path table. Does not import bpy."""

from __future__ import annotations

import numpy as np

from ...array_types import Indices, Real
from ...signal.decoding import PathClassPixels, TileReplicate, assemble_rows, log_encoding_ratio
from ...signal.paths import PATH_DTYPE, PathRows
from .path_classes import PathClassLayer, TracedReplicate


def rows_of_replicate(
    traced: TracedReplicate,
    shared: TileReplicate,
    metres_per_unit: float,
    vertex_map: tuple[Real, float],
) -> PathRows:
    """Make the rows of all paths of one tile replicate, path class by path class.

    Parameters
    ----------
    traced
        What was found.
    shared
        Rays and transmitter.
    metres_per_unit
        Length of a Blender unit [m].
    vertex_map
        Origin (3,) and scale of the last vertex in the transmitter's colour, Blender units.

    Returns
    -------
    ndarray
        (paths,), of `PATH_DTYPE`.
    """
    found = [np.flatnonzero(layer.amplitude > 0) for layer in traced.layers]
    rows = np.zeros(sum(index.size for index in found), dtype=PATH_DTYPE)
    start = 0
    for layer, index in zip(traced.layers, found, strict=True):
        pixels = _pixels(layer, index, metres_per_unit, vertex_map, traced.coloured)
        assemble_rows(pixels, index, shared, rows[start : start + index.size])
        start += index.size
    return rows


def ray_origins(traced: TracedReplicate, origin_m: Real) -> Real:
    """Return where the rays of these rows start, (paths, 3), or (3,) where it is one place for all.

    Parameters
    ----------
    traced
        What was found.
    origin_m
        Of all pixels, (3,) or (h, w, 3).

    Returns
    -------
    ndarray
    """
    if origin_m.ndim == 1:
        return origin_m
    parts = [origin_m[layer.amplitude > 0] for layer in traced.layers]
    return np.concatenate(parts) if parts else np.empty((0, 3))


def pixel_numbers(traced: TracedReplicate) -> Indices:
    """Return the pixel of each of these rows, counted row by row from 1, (paths,).

    Parameters
    ----------
    traced
        What was found.

    Returns
    -------
    ndarray
    """
    parts = [np.flatnonzero(layer.amplitude > 0) + 1 for layer in traced.layers]
    return np.concatenate(parts) if parts else np.empty(0, dtype=np.intp)


def _pixels(
    layer: PathClassLayer,
    index: Indices,
    metres_per_unit: float,
    vertex_map: tuple[Real, float],
    coloured: bool,
) -> PathClassPixels:
    amplitude = layer.amplitude.take(index)
    encoded = layer.encoded.colours(index)
    mixing = np.full(amplitude.shape, np.nan)
    if coloured and layer.plain is not None:
        plain = layer.plain.colours(index)
        log_ratio = _coloured_ratio(encoded, plain)
    else:
        log_ratio = log_encoding_ratio(encoded[0], encoded[2])
        usable = (encoded[0] > 1e-37) & (encoded[1] > 1e-37)
        # as (G/R)(B/R): R^2 may underflow
        np.divide(encoded[1], encoded[0], out=mixing, where=usable)
        mixing[usable] *= encoded[2][usable] / encoded[0][usable]
    nowhere = np.broadcast_to(np.nan, (amplitude.size, 3))
    position = nowhere
    unknown = np.zeros(amplitude.size, dtype=np.int32)
    first_object = unknown
    view = layer.encoded
    if view.position is not None:
        seen = view.position.reshape(-1, 3).take(index, axis=0)
        position = seen.astype(np.float64) * metres_per_unit
    if view.object_index is not None and layer.position_is_first:
        first_object = view.object_index.take(index)
    vertex = nowhere
    if layer.vertex is not None:
        white = encoded if layer.white is None else layer.white.colours(index)
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = layer.vertex.colours(index) / white
        origin, scale = vertex_map
        vertex = (origin + (ratio.T - 1) / scale) * metres_per_unit
    return PathClassPixels(
        order=layer.order,
        depth=layer.depth,
        amplitude=amplitude / metres_per_unit**2,
        log_ratio=log_ratio,
        mixing=mixing,
        position_m=position,
        vertex_m=vertex,
        object=first_object if layer.order == 1 else unknown,
        first_object=first_object,
        position_is_first=layer.position_is_first,
    )


def _coloured_ratio(encoded: Real, plain: Real) -> Real:
    """Coded length from the brightest channel; red and blue decay by 1/k, green by 2/k."""
    rates = np.array([1.0, 2.0, 1.0])[:, None]
    ratios = log_encoding_ratio(encoded, plain) / rates
    best = np.argmax(np.where(np.isfinite(ratios), plain, -1.0), axis=0)
    return np.asarray(np.take_along_axis(ratios, best[None], axis=0)[0])
