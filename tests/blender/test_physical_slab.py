# SPDX-License-Identifier: GPL-3.0-or-later
"""Straight through layers of physical materials, against the plane-parallel closed form."""

from __future__ import annotations

import math

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.physics.materials import material  # noqa: E402
from radarsim_addon.physics.slab import excess_path_m, slab_power  # noqa: E402
from tests.blender import slab_scene as ss  # noqa: E402

pytestmark = pytest.mark.blender

WAVELENGTH = 0.0566


def decibels(ratio: np.ndarray) -> np.ndarray:
    return np.abs(10 * np.log10(ratio))


@pytest.mark.parametrize("angle", [0, 30, 60])
@pytest.mark.parametrize(
    ("index", "thickness"),
    [(2.3, 0.2), (2.2926 + 0.1259j, 0.05), (1.05 + 0.001j, 0.2), (6.1 + 1.9j, 0.008)],
)
def test_slab_both_ways(index: complex, thickness: float, angle: float) -> None:
    """Power within 0.005 dB, optical delay within 1e-6 of the path."""
    found = ss.cross(complex(index), thickness, angle, WAVELENGTH)
    slab = slab_power(index, thickness, WAVELENGTH, found.cosine, "single-pass")
    # One way the mean of both polarisations; both ways the co-polar echo of a radar slanted 45
    # degrees to the plane of incidence.
    assert decibels(found.power / slab.transmitted**2).max() < 5e-3
    delay = excess_path_m(index, thickness, found.cosine)
    assert np.abs(found.extra - delay).max() < 1e-6 * ss.WALL


@pytest.mark.parametrize(("polarisation", "angle"), [(1, 30), (1, 60), (2, 30), (2, 60)])
def test_vertical_and_horizontal(polarisation: int, angle: float) -> None:
    """The plane of incidence is level: vertical is across it (s), horizontal in it (p)."""
    index = complex(material("concrete", 5.3e9))
    found = ss.cross(index, 0.05, angle, WAVELENGTH, polarisation)
    slab = slab_power(index, 0.05, WAVELENGTH, found.cosine, "single-pass")
    one_way = slab.transmitted_s if polarisation == 1 else slab.transmitted_p
    # Rays half a degree off the level plane mix a little of the other one in.
    assert decibels(found.power / one_way**2).max() < 2e-3
    other = slab.transmitted_p if polarisation == 1 else slab.transmitted_s
    assert decibels(found.power / other**2).min() > 0.5


@pytest.mark.parametrize("carrier_hz", [1e9, 5.3e9, 24e9, 77e9])
@pytest.mark.parametrize("loss_db", [20.0, 90.0])
def test_plate_behind_concrete(carrier_hz: float, loss_db: float) -> None:
    """20 to 90 dB both ways through walls of ITU-R P.2040-3 concrete, at 30 degrees."""
    index = complex(material("concrete", carrier_hz))
    wavelength = 299_792_458.0 / carrier_hz
    q = np.sqrt(index**2 - 1 + 0.75)
    faces = slab_power(index, 1e-9, wavelength, math.sqrt(0.75), "incoherent").transmitted
    absorbed = loss_db + 20 * math.log10(float(faces))
    thickness = absorbed * math.log(10) / 20 * wavelength / (4 * math.pi * q.imag)
    assert thickness < 4  # what fits between radar and wall
    found = ss.cross(index, thickness, 30, wavelength)
    slab = slab_power(index, thickness, wavelength, found.cosine, "single-pass")
    assert decibels(slab.transmitted**2).mean() == pytest.approx(loss_db, abs=1.5)
    assert decibels(found.power / slab.transmitted**2).max() < 0.02
    delay = excess_path_m(index, thickness, found.cosine)
    assert np.abs(found.extra - delay).max() < 1e-5 * ss.WALL


def test_100_db_both_ways() -> None:
    """Every supported Blender carries 100 dB; 4.5 and before end at about 120 dB."""
    index = 2.2926 + 0.1259j
    thickness = 0.373
    found = ss.cross(index, thickness, 0, WAVELENGTH)
    slab = slab_power(index, thickness, WAVELENGTH, found.cosine, "single-pass")
    assert decibels(slab.transmitted**2).mean() == pytest.approx(100, abs=10)
    assert decibels(found.power / slab.transmitted**2).max() < 0.02
