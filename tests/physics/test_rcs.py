# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed forms of radar cross sections against independent tables and integrals."""

import csv
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.errors import ConfigError
from radarsim_addon.physics import rcs
from radarsim_addon.physics.constants import SPEED_OF_LIGHT_MPS
from radarsim_addon.physics.radar_equation import to_db

DATA = Path(__file__).parents[1] / "data"


def table(name: str) -> list[dict[str, str]]:
    with open(DATA / f"{name}.csv", encoding="utf-8") as stream:
        lines = [line for line in stream if not line.startswith("#")]
    return list(csv.DictReader(lines))


def wavelength_m(row: dict[str, str]) -> float:
    return SPEED_OF_LIGHT_MPS / (float(row["freq_GHz"]) * 1e9)


def numbers(rows: list[dict[str, str]], column: str) -> np.ndarray:
    return np.array([float(row[column]) for row in rows])


@pytest.mark.parametrize(
    "row", table("closed_form_peaks"), ids=lambda r: f"{r['target']}-{r['freq_GHz']}"
)
def test_textbook_peaks(row: dict[str, str]) -> None:
    wavelength = wavelength_m(row)
    axis = np.ones(3)
    value = {
        "sphere a=0.15 (GO)": lambda: rcs.sphere_optical(0.15),
        "square plate": lambda: rcs.plate(0.3, 0.3, wavelength),
        "dihedral max": lambda: rcs.dihedral(0.3, 0.3, wavelength),
        "triangular trihedral": lambda: rcs.area_rcs_m2(
            rcs.trihedral_triangular_area_m2(0.3, axis), wavelength
        ),
        "square trihedral": lambda: rcs.area_rcs_m2(
            rcs.trihedral_square_area_m2(0.3, axis), wavelength
        ),
        "cylinder broadside": lambda: rcs.cylinder_broadside(0.05, 0.5, wavelength),
        "disc": lambda: rcs.disc(0.15, wavelength),
    }[row["target"]]()
    assert float(to_db(value)) == pytest.approx(float(row["dBsm"]), abs=0.6e-4)


def test_cylinder_table_and_its_distance_from_the_exact_series() -> None:
    for row in table("cylinder_broadside"):
        got = float(
            to_db(
                rcs.cylinder_broadside(
                    float(row["radius_m"]), float(row["length_m"]), wavelength_m(row)
                )
            )
        )
        assert got == pytest.approx(float(row["GO_2pi_a_L2_over_lam_dBsm"]), abs=0.6e-4)
        if float(row["ka"]) > 10:
            # What the optical form itself is worth there.
            assert abs(got - float(row["exact2D_E_par_axis_dBsm"])) < 0.03
            assert abs(got - float(row["exact2D_E_perp_axis_dBsm"])) < 0.15


def test_sphere_physical_optics_and_its_distance_from_the_exact_series() -> None:
    rows = table("pec_sphere_mie")
    ka = numbers(rows, "ka")
    got = rcs.sphere_physical_optics(1.0, 2 * np.pi / ka) / np.pi
    np.testing.assert_allclose(got, numbers(rows, "po_sigma_over_pia2"), rtol=2e-9)
    error_db = np.abs(10 * np.log10(got / numbers(rows, "sigma_over_pia2")))
    assert error_db[(ka >= 5) & (ka < 10)].max() < 2.3
    assert error_db[(ka >= 10) & (ka < 20)].max() < 0.85
    assert error_db[ka >= 20].max() < 0.4


def test_small_sphere_keeps_its_digits() -> None:
    """x -> 0: sigma_PO -> pi a^2 x^2 (its phase term), by series."""
    x = 1e-6
    assert float(rcs.sphere_physical_optics(1.0, 2 * np.pi / x)) == pytest.approx(
        np.pi * x**2, rel=1e-6
    )


def test_plates_against_tilt() -> None:
    for row in table("plate_po_vs_angle"):
        tilt = np.radians(float(row["tilt_deg"]))
        a, b = float(row["a_m"]), float(row["b_m"])
        got = (
            rcs.plate(a, b, wavelength_m(row), tilt)
            if row["shape"] == "rect"
            else rcs.disc(a, wavelength_m(row), tilt)
        )
        assert float(got) == pytest.approx(float(row["sigma_m2"]), rel=6e-9, abs=1e-14)


def test_dihedral_against_angle() -> None:
    rows = [r for r in table("dihedral_vs_angle") if float(r["double_bounce_only_dBsm"]) > -200]
    assert len(rows) > 100
    for row in rows:
        got = rcs.dihedral(
            float(row["a_m"]),
            float(row["b_m"]),
            wavelength_m(row),
            np.radians(float(row["angle_from_plate1_deg"])),
        )
        assert float(to_db(got)) == pytest.approx(float(row["double_bounce_only_dBsm"]), abs=0.6e-4)


def test_trihedrals_against_angle() -> None:
    rows = table("trihedral_vs_angle")
    assert {row["kind"] for row in rows} == {"square", "triangular"}
    for row in rows:
        azimuth, elevation = np.radians(float(row["az_deg"])), np.radians(float(row["el_deg"]))
        direction = [
            np.cos(elevation) * np.cos(azimuth),
            np.cos(elevation) * np.sin(azimuth),
            np.sin(elevation),
        ]
        area = {
            "triangular": rcs.trihedral_triangular_area_m2,
            "square": rcs.trihedral_square_area_m2,
        }[row["kind"]](float(row["a_m"]), direction)

        assert float(area) == pytest.approx(float(row["GO_area_m2"]), rel=2e-8)


def test_trihedral_forms_meet_where_they_change() -> None:
    """low + middle = high (triangular), middle = high/2 (square)."""
    for area, vector in (
        (rcs.trihedral_triangular_area_m2, np.array([0.3, 0.5, 0.8])),
        (rcs.trihedral_square_area_m2, np.array([0.3, 0.4, 0.8])),
    ):
        below, above = (float(area(1.0, vector + np.array([0, step, 0]))) for step in (-1e-9, 1e-9))
        assert below == pytest.approx(above, rel=1e-7)


def test_lambert_sphere_is_the_integral_of_its_patches() -> None:
    angle = (np.arange(2000) + 0.5) / 2000 * np.pi / 2
    rings = 2 * np.pi * 0.7**2 * np.sin(angle) * (np.pi / 2 / 2000)
    total = np.sum(rcs.patch_rcs_m2(rcs.lambert_sigma0(0.6, np.cos(angle)), rings))
    assert float(rcs.sphere_lambert(0.7, 0.6)) == pytest.approx(total, rel=1e-6)


@pytest.mark.parametrize(
    ("call", "message"),
    [
        (lambda: rcs.plate(0.3, 0.3, 0.0), "Wavelength is 0 m"),
        (lambda: rcs.sphere_optical(np.nan), "Radius holds nan"),
        (lambda: rcs.plate(0.3, 0.3, 0.05, 2.0), "Tilt is 2 rad"),
        (lambda: to_db(-1.0), "Power ratio"),
        (lambda: rcs.trihedral_square_area_m2(0.3, [1, -1, 0]), "Direction is -1"),
    ],
)
def test_bad_input(call, message) -> None:
    with pytest.raises(ConfigError, match=message):
        call()


@pytest.mark.parametrize("wavelength", [0.003, 0.03, 0.117])
def test_a_smooth_face_joins_the_closed_forms(wavelength: float) -> None:
    """Plate, cylinder, curved face, and a plane larger than a Fresnel zone at a finite range."""
    found = rcs.specular_face
    assert found(0.267, 0.152, wavelength) == pytest.approx(rcs.plate(0.267, 0.152, wavelength))
    radius, length = 40 * wavelength, 5 * wavelength
    assert found(radius, length, wavelength, 1 / radius) == pytest.approx(
        rcs.cylinder_broadside(radius, length, wavelength)
    )
    curved = found(1e3 * radius, 1e3 * radius, wavelength, 1 / radius, 1 / (3 * radius))
    assert curved == pytest.approx(3 * np.pi * radius**2)
    assert found(50.0, 90.0, wavelength, 1 / 20, 1 / 20) == pytest.approx(np.pi * 20**2)


@pytest.mark.parametrize(("lengths", "bends"), [((0.1, 0.3), (2.0, 1.0)), ((3.0, 2.0), (5.0, 0.7))])
def test_a_smooth_face_against_the_integral(
    lengths: tuple[float, float], bends: tuple[float, float]
) -> None:
    """4 pi / lambda^2 |integral exp(j k (c_1 x^2 + c_2 y^2)) dx dy|^2 at 77 GHz: edges leave 1 dB
    where lengths are far from those of the zones.
    """
    wavelength = 0.0039
    amplitude = 1.0 + 0j
    for length, bend in zip(lengths, bends, strict=True):
        x = length * ((np.arange(400_000) + 0.5) / 400_000 - 0.5)
        amplitude *= np.mean(np.exp(2j * np.pi / wavelength * bend * x**2)) * length
    expected = 4 * np.pi / wavelength**2 * abs(amplitude) ** 2
    measured = rcs.specular_face(*lengths, wavelength, *bends)
    assert to_db(measured) == pytest.approx(float(to_db(expected)), abs=1.0)
