# SPDX-License-Identifier: GPL-3.0-or-later
"""Jobs of the synthesis that go pulse by pulse, or once for all pulses."""

from __future__ import annotations

import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from queue import Empty, SimpleQueue
from typing import Protocol

import numpy as np

from ...array_types import Complex, Real
from .grid import Weights
from .transform import ErrorSum, PulseResult


class Transform(Protocol):
    """Spectra of pulses, one after the other, from lengths (pulses, ...) and amplitudes (rows,) or
    (pulses, rows), with the pulse intervals of folding.
    """

    def pulses(
        self, lengths_m: Real, weights: Weights, order: Real | None
    ) -> Iterator[PulseResult]: ...


@dataclass(frozen=True)
class PulseBlock:
    """Spectra of some pulses, (pulses, frequencies); `heard` and `folded` count paths once per
    pulse.
    """

    pulses: slice
    values: Complex
    error: ErrorSum
    heard: int
    folded: int
    cpu_s: float


class TransformPool:
    """Transforms with their buffers, made when a thread finds none free."""

    def __init__(self, make: Callable[[], Transform], count: int) -> None:
        self._free: SimpleQueue[Transform] = SimpleQueue()
        self._make, self._count = make, count

    def block(
        self,
        pulses: slice,
        lengths_m: Callable[[], Real],
        amplitude: Weights | Callable[[], Weights],
        order: Real | None = None,
    ) -> PulseBlock:
        """Spectra of the lengths (pulses, ...), one pulse after the other.

        `amplitude` is or returns (rows,) or (pulses, rows); `order` are the pulse intervals by
        which rows are folded, None: found from the delays.
        """
        start = time.thread_time()
        try:
            transform = self._free.get_nowait()
        except Empty:
            transform = self._make()
        try:
            lengths = lengths_m()
            weights = amplitude() if callable(amplitude) else amplitude
            values = np.empty((lengths.shape[0], self._count), dtype=np.complex128)
            error, heard, folded = ErrorSum(), 0, 0
            for pulse, found in enumerate(transform.pulses(lengths, weights, order)):
                values[pulse] = found.values
                error.merge(found.error)
                heard += found.kept
                folded += found.folded
        finally:
            self._free.put(transform)
        return PulseBlock(pulses, values, error, heard, folded, time.thread_time() - start)
