# SPDX-License-Identifier: GPL-3.0-or-later
"""The complex amplitude of a path in a channel: the only place where amplitudes are decided.

**Phase convention.** Echoes carry exp(-j 2 pi f0 tau), that is exp(+j w t). Material and Fresnel
formulas are written with exp(-j w t) and n + jk, so `amplitude` conjugates reflection coefficients
Gamma and scattering matrices S. The factor exp(-j 2 pi f0 tau) itself belongs to the synthesis,
which knows lengths and amplitudes and nothing of materials, speckle or antennas.

Antenna gains are those at the time of each pulse: at its middle for a pulse, in the middle of the
ramp for frequencies that come one after the other. Between the elements of an array the level's
dependence on distance is neglected, its dependence on direction is not.
"""

from __future__ import annotations

import dataclasses
from typing import get_args

import numpy as np
from numpy.typing import NDArray

from ...array_types import Complex, Real
from ...contract import AmplitudeModel
from ...errors import ConfigError
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..paths import Paths, path_power_w
from ..radar import SINGLE_CHANNEL, Channel, Element
from ..spectrum import AmplitudeHistory
from .antenna_gains import Link, PathEnds
from .random_phases import path_phasors


def path_amplitude(
    paths: Paths,
    wavelength_m: float,
    amplitude_model: AmplitudeModel = "radar-equation",
    receiver_gain: float = 1.0,
) -> Real:
    """Return the magnitude of each path's amplitude, without speckle.

    Parameters
    ----------
    paths
        n paths. Their ``gain`` is applied.
    wavelength_m
        Carrier wavelength [m].
    amplitude_model
        "radar-equation": sqrt(P) in sqrt(W), so that |amplitude|^2 is received power.
        "paper": B r^2 (Eq. 10, 14), blue taken as amplitude, one-way range squared; the same number
        in Blender units and in SI. It follows the radar equation in range for one object, not in
        size. The root of the paths' gain multiplies it.
    receiver_gain
        G_r, linear; used by "radar-equation" alone.

    Returns
    -------
    ndarray
        (n,), sqrt(W) for "radar-equation".

    Raises
    ------
    ConfigError
        The amplitude model is unknown.
    """
    if amplitude_model == "radar-equation":
        return np.sqrt(path_power_w(paths, wavelength_m, receiver_gain))
    if amplitude_model == "paper":
        amplitude = paths.radiance * paths.range_m**2
        return amplitude if paths.gain is None else amplitude * np.sqrt(paths.gain)
    raise ConfigError(
        f"Amplitude model {amplitude_model!r}; expected one of {get_args(AmplitudeModel)}."
    )


def amplitude_history(
    paths: Paths,
    channel: Channel,
    *,
    frequency_hz: float,
    pulses: int,
    amplitude_model: AmplitudeModel = "radar-equation",
    receiver_gain: float = 1.0,
    link: Link | None = None,
    speckle_seed: int | None = None,
) -> AmplitudeHistory:
    """Return the amplitudes of paths in a channel at any time of a burst.

    Parameters
    ----------
    paths, channel, frequency_hz, amplitude_model, receiver_gain, link, speckle_seed
        See `amplitude`.
    pulses
        Pulses of the burst; the gains of a single pulse are those at the frame's time.

    Returns
    -------
    AmplitudeHistory
        Of n paths, in sqrt(W); see `amplitude`.

    Raises
    ------
    ConfigError
        See `amplitude`.
    """

    def without_link(paths: Paths) -> Complex:
        wavelength_m = SPEED_OF_LIGHT_MPS / frequency_hz
        found = path_amplitude(paths, wavelength_m, amplitude_model, receiver_gain)
        if paths.mirror_phase_rad is not None:
            found = found * np.exp(1j * paths.mirror_phase_rad)
        if speckle_seed is None:
            return found.astype(np.complex128)
        return np.asarray(found * path_phasors(paths, speckle_seed))

    if link is None:
        _refuse_patterns(channel)
        return AmplitudeHistory.of(without_link(paths))
    ends = PathEnds.of_paths(paths)
    if not channel.reference_gain:
        paths = dataclasses.replace(paths, gain=link.start_factor(ends, channel))
    elif paths.gain is None:
        paths = dataclasses.replace(paths, gain=link.ends_factor(ends))
    constant = without_link(paths)
    varies = link.varies(ends) if pulses > 1 else np.zeros(len(paths), dtype=bool)
    if not varies.any():
        return AmplitudeHistory.of(constant)
    base = without_link(dataclasses.replace(paths, gain=None))

    def at(times_s: Real, rows: NDArray[np.intp]) -> Complex:
        return np.asarray(
            base[rows, None] * np.sqrt(link.factors(ends.select(rows), times_s, channel))
        )

    return AmplitudeHistory(constant, varies, at)


def amplitude(
    paths: Paths,
    channel: Channel = SINGLE_CHANNEL,
    times_s: Real | None = None,
    *,
    frequency_hz: float,
    amplitude_model: AmplitudeModel = "radar-equation",
    receiver_gain: float = 1.0,
    link: Link | None = None,
    speckle_seed: int | None = None,
) -> Complex:
    """Return the complex amplitude of paths in a channel at every pulse.

    Parameters
    ----------
    paths
        n paths. ``phasors``, from the scatterers of surfaces, are applied where they are known.
    channel
        Transmitting and receiving element.
    times_s
        Pulse times since the frame's time, (pulses,) [s]; None: that time alone.
    frequency_hz
        Carrier [Hz].
    amplitude_model, receiver_gain
        See `path_amplitude`.
    link
        Antennas and powers; None: the gains in ``paths.gain``, or none.
    speckle_seed
        Random phases, see :func:`.scattering.random_phases.path_phasors`; None: none, and the
        phasors of surfaces are left out too.

    Returns
    -------
    ndarray
        (n, 1) where no amplitude changes from pulse to pulse, else (n, pulses): sqrt(W) for
        "radar-equation", without exp(-j 2 pi f0 tau).

    Raises
    ------
    ConfigError
        The amplitude model is unknown, the paths have no directions for antenna gains, or an
        element has a pattern and there is no link.
    """
    times_s = np.zeros(1) if times_s is None else np.atleast_1d(times_s)
    history = amplitude_history(
        paths, channel, frequency_hz=frequency_hz, pulses=times_s.size,
        amplitude_model=amplitude_model, receiver_gain=receiver_gain, link=link,
        speckle_seed=speckle_seed,
    )  # fmt: skip
    if not history.varies.any():
        return np.asarray(history.constant[:, None], dtype=np.complex128)
    values: Complex = np.repeat(
        history.constant.astype(np.complex128)[:, None], times_s.size, axis=1
    )
    rows = np.flatnonzero(history.varies)
    values[rows] = history.at(times_s, rows)
    return values


def _refuse_patterns(channel: Channel) -> None:
    """Raise where an element has a pattern of its own, or is turned, and there is no link."""
    for element in (channel.tx, channel.rx):
        if element.antenna is not None or element.orientation != Element().orientation:
            raise ConfigError(
                "An antenna element has a pattern or an orientation of its own, but there is no "
                "link budget to apply gains with. Process with a link budget."
            )
