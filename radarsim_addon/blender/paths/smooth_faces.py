# SPDX-License-Identifier: GPL-3.0-or-later
"""Smooth faces near normal incidence: the level that physical optics gives them.

The lobe of a slope stands for heights of many wavelengths. A face of less than an eighth of a
wavelength reflects as a whole: its echo depends on area, curvature and wavelength, and not on the
slope of its polish. Does not import bpy.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from typing import Any

import numpy as np

from ... import contract
from ...array_types import Indices, Real
from ...findings import Finding, finding_about
from ...physics.constants import SPEED_OF_LIGHT_MPS
from ...physics.fresnel import unpolarised_reflectance
from ...physics.rcs import specular_face
from ...physics.rough import least_rms_height_m
from ...vectors import crosses, dots, norms
from ..materials import glint_slope, surface_of
from ..nodes.group_search import group_input
from ..nodes.radar_material import EXTINCTION, INDEX, SPECULARITY
from ..views import ViewWindow
from .glints import BrightParts, SurfaceParts, least_slopes
from .obstacles import Obstacles

#: RMS height over the wavelength from which on a surface is rough, less what a Roughness in float32
#: is off.
_ROUGH = 0.125 * (1 - 1e-4)
#: RMS slopes from normal incidence within which a face returns most of its echo.
_NEAR = 2.0
#: Difference from the measured level of a curved face that is worth a caution [dB].
_DIFFERS_DB = 1.0
#: Objects that are looked at, the largest first.
_MOST_OBJECTS = 256
#: Normals and heights over the size of the body up to which triangles are in one plane.
_ALIKE, _LEVEL = 1e-4, 1e-5
#: Wavelengths across a face from which on physical optics describes it, and part of the area of its
#: body that a plane face has at least: those of a mesh that stands for a curved body are smaller.
_LEAST_ACROSS, _LEAST_PART = 1.0, 0.03
#: Slope over the RMS slope up to which a part of a curved surface holds the specular point.
_SPECULAR = 1e-3
#: Steps along the sides of parts at which the nearest point is looked for, if there are few parts.
_STEPS, _FEW = 8, 2000


@dataclass(frozen=True)
class _Face:
    """A face near normal incidence: index of its body, RMS slope, cross section of a conductor,
    full width of the beam of its echo, angle from its normal, a place on it, and whether the radar
    is within the beam. The echo of a curved face has a beam of all directions.
    """

    body: int
    slope: float
    rcs_m2: float
    beam_rad: float
    aspect_rad: float
    place_m: Real
    in_beam: bool = True


class SmoothFaces:
    """The largest smooth face of each object in a view, found while the bodies are evaluated.

    Only objects of a single body: instances have one power for all of them.
    """

    def __init__(
        self,
        obstacles: Obstacles,
        receiver: contract.ReceiverRecord,
        transmitter: contract.TransmitterRecord,
        window: ViewWindow,
        carrier_hz: float,
    ) -> None:
        self._wavelength_m = wavelength_m = SPEED_OF_LIGHT_MPS / carrier_hz
        self._eirp_w = transmitter.eirp_w
        poses = (np.array(one.matrix_world, dtype=np.float64) for one in (transmitter, receiver))
        self._antennas_m = [pose[:3, 3] for pose in poses]
        #: By the object's number: cross section [m^2], face, and what `_height_m` says.
        self._faces: dict[int, tuple[float, _Face, float, bool]] = {}
        if receiver.kind == "orthographic":  # its powers tell no cross section
            return
        bodies, shapes = obstacles.bodies, obstacles.bodies.snapshot.shapes
        height = cache(lambda one: _height_m(one, wavelength_m))
        smooth = cache(lambda one: _reflectance(one) > 0 and height(one)[0] < _ROUGH * wavelength_m)
        slope = cache(lambda one: glint_slope(one) if smooth(one) else 0.0)
        slopes = [np.array([slope(one) for one in shape.materials]) for shape in shapes]
        shiny = np.array([bool(np.any(own > 0)) for own in slopes], dtype=bool)[bodies.shape]
        chosen = np.flatnonzero(shiny & (np.bincount(bodies.number)[bodies.number] == 1))
        if not chosen.size:
            return
        search = BrightParts(obstacles, receiver, window, slopes)
        chosen, _ = search.affordable(search.in_view(chosen), _MOST_OBJECTS)
        for shape in np.unique(bodies.shape[chosen]).tolist():
            own = chosen[bodies.shape[chosen] == shape]
            materials = dict(zip(slopes[shape].tolist(), shapes[shape].materials, strict=True))
            for parts in search.candidates(shape, own, self._antennas_m[0]):
                for face in _faces(search, parts, self._antennas_m, wavelength_m):
                    number, material = int(bodies.number[face.body]), materials[face.slope]
                    rcs_m2 = face.rcs_m2 * _reflectance(material)
                    if rcs_m2 > self._faces.get(number, (0.0,))[0]:
                        self._faces[number] = rcs_m2, face, *height(material)

    def findings(self, power_w: Mapping[str, float], names: Sequence[str]) -> list[Finding]:
        """Compare the faces with the received power of objects by name; `names` are those of the
        numbers from 1.
        """
        levels: dict[str, dict[str, float]] = {}
        unknown: dict[str, dict[str, float]] = {}
        for number, (rcs_m2, face, height_m, known) in self._faces.items():
            name = names[number - 1]
            if not power_w.get(name, 0.0) > 0:
                continue
            ways_m2 = math.prod(float(np.sum((face.place_m - m) ** 2)) for m in self._antennas_m)
            scale = (4 * math.pi) ** 3 * ways_m2 / (self._eirp_w * self._wavelength_m**2)
            expected_dbsm, measured_dbsm = (
                10 * math.log10(one) for one in (rcs_m2, power_w[name] * scale)
            )
            curved = face.beam_rad == math.pi
            # Right for curved faces, all of whose lobe returns: the optical limit. A plane is right
            # by chance, but if its height is unknown it does not matter which level it has.
            if (curved or (face.in_beam and not known)) and (
                abs(expected_dbsm - measured_dbsm) < _DIFFERS_DB
            ):
                continue
            (levels if known else unknown)[name] = {
                "height_m": height_m,
                "eighth_m": self._wavelength_m / 8,
                "aspect_deg": math.degrees(face.aspect_rad),
                "beam_deg": math.degrees(face.beam_rad),
                "measured_dbsm": measured_dbsm,
                "expected_dbsm": expected_dbsm,
            }
        findings = []
        if levels:
            findings.append(finding_about("smooth-face-level", levels))
        if unknown:
            findings.append(finding_about("face-height-unknown", unknown))
        return findings


def _height_m(material: Any, wavelength_m: float) -> tuple[float, bool]:
    """RMS height of a surface [m], and whether it is known; else the least one of its slope."""
    surface = surface_of(material)
    if surface is not None and surface.rms_height_m > 0:
        return surface.rms_height_m, True
    return float(least_rms_height_m(glint_slope(material), wavelength_m)), False


def _reflectance(material: Any) -> float:
    """Fraction of the power that the lobe of a Radar Material reflects at normal incidence; 0 for
    materials made for light, and where nodes set the index.
    """
    n, kappa, share = (group_input(material, one) for one in (INDEX, EXTINCTION, SPECULARITY))
    if n is None or kappa is None:
        return 0.0
    index = complex(n.default_value, kappa.default_value)
    found = float(unpolarised_reflectance(index, 1.0))
    return found if share is None else found * float(share.default_value)


def _faces(
    search: BrightParts, parts: SurfaceParts, antennas_m: list[Real], wavelength_m: float
) -> Iterator[_Face]:
    """Yield the faces of physical optics among parts of bodies."""
    slopes, facing = search.slopes_of(parts, antennas_m[0])
    parts, slopes = parts.take(facing), slopes[facing]
    tangents, places_m = _nearest(search, parts, slopes)
    near = tangents <= _NEAR * parts.slope
    for plane in _planes(parts):
        first = int(plane[np.argmin(tangents[plane])])
        area_m2, lengths_m = _size(parts.corners_m[plane])
        small = lengths_m.min() < _LEAST_ACROSS * wavelength_m
        body = int(parts.body[first])
        if not near[first] or small or area_m2 < _LEAST_PART * search.area_m2(body):
            continue
        bends, _ = _bends(parts.corners_m[first], slopes[first])
        beam_rad, aspect_rad = wavelength_m / float(lengths_m.max()), math.atan(tangents[first])
        # A face wider than a Fresnel zone mirrors the radar from any place in front of it.
        mirrors = float(np.min(lengths_m**2) * np.abs(bends).min()) > wavelength_m
        yield _Face(
            body,
            float(parts.slope[first]),
            _level_m2(lengths_m, bends, wavelength_m),
            beam_rad,
            aspect_rad,
            places_m[first],
            mirrors or aspect_rad < beam_rad / 2,
        )
    curved = np.where(parts.flat, np.inf, least_slopes(slopes)) <= _SPECULAR * parts.slope
    for first in np.flatnonzero(curved & near).tolist():
        bends, axes = _bends(parts.corners_m[first], slopes[first])
        body = int(parts.body[first])
        corners_m = parts.corners_m[(parts.body == body) & ~parts.flat].reshape(-1, 3)
        lengths_m = np.ptp(corners_m @ axes.T, axis=0)
        if lengths_m.min() < _LEAST_ACROSS * wavelength_m:
            continue
        rcs_m2 = _level_m2(lengths_m, bends, wavelength_m)
        place_m = places_m[first]
        yield _Face(body, float(parts.slope[first]), rcs_m2, math.pi, 0.0, place_m)


def _level_m2(lengths_m: Real, bends: Real, wavelength_m: float) -> float:
    (first_m, second_m), (first, second) = lengths_m.tolist(), bends.tolist()
    return float(specular_face(first_m, second_m, wavelength_m, first, second))


def _nearest(search: BrightParts, parts: SurfaceParts, slopes: Real) -> tuple[Real, Real]:
    """Least tangent of the angle from normal incidence on each part, as far as points in the view
    tell, (n,), infinite without any; and its place, (n, 3) [m].
    """
    steps = _STEPS if len(slopes) <= _FEW else 3
    numbers = np.array([(i, j) for i in range(steps + 1) for j in range(steps + 1 - i)])
    weights = np.column_stack([numbers, steps - numbers.sum(axis=1)]) / steps
    points_m = np.einsum("wc,nci->nwi", weights, parts.corners_m)
    found = np.linalg.norm(np.einsum("wc,nci->nwi", weights, slopes), axis=2)
    places, ahead = search.project(points_m)
    flat = places.reshape(-1, 2)
    found[~(ahead & search.meets(flat, flat).reshape(ahead.shape))] = np.inf
    best = found.argmin(axis=1)[:, None]
    return (
        np.take_along_axis(found, best, axis=1)[:, 0],
        np.take_along_axis(points_m, best[:, :, None], axis=1)[:, 0],
    )


def _planes(parts: SurfaceParts) -> Iterator[Indices]:
    """Yield the indices of the flat parts of each body that lie in one plane."""
    flat = np.flatnonzero(parts.flat)
    if not flat.size:
        return
    normals, corners_m = parts.normals[flat, 0], parts.corners_m[flat]
    # no common component of normals, as 0 or 1, is next to the limit of two steps
    steps = np.rint(normals / _ALIKE + 0.123)
    height_m = dots(normals, corners_m[:, 0])
    order = np.lexsort((height_m, *steps.T, parts.body[flat]))
    reach_m = np.linalg.norm(corners_m[:, 0] - corners_m[:, 1], axis=1)[order]
    apart = np.any(np.diff(steps[order], axis=0) != 0, axis=1)
    apart |= np.diff(parts.body[flat][order]) != 0
    apart |= np.diff(height_m[order]) > _LEVEL * np.maximum(reach_m[1:], reach_m[:-1])
    yield from np.split(flat[order], np.flatnonzero(apart) + 1)


def _size(corners_m: Real) -> tuple[float, Real]:
    """Area of a plane face [m^2], and the sides of a rectangle of this area and form, (2,) [m]."""
    a, b, c = np.moveaxis(corners_m, 1, 0)
    areas_m2 = norms(crosses(b - a, c - a)) / 2
    area_m2 = float(areas_m2.sum())
    middle_m = areas_m2 @ corners_m.mean(axis=1) / area_m2
    off_m = np.concatenate([corners_m, corners_m.mean(axis=1, keepdims=True)], axis=1) - middle_m
    # second moments of triangles: those of corners, and of the middle with weight 9
    shares = np.array([1.0, 1.0, 1.0, 9.0]) / 12
    moments = np.einsum("n,c,nci,ncj->ij", areas_m2, shares, off_m, off_m) / area_m2
    _, middle, largest = np.linalg.eigvalsh(moments)
    ratio = math.sqrt(math.sqrt(largest / max(middle, 1e-12 * largest)))
    side_m = math.sqrt(area_m2)
    return area_m2, np.array([side_m * ratio, side_m / ratio])


def _bends(corners_m: Real, slopes: Real) -> tuple[Real, Real]:
    """Principal curvatures of slopes that are linear over a triangle, (2,) [1/m]; their axes."""
    sides_m, turned = corners_m[1:] - corners_m[0], slopes[1:] - slopes[0]
    first = sides_m[0] / np.linalg.norm(sides_m[0])
    across = np.cross(*sides_m)
    axes = np.stack([first, np.cross(across / np.linalg.norm(across), first)])
    bend = np.linalg.solve(sides_m @ axes.T, turned @ axes.T)
    bends, turn = np.linalg.eigh((bend + bend.T) / 2)
    return bends, turn.T @ axes
