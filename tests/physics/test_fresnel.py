# SPDX-License-Identifier: GPL-3.0-or-later
"""Fresnel coefficients against values computed independently in multiple precision."""

import csv
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.physics import fresnel

DATA = Path(__file__).parents[1] / "data" / "fresnel_spot_values.csv"
VACUUM_PERMITTIVITY = 8.8541878128e-12

INDICES = {
    "eps4": 2.0,
    "eps2.56": 1.6,
    "n=1e4(1+i)": 1e4 * (1 + 1j),
    "TIR n=1/1.5": 1 / 1.5,
    "copper5.8e7@10GHz": np.sqrt(1 + 5.8e7j / (2 * np.pi * 10e9 * VACUUM_PERMITTIVITY)),
}


def reference_rows() -> list[dict[str, str]]:
    with open(DATA, encoding="utf-8") as stream:
        return list(csv.DictReader(line for line in stream if not line.startswith("#")))


def index_of(case: str) -> complex:
    """The table's index; for the one given without a number, from its normal incidence row."""
    if case in INDICES:
        return complex(INDICES[case])
    normal = next(r for r in reference_rows() if r["case"] == case and float(r["inc_deg"]) == 0)
    r_s = complex(float(normal["rs_re"]), float(normal["rs_im"]))
    return (1 - r_s) / (1 + r_s)


def test_reflection_matches_multiple_precision(subtests: pytest.Subtests) -> None:
    for row in reference_rows():
        with subtests.test(f"{row['case']}-{row['inc_deg']}"):
            cosine = np.cos(np.radians(float(row["inc_deg"])))
            r_s, r_p = fresnel.reflection_coefficients(index_of(row["case"]), cosine)
            for got, name in ((r_s, "rs"), (r_p, "rp")):
                expected = complex(float(row[f"{name}_re"]), float(row[f"{name}_im"]))
                # cos(89.9999 deg) itself carries 6e-11 of relative rounding in float64.
                assert abs(complex(got) - expected) <= 1e-10 * abs(expected)
            powers = [float(row[f"{n}_re"]) ** 2 + float(row[f"{n}_im"]) ** 2 for n in ("rs", "rp")]
            mean = float(fresnel.unpolarised_reflectance(index_of(row["case"]), cosine))
            assert mean == pytest.approx(sum(powers) / 2, rel=2e-10)


def test_transmission_keeps_digits_where_reflection_is_total(subtests: pytest.Subtests) -> None:
    for row in reference_rows():
        with subtests.test(f"{row['case']}-{row['inc_deg']}"):
            cosine = np.cos(np.radians(float(row["inc_deg"])))
            t_s, t_p = fresnel.power_transmission(index_of(row["case"]), cosine)
            # The table prints six digits.
            assert t_s == pytest.approx(float(row["1-|rs|^2"]), rel=1e-5, abs=1e-15)
            assert t_p == pytest.approx(float(row["1-|rp|^2"]), rel=1e-5, abs=1e-15)


def test_brewster_angle_reflects_nothing_of_p() -> None:
    index = 1.5
    _, r_p = fresnel.reflection_coefficients(index, np.cos(np.arctan(index)))
    assert abs(complex(r_p)) < 1e-15


def test_energy_is_conserved_everywhere() -> None:
    index = np.array([1.0 + 1e-9, 1.4 + 1.0j, 2.3 + 0.05j, 9 + 3j, 1e4 + 1e4j])[:, None]
    cosine = np.cos(np.radians([0, 10, 45, 80, 89.9999]))
    for r, t in zip(
        fresnel.reflection_coefficients(index, cosine),
        fresnel.power_transmission(index, cosine),
        strict=True,
    ):
        np.testing.assert_allclose(np.abs(r) ** 2 + t, 1, rtol=1e-13)
