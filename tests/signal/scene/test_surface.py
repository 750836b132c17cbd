# SPDX-License-Identifier: GPL-3.0-or-later
"""What follows from the numbers of a material."""

from __future__ import annotations

import math
import os
import pickle
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from scipy.special import i0e

from radarsim_addon.errors import ConfigError
from radarsim_addon.signal.scene import (
    Angles,
    Clutter,
    RoughSurface,
    Shader,
    Surface,
    is_conductor,
)

METAL = {"n": 1e4, "kappa": 1e4}
GLASS = {"n": 2.5, "kappa": 0.01}


def simple(**values: Any) -> Surface:
    return Surface("s", "simple", **{**GLASS, "specularity": 0.5, "roughness": 0.3, **values})


def physical(**values: Any) -> Surface:
    numbers = {**GLASS, "roughness": 0.3, "volume": True, "has_clutter_row": True}
    return Surface("p", "physical", **{**numbers, **values})


def sheet(**values: Any) -> Surface:
    return Surface("t", "sheet", **{**GLASS, "thickness": 0.25, **values})


def light(*kinds: str, **inputs: float | None) -> Surface:
    principled = {"Metallic": 0.0, "Base Color": 0.8, "Coat Weight": 0.0, "Coat Roughness": 0.03}
    numbers = {"Roughness": 0.5, "Specular IOR Level": 0.5, **principled, **inputs}
    shaders = tuple(Shader(kind, numbers, 0.8) for kind in kinds)
    return Surface("l", shaders=shaders, output=shaders[0])


EMPTY_SLOT = Surface(is_default=True)


@pytest.mark.parametrize(
    ("surface", "share", "height_m"),
    [
        (simple(roughness=0.003), 0.5, 0.0),
        (simple(roughness=0.005), None, 0.0),
        (simple(roughness=0.0, specularity=0.0), None, 0.0),
        (simple(roughness=0.0, specularity=None), None, 0.0),
        (simple(roughness=0.0, n=None), None, 0.0),
        (physical(roughness=0.009), 1.0, 0.0),
        (physical(roughness=0.011), None, 0.0),
        (physical(roughness=0.0, rough=RoughSurface(2e-3)), 1.0, 2e-3),
        (physical(roughness=None), None, 0.0),
        (sheet(), 1.0, 0.0),
        (sheet(thickness=0.0), None, 0.0),
        (sheet(thickness=math.nan), None, 0.0),
        (sheet(kappa=None), None, 0.0),
        (light("Glossy", Roughness=0.0), None, 0.0),
        (EMPTY_SLOT, None, 0.0),
    ],
)
def test_mirror(surface: Surface, share: float | None, height_m: float) -> None:
    found = surface.mirror
    if share is None:
        assert found is None
        return
    assert found is not None and found.index == complex(2.5, 0.01)
    assert (found.share, found.rms_height_m) == (share, height_m)
    assert found.polarised == (surface.kind != "simple")
    assert found.sheet_wavelengths == (0.25 if surface.kind == "sheet" else 0.0)


@pytest.mark.parametrize(
    ("surface", "like"),
    [
        (simple(roughness=0.003, n=None), True),
        (simple(roughness=0.003, specularity=0.0), False),
        (simple(roughness=None), False),
        (physical(roughness=0.009), True),
        (sheet(kappa=None), True),
        (light("Glossy", Roughness=0.003), True),
        (light("Glossy", Roughness=None), False),
        (light("Mix", "Diffuse", "Glass", Roughness=0.0), True),
        (light("Principled", Roughness=0.0), True),
        (light("Principled", Roughness=0.0, **{"Specular IOR Level": 0.0}), False),
        (light("Principled", Roughness=0.0, Metallic=None, **{"Specular IOR Level": 0.0}), True),
        (light("Principled", **{"Coat Weight": 1.0, "Coat Roughness": 0.0}), True),
        (light("Principled", **{"Coat Weight": 1.0, "Coat Roughness": None}), False),
        (EMPTY_SLOT, False),
    ],
)
def test_what_cycles_takes_for_a_mirror(surface: Surface, like: bool) -> None:
    assert surface.is_mirror_like == like


@pytest.mark.parametrize(
    ("surface", "width", "both_ways"),
    [
        (simple(**METAL, roughness=0.4), 0.16, 0.16),
        (simple(roughness=0.4), 0.16, 0.0),
        (simple(**METAL, specularity=0.0), math.inf, math.inf),
        (simple(**METAL, specularity=None), 0.0, 0.0),
        (simple(**METAL, roughness=0.0), 0.0, 0.0),
        (simple(**METAL, roughness=None), 0.0, 0.0),
        (simple(**METAL, exponent=16), 0.09, 0.0),
        (simple(**METAL, specularity=0.0, exponent=16), 0.25, 0.0),
        (physical(), 0.09, 0.09),
        (physical(roughness=0.0), 0.0, 0.0),
        (physical(roughness=0.0, clutter=Clutter("nrl_sea")), math.inf, math.inf),
        (physical(clutter=Clutter("nrl_sea")), math.inf, 0.0),
        (sheet(), 0.0, 0.0),
        (light("Diffuse", Roughness=None), math.inf, math.inf),
        (light("Principled"), 0.25, 0.0),
        (light("Principled", Roughness=None), 0.0, 0.0),
        (light("Glossy"), 0.0, 0.25),
        (light("Glossy", Normal=None), 0.0, 0.0),
        (light("Glass"), 0.0, 0.0),
        (light("Glossy", "Diffuse"), 0.0, 0.0),
        (EMPTY_SLOT, math.inf, math.inf),
        (Surface("no shader"), 0.0, 0.0),
    ],
)
def test_widths_of_lobes(surface: Surface, width: float, both_ways: float) -> None:
    assert surface.lobe_width == pytest.approx(width)
    assert surface.reciprocal_lobe == pytest.approx(both_ways)


@pytest.mark.parametrize(
    ("surface", "alpha"),
    [
        (simple(), 0.09),
        (simple(specularity=0.0), 0.0),
        (physical(roughness=0.0), 0.0),
        (physical(clutter=Clutter("nrl_sea")), 0.0),
        (light("Principled"), 0.0),  # its diffuse part outshines the lobe
        (light("Principled", **{"Base Color": 0.1}), 0.25),
        (light("Principled", Metallic=1.0), 0.25),
        (light("Mix", "Diffuse", "Glossy"), 0.25),
        (light("Glossy", Roughness=0.003), 0.0),
        (EMPTY_SLOT, 0.0),
    ],
)
def test_slope_of_glints(surface: Surface, alpha: float) -> None:
    assert surface.glint_slope == pytest.approx(alpha / math.sqrt(2))


def test_what_passes() -> None:
    walls = [simple(volume=True), physical(), sheet()]
    assert [one.has_interior for one in walls] == [True, True, False]
    assert [one.is_entered for one in walls] == [False, True, False]
    assert [one.passes_by_polarisation for one in walls] == [False, True, True]
    assert all(one.delays for one in walls)
    shut = [
        physical(volume=False),
        physical(transmissions=(0.0, 0.0)),
        physical(**METAL),
        simple(**METAL, volume=True),
        EMPTY_SLOT,
    ]
    assert not any(one.delays or one.has_interior for one in shut)
    assert physical(transmissions=(0.0, 0.0)).is_opaque
    assert not physical(transmissions=(0.0, None)).is_opaque
    assert not physical(n=None, kappa=1e4).is_opaque
    assert is_conductor(100 + 100j) and not is_conductor(100 + 99j)


def test_reflectance_at_normal_incidence() -> None:
    expected = abs((1 - (2.5 + 0.01j)) / (1 + (2.5 + 0.01j))) ** 2
    assert physical().reflectance == pytest.approx(expected)
    assert simple().reflectance == pytest.approx(expected / 2)
    assert physical(n=None).reflectance == light("Glossy").reflectance == 0


def test_rough_facets() -> None:
    rough = RoughSurface(rms_slope=0.1)
    assert all(one.has_rough_facets for one in (physical(), physical(roughness=None)))
    assert physical(roughness=0.0, rough=rough).has_rough_facets
    assert not any(one.has_rough_facets for one in (physical(roughness=0.0), simple(), sheet()))


def test_slope_and_correlation_length_follow_from_each_other() -> None:
    assert RoughSurface(1e-3, 1e-2).slope == pytest.approx(math.sqrt(2) * 0.1)
    assert RoughSurface(1e-3, 0.0, 0.1).correlation_length == pytest.approx(math.sqrt(2) * 1e-2)
    assert RoughSurface(1e-3).slope == RoughSurface(1e-3).correlation_length == 0


@pytest.mark.parametrize(
    ("surface", "said"),
    [
        (simple(exponent=0), "exponent"),
        (simple(exponent=9, clutter=Clutter("nrl_sea")), "clutter model and a scattered lobe"),
        (simple(exponent=9, specularity=1.0), "below 1"),
        (simple(exponent=9, kappa=None), "whose inputs are numbers"),
        (physical(exponent=9), "RMS height above 0"),
        (physical(exponent=9, roughness=0.0), "RMS height above 0"),
        (
            physical(exponent=9, roughness=0.0, rough=RoughSurface(1e-3), has_clutter_row=False),
            "Clutter Row",
        ),
        (sheet(exponent=9), "without the thickness"),
        (light("Diffuse"), None),
        (Surface("l", exponent=9), "needs a Radar Material"),
    ],
)
def test_directive_lobes_that_cannot_be(surface: Surface, said: str | None) -> None:
    if said is None:
        assert surface.scattered_lobe() is None
        return
    with pytest.raises(ConfigError, match=said):
        surface.scattered_lobe()


def test_directive_lobes() -> None:
    rough = simple(exponent=9).scattered_lobe()
    sharp = simple(exponent=9, roughness=0.0).scattered_lobe()
    assert rough is not None and sharp is not None
    assert (rough.exponent, rough.mirror.share, sharp.mirror.share) == (9, 0.5, 0.5)
    assert rough.alpha == pytest.approx(0.09)
    assert sharp.alpha == 0 and not rough.from_table
    wet = physical(exponent=9, roughness=0.0, rough=RoughSurface(1e-3)).scattered_lobe()
    assert wet is not None and wet.from_table and wet.mirror.rms_height_m == 1e-3
    # what the image loses is scattered (Miller, Brown and Vegh 1984)
    db = wet.rendered_db(np.array([math.pi / 2]), 4e-3)
    lost = 1 - i0e((2 * math.pi / 4e-3 * 1e-3) ** 2 * 2) ** 2
    assert db[0] == pytest.approx(10 * math.log10(4 * lost * physical().reflectance))


def test_a_table_that_changes_is_read_again(tmp_path: Path) -> None:
    table = tmp_path / "sigma0.csv"
    rows = "grazing_deg,sigma0_db\n1,{}\n90,{}\n"
    table.write_text(rows.format(-40, -10))
    clutter = Clutter("table", {}, str(table))
    before, key = clutter.sigma0_db(1e9, np.radians([90.0]), "average"), clutter.key
    table.write_text(rows.format(-40, -20))
    os.utime(table, ns=(1, 1))
    assert before[0] - clutter.sigma0_db(1e9, np.radians([90.0]), "average")[0] == pytest.approx(10)
    assert clutter.key != key


def test_surfaces_can_be_sent_to_other_processes() -> None:
    sent = pickle.loads(pickle.dumps(physical(clutter=Clutter("nrl_sea", {"sea_state": 3.0}))))
    assert sent.clutter.parameters == {"sea_state": 3.0} and sent.lobe_width == math.inf


#: sigma0 / sin(grazing angle) is 0.1; sin(grazing angle) is 0.5.
GAMMA = Clutter("constant_gamma", {"gamma_db": -10.0})


@pytest.mark.parametrize(
    ("surface", "brightness", "guessed"),
    [
        (light("Diffuse"), 4 * 0.8 * 0.5, False),
        (light("Principled"), 4 * 0.8 * 0.5, True),
        (light("Glossy"), 4 * 0.5 * 0.5, True),
        (EMPTY_SLOT, 4 * 0.8 * 0.5, False),
        (sheet(), 0.0, False),
        # F = |(n - 1) / (n + 1)|^2 = 1/9 at normal incidence; a mirror returns nothing
        (physical(n=2.0, kappa=0.0, roughness=0.0), 0.0, False),
        (simple(roughness=0.003, specularity=1.0), 0.0, False),
        (physical(roughness=0.0, clutter=GAMMA), 0.1 * 0.5 / 0.25, False),
        (physical(roughness=None, unlinked={"roughness": 0.0}, clutter=GAMMA), 0.2, True),
        # 1e4 (1 + j) reflects all but 1e-4
        (simple(**METAL, specularity=0.0), 4 * 0.5, False),
        (simple(**METAL, specularity=None, unlinked={"specularity": 0.0}), 4 * 0.5, True),
    ],
)
def test_brightness(surface: Surface, brightness: float, guessed: bool) -> None:
    half = np.array([0.5])
    angles = Angles(half, half, half, np.ones(1), np.array([0.25]))
    found = surface.brightness(angles, 10e9, "average")
    np.testing.assert_allclose(found, [brightness], rtol=1e-3)
    assert surface.is_guessed == guessed


def test_rough_facets_are_brightest_where_they_mirror_to_the_receiver() -> None:
    """At normal incidence on both, pi D F = F / alpha^2: alpha = roughness^2."""
    ones = np.ones(1)
    there = Angles(ones, ones, ones, ones, ones)
    found = physical(n=2.0, kappa=0.0, roughness=0.5).brightness(there, 10e9, "average")
    np.testing.assert_allclose(found, [1 / 9 / 0.5**4], rtol=1e-6)
    found = simple(n=2.0, kappa=0.0, roughness=0.5).brightness(there, 10e9, "average")
    np.testing.assert_allclose(found, [1 / 9 * (0.5 / 0.5**4 + 0.5 * 4)], rtol=1e-6)
