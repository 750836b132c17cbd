# SPDX-License-Identifier: GPL-3.0-or-later
"""Rain, fog, gases and the echo of rain, against an independent code's tables.

Attenuations of weather.csv agree with the package itur 0.4.0; its gases are that package's. Mie
series of dielectric_sphere_mie.csv were summed by another code.
"""

import csv
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.weather import (
    fog_attenuation_db_per_km,
    gas_attenuation_db_per_km,
    rain_attenuation_db_per_km,
    rain_coefficients,
    rain_fall_speeds,
    rain_reflectivity_per_m,
    sphere_backscatter_m2,
)

DATA = Path(__file__).parents[1] / "data"


def _rows(model: str) -> list[dict[str, str]]:
    with open(DATA / "weather.csv", encoding="utf-8") as stream:
        return [row for row in csv.DictReader(stream) if row["model"] == model]


def _rate(row: dict[str, str]) -> float:
    return float(row["parameters"].removeprefix("mm_per_h="))


def test_rain_attenuation_is_that_of_the_recommendation() -> None:
    rows = _rows("rain_attenuation_p838_3")
    assert len(rows) > 20
    names = {"H": "horizontal", "V": "vertical"}
    for row in rows:
        found = rain_attenuation_db_per_km(
            float(row["frequency_ghz"]) * 1e9, _rate(row), names[row["polarisation"]]
        )
        # the table has six digits
        assert found == pytest.approx(float(row["value3"]), rel=5e-6)


def test_average_polarisation_lies_between_the_two() -> None:
    f_hz = np.geomspace(1e9, 1e12, 50)
    horizontal, vertical, mean = (
        rain_attenuation_db_per_km(f_hz, 20.0, one) for one in ("horizontal", "vertical", "average")
    )
    # the mean exponent is weighted by k: up to 2 % beyond them at 3.6 GHz
    assert np.all(mean <= 1.03 * np.maximum(horizontal, vertical))
    assert np.all(mean >= 0.97 * np.minimum(horizontal, vertical))
    k, alpha = rain_coefficients(77e9, "average")
    assert rain_attenuation_db_per_km(77e9, 0.0) == 0.0
    assert rain_attenuation_db_per_km(77e9, 3.0) == pytest.approx(k * 3.0**alpha, rel=1e-12)
    # P.838-3 at 45 degrees of tilt: k is the mean, and k alpha is the mean of both products
    (k_h, alpha_h), (k_v, alpha_v) = (
        rain_coefficients(5.3e9, one) for one in ("horizontal", "vertical")
    )
    k, alpha = rain_coefficients(5.3e9, "average")
    assert k == pytest.approx((0.000306925 + 0.000274135) / 2, rel=5e-6)
    assert k * alpha == pytest.approx((k_h * alpha_h + k_v * alpha_v) / 2, rel=1e-12)


def test_gases_are_the_sum_over_their_lines() -> None:
    rows = _rows("gas_p676")
    assert len(rows) == 4
    for row in rows:
        expected = float(row["value1"]) + float(row["value2"])
        found = gas_attenuation_db_per_km(float(row["frequency_ghz"]) * 1e9)
        assert found == pytest.approx(expected, rel=1e-9)
        dry = gas_attenuation_db_per_km(float(row["frequency_ghz"]) * 1e9, vapour_g_per_m3=0.0)
        # vapour widens oxygen's lines a little
        assert dry == pytest.approx(float(row["value2"]), rel=2e-2)


@pytest.mark.parametrize("temperature_c", [-20.0, 40.0])
def test_a_little_vapour_absorbs_at_its_first_line_by_its_pressure(temperature_c: float) -> None:
    """P.676-12, eq. (3) to (6) and the first row of table 2, in thin air: no other line counts."""
    f_ghz, dry_hpa, kelvin = 22.235080, 20.0, temperature_c + 273.15
    theta, vapour_hpa = 300 / kelvin, 0.001 * kelvin / 216.7
    strength = 0.1079e-1 * vapour_hpa * theta**3.5 * np.exp(2.144 * (1 - theta))
    width = 26.38e-4 * dry_hpa * theta**0.76
    with_vapour, dry = (
        gas_attenuation_db_per_km(f_ghz * 1e9, dry_hpa, temperature_c, amount)
        for amount in (0.001, 0.0)
    )
    expected = 0.1820 * f_ghz * strength / width
    assert with_vapour - dry == pytest.approx(expected, rel=2e-3)


def test_a_vacuum_takes_nothing() -> None:
    f_hz = np.geomspace(1e9, 1e12, 200)
    assert np.all(gas_attenuation_db_per_km(f_hz, 0.0, 15.0, 0.0) == 0.0)
    assert np.all(fog_attenuation_db_per_km(np.array([1e9, 77e9]), 0.0) == 0.0)


def test_fog_is_rayleigh_absorption_of_its_drops() -> None:
    """6 pi Im((eps - 1) / (eps + 2)) / lambda times the drops' volume, in dB."""
    from radarsim_addon.physics.materials import liebe_permittivity

    for f_hz in (10e9, 35e9, 94e9):
        eps = liebe_permittivity(f_hz, 10.0)
        volume = 0.5 / 1e6  # m^3 of water in a m^3 of air
        per_m = 6 * np.pi * ((eps - 1) / (eps + 2)).imag * volume * f_hz / 299792458.0
        expected = 10 / np.log(10) * 1e3 * per_m
        assert fog_attenuation_db_per_km(f_hz, 0.5, 10.0) == pytest.approx(expected, rel=1e-3)


def test_dielectric_spheres_have_the_mie_cross_section() -> None:
    with open(DATA / "dielectric_sphere_mie.csv", encoding="utf-8") as stream:
        rows = list(csv.DictReader(line for line in stream if not line.startswith("#")))
    assert len(rows) > 250
    columns = [np.array([float(row[name]) for row in rows]) for name in ("eps_re", "eps_im", "ka")]
    index = np.sqrt(columns[0] + 1j * columns[1])
    found = sphere_backscatter_m2(1.0, 2 * np.pi / columns[2], index) / np.pi
    expected = [float(row["sigma_over_pia2"]) for row in rows]
    # ka is given to three digits behind the point, and narrow resonances feel its rounding
    np.testing.assert_allclose(found, expected, rtol=2e-5)


def test_small_spheres_are_rayleigh_scatterers() -> None:
    index, k = 4 + 2j, 2 * np.pi / 3.9e-3
    radius_m = np.array([0.0, 1e-7, 1e-6, 1e-5])
    factor = abs((index**2 - 1) / (index**2 + 2)) ** 2
    expected = 4 * np.pi * k**4 * radius_m**6 * factor
    np.testing.assert_allclose(sphere_backscatter_m2(radius_m, 3.9e-3, index), expected, rtol=1e-3)


def test_rain_echoes_as_its_drops_do() -> None:
    rows = _rows("rain_volume")
    assert len(rows) == 15
    for row in rows:
        eta = rain_reflectivity_per_m(float(row["frequency_ghz"]) * 1e9, _rate(row))
        # another formula for water's permittivity at 77 GHz: 0.011 dB
        assert 10 * np.log10(eta) == pytest.approx(float(row["value2"]), abs=0.015)


@pytest.mark.parametrize("temperature_c", [0.0, 30.0])
def test_the_echo_of_small_drops_follows_the_permittivity_of_their_temperature(
    temperature_c: float,
) -> None:
    """|K|^2 with K = (eps - 1) / (eps + 2): Rayleigh scatterers."""
    from radarsim_addon.physics.materials import liebe_permittivity

    eps = np.array([liebe_permittivity(1e9, at_c) for at_c in (temperature_c, 10.0)])
    of_drops = np.abs((eps - 1) / (eps + 2)) ** 2
    warm, usual = (rain_reflectivity_per_m(1e9, 1.0, at_c) for at_c in (temperature_c, 10.0))
    assert abs(of_drops[0] / of_drops[1] - 1) > 3e-3
    assert warm / usual == pytest.approx(of_drops[0] / of_drops[1], rel=3e-4)


def test_rain_falls_between_drizzle_and_the_largest_drops() -> None:
    """Below 10 GHz the fall speeds of the echo are those of D^6: closed forms of moments."""
    rate = 10.0
    slope = 4.1 * rate**-0.21  # 1/mm
    # moments of D^6 exp(-slope D) exp(-0.6 D)
    first, second = (slope / (slope + 0.6)) ** 7, (slope / (slope + 1.2)) ** 7
    mean_mps, spread_mps = rain_fall_speeds(3e9, rate)
    assert mean_mps == pytest.approx(9.65 - 10.3 * first, rel=0.02)
    assert spread_mps == pytest.approx(10.3 * np.sqrt(second - first**2), rel=0.02)
    assert rain_reflectivity_per_m(3e9, 0.0) == 0.0


@pytest.mark.parametrize(
    "call",
    [
        lambda: rain_attenuation_db_per_km(77e9, -1.0),
        lambda: rain_attenuation_db_per_km(77e9, np.nan),
        lambda: rain_attenuation_db_per_km(0.5e9, 1.0),
        lambda: rain_attenuation_db_per_km(77e9, 1.0, "diagonal"),  # type: ignore[arg-type]
        lambda: gas_attenuation_db_per_km(77e9, -5.0),
        lambda: gas_attenuation_db_per_km(2e12),
        lambda: fog_attenuation_db_per_km(300e9, 0.1),
        lambda: fog_attenuation_db_per_km(77e9, -0.1),
        lambda: sphere_backscatter_m2(1.0, 1e-6, 3.0),
        lambda: rain_fall_speeds(77e9, 0.0),
    ],
)
def test_what_cannot_be_is_refused_by_name(call) -> None:  # type: ignore[no-untyped-def]
    with pytest.raises(ConfigError, match=r"expected|summed up to"):
        call()
