# SPDX-License-Identifier: GPL-3.0-or-later
"""Specular points smaller than a pixel: right power with few pixels, others are named."""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon import blender as radarsim
from radarsim_addon import signal
from radarsim_addon.blender.paths import frame, glints
from radarsim_addon.signal.detection import object_echoes
from scripts.validation import scenes
from scripts.validation.closed_forms import kirchhoff_coefficient, power_over, sphere_power
from tests.blender import path_helpers as ph

pytestmark = [pytest.mark.blender, pytest.mark.slow]

INDEX = 9 + 3j
LIT = abs((INDEX - 1) / (INDEX + 1)) ** 2


def rough_sphere(place: tuple[float, float, float], radius: float, slope: float) -> Any:
    return scenes.add_sphere("Ball", place, radius, scenes.metallic(INDEX, slope), subdivisions=5)


def power_dbw(run: ph.PathRun) -> tuple[float, float]:
    """Received power, and its relative standard error."""
    rows, count = run.table(), run.record().replicates
    parts = count * np.bincount(rows["replicate"], rows["power_w"], count)
    return 10 * math.log10(parts.mean()), parts.std(ddof=1) / math.sqrt(count) / parts.mean()


@pytest.mark.parametrize(
    ("slope", "radius", "range_m", "fov_deg"),
    [(0.05, 0.3, 20.0, 90.0), (0.1, 0.3, 20.0, 90.0), (0.2, 0.3, 20.0, 90.0),
     (0.01, 0.05, 300.0, 40.0), (0.15, 1.5, 6.0, 60.0)],
)  # fmt: skip
def test_few_pixels_give_the_power_of_a_rough_sphere(
    tmp_path: Path, slope: float, radius: float, range_m: float, fov_deg: float
) -> None:
    """Against the integral of the Kirchhoff model; far away it is |Gamma|^2 pi a^2."""
    scenes.new_scene(fov_deg, metres_per_unit=0.1 if radius > 1 else 1.0)
    rough_sphere((0, range_m, 0), radius, slope)
    run = ph.run_paths(tmp_path, width_px=16, height_px=16, options={"replicates": 4})
    measured_dbw, error = power_dbw(run)
    expected_w = sphere_power(range_m, radius, kirchhoff_coefficient(INDEX, slope))
    assert measured_dbw == pytest.approx(10 * math.log10(expected_w), abs=0.1)
    assert error < 0.02
    if slope <= 0.05 and radius < 0.1 * range_m:
        optical_w = LIT * math.pi * radius**2 * scenes.EIRP_W * scenes.wavelength() ** 2
        optical_w /= (4 * math.pi) ** 3 * (range_m - radius) ** 4
        optical_w *= 1 / (1 + radius / (range_m - radius)) ** 2  # spreading at a finite range
        assert measured_dbw == pytest.approx(10 * math.log10(optical_w), abs=0.1)
    assert run.record().tiles > 1


def test_separate_antennas(tmp_path: Path) -> None:
    """The specular point lies half way between the antennas: pi a^2 for any angle between them."""
    radius, place = 0.2, np.array([1.0, 30.0, 2.0])
    lamp = np.array([25.0, 10.0, 5.0])
    scenes.new_scene(70.0, transmitter_m=lamp.tolist())
    rough_sphere(tuple(place), radius, 0.02)
    run = ph.run_paths(tmp_path, width_px=16, height_px=16, options={"replicates": 4})
    measured_dbw, error = power_dbw(run)
    towards = [one / np.linalg.norm(one) for one in (-place, lamp - place)]
    bisector = sum(towards) / np.linalg.norm(sum(towards))
    point = place + radius * bisector
    cosine = float(towards[0] @ bisector)
    fresnel = np.mean([abs(one) ** 2 for one in _fresnel(cosine)])
    ways = [np.linalg.norm(point), np.linalg.norm(lamp - point)]
    # astigmatic spreading of a sphere: sigma = pi a^2 for both far away, less near by
    near = sum(1 / way for way in ways)
    spread = 1 / ((1 + radius * cosine * near / 2) * (1 + radius / cosine * near / 2))
    sigma = math.pi * radius**2 * fresnel * spread
    expected = scenes.EIRP_W * scenes.wavelength() ** 2 * sigma / (4 * math.pi) ** 3
    expected /= (ways[0] * ways[1]) ** 2
    assert measured_dbw == pytest.approx(10 * math.log10(expected), abs=0.15)
    assert error < 0.02


def _fresnel(cosine: float) -> tuple[complex, complex]:
    q = np.sqrt(INDEX**2 - 1 + cosine**2)
    return (cosine - q) / (cosine + q), (INDEX**2 * cosine - q) / (INDEX**2 * cosine + q)


def test_panorama_finds_glints_behind_and_at_the_seam(tmp_path: Path) -> None:
    scenes.new_scene(90.0)
    camera = bpy.context.scene.camera or next(o for o in bpy.data.objects if o.type == "CAMERA")
    camera.data.type, camera.data.panorama_type = "PANO", "EQUIRECTANGULAR"
    places = [(0.0, -20.0, 0.3), (14.0, 3.0, 14.0)]
    for place in places:
        rough_sphere(place, 0.3, 0.05)
    run = ph.run_paths(tmp_path, width_px=64, height_px=32, options={"replicates": 4})
    measured_dbw, error = power_dbw(run)
    model = kirchhoff_coefficient(INDEX, 0.05)
    expected_w = sum(sphere_power(float(np.linalg.norm(one)), 0.3, model) for one in places)
    assert measured_dbw == pytest.approx(10 * math.log10(expected_w), abs=0.1)
    assert error < 0.02


def test_long_glint_of_an_oblique_cylinder(tmp_path: Path) -> None:
    """Against the integral over the cylinder; its spot is 5 mm wide and crosses the view."""
    radius, length, range_m, slope = 0.1, 2.0, 20.0, 0.05
    scenes.new_scene(60.0)
    bpy.ops.mesh.primitive_cylinder_add(
        radius=radius, depth=length, vertices=256, end_fill_type="NOTHING",
        location=(0, range_m, 0), rotation=(0, math.radians(35), 0),
    )  # fmt: skip
    bpy.ops.object.shade_smooth()
    bpy.context.object.data.materials.append(scenes.metallic(INDEX, slope))
    run = ph.run_paths(tmp_path, width_px=32, height_px=32, options={"replicates": 4})
    measured_dbw, error = power_dbw(run)
    angle, along = np.meshgrid(
        (np.arange(2000) + 0.5) / 2000 * math.pi, (np.arange(200) - 99.5) / 200 * length
    )
    axis = np.array([math.sin(math.radians(35)), 0.0, math.cos(math.radians(35))])
    across = np.array([math.cos(math.radians(35)), 0.0, -math.sin(math.radians(35))])
    normals = np.cos(angle)[..., None] * across - np.sin(angle)[..., None] * np.array([0, 1.0, 0])
    points = radius * normals + along[..., None] * axis + np.array([0.0, range_m, 0.0])
    weights = np.full(angle.size, math.pi / 2000 * radius * length / 200)
    model = kirchhoff_coefficient(INDEX, slope)
    expected_w = power_over(points.reshape(-1, 3), weights, normals.reshape(-1, 3), model)
    assert measured_dbw == pytest.approx(10 * math.log10(expected_w), abs=0.1)
    assert error < 0.02


def test_flat_facets_are_as_bright_as_the_smooth_sphere(tmp_path: Path) -> None:
    """Facets of 3 degrees in a lobe of 0.1: their edges average out."""
    scenes.new_scene(90.0)
    ball = rough_sphere((0.2, 20, 0.1), 0.3, 0.1)
    ball.data.polygons.foreach_set("use_smooth", [False] * len(ball.data.polygons))
    run = ph.run_paths(tmp_path, width_px=16, height_px=16, options={"replicates": 4})
    measured_dbw, error = power_dbw(run)
    expected_w = sphere_power(20.0, 0.3, kirchhoff_coefficient(INDEX, 0.1))
    assert measured_dbw == pytest.approx(10 * math.log10(expected_w), abs=0.4)
    assert error < 0.1


@pytest.mark.parametrize("kind", ["diffuse", "box", "resolved"])
def test_without_a_glint_nothing_is_added(tmp_path: Path, kind: str) -> None:
    scenes.new_scene(60.0)
    if kind == "diffuse":
        scenes.add_sphere("Ball", (0, 20, 0), 0.3, scenes.lambert(0.5), subdivisions=3)
    elif kind == "box":
        scenes.add_box("Box", (-1, 19, -1), (1, 21, 1), scenes.metallic(INDEX, 0.2))
    else:
        rough_sphere((0, 20, 0), 8.0, 0.2)
    run = ph.run_paths(tmp_path, width_px=64, height_px=64, options={"replicates": 2})
    assert run.record().tiles == 1


def test_strongest_glints_come_first_and_others_are_named(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(glints, "MOST_GLINTS", 1)
    scenes.new_scene(60.0)
    near = rough_sphere((1, 20, 0), 0.3, 0.05)
    near.name = "Near"
    far = rough_sphere((-5, 60, 0), 0.3, 0.05)
    far.name = "Far"
    run = ph.run_paths(tmp_path, width_px=16, height_px=16, options={"replicates": 2})
    (found,) = [one for one in run.record().findings if one.code == "glints-left-out"]
    assert found.subjects == ("Far",)
    assert found.numbers == {"count": 1, "traced": 1}
    echoes = {one.name: one for one in object_echoes(signal.open_run(tmp_path).frame(1), 5.3e9)}
    assert echoes["Near"].rcs_dbsm == pytest.approx(10 * math.log10(LIT * math.pi * 0.09), abs=0.3)


def test_uncertain_power_is_a_caution_in_lists_and_pictures(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(frame, "find_glints", lambda *_: ([], []))
    scenes.new_scene(90.0)
    rough_sphere((0.3, 20, 0.2), 0.3, 0.2)
    run = ph.run_paths(tmp_path, width_px=64, height_px=64, options={"replicates": 4})
    (found,) = [one for one in run.record().findings if one.code == "power-uncertain"]
    assert found.severity == "caution"
    assert found.subjects == ("Ball",)
    assert float(found.numbers["stderr_fraction"]) > 0.5  # type: ignore[arg-type]
    assert "caution" in run.job.summary
    (result,) = radarsim.process(tmp_path)
    assert "power-uncertain" in [one.code for one in result.findings]
    assert [line for line in result.budget.lines() if "%, uncertain" in line]
    assert result.budget.uncertain_text == "power of Ball uncertain"
    (ball,) = result.budget.objects
    two = [ball, dataclasses.replace(ball, name="Other", power_error_w=0.9999 * ball.power_w)]
    both = dataclasses.replace(result.budget, objects=two)
    assert both.uncertain_text == "power of 2 objects uncertain"  # whichever a finding names first
    assert "+- 100 %, uncertain" in "\n".join(both.lines())
