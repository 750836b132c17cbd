# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixels add up to the radar equation, analytically."""

import numpy as np
import pytest

from radarsim_addon.physics import radar_equation as eq


@pytest.mark.parametrize("range_m", [10.0, 1e3, 1e5])
def test_lambert_plate_pixels_add_up_to_the_radar_equation(range_m: float) -> None:
    albedo, eirp_w, area_m2, cosine, wavelength_m = 0.8, 12.0, 1e-4, 0.6, 0.0566
    radiance = eq.lambert_radiance(albedo, eirp_w, range_m, cosine)
    solid_angle = area_m2 * cosine / range_m**2
    expected = eq.monostatic_power_w(
        eirp_w, eq.lambert_plate_rcs_m2(albedo, area_m2, cosine), range_m, wavelength_m
    )
    assert float(eq.received_power_w(radiance, solid_angle, wavelength_m)) == pytest.approx(
        float(expected), rel=1e-12
    )


def test_power_falls_with_the_fourth_power_of_range() -> None:
    near, far = eq.monostatic_power_w(1.0, 1.0, np.array([1e3, 1e4]), 0.004)
    assert 10 * np.log10(near / far) == pytest.approx(40.0, abs=1e-12)
