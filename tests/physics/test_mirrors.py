# SPDX-License-Identifier: GPL-3.0-or-later
"""Polarised waves over mirrors of any tilt, against vectors by hand."""

from __future__ import annotations

import itertools
import math

import numpy as np
import pytest

from radarsim_addon.arrays import Complex, Real
from radarsim_addon.physics.mirrors import (
    MirrorMaterial,
    co_polar,
    reflected_ways,
    sent_fields,
)
from tests.physics.test_fresnel import index_of, reference_rows

#: A conductor: r_s = -1 and r_p = 1.
METAL = MirrorMaterial(complex(1e14, 1e14), 1.0, True)
LOSSY = MirrorMaterial(2.3 + 0.4j, 1.0, True)
EYE = np.eye(3, dtype=np.complex128)


def units(*shape: int, seed: int = 1) -> Real:
    """Random unit vectors (..., 3)."""
    found = np.random.default_rng(seed).normal(size=(*shape, 3))
    return np.asarray(found / np.linalg.norm(found, axis=-1, keepdims=True))


def dyad(mirror: MirrorMaterial, incoming: Real, normal: Real) -> Complex:
    """Matrix of the reflection of one wave, (3, 3): fields along the axes, one by one."""
    fields = mirror.reflect(EYE[:, None], incoming[None], normal, 1.0)
    return np.asarray(fields[:, 0].T)


def over(ways: Real, normals: Real) -> list[Real]:
    """Directions of waves before, between and behind mirrors in a row."""
    found = [ways]
    for normal in normals:
        found.append(reflected_ways(found[-1], normal))
    return found


def through(mirrors: list[MirrorMaterial], ways: Real, normals: Real, polarisation: str) -> Complex:
    """Fields behind mirrors in a row, (k, n, 3)."""
    fields = sent_fields(ways, polarisation)
    for mirror, normal, way in zip(mirrors, normals, over(ways, normals), strict=False):
        fields = mirror.reflect(fields, way, normal, 1.0)
    return fields


def test_a_conductor_reverses_the_field_along_it() -> None:
    """E' = 2 (n . E) n - E: the field along the surface vanishes there."""
    ways, normals = units(40), units(40, seed=2)
    for polarisation in ("horizontal", "vertical"):
        sent = sent_fields(ways, polarisation)
        across = np.sum(sent * normals, axis=-1, keepdims=True)
        found = METAL.reflect(sent, ways, normals, 1.0)
        np.testing.assert_allclose(found, 2 * across * normals - sent, atol=1e-9)
        behind = reflected_ways(ways, normals)
        np.testing.assert_allclose(np.sum(found * behind, axis=-1), 0.0, atol=1e-12)


@pytest.mark.parametrize("tilt_deg", [0.0, 20.0, 45.0, 70.0, 90.0])
@pytest.mark.parametrize("grazing_deg", [0.05, 4.0, 25.0])
def test_conductor_tilted_about_the_line_of_sight(tilt_deg: float, grazing_deg: float) -> None:
    """Field by 2 (n . E) n - E, where level and upright vectors are written out by hand."""
    tilt, grazing = math.radians(tilt_deg), math.radians(grazing_deg)
    normal = np.array([math.sin(tilt), 0.0, math.cos(tilt)])
    way = math.cos(grazing) * np.array([0.0, 1.0, 0.0]) - math.sin(grazing) * normal
    onward = math.cos(grazing) * np.array([0.0, 1.0, 0.0]) + math.sin(grazing) * normal

    def level(u: Real) -> Real:
        return np.array([u[1], -u[0], 0.0]) / math.hypot(u[0], u[1])

    def upright(u: Real) -> Real:
        return np.array([0.0, 0.0, 1.0]) - u[2] * u

    for polarisation, vector in (("horizontal", level), ("vertical", upright)):
        field = vector(way) / np.linalg.norm(vector(way))
        field = 2 * (normal @ field) * normal - field
        kept = float(field @ vector(onward) / np.linalg.norm(vector(onward)))
        found = METAL.reflection(way[None], normal, polarisation, 1.0)
        assert found.power[0] == pytest.approx(kept**2, abs=1e-9)
        assert found.turned[0] == pytest.approx(1 - kept**2, abs=1e-9)
        if abs(kept) > 1e-6:
            assert np.cos(found.phase_rad[0]) == pytest.approx(np.sign(kept), abs=1e-9)
        if grazing_deg < 0.1:  # then it is the doubled angle alone
            sign = 1 if polarisation == "vertical" else -1
            assert kept == pytest.approx(sign * math.cos(2 * tilt), abs=4e-3)


def test_a_dihedral_at_45_degrees_turns_vertical_into_horizontal() -> None:
    """Both faces of a right angle: E'' = 2 (f . E) f - E with the fold f between z and x."""
    fold = np.array([1.0, 0.0, 1.0]) / math.sqrt(2)
    other = np.array([1.0, 0.0, -1.0]) / math.sqrt(2)
    ahead = np.array([0.0, 1.0, 0.0])
    turn = math.radians(31)  # the wave meets the faces at unequal angles
    one = -math.cos(turn) * ahead + math.sin(turn) * other
    two = -math.sin(turn) * ahead - math.cos(turn) * other
    found = through([METAL, METAL], ahead[None], [one, two], "vertical")
    np.testing.assert_allclose(over(ahead[None], [one, two])[-1][0], -ahead, atol=1e-12)
    np.testing.assert_allclose(2 * fold[2] * fold - np.eye(3)[2], [1, 0, 0], atol=1e-12)
    np.testing.assert_allclose(found[0, 0], [1, 0, 0], atol=1e-9)
    assert co_polar(found, -ahead[None], "vertical").power[0] < 1e-18
    # and back over the fold as it was sent: the fold along z keeps both
    for polarisation, sign in (("vertical", 1.0), ("horizontal", -1.0)):
        x, y = np.array([1.0, 0, 0]), np.array([0.0, 1, 0])
        faces = [(-y - x) / math.sqrt(2), (-y + x) / math.sqrt(2)]
        kept = through([METAL, METAL], ahead[None], faces, polarisation)
        np.testing.assert_allclose(kept, sign * sent_fields(ahead[None], polarisation), atol=1e-9)


def test_two_conductors_rotate_the_field_with_the_wave() -> None:
    """Reflections at two planes are a rotation by twice the angle between their normals."""
    ways, normals = units(30, seed=3), units(2, 30, seed=4)
    found = through([METAL, METAL], ways, normals, "vertical")
    axis = np.cross(*normals)
    sine = np.linalg.norm(axis, axis=-1)
    axis /= sine[:, None]
    turn = 2 * np.arctan2(sine, np.sum(normals[0] * normals[1], axis=-1))

    def rotated(v: Real) -> Real:
        c, s = np.cos(turn)[:, None], np.sin(turn)[:, None]
        along = np.sum(axis * v, axis=-1, keepdims=True) * axis
        return np.asarray(along + c * (v - along) + s * np.cross(axis, v))

    np.testing.assert_allclose(over(ways, normals)[-1], rotated(ways), atol=1e-12)
    np.testing.assert_allclose(found[0], rotated(sent_fields(ways, "vertical")[0].real), atol=1e-8)


def test_two_tilted_mirrors_give_back_what_one_takes() -> None:
    """One at 45 degrees turns all into the other polarisation, the second one turns it back."""
    way, normal = np.array([[0.0, 1.0, 0.0]]), np.array([1.0, 0.0, 1.0]) / math.sqrt(2)
    grazing = way - 1e-4 * normal
    grazing /= np.linalg.norm(grazing)
    alone = METAL.reflection(grazing, normal, "vertical", 1.0)
    assert alone.power[0] < 1e-6
    both = through([METAL, METAL], grazing, [normal, -normal], "vertical")
    assert co_polar(both, grazing, "vertical").power[0] == pytest.approx(1.0, abs=1e-6)


@pytest.mark.parametrize("polarisation", ["horizontal", "vertical", "average"])
def test_lossless_mirrors_keep_the_power(polarisation: str) -> None:
    ways, normals = units(50, seed=5), units(3, 50, seed=6)
    fields = through([METAL] * 3, ways, normals, polarisation)
    found = co_polar(fields, over(ways, normals)[-1], polarisation)
    np.testing.assert_allclose(found.power + found.turned, 1.0, atol=1e-9)
    assert found.power.min() < 0.1
    assert found.power.max() > 0.9
    lossy = LOSSY.reflection(ways, normals[0], polarisation, 1.0)
    assert np.all(lossy.power + lossy.turned < 1)


def test_coefficients_are_the_tabulated_ones(subtests: pytest.Subtests) -> None:
    """Field across the plane of incidence by r_s, in it by r_p, for a plane of any direction."""
    for row in reference_rows():
        with subtests.test(f"{row['case']}-{row['inc_deg']}"):
            normal, across = np.linalg.qr(np.random.default_rng(13).normal(size=(3, 3)))[0][:2]
            along, angle = np.cross(across, normal), math.radians(float(row["inc_deg"]))
            way = math.sin(angle) * along - math.cos(angle) * normal
            onward = math.sin(angle) * along + math.cos(angle) * normal
            matrix = dyad(MirrorMaterial(index_of(row["case"]), 1.0, True), way, normal)
            r_s, r_p = (complex(float(row[f"{n}_re"]), float(row[f"{n}_im"])) for n in ("rs", "rp"))
            expected = r_s * np.outer(across, across)
            expected = expected + r_p * np.outer(np.cross(onward, across), np.cross(way, across))
            np.testing.assert_allclose(matrix, expected, atol=2e-10)
            np.testing.assert_allclose(matrix @ way, 0.0, atol=1e-12)


@pytest.mark.parametrize(
    "polarisations", list(itertools.product(("horizontal", "vertical"), repeat=2))
)
def test_reciprocity(polarisations: tuple[str, str]) -> None:
    """From an antenna over lossy mirrors to another one, and back with both antennas swapped."""
    mirrors = [LOSSY, METAL, MirrorMaterial(4 + 1j, 0.6, True, 0.02)]
    ways, normals = units(20, seed=7), units(3, 20, seed=8)
    behind = over(ways, normals)[-1]
    there = np.sum(
        through(mirrors, ways, normals, polarisations[0])[0]
        * sent_fields(behind, polarisations[1])[0].real,
        axis=-1,
    )
    # the receiver's field is that of a wave it would send: along -behind
    back = through(mirrors[::-1], -behind, normals[::-1], polarisations[1])[0]
    received = np.sum(back * sent_fields(ways, polarisations[0])[0].real, axis=-1)
    sign = 1 if polarisations[1] == "vertical" else -1  # a level vector turns with the wave
    np.testing.assert_allclose(sign * received, there, atol=1e-12)
    assert np.abs(there).max() > 0.05


def test_normal_incidence_is_the_same_for_all_polarisations() -> None:
    normals = units(20, seed=9)
    normals[0] = (0, 0, 1)
    r = (1 - LOSSY.index) / (1 + LOSSY.index)
    for polarisation in ("horizontal", "vertical"):
        sent = sent_fields(-normals, polarisation)
        np.testing.assert_allclose(
            LOSSY.reflect(sent, -normals, normals, 1.0), r * sent, atol=1e-12
        )
    # and the limit towards it
    near = -normals + 1e-7 * units(20, seed=10)
    near /= np.linalg.norm(near, axis=-1, keepdims=True)
    limit = LOSSY.reflection(near, normals, "average", 1.0)
    np.testing.assert_allclose(limit.power + limit.turned, abs(r) ** 2, rtol=1e-6)


def test_average_is_the_mean_of_both_polarisations() -> None:
    ways, normals = units(20, seed=11), units(20, seed=12)
    mean, level, upright = (
        LOSSY.reflection(ways, normals, name, 1.0) for name in ("average", "horizontal", "vertical")
    )
    np.testing.assert_allclose(mean.power, (level.power + upright.power) / 2, rtol=1e-12)
    np.testing.assert_allclose(mean.phase_rad, level.phase_rad, rtol=1e-12)


@pytest.mark.parametrize(("polarisation", "s"), [("vertical", True), ("horizontal", False)])
def test_a_wall_takes_vertical_waves_as_s(polarisation: str, s: bool) -> None:
    """Near Brewster's angle of a lossy wall, where a wrong conjugation shows."""
    index, angle = 2.5 + 0.3j, 1.15
    way = np.array([[math.cos(angle), math.sin(angle), 0.0]])
    root = np.sqrt(index**2 - math.sin(angle) ** 2)
    first = math.cos(angle) * (1 if s else index**2)
    expected = (first - root) / (first + root)
    wall = np.array([-1.0, 0.0, 0.0])
    found = MirrorMaterial(index, 1.0, True).reflection(way, wall, polarisation, 1.0)
    assert found.power[0] == pytest.approx(abs(expected) ** 2, rel=1e-12)
    assert np.exp(1j * found.phase_rad[0]) == pytest.approx(expected / abs(expected), abs=1e-12)


def test_a_part_of_a_rough_surface() -> None:
    """share of the power, and exp(-x) I0(x) of the amplitude."""
    way, up = np.array([[0.6, 0.0, -0.8]]), np.array([0.0, 0.0, 1.0])
    mirror = MirrorMaterial(LOSSY.index, 0.3, False, rms_height_m=0.004)
    smooth = LOSSY.reflection(way, up, "vertical", 0.05).power[0]
    x = 2 * (2 * math.pi * 0.004 * 0.8 / 0.05) ** 2
    expected = 0.3 * smooth * (math.exp(-x) * np.i0(x)) ** 2
    assert mirror.reflection(way, up, "vertical", 0.05).power[0] == pytest.approx(expected)
    # Cycles: smooth, and the mean of both polarisations
    mean = LOSSY.reflection(way, up, "average", 0.05).power[0]
    assert mirror.rendered_power(way, up, "vertical")[0] == pytest.approx(0.3 * mean)
    assert LOSSY.rendered_power(way, up, "vertical")[0] == pytest.approx(smooth)
