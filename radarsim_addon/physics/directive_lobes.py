# SPDX-License-Identifier: GPL-3.0-or-later
"""Scattering around the mirrored direction: the directive lobe of effective roughness.

A surface scatters a fraction of the power that it reflects. Per steradian the scattered power goes
with ((1 + cos psi) / 2)^exponent, psi the angle to the direction of the mirrored wave. Over all
directions above the surface the lobe adds up to 1, whatever the angle of incidence.

References
----------
V. Degli-Esposti, F. Fuschini, E. M. Vitucci, G. Falciasecca, Measurement and modelling of
scattering from buildings, IEEE Trans. Antennas Propag. 55 (2007) 143-153, eq. 9 to 12.
"""

from __future__ import annotations

import math
from functools import lru_cache
from typing import Any

import numpy as np

from ..array_types import Real
from ..errors import ConfigError
from ..vectors import dots

#: Largest exponent of a lobe: half of its power lies within 2.4 degrees there.
MOST_EXPONENT = 1000
#: Cosines in a table of `lobe_integral`.
_COSINES = 4097


def lobe_exponent(value: Any) -> int:
    """Return an exponent as a whole number.

    Parameters
    ----------
    value
        Number.

    Returns
    -------
    int
        1 to `MOST_EXPONENT`.

    Raises
    ------
    ConfigError
        It is no such number.
    """
    is_number = isinstance(value, int | float | np.integer | np.floating)
    if (
        not is_number
        or isinstance(value, bool)
        or not 1 <= value <= MOST_EXPONENT
        or value != int(value)
    ):
        raise ConfigError(
            f"The exponent of a scattered lobe is {value!r}; expected a whole number from 1 (wide) "
            f"to {MOST_EXPONENT} (narrow)."
        )
    return int(value)


def lobe_integral(exponent: int, cosine: Real) -> Real:
    """Return the integral of ((1 + cos psi) / 2)^exponent over all directions above a surface.

    Parameters
    ----------
    exponent
        See `lobe_exponent`.
    cosine
        Cosines of angles of incidence.

    Returns
    -------
    ndarray
        Solid angles [sr].
    """
    cosine = np.asarray(cosine, dtype=np.float64)
    sine2 = (1 - cosine) * (1 + cosine)
    total = np.zeros(cosine.shape)
    # the sum over w up to (j - 1) / 2 of binomial(2w, w) (sine / 2)^(2w)
    part = term = np.ones(cosine.shape)
    for j in range(exponent + 1):
        share = math.exp(
            math.lgamma(exponent + 1)
            - math.lgamma(j + 1)
            - math.lgamma(exponent - j + 1)
            - exponent * math.log(2)
        )
        if j % 2 and j > 1:
            w = (j - 1) // 2
            term = term * sine2 * (2 * w - 1) / (2 * w)
            part = part + term
        total += share * 2 * math.pi / (j + 1) * (cosine * part if j % 2 else 1.0)
    return np.asarray(total)


@lru_cache(maxsize=64)
def _table(exponent: int) -> tuple[Real, Real]:
    """Cosines and the integrals there."""
    cosines = np.linspace(0.0, 1.0, _COSINES)
    return cosines, lobe_integral(exponent, cosines)


def directive_lobe(exponent: int, normal: Real, to_source: Real, to_observer: Real) -> Real:
    """Return the scattered radiance over the irradiance of the scattered fraction, per steradian.

    Parameters
    ----------
    exponent
        See `lobe_exponent`.
    normal, to_source, to_observer
        Unit vectors: of the surface, and from it towards both, on its side, (n, 3).

    Returns
    -------
    ndarray
        (n,). Its integral over the observer's directions, times their cosines, is 1.
    """
    cosine = dots(normal, to_source)
    mirrored = 2 * cosine * dots(normal, to_observer) - dots(to_source, to_observer)
    lobe = np.clip((1 + mirrored) / 2, 0.0, 1.0) ** exponent
    integral = np.interp(np.clip(cosine, 0.0, 1.0), *_table(exponent))
    return np.asarray(lobe / integral / dots(normal, to_observer))
