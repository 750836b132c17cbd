# SPDX-License-Identifier: GPL-3.0-or-later
"""Colours to range and radiance (Eq. 4), directions and solid angles."""

import dataclasses
import math

import numpy as np
import pytest

from radarsim_addon.errors import SchemaError
from radarsim_addon.signal import decode, pixel_grid
from tests.signal.synthetic import Setup, encode, render_record

SETUP = Setup(width_px=1, height_px=1, half_width=1e-3, half_height=1e-3)


def decode_values(red: float, green: float, blue: float, setup: Setup = SETUP):  # type: ignore[no-untyped-def]
    channels = {
        name: np.full((1, 1), value, np.float32)
        for name, value in (("R", red), ("G", green), ("B", blue))
    }
    return decode(render_record(setup, 1, 0, 0), channels)


@pytest.mark.parametrize("metres_per_unit", [1e-3, 1.0, 100.0])
def test_range_and_radiance_come_back(metres_per_unit: float) -> None:
    setup = Setup(metres_per_unit=metres_per_unit, near_clip_m=1e-6 * metres_per_unit)
    rng = np.random.default_rng(2)
    range_m = rng.uniform(10, 4000, (setup.height_px, setup.width_px))
    radiance = rng.uniform(1e-9, 1e3, range_m.shape)
    found = decode(render_record(setup, 1, 0, 0), encode(setup, range_m, radiance))
    assert found.mask.all()
    # float32 rounding of R and B, half an ulp each: l off by at most 1.2e-7 k
    assert np.abs(found.range_m - range_m).max() < 1.3e-7 * setup.range_encoding_length_m / 2
    np.testing.assert_allclose(found.radiance, radiance, rtol=1e-7)
    assert np.nanmax(np.abs(found.mixing - 1)) < 5e-7


def test_near_clip_is_added_back_along_the_ray() -> None:
    setup = Setup(near_clip_m=0.5, range_encoding_length_m=100.0)
    range_m = np.full((setup.height_px, setup.width_px), 30.0)
    found = decode(render_record(setup, 1, 0, 0), encode(setup, range_m, np.ones_like(range_m)))
    np.testing.assert_allclose(found.range_m, 30.0, atol=1e-5)
    without = dataclasses.replace(
        render_record(setup, 1, 0, 0), receiver=dataclasses.replace(setup.camera(), near_clip_m=0.0)
    )
    short = decode(without, encode(setup, range_m, np.ones_like(range_m)))
    oblique = math.sqrt(1 + found.u[0] ** 2 + found.v[0] ** 2)
    assert 2 * (30.0 - short.range_m[0, 0]) == pytest.approx(0.5 * oblique, abs=1e-4)


def test_no_echo_is_masked_and_not_counted() -> None:
    found = decode_values(0.0, 0.0, 0.0)
    assert not found.mask.any()
    assert found.range_m[0, 0] == 0
    assert found.radiance[0, 0] == 0
    assert math.isnan(found.mixing[0, 0])
    assert (found.range_encoding_underflow, found.no_range_encoding) == (0, 0)


@pytest.mark.parametrize("red", [0.0, 1e-45, 1e-39])
def test_zero_or_denormal_red_is_beyond_the_code(red: float) -> None:
    found = decode_values(red, 0.0, 1.0)
    assert not found.mask.any()
    assert found.range_encoding_underflow == 1


def test_far_echo_with_underflown_check_channel_still_has_its_range() -> None:
    red = np.float32(math.exp(-60.0))  # G = exp(-120) is zero in float32
    found = decode_values(float(red), 0.0, 1.0)
    assert found.mask.all()
    assert found.total_length_m[0, 0] == pytest.approx(60 * SETUP.range_encoding_length_m, rel=1e-7)
    assert math.isnan(found.mixing[0, 0])


def test_rounding_at_zero_length_reads_zero() -> None:
    above = float(np.nextafter(np.float32(1), np.float32(2)))
    found = decode_values(above, above, 1.0)
    assert found.mask.all()
    assert found.total_length_m[0, 0] == pytest.approx(SETUP.near_clip_m, rel=1e-6)


def test_more_red_than_blue_is_no_code() -> None:
    found = decode_values(1.01, 1.0, 1.0)
    assert not found.mask.any()
    assert found.no_range_encoding == 1


def test_mixture_shows_in_the_check_channel() -> None:
    """Two equal paths at l/k = 0.9 and 1.1: G B / R^2 = cosh(0.2) / cosh(0.1)^2 by hand."""
    codes = np.exp(-np.array([0.9, 1.1]))
    found = decode_values(codes.mean(), (codes**2).mean(), 1.0)
    assert found.mixing[0, 0] == pytest.approx(math.cosh(0.2) / math.cosh(0.1) ** 2, abs=1e-6)


def test_solid_angles_add_up_to_the_frame() -> None:
    """Pyramid: 4 asin(sin a sin b) with half angles a, b."""
    for half_width, half_height, size in ((1.0, 0.7, 64), (1e-6, 2e-6, 32), (4.0, 4.0, 256)):
        camera = Setup(half_width=half_width, half_height=half_height).camera()
        total = pixel_grid(camera, size, size).solid_angle_sr.sum()
        a, b = math.atan(half_width), math.atan(half_height)
        assert total == pytest.approx(4 * math.asin(math.sin(a) * math.sin(b)), rel=1e-8)


def test_directions_with_lens_shift() -> None:
    camera = dataclasses.replace(Setup().camera(), left=0.0, right=1.0, bottom=-1.0, top=3.0)
    grid = pixel_grid(camera, 2, 4)
    assert grid.u.tolist() == [0.25, 0.75]
    assert grid.v.tolist() == [2.5, 1.5, 0.5, -0.5]


def test_other_cameras_are_refused() -> None:
    with pytest.raises(SchemaError, match="fisheye"):
        pixel_grid(dataclasses.replace(Setup().camera(), kind="fisheye"), 2, 2)
    with pytest.raises(SchemaError, match="left < right"):
        pixel_grid(dataclasses.replace(Setup().camera(), right=-1.0), 2, 2)
