# SPDX-License-Identifier: GPL-3.0-or-later
"""From gated pixels to rows: lengths, vertices and flags against paths made by hand."""

from __future__ import annotations

import math
from typing import Any

import numpy as np
import pytest

from radarsim_addon.contract import ReceiverRecord
from radarsim_addon.signal import PathFlag
from radarsim_addon.signal.decoding import (
    PathClassPixels,
    PixelRays,
    TileReplicate,
    assemble_rows,
    log_encoding_ratio,
    pixel_rays,
)
from radarsim_addon.signal.decoding.path_class_pixels import first_vertex_order_2
from radarsim_addon.signal.paths import PathRows

SIZE = 8
K_M = 20.0
CLIP_M = 1e-6


def rays(origin: tuple[float, float, float] = (0.0, 0.0, 0.0), half: float = 0.2) -> PixelRays:
    pose = np.eye(4)
    pose[:3, 3] = origin
    return pixel_rays(
        ReceiverRecord("perspective", pose.tolist(), -half, half, -half, half, 0.0), SIZE, SIZE
    )


def every_pixel() -> tuple[np.ndarray, np.ndarray]:
    rows, cols = np.divmod(np.arange(SIZE * SIZE), SIZE)
    return rows, cols


def path_class(length_m: np.ndarray, view: PixelRays, **changes: Any) -> PathClassPixels:
    """Order 1, depth 0, code exact to float64, nothing else known."""
    n = length_m.size
    nowhere = np.full((n, 3), np.nan)
    encoded = length_m - CLIP_M / view.near_cosine[every_pixel()]
    values: dict[str, Any] = {
        "order": 1,
        "depth": 0,
        "amplitude": np.full(n, 2.0),
        "log_ratio": -encoded / K_M,
        "mixing": np.ones(n),
        "position_m": nowhere,
        "vertex_m": nowhere,
        "object": np.ones(n, dtype=np.int32),
        "first_object": np.ones(n, dtype=np.int32),
        "position_is_first": True,
    }
    values.update(changes)
    return PathClassPixels(**values)


def rows_of(pixels: PathClassPixels, view: PixelRays, emitter_m: Any) -> PathRows:
    transmitter_m = np.asarray(emitter_m, dtype=np.float64)
    shared = TileReplicate(view, transmitter_m, K_M, CLIP_M, 0.5, 0.25, 3, 2)
    return assemble_rows(pixels, np.arange(SIZE * SIZE), shared)


def plate_points(view: PixelRays, distance_m: float, origin: Any = (0, 0, 0)) -> np.ndarray:
    direction = view.direction[every_pixel()]
    return np.asarray(origin) + direction * (-distance_m / direction[:, 2:])


def test_first_vertex_of_two_bounces() -> None:
    """Random triangles: the closed form gives back the vertex the length was made from."""
    rng = np.random.default_rng(7)
    n = 10_000
    camera, emitter = rng.normal(size=3), rng.normal(size=3)
    first, last = rng.normal(size=(2, n, 3)) * 20
    direction = first - camera
    reach = np.linalg.norm(direction, axis=1)
    direction /= reach[:, None]
    to_emitter = np.linalg.norm(last - emitter, axis=1)
    length = reach + np.linalg.norm(last - first, axis=1) + to_emitter
    found, conditioning = first_vertex_order_2(
        np.broadcast_to(camera, (n, 3)), direction, last, emitter, length
    )
    good = conditioning > 1e-3
    assert good.mean() > 0.99
    error = np.linalg.norm(found - first, axis=1)
    assert error[good].max() < 1e-9
    # What the denominator says: s - d . (P2 - C) over s, near 0 for a path that runs straight on.
    s = length - to_emitter
    np.testing.assert_allclose(
        conditioning, 1 - np.sum(direction * (last - camera), axis=1) / s, atol=1e-13
    )


def test_a_straight_chain_is_flagged() -> None:
    """Both vertices on one ray: any first vertex fits the length; conditioning goes to 0."""
    direction = np.array([[0.0, 0.0, -1.0]])
    _, conditioning = first_vertex_order_2(
        np.zeros((1, 3)), direction, np.array([[0.0, 0.0, -20.0]]), np.zeros(3), np.array([40.0])
    )
    assert abs(conditioning[0]) < 1e-12


@pytest.mark.parametrize("emitter", [(0.0, 0.0, 0.0), (3.0, -1.0, 2.0)])
def test_order_1_from_the_code_alone(emitter: tuple[float, float, float]) -> None:
    """Direction and length give the scatterer, monostatic and bistatic (an ellipsoid)."""
    view = rays()
    points = plate_points(view, 30.0)
    length = np.linalg.norm(points, axis=1) + np.linalg.norm(points - np.array(emitter), axis=1)
    rows = rows_of(path_class(length, view), view, emitter)
    np.testing.assert_allclose(rows["length_m"], length, rtol=1e-14)
    np.testing.assert_allclose(rows["last_scatterer_m"], points, atol=1e-11)
    np.testing.assert_array_equal(rows["first_scatterer_m"], rows["last_scatterer_m"])
    assert np.all(rows["flags"] == PathFlag.ENCODED_LENGTH)


def test_order_1_from_positions() -> None:
    """A known position that agrees with the code gives the length in float64, whatever the code."""
    origin = (0.0, 0.0, 10_000.0)
    view = rays(origin, half=1e-4)
    points = plate_points(view, 10_000.0, origin)
    length = 2 * np.linalg.norm(points - np.array(origin), axis=1)
    noisy = length * (1 + 5e-8 * np.cos(np.arange(length.size)))  # float32 of the code
    rows = rows_of(path_class(noisy, view, position_m=points), view, origin)
    np.testing.assert_allclose(rows["length_m"], length, rtol=1e-15)
    assert np.all(rows["flags"] == 0)
    # Rays in float32 end 0.7 mm rms beside the pixel's own at 10 km, on surfaces of any slant.
    assert 5e-4 < rows["length_sigma_m"].min() <= rows["length_sigma_m"].max() < 2.5e-3


def test_sigma_behind_a_pane_is_that_of_the_code() -> None:
    """A delay that the code's float32 hides could be in the length: its noise is the sigma."""
    rng = np.random.default_rng(11)
    true_m = rng.uniform(20.0, 60.0, 100_000)
    legs = np.exp(-np.stack([true_m / 2, true_m / 2]) / K_M).astype(np.float32)
    factor = rng.uniform(0.1, 1.0, true_m.size).astype(np.float32)
    red, blue = (factor * legs[0]) * legs[1], factor
    decoded_m = -K_M * np.log(red.astype(np.float64) / blue)
    noise_m = float(np.std(decoded_m - true_m))
    assert noise_m > 1e-6
    view = rays()
    points = plate_points(view, 20.0)
    length = 2 * np.linalg.norm(points, axis=1)
    for depth in (1, 3):
        rows = rows_of(
            path_class(length + noise_m, view, position_m=points, depth=depth), view, (0, 0, 0)
        )
        np.testing.assert_allclose(rows["length_m"], length, rtol=1e-14)
        sigma_m = rows["length_sigma_m"]
        assert 0.6 * noise_m < sigma_m.min() <= sigma_m.max() < 4 * noise_m
    by_code = rows_of(path_class(length, view, depth=1), view, (0, 0, 0))
    np.testing.assert_allclose(by_code["length_sigma_m"], sigma_m, rtol=1e-5)


def test_a_delay_on_the_way_comes_from_the_code() -> None:
    """Glass in front: geometry cannot see its delay. The length is the code's."""
    view = rays()
    points = plate_points(view, 30.0)
    geometric = 2 * np.linalg.norm(points, axis=1)
    rows = rows_of(path_class(geometric + 0.3, view, position_m=points, depth=2), view, (0, 0, 0))
    np.testing.assert_allclose(rows["length_m"], geometric + 0.3, rtol=1e-14)
    assert np.all(rows["flags"] == PathFlag.ENCODED_LENGTH)
    # The scatterer is where it is seen, not where the delayed code would put it.
    np.testing.assert_allclose(rows["last_scatterer_m"], points, atol=1e-12)


def test_a_thin_delay_far_away_comes_from_the_code() -> None:
    """A pane's delay of 3 cm at 2 km is 1e-5 of the length, yet half a wavelength at 5.3 GHz."""
    view = rays(half=1e-3)
    points = plate_points(view, 2000.0)
    geometric = 2 * np.linalg.norm(points, axis=1)
    pixels = path_class(geometric + 0.03, view, position_m=points, depth=2)
    encoded = geometric + 0.03 - CLIP_M / view.near_cosine[every_pixel()]
    pixels = PathClassPixels(**{**vars(pixels), "log_ratio": -encoded / 500.0})
    shared = TileReplicate(view, np.zeros(3), 500.0, CLIP_M, 0.5, 1.0, 0, 0)
    rows = assemble_rows(pixels, np.arange(SIZE * SIZE), shared)
    np.testing.assert_allclose(rows["length_m"], geometric + 0.03, rtol=1e-12)
    assert np.all(rows["flags"] == PathFlag.ENCODED_LENGTH)


def test_order_2() -> None:
    """A dihedral's paths from direction, length and last vertex."""
    rng = np.random.default_rng(3)
    view = rays()
    direction = view.direction[every_pixel()]
    first = direction * rng.uniform(10, 20, (SIZE * SIZE, 1))
    last = first + rng.normal(size=first.shape) * 5
    emitter = np.array([1.0, 0.0, 0.0])
    length = (
        np.linalg.norm(first, axis=1)
        + np.linalg.norm(last - first, axis=1)
        + np.linalg.norm(last - emitter, axis=1)
    )
    pixels = path_class(length, view, order=2, vertex_m=last, position_is_first=False)
    rows = rows_of(pixels, view, emitter)
    np.testing.assert_allclose(rows["first_scatterer_m"], first, atol=1e-9)
    np.testing.assert_array_equal(rows["last_scatterer_m"], last)
    np.testing.assert_allclose(rows["length_m"], length, rtol=1e-14)
    assert np.all(rows["flags"] == PathFlag.ENCODED_LENGTH)


def test_order_3_has_no_first_vertex_unless_seen() -> None:
    view = rays()
    points = plate_points(view, 15.0)
    length = np.full(SIZE * SIZE, 60.0)
    hidden = path_class(length, view, order=3, vertex_m=points, position_is_first=False)
    rows = rows_of(hidden, view, (0, 0, 0))
    assert np.all(rows["flags"] == PathFlag.ENCODED_LENGTH | PathFlag.NO_FIRST_VERTEX)
    assert np.all(np.isnan(rows["first_scatterer_m"]))
    seen = path_class(length, view, order=3, vertex_m=points, position_m=points * 0.5)
    rows = rows_of(seen, view, (0, 0, 0))
    assert np.all(rows["flags"] == PathFlag.ENCODED_LENGTH)
    np.testing.assert_allclose(rows["first_scatterer_m"], points * 0.5)


def test_without_code() -> None:
    """Red lost to underflow: a position seen directly still gives the length; nothing else does."""
    view = rays()
    points = plate_points(view, 30.0)
    nothing = np.full(SIZE * SIZE, -np.inf)
    length = 2 * np.linalg.norm(points, axis=1)
    rows = rows_of(path_class(length, view, log_ratio=nothing, position_m=points), view, (0, 0, 0))
    np.testing.assert_allclose(rows["length_m"], length, rtol=1e-14)
    assert np.all(rows["flags"] == PathFlag.NO_RANGE)
    behind = path_class(length, view, log_ratio=nothing, position_m=points, depth=2)
    rows = rows_of(behind, view, (0, 0, 0))
    assert np.all(rows["length_m"] == 0)
    assert np.all(rows["flags"] & PathFlag.NO_RANGE)


def test_mixtures_are_flagged() -> None:
    view = rays()
    points = plate_points(view, 30.0)
    mixing = np.where(np.arange(SIZE * SIZE) % 2, 1 + 3e-6, 1.001)
    length = 2 * np.linalg.norm(points, axis=1)
    rows = rows_of(path_class(length, view, mixing=mixing, position_m=points), view, (0, 0, 0))
    assert np.all((rows["flags"] & PathFlag.MIXED != 0) == (mixing > 1.0001))


def test_powers_and_numbers() -> None:
    """Power is radiance times solid angle times effective area; shifts share the solid angle."""
    view = rays()
    points = plate_points(view, 30.0)
    length = 2 * np.linalg.norm(points, axis=1)
    rows = rows_of(path_class(length, view, position_m=points), view, (0, 0, 0))
    solid = view.solid_angle_sr[every_pixel()] * 0.25
    np.testing.assert_allclose(rows["solid_angle_sr"], solid)
    np.testing.assert_allclose(rows["power_w"], 2.0 * 0.5 * solid)
    assert set(rows["tile"]) == {3}
    assert set(rows["replicate"]) == {2}
    assert set(rows["last_object"]) == {1}


def test_log_ratio_does_not_trust_denormals() -> None:
    """Red below the least normal float32 has lost its digits."""
    encoded = np.array([0.5, 1e-39, 0.0, 0.3])
    plain = np.array([1.0, 1.0, 1.0, 0.0])
    found = log_encoding_ratio(encoded, plain)
    assert found[0] == pytest.approx(math.log(0.5))
    assert np.all(np.isneginf(found[1:]))
