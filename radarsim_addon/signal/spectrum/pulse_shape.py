# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra of a pulse and of its parts around interpolation nodes; see :mod:`.pulse_motion`."""

from __future__ import annotations

import math

import numpy as np

from ...array_types import Complex, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS

#: Fraction of the tolerance for the interpolation between nodes; a digit costs one.
NODES_SHARE = 0.01


class PulseShape:
    """A transmitted pulse, for motion while it is under way.

    Parameters
    ----------
    samples
        Complex samples, from the first to the last, (n,).
    rate_hz
        Sampling rate, which is the band of the frequency grid [Hz].
    count
        Number of frequencies, at least n.
    """

    def __init__(self, samples: Complex, rate_hz: float, count: int) -> None:
        self._samples, self._count = samples, count
        middle = (samples.size - 1) / 2
        #: From the middle of the pulse to its ends [s].
        self.half_s = max(middle, 0.5) / rate_hz
        self._times = (np.arange(samples.size) - middle) / max(middle, 0.5)
        self._shift = np.exp(2j * np.pi * np.fft.fftfreq(count) * middle)
        self._parts: dict[int, tuple[Real, Complex]] = {}
        #: Spectrum of the pulse, frequencies ascending, and its root mean square.
        self.spectrum: Complex = self.parts(1)[1][0]
        self.rms = float(np.sqrt(np.mean(np.abs(self.spectrum) ** 2)))

    def parts(self, nodes: int) -> tuple[Real, Complex]:
        """Times u_j of the nodes from the middle [s], and W_j, (nodes, frequencies)."""
        if nodes not in self._parts:
            at = np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes)
            inverse = np.linalg.inv(np.polynomial.chebyshev.chebvander(at, nodes - 1))
            spectra = np.empty((nodes, self._count), dtype=np.complex128)
            for spectrum, series in zip(spectra, inverse.T, strict=True):
                part = self._samples * np.polynomial.chebyshev.chebval(self._times, series)
                spectrum[:] = np.fft.fftshift(np.fft.fft(part, self._count) * self._shift)
            self._parts[nodes] = (self.half_s * at, spectra)
        return self._parts[nodes]

    def nodes(self, rate_mps: Real, highest_hz: float, tolerance: float) -> int:
        """Nodes for paths whose lengths change at these rates [m/s]."""
        fastest = float(np.abs(rate_mps).max(initial=0.0)) / SPEED_OF_LIGHT_MPS
        phase_rad = 2 * math.pi * highest_hz * fastest * self.half_s
        return nodes_for(phase_rad, NODES_SHARE * tolerance)


def nodes_for(bend_rad: float, tolerance: float) -> int:
    """Nodes for exp(j L p), |p| <= 1, L = `bend_rad`, to be within the tolerance."""
    nodes, left = 1, 4 * (bend_rad / 2)
    while left > tolerance or nodes < bend_rad / 2:
        nodes += 1
        left *= bend_rad / 2 / nodes
    return nodes
