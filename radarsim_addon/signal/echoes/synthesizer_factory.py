# SPDX-License-Identifier: GPL-3.0-or-later
"""Which engine makes the raw samples of which waveform."""

from __future__ import annotations

from collections.abc import Iterable

from ...array_types import Mask
from ...contract import AmplitudeModel
from ..motion import AntennaMotion
from ..paths import Paths
from ..radar import Radar
from ..scattering import Link
from ..spectrum import TOLERANCE, Backend, Method
from .echoes import DEFAULT_OPTIONS, Echoes, EchoOptions
from .frequency_synthesis import StretchSynthesizer
from .phase_noise import LineOscillator, PhaseNoise, takes_phase_noise_by_path
from .pulse_synthesis import EchoSynthesizer


def synthesizer_for(
    radar: Radar,
    range_limits_m: tuple[float, float],
    options: EchoOptions = DEFAULT_OPTIONS,
    *,
    phase_noise: PhaseNoise | None = None,
    phase_noise_seed: int = 0,
    link: Link | None = None,
    antennas: AntennaMotion | None = None,
    wanted: Mask | None = None,
) -> EchoSynthesizer | StretchSynthesizer:
    """Return the synthesizer for the waveform's family.

    Parameters
    ----------
    radar
        Waveform and burst.
    range_limits_m
        One-way ranges (start, stop) whose echoes are recorded whole [m].
    options
        How echoes are formed.
    phase_noise, phase_noise_seed
        For FMCW and stepped frequency, which take it path by path; see `apply_receiver`.
    link
        Antenna gains at every pulse; None: those that the paths have.
    antennas
        Motion of the antennas, for channels of elements away from their origins; None: the link's.
    wanted
        Pulses whose echoes are formed, (pulses,); those of the others are 0. None: all.

    Returns
    -------
    EchoSynthesizer or StretchSynthesizer
        Takes paths in parts with ``add``; ``result`` returns the `Echoes`.

    Raises
    ------
    ConfigError
        The range limits are empty or reversed, or the matrix of echoes is too large.
    """
    if radar.waveform.family == "pulse":
        return EchoSynthesizer(
            radar, range_limits_m, options, link=link, antennas=antennas, wanted=wanted
        )
    oscillators = None
    if phase_noise is not None and takes_phase_noise_by_path(radar):
        oscillators = [
            LineOscillator(radar, phase_noise, phase_noise_seed, channel.start_offset_s)
            for channel in radar.channels
        ]
        wanted = None  # the oscillators' factors are of all rows
    return StretchSynthesizer(
        radar,
        range_limits_m,
        options,
        oscillators=oscillators,
        link=link,
        antennas=antennas,
        wanted=wanted,
    )


def synthesize(
    paths: Paths | Iterable[Paths],
    radar: Radar,
    *,
    range_limits_m: tuple[float, float],
    amplitude_model: AmplitudeModel = "radar-equation",
    receiver_gain: float = 1.0,
    nufft_backend: Backend = "auto",
    tolerance: float = TOLERANCE,
    slow_time_transform: Method = "auto",
    range_folding: bool = True,
    motion_within_pulse: bool = True,
    chunk: int = 1 << 17,
    speckle_seed: int | None = None,
    link: Link | None = None,
    antennas: AntennaMotion | None = None,
) -> Echoes:
    """Return the echoes of a burst from paths (Eq. 9-14).

    Parameters
    ----------
    paths
        Paths, or several tables of them, as from :func:`.decoding.iter_path_chunks`.
    radar
        Waveform and burst.
    range_limits_m
        One-way ranges (start, stop) whose echoes are recorded whole [m]. Echoes that reach in from
        outside are cut at the edge, not folded.
    amplitude_model, receiver_gain, nufft_backend, tolerance, slow_time_transform, range_folding
        See :class:`.echoes.EchoOptions`.
    motion_within_pulse, chunk, speckle_seed
        See :class:`.echoes.EchoOptions`.
    link, antennas
        See :func:`synthesizer_for`.

    Returns
    -------
    Echoes
        Samples (channels, rows, samples).

    Notes
    -----
    A pulse comes back scaled in time by the range rate: its echo has the Doppler shift, and so the
    range-Doppler coupling, of a moving target. The delay is that of the wave which meets the path
    half its delay after its emission. A folded echo has the carrier phase of its true delay, for
    the oscillator runs on.
    """
    options = EchoOptions(
        amplitude_model=amplitude_model,
        receiver_gain=receiver_gain,
        nufft_backend=nufft_backend,
        tolerance=tolerance,
        slow_time_transform=slow_time_transform,
        range_folding=range_folding,
        motion_within_pulse=motion_within_pulse,
        chunk=chunk,
        speckle_seed=speckle_seed,
    )
    synthesizer = synthesizer_for(radar, range_limits_m, options, link=link, antennas=antennas)
    for part in [paths] if isinstance(paths, Paths) else paths:
        synthesizer.add(part)
    return synthesizer.result()
