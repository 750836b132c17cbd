# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra of a pulse or code whose echoes move meanwhile, from interpolation nodes; see
:mod:`.pulse_motion`.
"""

from __future__ import annotations

import math

import numpy as np

from ...array_types import Complex, Real
from ...errors import ConfigError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from .meeting import EMISSION, RECEPTION

Weights = Real | Complex

#: Fraction of the tolerance for the interpolation between nodes; a digit costs one.
NODES_SHARE = 0.01
#: At 77 GHz and 10 us that is 1200 km/s; each two radians cost a transform.
_MOST_BEND_RAD = 1e4


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

    #: Nodes are times of emission.
    meeting = EMISSION

    def __init__(self, samples: Complex, rate_hz: float, count: int) -> None:
        self._samples, self._count = samples, count
        middle = (samples.size - 1) / 2
        #: From the middle of the pulse to its ends [s].
        self.half_s = max(middle, 0.5) / rate_hz
        self._times = (np.arange(samples.size) - middle) / max(middle, 0.5)
        self._bases: dict[int, Weights] = {}
        #: Spectrum of the pulse, frequencies ascending, and its root mean square.
        self.spectrum = self._spectrum(samples)
        self.rms = float(np.sqrt(np.mean(np.abs(self.spectrum) ** 2)))

    def _spectrum(self, samples: Complex) -> Complex:
        """Spectrum of samples (..., n) about the middle of the pulse, (..., frequencies)."""
        middle = (self._samples.size - 1) / 2
        shift = np.exp(2j * np.pi * np.fft.fftfreq(self._count) * middle)
        return np.fft.fftshift(np.fft.fft(samples, self._count) * shift, axes=-1)

    def _basis(self, polynomials: Real) -> Weights:
        """W_j from the Lagrange polynomials (nodes, n) at the samples, (nodes, frequencies)."""
        return self._spectrum(self._samples * polynomials)

    def _weights(self, nodes: int) -> Weights:
        if nodes not in self._bases:
            vander = np.polynomial.chebyshev.chebvander
            inverse = np.linalg.inv(vander(_places(nodes), nodes - 1))
            at_samples = np.asarray((vander(self._times, nodes - 1) @ inverse).T, np.float64)
            self._bases[nodes] = self._basis(at_samples)
        return self._bases[nodes]

    def times_s(self, nodes: int) -> Real:
        """Times u_j of the nodes from the middle, (nodes,) [s]."""
        return self.half_s * _places(nodes)

    def joined(self, spectra: Complex) -> Complex:
        """Spectra of the echoes from those S at each node, (..., nodes, frequencies)."""
        weights = self._weights(spectra.shape[-2])
        return np.asarray(np.einsum("...jf,jf->...f", spectra, weights))

    def nodes(self, rate_mps: Real, highest_hz: float, tolerance: float) -> int:
        """Nodes for paths whose lengths change at these rates [m/s]."""
        fastest = float(np.abs(rate_mps).max(initial=0.0)) / SPEED_OF_LIGHT_MPS
        phase_rad = 2 * math.pi * highest_hz * fastest * self.half_s
        return nodes_for(phase_rad, NODES_SHARE * tolerance)

    def stretch(self, rate_mps: Real) -> Real:
        """1 + beta, (n,): how much longer a pulse is received than it was sent."""
        return np.asarray(1 + rate_mps / (SPEED_OF_LIGHT_MPS - rate_mps / 2))


class CodeShape(PulseShape):
    """A code that repeats without end, received for one of its periods.

    What is received at t_m + u, u from the middle of the period, has the delay tau(t_m + u): S is
    that of all samples, each of which takes it at its own time. So the sums at the nodes are
    turned into samples, and these are weighted by L_j(u).

    Parameters
    ----------
    samples
        Complex samples of one period, (n,).
    rate_hz
        Sampling rate, which is the band of the frequency grid [Hz].
    """

    #: Nodes are times of reception.
    meeting = RECEPTION

    def __init__(self, samples: Complex, rate_hz: float) -> None:
        super().__init__(samples, rate_hz, samples.size)

    def _spectrum(self, samples: Complex) -> Complex:
        """Spectrum of samples (..., n) from the beginning of the code."""
        return np.fft.fftshift(np.fft.fft(samples), axes=-1)

    def _basis(self, polynomials: Real) -> Weights:
        return polynomials

    def joined(self, spectra: Complex) -> Complex:
        """Spectra of what is received, from the sums at each node, (..., nodes, frequencies)."""
        echoes = np.fft.ifft(np.fft.ifftshift(spectra * self.spectrum, axes=-1))
        weights = self._weights(spectra.shape[-2])
        return self._spectrum(np.einsum("...jt,jt->...t", echoes, weights))

    def stretch(self, rate_mps: Real) -> Real:
        """1: samples are taken at their own times."""
        return np.ones_like(rate_mps)


def _places(nodes: int) -> Real:
    """Chebyshev nodes within -1 and 1."""
    return np.asarray(np.cos(np.pi * (np.arange(nodes) + 0.5) / nodes))


def nodes_for(bend_rad: float, tolerance: float) -> int:
    """Nodes for exp(j L p), |p| <= 1, L = `bend_rad`, to be within the tolerance."""
    if not bend_rad <= _MOST_BEND_RAD:
        raise ConfigError(
            f"Motion turns the phase of an echo by {2 * bend_rad:.3g} rad within a pulse; at most "
            f"{2 * _MOST_BEND_RAD:g} can be followed. Look for an object that jumps or is faster "
            "than any can be, or render the frame again if its files are damaged."
        )
    nodes, left = 1, 4 * (bend_rad / 2)
    while left > tolerance or nodes < bend_rad / 2:
        nodes += 1
        left *= bend_rad / 2 / nodes
    return nodes
