# SPDX-License-Identifier: GPL-3.0-or-later
"""Window functions as closed forms of a continuous position, for spectra and for pulse trains.

Named by text: "none", "hann", "hamming" or "hamming:0.75", "blackman", "kaiser:2.5" (beta),
"taylor:4:-35" (nbar, sidelobe level in dB).
"""

from __future__ import annotations

import math

import numpy as np

from ...array_types import Real
from ...errors import ConfigError

WINDOW_NAMES = ("none", "hann", "hamming", "blackman", "kaiser:beta", "taylor:nbar:sll_db")


def window_at(spec: str, position: Real) -> Real:
    """Value of a window at positions within its extent.

    Parameters
    ----------
    spec
        Name and parameters, see the module.
    position
        From -1/2 to 1/2, any shape. Outside, the window is 0.

    Returns
    -------
    ndarray
        Same shape; 1 at the centre for all but Taylor (whose mean is 1).

    Raises
    ------
    ConfigError
        Unknown name, or parameters that do not fit.
    """
    name, *texts = spec.lower().split(":")
    try:
        numbers = [float(text) for text in texts]
    except ValueError:
        numbers = [math.nan]
    inside = np.abs(position) <= 0.5
    angle = 2 * np.pi * position
    if name in ("none", "rectangular") and not numbers:
        value = np.ones_like(angle)
    elif name == "hann" and not numbers:
        value = 0.5 + 0.5 * np.cos(angle)
    elif name == "hamming" and (not numbers or (len(numbers) == 1 and 0.5 <= numbers[0] <= 1)):
        alpha = numbers[0] if numbers else 0.54
        value = alpha + (1 - alpha) * np.cos(angle)
    elif name == "blackman" and not numbers:
        value = 0.42 + 0.5 * np.cos(angle) + 0.08 * np.cos(2 * angle)
    elif name == "kaiser" and len(numbers) == 1 and 0 <= numbers[0] <= 100:
        bell = np.sqrt(np.maximum(1 - (2 * position) ** 2, 0.0))
        value = np.i0(numbers[0] * bell) / np.i0(numbers[0])
    elif name == "taylor" and len(numbers) == 2 and numbers[0] >= 1 and numbers[0] % 1 == 0:
        value = _taylor(angle, int(numbers[0]), abs(numbers[1]))
    else:
        raise ConfigError(
            f"Window {spec!r} is unknown; expected one of {', '.join(WINDOW_NAMES)}, "
            "for example 'hamming', 'kaiser:2.5' or 'taylor:4:-35'."
        )
    return np.where(inside, value, 0.0)


def slow_time_window(spec: str, pulses: int) -> Real:
    """Return a window over a train of pulses.

    Parameters
    ----------
    spec
        Name of the window, see :func:`window_at`.
    pulses
        Number of pulses.

    Returns
    -------
    ndarray
        (pulses,), sampled at the middle of each pulse interval.
    """
    return window_at(spec, (np.arange(pulses) - (pulses - 1) / 2) / pulses)


def _taylor(angle: Real, nbar: int, sidelobe_db: float) -> Real:
    """Taylor window (Carrara, Goodman, Majewski, Spotlight SAR, appendix D)."""
    if not 0 < sidelobe_db <= 200 or nbar > 1000:
        raise ConfigError(
            f"Taylor window with nbar {nbar} and {sidelobe_db} dB; expected nbar up to 1000 and a "
            "sidelobe level of a few tens of dB, for example 'taylor:4:-35'."
        )
    a_squared = (math.acosh(10 ** (sidelobe_db / 20)) / math.pi) ** 2
    sigma_squared = nbar**2 / (a_squared + (nbar - 0.5) ** 2)
    value = np.ones_like(angle)
    for m in range(1, nbar):
        top, bottom = 1.0, 1.0
        for n in range(1, nbar):
            top *= 1 - m**2 / sigma_squared / (a_squared + (n - 0.5) ** 2)
            if n != m:
                bottom *= 1 - m**2 / n**2
        value += (-1) ** (m + 1) * top / bottom * np.cos(m * angle)
    return value
