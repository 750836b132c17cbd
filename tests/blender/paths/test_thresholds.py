# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits are crossed: just below and just above."""

from __future__ import annotations

import math
from collections.abc import Callable
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest

pytest.importorskip("bpy")


from radarsim_addon.blender.paths import (
    clutter_weights,
    error_budget,
    glints,
)
from radarsim_addon.blender.paths.frame import FrameWork
from radarsim_addon.blender.paths.hit_points import BodyMeshes, HitPoints
from radarsim_addon.blender.paths.measured_tiles import QualitySums
from radarsim_addon.blender.paths.tiles import Area, Tile, ViewBoxes, lay_in_steps
from radarsim_addon.blender.paths.view_tracer import ViewTracer
from radarsim_addon.blender.plan import PathOptions
from radarsim_addon.blender.views import ViewWindow
from radarsim_addon.signal.paths import PathFlag, PathRows

pytestmark = pytest.mark.blender

FRAME = ViewWindow(0.0, 100.0, 0.0, 100.0, 100, 100)
SIDES = {"left": -1.0, "right": 1.0, "bottom": -1.0, "top": 1.0}
EARTH_M = 4 / 3 * 6_371_000


def camera() -> Any:
    """A receiver at the origin that looks along -Z."""
    return SimpleNamespace(kind="perspective", matrix_world=np.eye(4), **SIDES)


def strong_enough(ratio: float) -> bool:
    cells = error_budget.CellPowers(np.array([1, 2]), np.array([1.0, ratio]), np.zeros(2))
    return 2 in error_budget.ErrorBudget(0, powers={0: cells}).object_errors()


def echoes(ratio: float) -> bool:
    rows = PathRows.zeros(2)
    rows["order"] = rows["length_m"] = rows["solid_angle_sr"] = 1
    rows["power_w"], rows["last_object"] = (1.0, ratio), (1, 2)
    sums = QualitySums()
    sums.add_rows(rows, camera())
    return 2 in sums.echoing


def is_mirrored(angle: float) -> bool:
    back, onward = (np.array([[math.sin(a), 0.0, math.cos(a)]]) for a in (0.0, angle))
    return bool(clutter_weights.is_mirrored((back[:, 2], onward[:, 2]), back, onward)[0])


def curves_away(part: float) -> bool:
    """A level proportional to the sine, of which the Earth takes a part away."""
    lobe: Any = SimpleNamespace(material="Sea", sigma0=lambda sine: sine)
    return bool(
        clutter_weights._curvature(lobe, np.array([0.1]), np.array([2 * EARTH_M * 0.1 * part]))
    )


def box(pixels: float) -> ViewBoxes:
    one = np.ones(1)
    right, top = (10 + pixels) * one, 90 * one
    return ViewBoxes(
        one.astype(int), 10 * one, right, 10 * one, top, one, np.zeros((1, 3)), one, one
    )


def is_large(pixels: float) -> bool:
    return not len(error_budget.small_boxes(box(pixels), FRAME))


def is_surely_hit(pixels: float) -> bool:
    anything: Any = None
    with mock.patch.object(error_budget, "projected_bounds", return_value=box(pixels)):
        return not error_budget.missed_objects_findings(anything, ["Box"], (), anything, FRAME)


def differs(level_db: float) -> bool:
    """A curved face of 1 m^2 at 1 m, for a wavelength of 1 m and an EIRP of 1 W."""
    faces = object.__new__(glints.SmoothFaces)
    faces._wavelength_m = faces._eirp_w = 1.0
    faces._antennas_m = [np.zeros(3)] * 2
    face = glints._Face(0, 0.1, 1.0, math.pi, 0.0, np.array([1.0, 0.0, 0.0]))
    faces._faces = {1: (1.0, face, 1e-3, True)}
    return bool(faces.findings({"Ball": 10 ** (level_db / 10) / (4 * math.pi) ** 3}, ["Ball"]))


def search(window: ViewWindow = FRAME) -> Any:
    """The search for bright parts from the origin along -Z."""
    found: Any = object.__new__(glints.BrightParts)
    found._kind, found._window = "perspective", window
    found._turn, found._place_m = np.eye(3), np.zeros(3)
    found._bodies = SimpleNamespace(number=np.ones(1, int), name=lambda _: "Ball")
    found._box = found.area_m2 = lambda _: 1.0
    return found


def part(slopes: list[tuple[float, float]], across_m: float, flat: bool) -> glints.SurfaceParts:
    """A triangle 100 m ahead of RMS slope 0.05, with these slopes from normal incidence."""
    corners_m = np.array([[[0.0, 0, -100], [across_m, 0, -100], [0, across_m, -100]]])
    normals = -corners_m / np.linalg.norm(corners_m, axis=2)[..., None]
    normals = normals - np.pad(slopes, ((0, 0), (0, 1)))
    normals /= np.linalg.norm(normals, axis=2)[..., None]
    one = np.zeros(1, int)
    return glints.SurfaceParts(corners_m, normals, np.array([0.05]), one, np.array([flat]))


def spots(weight: list[float], deviation: list[float], solid: float, flat: bool) -> Any:
    many = len(weight)
    one, square = np.ones(many), np.tile(1e-6 * np.eye(2), (many, 1, 1))
    low, high = np.full((many, 2), 10.0), np.full((many, 2), 90.0)
    return glints._Spots(
        np.zeros(many, int), one.astype(bool) & flat, low, high, one, np.array(deviation),
        np.array(weight), np.array(weight), low, square, solid / many * one,
    )  # fmt: skip


def is_dark(slopes: float) -> bool:
    window = ViewWindow(-1.0, 1.0, -1.0, 1.0, 100, 100)
    tilted = part([(slopes * 0.05, 0.0)] * 3, 1e-3, True)
    return not any(one.body.size for one in search(window)._spots(tilted, np.zeros(3)))


def asks_for_pixels(weight: float) -> bool:
    """A spot that the view does not resolve, next to one that it does."""
    return bool(search()._glint(spots([1.0, weight], [10.0, 0.1], 1.0, False)))


def fills_its_box(fraction: float) -> bool:
    """Bright facets of an object, as small as a thousandth of a pixel."""
    return not search()._glint(spots([1.0], [10.0], fraction, True))


def is_facet_resolved(pixels: float) -> bool:
    return not search()._unresolved(spots([1.0], [10.0], pixels**2, True)).body.size


def is_aside(slopes: float) -> bool:
    """A mirroring square of 1 m, that many RMS slopes from normal incidence."""
    window = ViewWindow(-1.0, 1.0, -1.0, 1.0, 100, 100)
    tilted = part([(slopes * 0.05, 0.0)] * 3, 1.0, True)
    return not list(glints._faces(search(window), tilted, [np.zeros(3)] * 2, 0.1))


def misses_the_specular_point(slopes: float) -> bool:
    window = ViewWindow(-1.0, 1.0, -1.0, 1.0, 100, 100)
    least = slopes * 0.05
    bent = part([(least, 0.0), (least + 0.05, 0.02), (least + 0.05, -0.02)], 1.0, False)
    return not list(glints._faces(search(window), bent, [np.zeros(3)] * 2, 0.1))


def refined(order: int, away_m: float, sigma_m: float) -> bool:
    """Whether a path is computed again for a wavelength of 1 m."""
    anything: Any = None
    hits = HitPoints(anything, 1.0, True, anything)
    hits._surfaces = SimpleNamespace(  # type: ignore[assignment]
        hit=lambda bodies, *_: (np.full(bodies.size, np.nan), np.full((bodies.size, 3), np.nan))
    )
    rows = PathRows.zeros(1)
    rows["order"], rows["length_sigma_m"], rows["length_m"] = order, sigma_m, 2 * away_m
    rows["direction"] = [[0, 0, -1]]
    rows["last_scatterer_m"] = rows["first_scatterer_m"] = [[0, 0, -away_m]]
    return bool(hits.refine(rows, np.zeros(3), np.zeros(3))._found)


def is_delayed(order: int, sigmas: float) -> bool:
    """Whether the encoded length of a path from the origin stays: of so many deviations more."""
    anything: Any = None
    hits = HitPoints(anything, 1e-3, True, anything)
    hits._surfaces = SimpleNamespace(  # type: ignore[assignment]
        hit=lambda bodies, *_: (
            np.where(bodies > 0, 1.0, np.nan),
            np.tile([0.0, 0.0, 1.0], (bodies.size, 1)),
        )
    )
    rows = PathRows.zeros(1)
    rows["order"], rows["flags"] = order, PathFlag.ENCODED_LENGTH
    rows["first_body"] = rows["last_body"] = 1
    rows["direction"] = rows["first_scatterer_m"] = [[0, 0, -1]]
    rows["last_scatterer_m"] = [[order - 1, 0, -1]]
    rows["length_sigma_m"] = 1e-3
    rows["length_m"] = {1: 2.0, 2: 2 + math.sqrt(2)}[order] + 1e-3 * sigmas
    hits.refine(rows, np.zeros(3), np.zeros(3))
    return bool(rows["flags"][0])


def is_another_mesh(fraction: float) -> bool:
    """Of 1000 hit points, this fraction is off the mesh."""
    lost = np.arange(1000) < 1000 * fraction
    normals = np.ones((1000, 3))
    mesh = SimpleNamespace(hit=lambda *_: (np.where(lost, np.nan, 1.0), normals.copy()))
    bodies: Any = SimpleNamespace(pose=np.eye(4)[None], shape=np.zeros(1, int))
    anything: Any = None
    meshes: Any = BodyMeshes(bodies, anything)
    meshes._meshes_of = lambda *_: [(mesh, np.zeros(1, int))]
    found, _ = meshes.hit(np.ones(1000, int), np.zeros(3), normals, normals, np.ones(1000))
    return bool(np.isnan(found).all())


def are_apart(fraction: float) -> bool:
    """Antennas this far from one another, over the distance of the farthest surface."""
    extent = SimpleNamespace(from_receiver_m=1.0)
    run = SimpleNamespace(polarising=True, deterministic=True, plan=SimpleNamespace(extent=extent))
    own: Any = SimpleNamespace(
        run=run, receiver=camera(), transmitter_m=np.array([fraction, 0.0, 0.0])
    )
    return ViewTracer._polarised_from(own) == 0


def is_halved(pitch: float) -> bool:
    """Whether a frame measures halves of its only tile, which is of this pitch."""
    tile = Tile(ViewWindow(0.0, 8 * pitch, 0.0, 8 * pitch, 8, 8))
    own: Any = SimpleNamespace(
        _options=PathOptions(max_standard_error=0.1),
        _tiles=SimpleNamespace(tiles={1: SimpleNamespace(tile=tile)}),
        _budget=SimpleNamespace(
            relative_error=lambda: 1.0,
            squared_errors=lambda open_tiles: dict.fromkeys(open_tiles, 1.0),
            worst=lambda open_tiles, _: open_tiles,
        ),
        _seconds=0.0,
        _progress=mock.Mock(),
        _measure=lambda part: iter([part]),
    )
    halves = next(FrameWork._refine(own), None)
    return halves is not None


def is_poor(width: float, end: str) -> bool:
    """A path between two lobes, of which the one at this end is as many times wider."""
    other = {"first": "last", "last": "first"}[end]
    rows = PathRows.zeros(1)
    rows["order"], rows["flags"] = 2, PathFlag.HAS_REVERSE
    rows[f"{end}_body"], rows[f"{other}_body"] = 2, 1
    rows["last_scatterer_m"] = rows["first_scatterer_m"] = [[0, 0, -1]]
    better: Any = object.__new__(clutter_weights.BetterDirection)
    better._together_m, better._opaque = 1.0, True
    better._widths = np.array([0.0, 0.1, 0.1 * width])
    tracer: Any = SimpleNamespace(receiver=camera(), transmitter_m=np.zeros(3))
    return len(better.in_better_direction(rows, tracer)) == {"first": 0, "last": 2}[end]


def spoils_phases(wavelengths: float) -> bool:
    sums = QualitySums()
    sums.total_w = sums._row_w = 1.0
    sums._sigma2_wm2 = wavelengths**2
    return "phase-unreliable" in {one.code for one in sums.findings(1.0)}


def is_divided(pitch: float) -> bool:
    """A tile of this pitch, over a tiny object."""
    window = ViewWindow(0.0, 8 * pitch, 0.0, 8 * pitch, 8, 8)
    area = Area(3.1 * pitch, 3.2 * pitch, 3.1 * pitch, 3.2 * pitch, 1.0)
    return len(lay_in_steps([Tile(window)], [(1e-3 * pitch, area)], window, 64)) > 1


@pytest.mark.parametrize(
    ("crossed", "below", "above"),
    [
        pytest.param(strong_enough, 0.5e-8, 2e-8, id="faintest-cell"),
        pytest.param(echoes, 0.5e-12, 2e-12, id="faintest-echo"),
        pytest.param(lambda a: not is_mirrored(a), 3e-5, 7e-5, id="mirrored-ray"),
        pytest.param(curves_away, 0.08, 0.15, id="flat-earth-0.5-dB"),
        pytest.param(is_large, 7.0, 9.0, id="small-object"),
        pytest.param(is_surely_hit, 1.5, 2.5, id="surely-hit"),
        pytest.param(differs, 0.8, 1.2, id="level-of-a-curved-face"),
        pytest.param(is_dark, 5.8, 6.2, id="reach-of-a-lobe"),
        pytest.param(asks_for_pixels, 0.08, 0.12, id="faint-spot"),
        pytest.param(fills_its_box, 0.28, 0.32, id="facets-in-their-box"),
        pytest.param(is_facet_resolved, 15.0, 17.0, id="large-facets"),
        pytest.param(is_aside, 1.7, 2.3, id="face-aside"),
        pytest.param(misses_the_specular_point, 0.7e-3, 1.4e-3, id="specular-point"),
        # 4 * 4 * 2^-24 * 2 r is 1e-3 at 524 m
        pytest.param(lambda r: refined(1, r, 0.0), 450.0, 600.0, id="length-over-point"),
        pytest.param(lambda s: refined(2, 1.0, s), 4e-5, 6e-5, id="sigmas"),
        pytest.param(lambda x: is_delayed(1, x), 19.0, 21.0, id="delay"),
        pytest.param(lambda x: is_delayed(2, x), 19.0, 21.0, id="delay-between"),
        pytest.param(is_another_mesh, 0.045, 0.055, id="another-mesh"),
        pytest.param(are_apart, 0.009, 0.011, id="one-place"),
        pytest.param(is_halved, 0.9e-6, 1.1e-6, id="finest-pitch-of-halves"),
        pytest.param(lambda w: is_poor(w, "first"), 1.8, 2.2, id="from-a-wide-lobe"),
        pytest.param(lambda w: is_poor(w, "last"), 1.8, 2.2, id="to-a-wide-lobe"),
        pytest.param(spoils_phases, 0.045, 0.055, id="length-error"),
        pytest.param(is_divided, 0.9e-6, 1.1e-6, id="finest-pitch"),
    ],
)
def test_limit_is_crossed(crossed: Callable[[float], bool], below: float, above: float) -> None:
    assert not crossed(below)
    assert crossed(above)
