# SPDX-License-Identifier: GPL-3.0-or-later
"""How clutter fluctuates: texture over the surface, and the motion of its scatterers.

Texture is a factor on sigma0 of mean 1 with a correlation length. Over speckle it makes the
intensity K-distributed, log-normal with speckle, or Weibull. Scatterers have constant random
velocities, so the echo of many has the Doppler spectrum that the velocities are drawn from.
"""

from __future__ import annotations

import math

import numpy as np

from ..array_types import Real
from ..errors import ConfigError
from .checks import real_array

TEXTURES = ("none", "k", "lognormal", "weibull")
MOTIONS = ("none", "exponential", "gaussian", "sea")

#: Cosines that a Gaussian field is the sum of.
_COSINES = 128
_GRAVITY_MPS2 = 9.81
#: Surface tension of water over its density [m^3/s^2].
_TENSION = 7.4e-5
#: Probabilities away from 0 and 1, where quantiles are infinite.
_LEAST = 1e-12


def check_texture(kind: str, shape: float, length_m: float) -> None:
    """Check the numbers of a texture.

    Parameters
    ----------
    kind, shape, length_m
        As for `texture`.

    Raises
    ------
    ConfigError
        An unknown kind, a number out of range.
    """
    if kind not in TEXTURES:
        raise ConfigError(f"Texture is {kind!r}; expected one of {', '.join(TEXTURES)}.")
    if kind == "none":
        return
    highest = {"k": 1e3, "lognormal": 3.0, "weibull": 1.0}[kind]
    real_array(f"Shape of the texture {kind!r}", shape, "", minimum=0.05, maximum=highest)
    real_array("Length of the texture", length_m, "m", above=0.0)


def texture(points_m: Real, kind: str, shape: float, length_m: float, seed: int) -> Real:
    """Return factors of mean 1 on the power of scatterers at points of a surface.

    Parameters
    ----------
    points_m
        In the surface's own coordinates, (n, 3) [m].
    kind
        One of `TEXTURES`: "k": gamma distribution of the order `shape` (nu); "lognormal": standard
        deviation `shape` of the natural logarithm; "weibull": with speckle the intensity has a
        Weibull distribution of the shape `shape`, at most 1, and a Rayleigh amplitude at 1.
    shape
        See `kind`.
    length_m
        Correlation length L: the field underneath has the correlation exp(-(r/L)^2) [m].
    seed
        Of the realisation.

    Returns
    -------
    ndarray
        (n,).

    Raises
    ------
    ConfigError
        An unknown kind, a number out of range.
    """
    check_texture(kind, shape, length_m)
    if kind == "none":
        return np.ones(len(points_m))
    rng = np.random.default_rng(seed)
    field = _gaussian_field(points_m / length_m, rng)
    if kind == "lognormal":
        return np.asarray(np.exp(shape * field - shape**2 / 2))
    if kind == "k":
        from scipy.special import gammaincinv  # not at import: some Blenders have no scipy

        return np.asarray(gammaincinv(shape, _probability(field)) / shape)
    angle = np.pi * _probability(field)
    return _inverse_stable(angle, _gaussian_field(points_m / length_m, rng), shape)


def _gaussian_field(places: Real, rng: np.random.Generator) -> Real:
    """Unit Gaussian field of correlation exp(-r^2), (n,): random Fourier features."""
    waves = rng.normal(0.0, math.sqrt(2.0), (_COSINES, 3))
    phases = rng.uniform(0.0, 2 * np.pi, _COSINES)
    found = np.zeros(len(places))
    for wave, phase in zip(waves, phases, strict=True):
        found += np.cos(places @ wave + phase)
    return found * math.sqrt(2 / _COSINES)


def _probability(field: Real) -> Real:
    from scipy.special import ndtr

    return np.asarray(np.clip(ndtr(field), _LEAST, 1 - _LEAST))


def _inverse_stable(angle: Real, field: Real, shape: float) -> Real:
    """1/S of mean 1, S one-sided stable (Kanter, Ann. Probab. 3, 697, 1975): an exponential times
    it is Weibull.
    """
    if shape == 1.0:
        return np.ones(angle.size)
    waiting = -np.log(_probability(field))
    log_stable = (
        np.log(np.sin(shape * angle))
        - np.log(np.sin(angle)) / shape
        + (1 - shape) / shape * (np.log(np.sin((1 - shape) * angle)) - np.log(waiting))
    )
    return np.asarray(np.exp(-log_stable - math.lgamma(1 + 1 / shape)))


def check_motion(kind: str, speed_mps: float, fraction: float) -> None:
    """Check the numbers of internal motion.

    Parameters
    ----------
    kind, speed_mps, fraction
        As for `clutter_velocities`.

    Raises
    ------
    ConfigError
        An unknown kind, a number out of range.
    """
    if kind not in MOTIONS:
        raise ConfigError(f"Clutter motion is {kind!r}; expected one of {', '.join(MOTIONS)}.")
    real_array("Speed of the clutter motion", speed_mps, "m/s", minimum=0.0, maximum=100.0)
    real_array("Fraction of the clutter motion", fraction, "", minimum=0.0, maximum=1.0)


def clutter_velocities(
    kind: str,
    speed_mps: float,
    fraction: float,
    draws: tuple[Real, Real],
    grazing_cosine: Real,
    wavelength_m: float,
) -> Real:
    """Return the velocities of scatterers along the line of sight, receding positive.

    Parameters
    ----------
    kind
        One of `MOTIONS`. "exponential": spectrum exp(-|v| / speed_mps), as Billingsley found over
        wooded land, and a `fraction` of the power that does not move. "gaussian": standard
        deviation `speed_mps`. "sea": both Bragg lines, approaching with the `fraction`, each
        with the standard deviation `speed_mps`.
    speed_mps, fraction
        See `kind`.
    draws
        Two numbers even over 0 to 1 for each scatterer, (n,) each.
    grazing_cosine
        Cosine of the grazing angle, (n,); for "sea".
    wavelength_m
        Of the carrier; for "sea".

    Returns
    -------
    ndarray
        (n,) [m/s].

    Raises
    ------
    ConfigError
        An unknown kind, a number out of range.
    """
    check_motion(kind, speed_mps, fraction)
    one, other = (np.clip(draw, _LEAST, 1 - _LEAST) for draw in draws)
    if kind == "none":
        return np.zeros(one.size)
    if kind == "exponential":
        # one draw for stillness and side, another for the speed
        side = np.where(one < fraction + (1 - fraction) / 2, -1.0, 1.0)
        return np.asarray(np.where(one < fraction, 0.0, -side * speed_mps * np.log(other)))
    from scipy.special import ndtri

    spread_mps = speed_mps * ndtri(other)
    if kind == "gaussian":
        return np.asarray(spread_mps)
    side = np.where(one < fraction, -1.0, 1.0)
    return np.asarray(side * bragg_velocity_mps(wavelength_m, grazing_cosine) + spread_mps)


def clutter_correlation(
    kind: str, speed_mps: float, fraction: float, lag_s: Real, wavelength_m: float
) -> Real:
    """Return the correlation of the echo of many scatterers with themselves, a time later.

    Parameters
    ----------
    kind, speed_mps, fraction
        As for `clutter_velocities`.
    lag_s
        Times, (n,) [s].
    wavelength_m
        Of the carrier [m].

    Returns
    -------
    ndarray
        (n,), 1 at lag 0: the characteristic function of the velocities. Of "sea" it is that of each
        Bragg line, about its own velocity.
    """
    turn = 4 * np.pi / wavelength_m * speed_mps * np.asarray(lag_s, dtype=np.float64)
    if kind == "none":
        return np.ones(turn.shape)
    if kind == "exponential":
        return np.asarray(fraction + (1 - fraction) / (1 + turn**2))
    return np.asarray(np.exp(-(turn**2) / 2))


def bragg_velocity_mps(wavelength_m: float, grazing_cosine: Real | float) -> Real:
    """Return the phase velocity of the sea waves that scatter back, along the line of sight.

    Parameters
    ----------
    wavelength_m
        Of the carrier [m].
    grazing_cosine
        Cosine of the grazing angle.

    Returns
    -------
    ndarray
        sqrt(g k_B + 7.4e-5 k_B^3) / (2 k), k_B = 2 k cos of the angle, in deep water [m/s].
    """
    k = 2 * np.pi / wavelength_m
    bragg = 2 * k * np.asarray(grazing_cosine, dtype=np.float64)
    return np.asarray(np.sqrt(_GRAVITY_MPS2 * bragg + _TENSION * bragg**3) / (2 * k))
