# SPDX-License-Identifier: GPL-3.0-or-later
"""Shapes of the responses of a map: to a Doppler, to slow paths, and envelopes."""

from __future__ import annotations

import functools
import math

import numpy as np

from ...array_types import Complex, Real
from ..maps import PointResponse
from ..radar import slow_time_window


def doppler_line(weight: Real, cells: float) -> Complex:
    """Return the map's response, row by row, to an echo at a Doppler in cells; 1 at its place."""
    pulse = np.arange(weight.size)
    train = weight / weight.sum() * np.exp(2j * np.pi * cells * pulse / weight.size)
    return np.asarray(np.fft.fftshift(np.fft.fft(train)))


@functools.lru_cache(4)
def ridge_shape(doppler_taper: str, pulses: int, fastest_cells: float) -> Real:
    """Return the largest response of a ridge scatterer per row, relative to that next to 0 Hz.

    Of scatterers slower than `fastest_cells`, without what is stationary.
    """
    weight = slow_time_window(doppler_taper, pulses)
    zero, still = weight.size // 2, doppler_line(weight, 0.0)
    shape = np.zeros(weight.size)
    for cells in np.linspace(0.05, fastest_cells, 25):
        line = doppler_line(weight, float(cells))
        line -= line[zero] * still
        level = np.abs(line)
        shape = np.maximum(shape, level / max(level[zero - 1], level[zero + 1]))
    return np.asarray(np.maximum(shape, np.roll(shape[::-1], 1 - weight.size % 2)))


def envelope(response: PointResponse, row: int, col: int) -> Real:
    """Return the envelope of a response without nulls between sidelobes, (Doppler, ranges)."""
    pulses, nodes = response.doppler.shape
    columns = response.ranges.shape[1]
    near = response.ranges[:, max(0, col - 4) : col + 5]
    # also between the rows: an echo on a row has its zeros in all others
    trains = np.fft.ifft(np.fft.ifftshift(response.doppler, axes=0), axis=0)
    half = np.exp(-1j * np.pi * np.arange(pulses) / pulses)[:, None]
    between = np.fft.fftshift(np.fft.fft(trains * half, axis=0), axes=0)
    lines = np.maximum(np.abs(response.doppler @ near), np.abs(between @ near)).max(axis=1)
    reach = 1 + math.ceil(nodes / 2)  # range sidelobes of a migrating echo are next to its row
    doppler = np.max([np.roll(lines, k) for k in range(-reach, reach + 1)], axis=0)
    profile = np.pad(np.abs(response.ranges).max(axis=0), 2)
    ranges = np.max([profile[k : k + columns] for k in range(5)], axis=0)
    found = np.outer(doppler, ranges)
    if response.image is not None:
        found += np.outer(
            np.abs(response.image.doppler).max(axis=1), np.abs(response.image.ranges).max(axis=0)
        )
    return np.asarray(found)


def vertex(values: Real) -> float:
    """Return the maximum of a parabola through the logarithms of three values, -1/2 to 1/2."""
    low, middle, high = np.log(np.maximum(values, 1e-300))
    bend = low - 2 * middle + high
    return float(np.clip((low - high) / (2 * bend), -0.5, 0.5)) if bend < 0 else 0.0
