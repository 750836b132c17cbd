# SPDX-License-Identifier: GPL-3.0-or-later
"""Directive lobes: walls by effective roughness, and what slight roughness takes from a mirror."""

from __future__ import annotations

import dataclasses
import math

import bpy
import numpy as np

from radarsim_addon import blender as radarsim
from radarsim_addon.arrays import Real
from radarsim_addon.blender import nodes

from .case import Bench, Check, power_check, relative_check, worst_of
from .scenes import EIRP_W, Plate, acquire, add_plate, lambert, new_scene, wavelength

CARRIER_HZ = 9.65e9
INDEX = 2.4 + 0.1j
SCATTERING = 0.9
EXPONENT = 4


def _fresnel(sine: Real) -> Real:
    """Mean reflectance of both polarisations at sines of grazing angles."""
    root = np.sqrt(INDEX**2 - (1 - sine**2))
    h, v = (sine - root) / (sine + root), (INDEX**2 * sine - root) / (INDEX**2 * sine + root)
    return np.asarray((np.abs(h) ** 2 + np.abs(v) ** 2) / 2)


def _norm_sr(exponent: int, cosine: Real) -> Real:
    """Integral of the lobe over the half-space by a product rule over the sphere."""
    x, weights = np.polynomial.legendre.leggauss(200)
    up, weights = (x + 1) / 2, weights / 2
    turn = (np.arange(400) + 0.5) * 2 * np.pi / 400
    angles = np.linspace(0, np.pi / 2, 300)
    across = np.sqrt(1 - up**2)[:, None] * np.cos(turn)
    norms = [
        2 * np.pi
        * np.mean(weights @ ((1 + np.sin(a) * across + np.cos(a) * up[:, None]) / 2) ** exponent)
        for a in angles
    ]  # fmt: skip
    return np.asarray(np.interp(np.arccos(np.minimum(cosine, 1)), angles, norms))


def _scattering(normal: Real, to_source: Real, to_observer: Real) -> Real:
    """Scattered radiance over irradiance of the wall, per steradian."""
    cosine, seen = to_source @ normal, to_observer @ normal
    mirrored = 2 * cosine * seen - np.einsum("...i,...i", to_source, to_observer)
    lobe = ((1 + mirrored) / 2) ** EXPONENT / _norm_sr(EXPONENT, cosine)
    return np.asarray(SCATTERING**2 * _fresnel(cosine) * lobe / seen)


def _wall() -> object:
    material = nodes.make_material(
        "Wall", n=INDEX.real, kappa=INDEX.imag, specularity=1 - SCATTERING**2, roughness=0.0
    )
    radarsim.set_scattered_lobe(material, EXPONENT)
    return material


def directive_walls(bench: Bench) -> list[Check]:
    """Each path of a wall, monostatic and bistatic; second reflections at a wall and a plate."""
    return [
        _paths_of_a_wall(bench, "monostatic", (0.0, 0.0, 0.0)),
        _paths_of_a_wall(bench, "bistatic", (12.0, 3.0, 5.0)),
        *_second_reflections(bench),
    ]


def _paths_of_a_wall(bench: Bench, name: str, site_m: tuple[float, float, float]) -> Check:
    new_scene(12.0, transmitter_m=site_m)
    tilt, spin = math.radians(50.0), math.radians(25.0)
    right = np.array([math.cos(spin), math.sin(spin), 0.0])
    ahead = np.array([-math.sin(spin), math.cos(spin), 0.0])
    back = math.sin(tilt) * ahead + math.cos(tilt) * np.array([0.0, 0.0, 1.0])
    plate = Plate(np.array([3.0, 20.0, 1.0]), 60 * right, 110 * back)
    add_plate("Wall", plate, _wall())
    rows = acquire(bench, 64, 1, carrier_hz=CARRIER_HZ).rows
    way = np.array(site_m) - rows["last_scatterer_m"]
    far = np.linalg.norm(way, axis=1)
    normal = plate.normal if plate.normal @ rows["direction"][0] < 0 else -plate.normal
    to_source = way / far[:, None]
    rows, far, to_source = (one[to_source @ normal > 0] for one in (rows, far, to_source))
    radiance = _scattering(normal, to_source, -rows["direction"]) * (to_source @ normal)
    radiance *= EIRP_W / (4 * math.pi * far**2)
    expected = radiance * rows["solid_angle_sr"] * wavelength(CARRIER_HZ) ** 2 / (4 * math.pi)
    worst = int(np.argmax(np.abs(np.log(rows["power_w"] / expected))))
    check = power_check(
        f"path of a wall with a directive lobe, {name}", float(expected[worst]),
        float(rows["power_w"][worst]), 0.01, "effective roughness, lobe integrated by quadrature",
    )  # fmt: skip
    return dataclasses.replace(check, points=rows.size)


def _second_reflections(bench: Bench) -> list[Check]:
    new_scene(34.0)
    wall = Plate(np.array([0.0, 9.5, -1.0]), np.array([4.0, 0, 0]), np.array([0, 3.0, 0]))
    plate = Plate(np.array([0.0, 12.0, 0.5]), np.array([4.0, 0, 0]), np.array([0, 0, 3.0]))
    add_plate("Wall", wall, _wall())
    add_plate("Plate", plate, lambert(0.6))
    found = acquire(bench, 256, 32, carrier_hz=CARRIER_HZ, max_reflections=2, mirror_images=0)
    rows = found.rows
    onward = rows["last_scatterer_m"] - rows["first_scatterer_m"]
    rising = onward[:, 2] / np.maximum(np.linalg.norm(onward, axis=1), 1e-9)
    mirrored = np.abs(rising + rows["direction"][:, 2]) < 1e-4
    first = rows["first_object"] == found.record.objects.index("Wall") + 1
    chosen = (rows["order"] == 2) & ~(first & mirrored)
    low, low_m2 = wall.nodes(48)
    high, high_m2 = plate.nodes(48)
    low_m, high_m = np.linalg.norm(low, axis=1), np.linalg.norm(high, axis=1)
    between = high[None] - low[:, None]
    d = np.linalg.norm(between, axis=-1)
    up, home, across = np.array([0.0, 0, 1]), -low / low_m[:, None], between / d[..., None]
    # the wall is lit by the radar and seen by the plate, or the other way round
    homes = np.broadcast_to(home[:, None], across.shape)
    kernels = _scattering(up, homes, across), _scattering(up, across, homes)
    rest = 0.6 / math.pi * (high[:, 1] / high_m)[None] * (between[..., 1] / d)
    rest = rest * (across @ up) * (home @ up)[:, None] / (low_m[:, None] * high_m[None] * d) ** 2
    level = EIRP_W / (4 * math.pi) * wavelength(CARRIER_HZ) ** 2 / (4 * math.pi)
    powers = [
        np.array([
            rows["power_w"][chosen & mine & (rows["replicate"] == one)].sum()
            for one in range(found.record.replicates)
        ])
        for mine in (~first, first)
    ]  # fmt: skip
    return [
        power_check(
            f"order 2, a plate and a wall with a directive lobe, {name} first",
            level * float(np.einsum("ij,i,j", kernel * rest, low_m2, high_m2)),
            float(each.sum()),
            0.2,
            "integral over both surfaces",
            relative_error=float(each.std(ddof=1) * math.sqrt(each.size) / each.sum()),
        )
        for name, kernel, each in zip(("plate", "wall"), kernels, powers, strict=True)
    ]


def rough_mirrors(bench: Bench) -> list[Check]:
    """Power of the lobe over all directions, and of the image, for a conductor of slight roughness.

    The receiver stands close above the mirror, the transmitter far away: each path has another
    direction away from the mirror and the same angle of incidence.
    """
    checks = []
    for exponent in (10, 100):
        found = []
        for incidence_deg, roughness in ((30, 0.1), (30, 0.5), (30, 1.0), (30, 2.0), (60, 1.0)):
            share = _scattered_share(bench, exponent, incidence_deg, roughness)
            x = 2 * roughness**2
            coherent = (math.exp(-x) * float(np.i0(x))) ** 2
            label = f"k h cos {roughness:g}, {incidence_deg} deg"
            source = "the smooth mirror reflects all"
            found.append(relative_check(label, 1.0, share + coherent, 0.01, source))
        checks.append(worst_of(f"image and lobe of a rough mirror, exponent {exponent}", found))
    return checks


def _scattered_share(bench: Bench, exponent: int, incidence_deg: float, roughness: float) -> float:
    """Scattered part of the power that falls on a rough mirror."""
    angle, far_m = math.radians(incidence_deg), 20e3
    site = far_m * np.array([0.0, math.sin(angle), math.cos(angle)])
    new_scene(12.0, transmitter_m=site.tolist())
    camera = bpy.context.scene.camera.data
    camera.type = "PANO"
    view = camera if hasattr(camera, "panorama_type") else camera.cycles
    view.panorama_type = "EQUIRECTANGULAR"
    view.longitude_min, view.longitude_max = -math.pi, math.pi
    view.latitude_min, view.latitude_max = -math.pi / 2, 0.0
    length_m = wavelength(CARRIER_HZ)
    height_m = roughness * length_m / (2 * math.pi * math.cos(angle))
    material = radarsim.material("metal", rms_height_m=height_m)
    radarsim.set_scattered_lobe(material, exponent)
    spin = math.radians(20.0)
    u = np.array([math.cos(spin), math.sin(spin), 0.0])
    v = np.array([-math.sin(spin), math.cos(spin), 0.0])
    add_plate("Mirror", Plate(np.array([0.013, 0.007, -1.0]), 300 * u, 300 * v), material)
    rows = acquire(bench, 160, 1, height_px=80, carrier_hz=CARRIER_HZ).rows
    way = site - rows["last_scatterer_m"]
    far = np.linalg.norm(way, axis=1)
    irradiance = EIRP_W * way[:, 2] / (4 * math.pi * far**3)
    sine = -rows["direction"][:, 2]
    received = rows["power_w"] * 4 * math.pi / length_m**2
    return float(np.sum(received * sine / irradiance))
