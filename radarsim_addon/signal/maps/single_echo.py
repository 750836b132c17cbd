# SPDX-License-Identifier: GPL-3.0-or-later
"""What a range-Doppler map shows of one echo: the exact response of the waveform.

Range sidelobes, paired echoes of a short chirp, the cut at the ends of the record, windows, range
migration and the canceller are all in it, because a unit echo is synthesized and compressed as the
scene's are. While the echo moves from r - d to r + d its profile is interpolated between Q ranges
(Chebyshev nodes, barycentric Lagrange; Trefethen, Approximation Theory and Practice, ch. 5), so
that the response is a product (pulses, Q) x (Q, ranges).
"""

from __future__ import annotations

import dataclasses
import math
from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex, Real
from ..echoes import Echoes, EchoOptions, synthesizer_for
from ..paths import make_paths
from ..radar import Burst, FmcwWaveform, Radar
from .mti import mti_cancel
from .range_compression import RangeProfiles, range_process
from .range_doppler_map import RangeDopplerMap, range_doppler

#: Error of the interpolation over the migration, relative to the peak.
_NODE_ERROR = 1e-4
#: Most nodes: a migration of some ten range cells.
_MOST_NODES = 24
#: Nearest echo: delays below 0 are not heard [m].
_NEAREST_M = 1e-6


@dataclass(frozen=True)
class Recording:
    """A range-Doppler map with the samples that it was made of.

    Attributes
    ----------
    echoes
        The samples, with the window that was recorded.
    range_limits_m
        Ranges of the map, maybe beyond that window [m].
    rd_map
        The map.
    mti
        Pulses of the canceller, 0 for none.
    strongest
        Highest power of a range cell in any pulse, before the canceller.
    """

    echoes: Echoes
    range_limits_m: tuple[float, float]
    rd_map: RangeDopplerMap
    mti: int
    strongest: float

    @classmethod
    def over(
        cls, echoes: Echoes, range_limits_m: tuple[float, float], rd_map: RangeDopplerMap, mti: int
    ) -> Recording:
        """A map over another range window [m], else made as `rd_map` was."""
        found = range_process(
            dataclasses.replace(echoes, range_limits_m=range_limits_m), rd_map.range_taper
        )
        strongest = float(np.max(np.abs(found.values), initial=0.0)) ** 2
        found = mti_cancel(found, mti) if mti else found
        wide = range_doppler(found, rd_map.doppler_taper)
        return cls(echoes, range_limits_m, wide, mti, strongest)


@dataclass(frozen=True)
class PointResponse:
    """Response of a map to one echo: ``doppler @ ranges``, its magnitude at the echo about 1.

    Attributes
    ----------
    doppler
        (Doppler, Q), complex.
    ranges
        (Q, ranges), complex.
    image
        Response to its image at negative beats and the opposite Doppler, which a real ADC adds
        with the conjugate amplitude; else None.
    """

    doppler: Complex
    ranges: Complex
    image: PointResponse | None = None

    @property
    def values(self) -> Complex:
        """(Doppler, ranges), without the image."""
        return np.asarray(self.doppler @ self.ranges)

    def echo(self, amplitude: complex) -> Complex:
        """What the map shows of an echo, (Doppler, ranges)."""
        values = (amplitude * self.doppler) @ self.ranges
        if self.image is not None:
            values += (np.conj(amplitude) * self.image.doppler) @ self.image.ranges
        return np.asarray(values)


def point_response(
    recording: Recording, range_m: float, cycles: float, folds: int = 0
) -> PointResponse:
    """Response to an echo that stands in the map at a range and a Doppler.

    Parameters
    ----------
    recording
        The map and its samples.
    range_m
        Where the echo stands in the middle of the burst, as the map has it [m].
    cycles
        Doppler, cycles per pulse.
    folds
        Turns per pulse that the Doppler has folded: the echo migrates with what belongs to
        cycles + folds.
    """
    radar = recording.echoes.radar
    pulses, waveform = radar.burst.pulses, radar.waveform
    times = np.arange(pulses) - (pulses - 1) / 2
    travel_m = -(cycles + folds) * waveform.wavelength_m / 2 * (pulses - 1) / 2
    turn = math.pi / 2 * abs(travel_m) / waveform.sample_spacing_m
    count, error = 1, 2 * turn
    while error > _NODE_ERROR and count < _MOST_NODES:
        count += 1
        error *= turn / count
    nodes = np.cos((2 * np.arange(count) + 1) * np.pi / (2 * count))
    shares = _lagrange(nodes, times / max(times[-1], 0.5))
    profiles = [_profiles(recording, range_m + travel_m * node) for node in nodes]
    turns = np.exp(2j * np.pi * cycles * times)[:, None]
    response = PointResponse(
        _doppler(recording, shares * turns), np.stack([own for own, _ in profiles])
    )
    images = [image for _, image in profiles if image is not None]
    if not images:
        return response
    image = PointResponse(_doppler(recording, shares * np.conj(turns)), np.stack(images))
    return dataclasses.replace(response, image=image)


def cut_range_m(recording: Recording, line: Complex, range_m: float) -> float:
    """Where an echo beyond the window stands that shows such a line of the map, best fit.

    Of an echo that the end of the record cuts to a part of its pulse, the peak is not where it
    stands, and may be at a sidelobe. All ranges on that side are tried, half a sample apart.

    Parameters
    ----------
    recording
        The map and its samples, of pulses.
    line
        (ranges,) of the map, at the echo's Doppler.
    range_m
        On that side of the window: where its peak is [m].
    """
    echoes, (start_m, stop_m) = recording.echoes, recording.range_limits_m
    waveform, radar = echoes.radar.waveform, echoes.radar
    if range_m < echoes.range_limits_m[0]:
        low_m, high_m = max(start_m, _NEAREST_M), echoes.range_limits_m[0]
    else:
        low_m, high_m = echoes.range_limits_m[1], stop_m
    count = max(2, math.ceil((high_m - low_m) / waveform.sample_spacing_m * 2))
    # One pulse a range: an echo that moves on by a step from pulse to pulse.
    radar = Radar(waveform, Burst(radar.burst.prf_hz, count))
    step_m = (high_m - low_m) / (count - 1)
    synthesizer = synthesizer_for(radar, echoes.range_limits_m, EchoOptions(nufft_backend="direct"))
    aperture_m2 = waveform.wavelength_m**2 / (4 * math.pi)
    synthesizer.add(make_paths(1 / aperture_m2, 2 * low_m, step_m * radar.burst.prf_hz))
    echo = dataclasses.replace(synthesizer.result(), range_limits_m=recording.range_limits_m)
    tried = range_process(echo, recording.rd_map.range_taper).values[:, : line.size]
    energy = np.sum(np.abs(tried) ** 2, axis=1)
    # What is left of a pulse below a thousandth of it tells nothing.
    fit = np.abs(np.conj(tried) @ line) ** 2 / np.maximum(energy, 1e-3 * energy.max())
    return low_m + step_m * int(np.argmax(fit))


def _doppler(recording: Recording, trains: NDArray[Any]) -> Complex:
    """Canceller, window and transform of the map, over pulse trains (pulses, Q)."""
    radar, rd_map = recording.echoes.radar, recording.rd_map
    columns = np.arange(trains.shape[1], dtype=np.float64)
    found = RangeProfiles(trains, columns, radar, rd_map.range_taper)
    found = mti_cancel(found, recording.mti) if recording.mti else found
    return range_doppler(found, rd_map.doppler_taper).values


def _lagrange(nodes: Real, places: Real) -> Real:
    """Values at `places` of the polynomials that are 1 at one Chebyshev node, (places, nodes)."""
    count = nodes.size
    weights = (-1.0) ** np.arange(count) * np.sin((2 * np.arange(count) + 1) * np.pi / (2 * count))
    apart = places[:, None] - nodes[None, :]
    hit = np.abs(apart) < 1e-14
    terms = weights / np.where(hit, 1.0, apart)
    shares = terms / terms.sum(axis=1, keepdims=True)
    on_node = hit.any(axis=1)
    shares[on_node] = hit[on_node]
    return np.asarray(shares)


def _profiles(recording: Recording, range_m: float) -> tuple[Complex, Complex | None]:
    """Profiles (ranges,) of a unit echo that stands still, and of its image in a real ADC.

    Their carrier phases are taken out, so that they change slowly with range.
    """
    echoes, range_taper = recording.echoes, recording.rd_map.range_taper
    waveform = echoes.radar.waveform
    if isinstance(waveform, FmcwWaveform) and waveform.real_adc:
        waveform = dataclasses.replace(waveform, real_adc=False)  # what the image adds is its own
    radar = Radar(waveform, Burst(echoes.radar.burst.prf_hz, 1))
    range_m = max(range_m, _NEAREST_M)
    aperture_m2 = waveform.wavelength_m**2 / (4 * math.pi)
    synthesizer = synthesizer_for(radar, echoes.range_limits_m, EchoOptions(nufft_backend="direct"))
    synthesizer.add(make_paths(1 / aperture_m2, 2 * range_m))
    echo = dataclasses.replace(synthesizer.result(), range_limits_m=recording.range_limits_m)
    columns = recording.rd_map.range_m.size
    carrier = np.exp(2j * np.pi * (2 * range_m / waveform.wavelength_m % 1.0))
    own = range_process(echo, range_taper).values[0, :columns] * carrier
    if waveform is echoes.radar.waveform:
        return own, None
    echo = dataclasses.replace(echo, samples=np.conj(echo.samples))
    return own, range_process(echo, range_taper).values[0, :columns] * np.conj(carrier)
