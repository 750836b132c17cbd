# SPDX-License-Identifier: GPL-3.0-or-later
"""Response of a range-Doppler map to one echo: the exact response of the waveform.

It contains range sidelobes, paired echoes of a short chirp, the cut at the ends of the record,
tapers, range migration and the canceller, because a unit echo is synthesized and compressed like
the scene's. While the echo moves from r - d to r + d its profile is interpolated between Q ranges
(Chebyshev nodes, barycentric Lagrange; Trefethen, Approximation Theory and Practice, ch. 5), so
that the response is a product (pulses, Q) x (Q, ranges).
"""

from __future__ import annotations

import dataclasses
import functools
import math
from dataclasses import dataclass

import numpy as np

from ...arrays import Complex, Real
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..echoes import Echoes, EchoSynthesizer, StretchSynthesizer, synthesizer_for
from ..radar import (
    AnyWaveform,
    Burst,
    FmcwWaveform,
    PmcwWaveform,
    Radar,
    SteppedWaveform,
    frequencies_hz,
    matched_filter,
    replica,
)
from .range_compression import OVERSAMPLE, RangeProfiles, range_axis, range_process
from .range_doppler_map import RangeDopplerMap, mti_cancel, range_doppler

#: Error of the interpolation over the migration, relative to the peak.
_NODE_ERROR = 1e-4
#: Maximum number of nodes: a migration of some ten range cells.
_MAX_NODES = 24
#: Nearest echo: delays below 0 are not received [m].
_NEAREST_M = 1e-6


@dataclass(frozen=True)
class Recording:
    """A range-Doppler map with its samples."""

    #: The samples, with the range limits of the record.
    echoes: Echoes
    #: Ranges of the map, possibly beyond those limits.
    range_limits_m: tuple[float, float]
    rd_map: RangeDopplerMap
    #: Pulses of the canceller, 0 for none.
    mti: int
    #: Highest power of a range cell in any pulse, before the canceller.
    strongest: float

    @functools.cached_property
    def synthesizer(self) -> EchoSynthesizer | StretchSynthesizer:
        """Synthesizer of single echoes in the receive window of the record."""
        radar = self.echoes.radar
        single = Radar(radar.waveform, Burst(radar.burst.prf_hz, 1))
        return synthesizer_for(single, self.echoes.range_limits_m)

    @functools.cached_property
    def later_s(self) -> float:
        """Time after which a moving echo is at the range where a pulse shows it now [s]."""
        return _coupling_s(self.echoes.radar.waveform, self.rd_map.range_taper)

    @classmethod
    def over(
        cls,
        echoes: Echoes,
        range_limits_m: tuple[float, float],
        rd_map: RangeDopplerMap,
        mti: int,
        compressed: RangeProfiles | None = None,
    ) -> Recording:
        """Return a map over other range limits, processed as `rd_map` otherwise.

        It uses the profiles of that map (`compressed`) if they are known and cover the same ranges.
        """
        wide, found = rd_map, compressed
        if found is None or not np.array_equal(
            found.range_m, range_axis(echoes.radar, range_limits_m, OVERSAMPLE)
        ):
            found = range_process(
                dataclasses.replace(echoes, range_limits_m=range_limits_m), rd_map.range_taper
            )
            wide = _map(found, mti, rd_map.doppler_taper)
        strongest = float(np.max(np.abs(found.values), initial=0.0)) ** 2
        return cls(echoes, range_limits_m, wide, mti, strongest)


@dataclass(frozen=True)
class PointResponse:
    """Response of a map to one echo: ``doppler @ ranges``, its magnitude at the echo about 1."""

    #: (Doppler, Q).
    doppler: Complex
    #: (Q, ranges).
    ranges: Complex
    #: Response to its image at negative beats and the opposite Doppler, which a real ADC adds with
    #: the conjugate amplitude; None for a complex ADC.
    image: PointResponse | None = None

    @property
    def values(self) -> Complex:
        """(Doppler, ranges), without the image."""
        return np.asarray(self.doppler @ self.ranges)

    def echo(self, amplitude: complex) -> Complex:
        """Return the map's values of an echo, (Doppler, ranges)."""
        values = (amplitude * self.doppler) @ self.ranges
        if self.image is not None:
            values += (np.conj(amplitude) * self.image.doppler) @ self.image.ranges
        return np.asarray(values)


def point_response(
    recording: Recording, range_m: float, cycles: float, folds: int = 0
) -> PointResponse:
    """Return the response of the map to an echo at a range in the middle of the burst and at a
    Doppler.

    `cycles` is the Doppler of the map in cycles per pulse. `folds` is the number of whole cycles
    per pulse that the map does not show: the echo migrates with cycles + folds.
    """
    radar = recording.echoes.radar
    pulses, waveform = radar.burst.pulses, radar.waveform
    times = np.arange(pulses) - (pulses - 1) / 2
    travel_m = -(cycles + folds) * waveform.wavelength_m / 2 * (pulses - 1) / 2
    turn = math.pi / 2 * abs(travel_m) / waveform.sample_spacing_m
    count, error = 1, 2 * turn
    while error > _NODE_ERROR and count < _MAX_NODES:
        count += 1
        error *= turn / count
    nodes = np.cos((2 * np.arange(count) + 1) * np.pi / (2 * count))
    weights = _lagrange(nodes, times / max(times[-1], 0.5))
    rate_mps = -(cycles + folds) * waveform.wavelength_m / 2 * radar.burst.prf_hz
    own, conjugate = _profiles(recording, range_m + travel_m * nodes, rate_mps)
    turns: Complex = np.exp(2j * np.pi * cycles * times)[:, None]
    response = PointResponse(_doppler(recording, weights * turns), own)
    if conjugate is None:
        return response
    image = PointResponse(_doppler(recording, weights * turns.conj()), conjugate)
    return dataclasses.replace(response, image=image)


def cut_range_m(recording: Recording, line: Complex, range_m: float) -> float:
    """Return the range beyond the range limits whose echo fits a row of the map best.

    The end of the record cuts such an echo, so its peak need not be at its range. All ranges on
    that side of the limits are tried, half a sample apart. `line` is the row of the map at the
    Doppler of the echo, and `range_m` the range of its peak.
    """
    echoes, (start_m, stop_m) = recording.echoes, recording.range_limits_m
    if range_m < echoes.range_limits_m[0]:
        low_m, high_m = max(start_m, _NEAREST_M), echoes.range_limits_m[0]
    else:
        low_m, high_m = echoes.range_limits_m[1], stop_m
    count = max(2, math.ceil((high_m - low_m) / echoes.radar.waveform.sample_spacing_m * 2))
    ranges_m = np.linspace(low_m, high_m, count)
    tried = _pulse_profiles(recording, ranges_m, 0.0)
    energy = np.sum(np.abs(tried) ** 2, axis=1)
    # Less than a thousandth of a pulse is no evidence.
    fit = np.abs(np.conj(tried) @ line) ** 2 / np.maximum(energy, 1e-3 * energy.max())
    return float(ranges_m[np.argmax(fit)])


def fit_point(own: Complex, patch: Complex) -> tuple[complex, float]:
    """Fit a response to a patch of a map in the same cells by least squares.

    Returns the amplitude of the echo, and the fraction of the patch's energy in its response.
    """
    norm = max(float(np.vdot(own, own).real), 1e-300)
    product = complex(np.vdot(own, patch))
    energy = max(float(np.vdot(patch, patch).real), 1e-300)
    return product / norm, abs(product) ** 2 / (norm * energy)


def _profiles(
    recording: Recording, ranges_m: Real, rate_mps: float
) -> tuple[Complex, Complex | None]:
    """Return the profiles (Q, ranges) of unit echoes at Q ranges, and of their images in a real
    ADC.

    They have no carrier phase, so that they change slowly with range. The echoes move during pulses
    and codes. If the frequencies follow one another in time, the profile is that of a stationary
    echo.
    """
    waveform = recording.echoes.radar.waveform
    if isinstance(waveform, FmcwWaveform | SteppedWaveform):
        return _still_profiles(recording, waveform, np.maximum(ranges_m, _NEAREST_M))
    ranges_m = np.maximum(ranges_m - rate_mps * recording.later_s, _NEAREST_M)
    carrier = np.exp(2j * np.pi * (2 * ranges_m / waveform.wavelength_m % 1.0))
    return carrier[:, None] * _pulse_profiles(recording, ranges_m, rate_mps), None


def _still_profiles(
    recording: Recording, waveform: FmcwWaveform | SteppedWaveform, ranges_m: Real
) -> tuple[Complex, Complex | None]:
    """Return `_profiles` of stationary echoes, with beats from their closed form."""
    real = False
    if isinstance(waveform, FmcwWaveform) and waveform.real_adc:
        real = True
        waveform = dataclasses.replace(waveform, real_adc=False)  # what the image adds is its own
    delay_s = (2 / SPEED_OF_LIGHT_MPS * ranges_m)[:, None]
    cycles = (
        -waveform.grid_step_hz * delay_s * (np.arange(waveform.grid_count) - waveform.grid_middle)
    )
    if isinstance(waveform, FmcwWaveform):
        cycles += waveform.slope_hz_per_s / 2 * delay_s**2
    beats = np.exp(2j * np.pi * cycles)
    if isinstance(waveform, FmcwWaveform):
        beats[ranges_m >= waveform.unambiguous_range_m] = 0  # filtered out
    echo = dataclasses.replace(
        recording.echoes,
        samples=beats[None],
        radar=Radar(waveform, Burst(recording.echoes.radar.burst.prf_hz, ranges_m.size)),
        range_limits_m=recording.range_limits_m,
    )
    own = _compressed(recording, echo)
    if not real:
        return own, None
    return own, _compressed(recording, dataclasses.replace(echo, samples=np.conj(beats)[None]))


def _coupling_s(waveform: AnyWaveform, range_taper: str) -> float:
    """Return the time after which a moving echo is at the range where a pulse shows it now [s].

    It is f0 / K for a chirp. A Doppler shift turns the spectrum W of w(t) by the spectrum T of t
    w(t). The slope of its phase over the band is a delay. Codes of PMCW are shown in the middle of
    their repeats.
    """
    samples = replica(waveform)
    times_s = (np.arange(samples.size) - (samples.size - 1) / 2) / waveform.sampling_rate_hz
    repeats = isinstance(waveform, PmcwWaveform)
    size = samples.size * (1 if repeats else 4)
    f = frequencies_hz(waveform, size)
    spectrum = np.fft.fft(samples, size)
    late = np.fft.fft(times_s * samples, size)
    size_of = np.maximum(np.abs(spectrum), 1e-300)
    weight = 1.0 if repeats else np.abs(matched_filter(waveform, size, range_taper)) / size_of
    slope = np.sum(weight * f * (late * np.conj(spectrum)).real)
    coupling = slope / np.sum(weight * f**2 * np.abs(spectrum) ** 2)
    return float(waveform.carrier_hz * coupling + (waveform.duration_s / 2 if repeats else 0.0))


def _pulse_profiles(recording: Recording, ranges_m: Real, rate_mps: float) -> Complex:
    """Return profiles of echoes of amplitude 1 in pulses or codes, (Q, ranges)."""
    echo = recording.synthesizer.single_echoes(ranges_m, np.full(ranges_m.size, rate_mps))
    return _compressed(
        recording, dataclasses.replace(echo, range_limits_m=recording.range_limits_m)
    )


def _compressed(recording: Recording, echo: Echoes) -> Complex:
    """Return profiles of echoes over the ranges of the map, (pulses, ranges)."""
    found = range_process(echo, recording.rd_map.range_taper).values[0]
    return np.asarray(found[:, : recording.rd_map.range_m.size])


def _lagrange(nodes: Real, places: Real) -> Real:
    """Return the polynomials that are 1 at one Chebyshev node, (places, nodes), at `places`."""
    count = nodes.size
    weights = (-1.0) ** np.arange(count) * np.sin((2 * np.arange(count) + 1) * np.pi / (2 * count))
    apart = places[:, None] - nodes[None, :]
    hit = np.abs(apart) < 1e-14
    terms = weights / np.where(hit, 1.0, apart)
    values = terms / terms.sum(axis=1, keepdims=True)
    on_node = hit.any(axis=1)
    values[on_node] = hit[on_node]
    return np.asarray(values)


def _doppler(recording: Recording, trains: Complex) -> Complex:
    """Apply canceller, taper and transform of the map to pulse trains (pulses, Q)."""
    radar, rd_map = recording.echoes.radar, recording.rd_map
    columns = np.arange(trains.shape[1], dtype=np.float64)
    profiles = RangeProfiles(trains[None], columns, radar, rd_map.range_taper)
    return _map(profiles, recording.mti, rd_map.doppler_taper).plane


def _map(profiles: RangeProfiles, mti: int, doppler_taper: str) -> RangeDopplerMap:
    return range_doppler(mti_cancel(profiles, mti) if mti else profiles, doppler_taper)
