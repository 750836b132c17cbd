# SPDX-License-Identifier: GPL-3.0-or-later
"""Transmitters that send at once: what each receiver records of them, and how they are told apart.

In slot q of a cycle of L, transmitter t has the factor c_t[q] (`Channel.code`). A receiver records
y[m] = sum_t c_t[m mod L] x_t[m] at pulse m. Phases that rise evenly (DDM) shift transmitter t by t
PRF / L in Doppler: y conj(c_t) has its echoes about 0, and those that are slower than half of a
share stay within it. The band is cut out and leaves a burst of one pulse a cycle (Sun, Petropulu,
Poor, IEEE Signal Process. Mag. 37, 98, 2020). Other codes are taken off in blocks of L pulses,

    x_t[p] = 1/L sum_q conj(c_t[q]) y[p L + q],

with the time of the block's middle. Both are exact for stationary scenes. Of a target whose phase
turns by w from pulse to pulse, transmitter s leaks into t by |1/L sum_q conj(c_t[q]) c_s[q]
exp(j w q)| in blocks (`crosstalk`); in bands by the sidelobes of the burst's spectrum alone.
"""

from __future__ import annotations

import dataclasses
import math

import numpy as np

from ...arrays import Complex
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ..radar import Channel, Radar
from .echoes import Echoes
from .receiver import ReceivedSignal


def shifts_doppler(radar: Radar) -> bool:
    """Return whether all codes rise evenly, so that they shift transmitters in Doppler."""
    rises = np.array([channel.code_turns for channel in radar.channels])
    even = rises[:, 1:2] * np.arange(rises.shape[1])
    return bool(np.allclose(np.exp(2j * np.pi * (rises - even)), 1.0, rtol=0, atol=1e-9))


def recorded_together(echoes: Echoes, radar: Radar) -> Echoes:
    """Return what each receiver records while all transmitters send.

    Parameters
    ----------
    echoes
        Of each pair by itself, at every pulse that `radar.sent` sends.
    radar
        With codes.

    Returns
    -------
    Echoes
        A channel for each receiver.
    """
    receivers = {
        channel.rx: number for number, channel in reversed(list(enumerate(radar.channels)))
    }
    order = sorted(receivers, key=lambda rx: receivers[rx])
    rows = echoes.samples.shape[1]
    samples = np.zeros((len(order), *echoes.samples.shape[1:]), dtype=np.complex128)
    for channel, own in zip(radar.channels, echoes.samples, strict=True):
        samples[order.index(channel.rx)] += _by_row(channel.code, rows, radar)[:, None] * own
    channels = tuple(Channel(radar.channels[receivers[rx]].tx, rx) for rx in order)
    together = dataclasses.replace(echoes.radar, channels=channels)
    return dataclasses.replace(echoes, samples=samples, radar=together)


def separate(received: ReceivedSignal, radar: Radar) -> ReceivedSignal:
    """Tell transmitters apart that have sent at once.

    Parameters
    ----------
    received
        A channel for each receiver, see `recorded_together`.
    radar
        With codes.

    Returns
    -------
    ReceivedSignal
        A channel for each pair and a pulse for each cycle. Noise and rounding have the power that
        is left of them. `recorded` are the samples before.
    """
    echoes = received.echoes
    rows, count = echoes.samples.shape[1:]
    slots, repeats = radar.slots, rows // (radar.burst.pulses * radar.slots)
    order = [channel.rx for channel in echoes.radar.channels]
    samples = np.empty((len(radar.channels), rows // slots, count), dtype=np.complex128)
    in_bands = shifts_doppler(radar)
    for channel, own in zip(radar.channels, samples, strict=True):
        turned = echoes.samples[order.index(channel.rx)]
        turned = _by_row(channel.code.conj(), rows, radar)[:, None] * turned
        if in_bands:
            pulses = turned.reshape(-1, repeats, count)
            found = _middle_band(pulses, radar.burst.pulses)
        else:
            found = turned.reshape(-1, slots, repeats, count).mean(axis=1)
        own[:] = found.reshape(own.shape)
    return dataclasses.replace(
        received,
        echoes=dataclasses.replace(echoes, samples=samples, radar=radar),
        noise_power_w=received.noise_power_w / slots,
        step=None if received.step is None else received.step / math.sqrt(slots),
        recorded=echoes,
    )


def crosstalk(radar: Radar, range_rate_mps: float) -> float:
    """Return the largest part of one transmitter in another after separation, relative to its
    amplitude, for a point at a constant range rate.

    Parameters
    ----------
    radar
        With codes.
    range_rate_mps
        Range rate [m/s].

    Returns
    -------
    float
        0 if it is stationary. For phases that rise evenly: 0 at the target's own Doppler up to the
        range rate at which its echo leaves its part of the Doppler axis, 1 beyond.
    """
    turn = -4 * math.pi * range_rate_mps * radar.waveform.carrier_hz / SPEED_OF_LIGHT_MPS
    turn /= radar.sent.burst.prf_hz
    if shifts_doppler(radar):
        return float(abs(turn) * radar.slots > math.pi)
    codes = np.array(list({channel.tx: channel.code for channel in radar.channels}.values()))
    moving = codes * np.exp(1j * turn * np.arange(radar.slots))
    leaks = np.abs(codes.conj() @ moving.T) / radar.slots
    return float((leaks - np.diag(np.diag(leaks))).max())


def _by_row(code: Complex, rows: int, radar: Radar) -> Complex:
    """Return a code at all rows of samples, (rows,): one for each pulse, of PMCW several."""
    repeats = rows // (radar.burst.pulses * radar.slots)
    return np.repeat(np.tile(code, radar.burst.pulses), repeats)


def _middle_band(pulses: Complex, kept: int) -> Complex:
    """Return a burst (pulses, ...) with its `kept` lowest Doppler frequencies alone, as so many
    pulses.
    """
    count = len(pulses)
    spectrum = np.fft.fftshift(np.fft.fft(pulses, axis=0), axes=0)
    first = count // 2 - kept // 2
    band = np.fft.ifftshift(spectrum[first : first + kept], axes=0)
    return np.asarray(np.fft.ifft(band, axis=0) * (kept / count))
