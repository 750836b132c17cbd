# SPDX-License-Identifier: GPL-3.0-or-later
"""From the renders of one view to rows of the path table. No bpy."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ... import contract
from ...array_types import Real
from ...signal.decoding import GatePixels, Geometry, PixelRays, assemble_rows, log_code_ratio
from ...signal.paths import PATH_DTYPE, PathRows
from .path_classes import GateLayer, TracedView


def rows_of_view(
    traced: TracedView,
    rays: PixelRays,
    camera: contract.ReceiverRecord,
    emitter_m: Real,
    range_encoding_length_m: float,
    metres_per_unit: float,
    vertex_map: tuple[Real, float],
    effective_area_m2: float,
    share: float,
    tile: int,
    shift: int,
) -> PathRows:
    """All paths of one view, as rows.

    Parameters
    ----------
    vertex_map
        Origin and scale of the last vertex in the emitter's colour, Blender units.
    share
        One over the number of shifts of the tile.
    """
    geometry = Geometry(emitter_m, range_encoding_length_m, camera.near_clip_m)
    parts = []
    for layer in traced.layers:
        row, col = np.nonzero(layer.amplitude > 0)
        index = (row, col)
        pixels = _pixels(layer, index, metres_per_unit, vertex_map, traced.coloured)
        parts.append(
            assemble_rows(pixels, rays, index, geometry, effective_area_m2, share, tile, shift)
        )
    return np.concatenate(parts) if parts else np.empty(0, dtype=PATH_DTYPE)


def _pixels(
    layer: GateLayer,
    index: tuple[NDArray[np.intp], NDArray[np.intp]],
    metres_per_unit: float,
    vertex_map: tuple[Real, float],
    coloured: bool,
) -> GatePixels:
    amplitude = layer.amplitude[index]
    coded = layer.coded.channels()[:, index[0], index[1]]
    mixing = np.full(amplitude.shape, np.nan)
    if coloured and layer.plain is not None:
        plain = layer.plain.channels()[:, index[0], index[1]]
        log_ratio = _coloured_ratio(coded, plain)
    else:
        log_ratio = log_code_ratio(coded[0], coded[2])
        usable = (coded[0] > 1e-37) & (coded[1] > 1e-37)
        # as (G/R)(B/R): R^2 may underflow
        np.divide(coded[1], coded[0], out=mixing, where=usable)
        mixing[usable] *= coded[2][usable] / coded[0][usable]
    nowhere = np.full((amplitude.size, 3), np.nan)
    position = nowhere
    unknown = np.zeros(amplitude.size, dtype=np.int32)
    first_object = unknown
    view = layer.coded
    if view.position is not None:
        position = view.position[index] * metres_per_unit
    if view.object_index is not None and layer.position_is_first:
        first_object = view.object_index[index]
    vertex = nowhere
    if layer.vertex is not None:
        ratio = layer.vertex.channels()[:, index[0], index[1]]
        with np.errstate(divide="ignore", invalid="ignore"):
            ratio = ratio / coded
        origin, scale = vertex_map
        vertex = (origin + (ratio.T - 1) / scale) * metres_per_unit
    return GatePixels(
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


def _coloured_ratio(coded: Real, plain: Real) -> Real:
    """Coded length from the brightest channel; red and blue decay by 1/k, green by 2/k."""
    rates = np.array([1.0, 2.0, 1.0])[:, None]
    ratios = log_code_ratio(coded, plain) / rates
    best = np.argmax(np.where(np.isfinite(ratios), plain, -1.0), axis=0)
    return np.asarray(np.take_along_axis(ratios, best[None], axis=0)[0])
