# SPDX-License-Identifier: GPL-3.0-or-later
"""Coverage diagram: the echo of a target over a smooth ground against height and range.

A target has the direct path and the path via the ground, on the way there and on the way back. The
ground reflects by its material; the Earth is round, with the refraction of the standard atmosphere.
Close to the horizon rays do not describe the field.
"""

from __future__ import annotations

import math
from dataclasses import dataclass

import numpy as np
from numpy.typing import ArrayLike

from ...arrays import Complex, Real
from ...errors import ConfigError
from ...findings import Finding, finding
from ...physics.antennas import Antenna, to_antenna_frame
from ...physics.constants import SPEED_OF_LIGHT_MPS, STANDARD_EARTH_RADIUS_M
from ...physics.mirrors import MirrorMaterial
from ...physics.round_earth import GroundPath, ground_path, least_grazing_rad
from .link_budget import PeakedAntenna

#: Most points of a diagram, and the most steps along one of its axes.
_MOST_POINTS = 4_000_000
#: Antennas farther apart than this part of the shortest range see different lobes.
_APART = 0.01
#: Steps of phase between neighbours of the diagram above which its lobes are not resolved [rad].
_RESOLVED_RAD = math.pi / 2


@dataclass(frozen=True)
class Mount:
    """An antenna over the ground."""

    antenna: PeakedAntenna
    #: Over the ground [m].
    height_m: float
    #: Matrix to the world, (4, 4) [m]; the antenna looks along its -z, its y is up.
    pose: Real


@dataclass(frozen=True)
class CoverageSetup:
    """A radar over a ground."""

    transmitter: Mount
    receiver: Mount
    #: Reflection of the ground at the carrier.
    ground: MirrorMaterial
    wavelength_m: float
    #: "horizontal", "vertical" or "average".
    polarisation: str
    #: Radius of the Earth with its refraction [m]; ``math.inf``: flat.
    radius_m: float = STANDARD_EARTH_RADIUS_M


@dataclass(frozen=True)
class Coverage:
    """A coverage diagram: h heights and r ranges."""

    #: Ranges along the ground (r,) and heights over it (h,) [m].
    range_m: Real
    height_m: Real
    #: Pattern-propagation factor F^4, (h, r): power of the echo over that of the same target in
    #: free space at the peaks of both antennas. NaN below the horizon.
    factor: Real
    #: Power of the echo over that without the ground, (h, r). NaN below the horizon.
    ground_gain: Real
    #: 0: rays describe the field; 1: close to the horizon, where they do not; 2: below it, (h, r).
    zone: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]
    setup: CoverageSetup
    findings: tuple[Finding, ...]

    @property
    def title(self) -> str:
        """One line for a figure."""
        setup = self.setup
        earth = "flat Earth" if math.isinf(setup.radius_m) else "4/3 Earth"
        return (
            f"{SPEED_OF_LIGHT_MPS / setup.wavelength_m / 1e9:.6g} GHz, {setup.polarisation} "
            f"polarisation, radar {setup.receiver.height_m:.6g} m over the ground, {earth}"
        )


def compute_coverage(setup: CoverageSetup, height_m: ArrayLike, range_m: ArrayLike) -> Coverage:
    """Compute a coverage diagram over heights above the ground (h,) and ranges along it (r,), both
    rising [m].
    """
    heights, ranges = _axis("Target heights", height_m, 0.0), _axis("Ranges", range_m, None)
    if heights.size * ranges.size > _MOST_POINTS:
        raise ConfigError(
            f"The diagram has {heights.size} heights and {ranges.size} ranges; expected at most "
            f"{_MOST_POINTS:,} points. Give wider steps."
        )
    _check_mounts(setup, float(ranges[0]))
    z, x = heights[:, None], ranges[None, :]
    factor, gain = np.ones((heights.size, ranges.size)), np.ones((heights.size, ranges.size))
    for mount in (setup.transmitter, setup.receiver):
        path = ground_path(mount.height_m, z, x, setup.radius_m)
        direct, ground = _fields(setup, mount, path)
        factor *= np.abs(direct + ground) ** 2
        with np.errstate(divide="ignore", invalid="ignore"):
            gain *= np.abs(1 + ground / direct) ** 2
    zone = np.where(path.grazing_rad < least_grazing_rad(setup.wavelength_m, setup.radius_m), 1, 0)
    zone[path.grazing_rad < 0] = 2
    for values in (factor, gain):
        values[zone == 2] = np.nan
    findings = _findings(setup, path, zone)
    return Coverage(ranges, heights, factor, gain, zone.astype(np.uint8), setup, findings)


@dataclass(frozen=True)
class CoverageCurve:
    """A coverage diagram at one range, and the textbook's flat two-ray model next to it."""

    range_m: float
    #: As in `Coverage`, (h,).
    factor: Real
    ground_gain: Real
    zone: np.ndarray[tuple[int, ...], np.dtype[np.uint8]]
    #: From `two_ray_gain`, (h,).
    two_ray: Real


def coverage_curve(found: Coverage, range_m: float | None = None) -> CoverageCurve:
    """Compute the curve over the heights of a diagram at a range [m]; None: its last range."""
    at_m = float(found.range_m[-1]) if range_m is None else range_m
    one = compute_coverage(found.setup, found.height_m, at_m)
    two_ray = two_ray_gain(found.setup, found.height_m, at_m)
    return CoverageCurve(at_m, one.factor[:, 0], one.ground_gain[:, 0], one.zone[:, 0], two_ray)


def two_ray_gain(setup: CoverageSetup, height_m: ArrayLike, range_m: float) -> Real:
    """Return the textbook's power of an echo over a flat ground, over that without the ground,
    (h,).

    It is ``|1 + Gamma* exp(-jk d)|^4`` with the path difference d = 2 h_r h / R. For a perfect
    conductor and horizontal polarisation that is 16 sin^4(2 pi h_r h / (lambda R)), with lobes at
    odd multiples of h = lambda R / (4 h_r), and nulls at even ones. The antennas' patterns and the
    Earth's radius have no effect.
    """
    height = np.asarray(height_m, dtype=np.float64)
    mounts = (setup.transmitter.height_m, setup.receiver.height_m)
    gain = np.ones(height.shape)
    for antenna_m in mounts:
        gamma = _reflection(setup, np.arctan2(antenna_m + height, range_m))
        turn = np.exp(-4j * np.pi * antenna_m * height / (setup.wavelength_m * range_m))
        gain *= np.abs(1 + gamma * turn) ** 2
    return gain


def _axis(name: str, values: ArrayLike, least: float | None) -> Real:
    found = np.atleast_1d(np.asarray(values, dtype=np.float64))
    low = found > 0 if least is None else found >= least
    if found.ndim != 1 or not found.size or not np.isfinite(found).all() or not low.all():
        bound = "above 0" if least is None else f"from {least:g} m on"
        raise ConfigError(f"{name} are {found.tolist()!r:.80}; expected finite numbers {bound}.")
    if np.any(np.diff(found) <= 0):
        raise ConfigError(f"{name} do not rise: {found.tolist()!r:.80}.")
    return found


def _check_mounts(setup: CoverageSetup, nearest_m: float) -> None:
    one, other = setup.transmitter, setup.receiver
    for name, mount in (("transmitter", one), ("receiver", other)):
        if not mount.height_m > 0:
            raise ConfigError(
                f"The {name} is {mount.height_m:g} m over the ground; expected more than 0. Raise "
                "the radar, or choose another ground."
            )
    apart_m = float(np.linalg.norm(one.pose[:3, 3] - other.pose[:3, 3]))
    if apart_m > _APART * nearest_m:
        raise ConfigError(
            f"Transmitter and receiver are {apart_m:g} m apart, more than {_APART:.0%} of the "
            f"shortest range of {nearest_m:g} m; a coverage diagram is of a monostatic radar. "
            "Begin at a longer range, or place both antennas together."
        )


def _reflection(setup: CoverageSetup, grazing_rad: Real) -> Complex:
    """Return the coefficient of the ground for echoes that carry exp(+j w t), as `grazing_rad`."""
    flat = np.maximum(grazing_rad, 0.0).ravel()
    incoming = np.stack([np.cos(flat), np.zeros(flat.size), -np.sin(flat)], axis=1)
    up = np.array([0.0, 0.0, 1.0])
    found = setup.ground.reflection(incoming, up, setup.polarisation, setup.wavelength_m)
    gamma = np.sqrt(found.power) * np.exp(-1j * found.phase_rad)
    return np.asarray(gamma.reshape(grazing_rad.shape))


def _fields(setup: CoverageSetup, mount: Mount, path: GroundPath) -> tuple[Real, Complex]:
    """Return the fields of both paths at the target, over that of free space at the peak of the
    antenna.
    """
    direct, ground = (
        np.sqrt(_gain(mount, elevation) / mount.antenna.peak_gain)
        for elevation in (path.direct_elevation_rad, path.ground_elevation_rad)
    )
    turn = np.exp(-2j * np.pi / setup.wavelength_m * path.excess_m)
    reflected = _reflection(setup, path.grazing_rad) * path.divergence * path.spreading
    return direct, ground * reflected * turn


def _gain(mount: Mount, elevation_rad: Real) -> Real:
    """Return the gain towards elevations in the vertical plane that the antenna looks along."""
    ahead = -mount.pose[:2, 2]
    length = float(np.hypot(*ahead))
    if length < 1e-6:
        raise ConfigError(
            "The radar looks straight up or down, so the diagram has no direction along the "
            "ground. Tilt the radar towards the targets."
        )
    across = np.cos(elevation_rad)[..., None] * (ahead / length)
    world = np.concatenate([across, np.sin(elevation_rad)[..., None]], axis=-1)
    antenna: Antenna = mount.antenna
    return antenna.gain(to_antenna_frame(mount.pose, world))


def _findings(
    setup: CoverageSetup, path: GroundPath, zone: np.ndarray[tuple[int, ...], np.dtype[np.int_]]
) -> tuple[Finding, ...]:
    found = []
    if (zone > 0).any():
        numbers = {"hidden": (zone == 2).mean(), "grazing": (zone == 1).mean()}
        found.append(finding("coverage-near-horizon", **numbers))
    turns = np.where(zone == 2, np.nan, 2 * np.pi / setup.wavelength_m * path.excess_m)
    steps = [np.abs(np.diff(turns, axis=axis)) for axis in (0, 1)]
    worst = [max(1, math.ceil(np.nanmax(one, initial=0.0) / _RESOLVED_RAD)) for one in steps]
    if max(worst) > 1:
        fraction = max(float((one > _RESOLVED_RAD).mean()) for one in steps if one.size)
        numbers = {"height_times": worst[0], "range_times": worst[1], "fraction": fraction}
        found.append(finding("coverage-lobes-unresolved", **numbers))
    return tuple(found)
