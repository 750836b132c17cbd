# SPDX-License-Identifier: GPL-3.0-or-later
"""Several renders of one burst as one: each stands for the pulses around the time it shows.

Where visibility changes during a burst (a target comes out from behind a wall) one render cannot
serve it all. Each of several has its own table, whose paths have their lengths at every pulse. The
echoes of all are added with weights that are hat functions of slow time: 1 at the pulse that a
render shows, 0 at its neighbours', and their sum is 1 at every pulse. Phases are those of each
render's own paths, so what is seen by two of them fades from one to the other without a jump.
"""

from __future__ import annotations

import dataclasses
import functools
import itertools
from collections.abc import Iterable, Sequence

import numpy as np

from ...array_types import Mask, Real
from ...errors import SchemaError
from ..decoding import FrameInput
from ..radar import Radar
from .echoes import Echoes, pulse_times_s


def interpolation_weights(slow_time_s: Real, shown_s: Sequence[float]) -> Real:
    """Weights of renders that show the scene at `shown_s`, (renders, pulses); columns sum to 1."""
    nodes = np.asarray(shown_s, dtype=np.float64)
    if nodes.size == 1:
        return np.ones((1, slow_time_s.size))
    hats = np.eye(nodes.size)
    return np.array([np.interp(slow_time_s, nodes, hat) for hat in hats])


def render_times_s(frame_input: FrameInput) -> list[float]:
    """Return when each render of a frame's burst shows the scene, after the frame's time t.

    Parameters
    ----------
    frame_input
        Frame of the sampling mode "paths".

    Returns
    -------
    list of float
        Ascending times, one for each render [s].

    Raises
    ------
    SchemaError
        The times are not in order.
    """
    motions = [table.motion for table in frame_input.tables]
    times = [0.0 if motion is None else motion.epoch_offset_s for motion in motions]
    if any(later <= earlier for earlier, later in itertools.pairwise(times)):
        raise SchemaError(
            f"{frame_input.frame.path}: the renders of its burst show {times} s; expected "
            "ascending times. Render the frame again."
        )
    return times


def pulses_of_render(radar: Radar, shown_s: Sequence[float], number: int) -> Mask:
    """Return the pulses whose interpolated echoes this render contributes to, in any channel.

    Parameters
    ----------
    radar
        Burst and channels.
    shown_s
        Scene time of each render after the start of the burst, ascending [s].
    number
        Index of the render in `shown_s`.

    Returns
    -------
    ndarray of bool
        (pulses,), True where the weight is above 0.
    """
    return np.asarray((_weights(radar, shown_s, number) > 0).any(axis=0))


def interpolate_renders(parts: Iterable[Echoes], shown_s: Sequence[float]) -> Echoes:
    """Return the echoes of a burst from those of its renders.

    Parameters
    ----------
    parts
        Echoes of each render, at least for the pulses of `pulses_of_render`; from a generator, one
        at a time is in memory.
    shown_s
        When each render shows the scene, ascending [s].

    Returns
    -------
    Echoes
        Samples (channels, rows, samples); between two renders their weights are linear in time.
    """
    weighted = (_weighted(part, shown_s, number) for number, part in enumerate(parts))
    return functools.reduce(_sum, weighted)


def _weighted(part: Echoes, shown_s: Sequence[float], number: int) -> Echoes:
    """Echoes of a render times its weight at each pulse of each channel."""
    weight = _weights(part.radar, shown_s, number)
    rows = np.repeat(weight, part.samples.shape[1] // part.radar.burst.pulses, axis=1)
    return dataclasses.replace(
        part,
        samples=rows[..., None] * part.samples,
        outside=part.outside * float(weight.mean()),
    )


def _weights(radar: Radar, shown_s: Sequence[float], number: int) -> Real:
    """Weight of a render at each pulse of each channel, (channels, pulses)."""
    offsets_s = np.array([channel.start_offset_s for channel in radar.channels])
    times_s = pulse_times_s(radar) + offsets_s[:, None]
    weights = interpolation_weights(times_s.ravel(), shown_s)
    return np.asarray(weights[number].reshape(times_s.shape))


def _sum(total: Echoes, part: Echoes) -> Echoes:
    return dataclasses.replace(
        total, samples=part.samples + total.samples, outside=total.outside + part.outside
    )
