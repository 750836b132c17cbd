# SPDX-License-Identifier: GPL-3.0-or-later
"""Example scenes: the number that each is there for, against its closed form."""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

pytestmark = [pytest.mark.blender, pytest.mark.slow]
C_MPS = 299_792_458.0
ROOT = Path(__file__).resolve().parents[2]
NAMES = ("street", "sea", "drone", "indoor")


@pytest.fixture
def measured(bpy: Any, tmp_path: Path) -> Callable[..., tuple[Any, Any]]:
    """Return what builds an example and measures it: the run, and the result of its frame."""
    from radarsim_addon import blender as radarsim
    from radarsim_addon.signal import ProcessOptions
    from scripts.examples import EXAMPLES
    from scripts.examples.shared import new_scene

    def measure(name: str, hide: str = "", **values: Any) -> tuple[Any, Any]:
        new_scene()
        radar = EXAMPLES[name].build()
        if hide:
            bpy.data.objects[hide].hide_render = True
        run = radarsim.measure(radar, tmp_path / f"{name}{hide}", frames=[1], **values)
        (result,) = radarsim.process(run, ProcessOptions(plots=False, products=False))
        return run, result

    return measure


@pytest.mark.filterwarnings("ignore::UserWarning")  # findings
def test_street(measured: Callable[..., tuple[Any, Any]]) -> None:
    """Range rates of cars: (v - v0) . u, with u towards what is visible of them."""
    from scripts.examples.street import CAR_HALF_WIDTH_M, CARS, OWN_MPS, RADAR_M

    _, result = measured("street", width_px=128, height_px=30, max_reflections=1, pulses=64)
    echoes = {echo.name: echo for echo in result.budget.objects}
    for name, (place, velocity_mps) in CARS.items():
        relative = np.subtract(velocity_mps, OWN_MPS)
        sides = ((-CAR_HALF_WIDTH_M, CAR_HALF_WIDTH_M), (-2.2, 2.2), (0.25, 1.45))
        points = np.stack(np.meshgrid(*(np.linspace(*side, 9) for side in sides)), axis=-1)
        away = (points + place - RADAR_M).reshape(-1, 3)
        rates = away @ relative / np.linalg.norm(away, axis=1)
        assert rates.min() <= echoes[name].range_rate_mps <= rates.max()
        assert np.ptp(rates) < 0.3  # so the bounds are narrow
        cell_mps = abs(result.rd_map.velocity_mps[1] - result.rd_map.velocity_mps[0])
        near = abs(result.rd_map.range_m - echoes[name].range_m) < 1.0
        in_map = result.rd_map.velocity_mps[np.argmax(result.rd_map.power[0][:, near].max(axis=1))]
        if name != "Parked Car":  # the houses have its range, too
            assert abs(in_map - rates.mean()) < cell_mps + np.ptp(rates)
        listed = [
            peak
            for peak in result.moving_targets
            if abs(peak.range_m - echoes[name].range_m) < 1.0
            and abs(peak.velocity_mps - rates.mean()) < cell_mps + np.ptp(rates)
        ]
        assert bool(listed) == any(velocity_mps), name  # the parked car is none
        edges = [edge.peak_range_m for edge in result.edges]
        assert min(abs(np.subtract(edges, echoes[name].range_m))) < 1.0, name
    # others belong to walkers: the ground and the houses are no moving targets
    assert all(
        any(
            abs(peak.range_m - echo.range_m) < 1.0
            for echo in echoes.values()
            if not echo.name.startswith(("House", "Road", "Parked"))
        )
        for peak in result.moving_targets
    )


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_sea(measured: Callable[..., tuple[Any, Any]]) -> None:
    """Power of the sea: NRL's sigma0 over the beam's width; the ship's range and range rate."""
    from radarsim_addon.physics.clutter import clutter_model
    from radarsim_addon.signal import expected_power_profile, make_paths
    from scripts.examples.sea import HEIGHT_M, SEA_STATE, SHIP_MPS, STERN_M

    run, result = measured("sea", max_reflections=1, pulses=8)
    hull = next(echo for echo in result.budget.objects if echo.name == "Hull")
    assert hull.range_m == pytest.approx(math.hypot(STERN_M[1], HEIGHT_M - 2.0), abs=0.3)
    assert hull.range_rate_mps == pytest.approx(SHIP_MPS[1], abs=1e-3)

    found, step_m = result.profile, 0.5
    range_m = np.arange(700.0, 2700.0, step_m) + step_m / 2
    grazing = np.arcsin(HEIGHT_M / range_m)
    sigma0 = 10 ** (
        clutter_model("nrl_sea").sigma0_db(9.41e9, grazing, "horizontal", sea_state=SEA_STATE) / 10
    )
    # Gaussian beam of 1.2 x 25 degrees at half power; the boresight points 1.15 degrees down.
    azimuth, elevation = np.radians(1.2), np.radians(25.0)
    gain = 16 * math.log(2) / (azimuth * elevation)
    off = (grazing - math.atan2(HEIGHT_M, 1000.0)) / elevation
    two_way = gain**2 * np.exp(-8 * math.log(2) * off**2)
    width = azimuth * math.sqrt(math.pi / (8 * math.log(2)))  # of the two-way beam
    power_w = 200.0 * (C_MPS / 9.41e9) ** 2 / (4 * math.pi) ** 3 * two_way * sigma0
    power_w *= width * range_m * step_m / range_m**4
    edges_m = np.arange(700.0, 2701.0, 250.0)
    expected = np.histogram(range_m, edges_m, weights=power_w)[0]
    got = np.histogram(found.range_m, edges_m, weights=found.power)[0]
    point = expected_power_profile(
        make_paths(1.0, 3000.0), run.radar, range_limits_m=(1000.0, 2000.0)
    ).power  # the profile's unit is the peak of a point's response
    error_db = 10 * np.log10(got / (point.sum() / point.max()) / expected)
    assert np.abs(error_db).max() < 0.3, error_db


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_drone(measured: Callable[..., tuple[Any, Any]]) -> None:
    """Doppler of the blade tips: 4 pi f r cos(elevation) / lambda around that of the drone."""
    from radarsim_addon.signal import frame_paths
    from scripts.examples import drone
    from scripts.examples.pictures import spectrogram

    run, result = measured("drone")
    slant_m = math.hypot(drone.DISTANCE_M, drone.HEIGHT_M)
    level = drone.DISTANCE_M / slant_m
    tip_hz = 4 * math.pi * 84.0 * drone.BLADE_M * level / (C_MPS / 24.15e9)
    body_hz = 2 * 4.0 * level / (C_MPS / 24.15e9)
    body = next(echo for echo in result.budget.objects if echo.name == "Drone")
    to_hz = -2 / run.radar.waveform.wavelength_m
    assert to_hz * body.range_rate_mps == pytest.approx(body_hz, rel=0.01)
    doppler_hz = to_hz * frame_paths(run.frame(1)).range_rate_mps - body_hz
    # the outermost ray is up to a pixel, 7.5 of 150 mm, from the end of a blade
    assert 0.95 * tip_hz < doppler_hz.max() < 1.005 * tip_hz
    assert 0.95 * tip_hz < -doppler_hz.min() < 1.005 * tip_hz

    _, rate_mps, db = spectrogram(result)
    strong_hz = to_hz * rate_mps[(db > -30).any(axis=1)] - body_hz
    resolution_hz = 2 * 30e3 / 48  # main lobe of a Hann window of 48 pulses, to its first zero
    assert tip_hz - resolution_hz < strong_hz.max() < tip_hz + resolution_hz
    assert -tip_hz - resolution_hz < strong_hz.min() < -tip_hz + resolution_hz
    # nothing is faster than the tips, down to the window's side lobes
    weak_hz = to_hz * rate_mps[(db > -40).any(axis=1)] - body_hz
    assert np.abs(weak_hz).max() < tip_hz + resolution_hz


@pytest.mark.filterwarnings("ignore::UserWarning")
def test_indoor(measured: Callable[..., tuple[Any, Any]]) -> None:
    """Loss and delay of 0.2 m of concrete: two Fresnel faces, absorption, d (n cos t - cos i)."""
    from scripts.examples.indoor import CABINET_M, CARRIER_HZ, THICKNESS_M

    values = {"width_px": 96, "height_px": 54, "max_reflections": 1}
    through, bare = (
        next(echo for echo in measured("indoor", hide, **values)[1].budget.objects
             if echo.name == "Cabinet")
        for hide in ("", "Wall")
    )  # fmt: skip
    # ITU-R P.2040-3, Table 3: concrete 5.24, 0.0462 f^0.7822 S/m
    conductivity = 0.0462 * (CARRIER_HZ / 1e9) ** 0.7822
    index = np.sqrt(5.24 + 1j * conductivity / (2 * math.pi * CARRIER_HZ * 8.8541878128e-12))
    x, z = np.meshgrid(np.linspace(-0.5, 0.5, 41), np.linspace(-1.0, 0.8, 41))
    cosine = CABINET_M / np.sqrt(CABINET_M**2 + x**2 + z**2)
    inside = np.sqrt(index**2 - 1 + cosine**2)
    r_s = (cosine - inside) / (cosine + inside)
    r_p = (index**2 * cosine - inside) / (index**2 * cosine + inside)
    absorbed = np.exp(-4 * math.pi * CARRIER_HZ / C_MPS * inside.imag * THICKNESS_M)
    once = (np.abs(1 - r_s**2) ** 2 + np.abs(1 - r_p**2) ** 2) / 2 * absorbed
    loss_db = -10 * np.log10(np.mean(once**2))
    assert 28 < loss_db < 32
    assert 10 * math.log10(bare.power_w / through.power_w) == pytest.approx(loss_db, abs=0.05)
    delay_m = float(np.mean(THICKNESS_M * (inside.real - cosine)))
    assert through.range_m - bare.range_m == pytest.approx(delay_m, abs=1e-3)


@pytest.mark.parametrize("name", NAMES)
def test_file_is_what_its_script_makes(bpy: Any, name: str) -> None:
    from scripts.examples import EXAMPLES
    from scripts.examples.shared import new_scene

    new_scene()
    EXAMPLES[name].build()
    bpy.context.scene.frame_set(1)
    made = dict(_contents(bpy))
    path = ROOT / "blend_examples" / f"{name}.blend"
    bpy.ops.wm.open_mainfile(filepath=str(path), use_scripts=False)
    assert dict(_contents(bpy)) == made
    assert path.stat().st_size < 300_000


@pytest.mark.parametrize(
    "path", sorted((ROOT / "blend_examples").glob("*.blend")), ids=lambda path: path.stem
)
def test_blender_4_3_opens_the_file(bpy: Any, path: Path) -> None:
    """Files of Blender 5 have a header that Blender 4.3 does not know."""
    bpy.ops.wm.open_mainfile(filepath=str(path), use_scripts=False)
    assert bpy.data.version < (5, 0, 0)


def _contents(bpy: Any) -> Iterator[tuple[str, Any]]:
    """Yield objects with their places, meshes and keys, and materials."""
    for item in bpy.context.scene.objects:
        yield item.name, tuple(tuple(round(x, 5) for x in row) for row in item.matrix_world)
        if item.type == "MESH":
            yield f"{item.name} mesh", [[round(x, 6) for x in v.co] for v in item.data.vertices]
            yield f"{item.name} slots", [slot.material.name for slot in item.material_slots]
        if item.animation_data:
            yield f"{item.name} keys", tuple(item.animation_data.action.frame_range)
    group = bpy.data.objects["Radar"].radarsim
    values = {key: group.get(key) for key in sorted(group.keys())}
    yield "radar", {key: value for key, value in values.items() if not hasattr(value, "keys")}


@pytest.mark.parametrize("name", NAMES)
def test_readme_shows_the_example(name: str) -> None:
    """A section with its picture, which is small, and its time."""
    text = (ROOT / "blend_examples" / "README.md").read_text("utf-8")
    section = re.search(rf"^## {name}\.blend$(.*?)(?=^## |\Z)", text, re.DOTALL | re.MULTILINE)
    assert section is not None
    assert f"../docs/images/example_{name}.png" in section[1]
    assert "processor second" in section[1]
    assert (ROOT / "docs" / "images" / f"example_{name}.png").stat().st_size < 150_000
