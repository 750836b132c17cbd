# SPDX-License-Identifier: GPL-3.0-or-later
"""Pixel directions and solid angles against closed forms."""

from __future__ import annotations

import math

import numpy as np
import pytest

from radarsim_addon.contract import ReceiverRecord
from radarsim_addon.errors import SchemaError
from radarsim_addon.signal.decoding import in_view, pixel_rays
from radarsim_addon.signal.decoding import ring_pixels as cameras
from radarsim_addon.signal.decoding.ring_pixels import solid_angles_sr


def camera(
    kind: str = "perspective",
    edges: tuple[float, float, float, float] = (-1.0, 1.0, -1.0, 1.0),
    matrix: np.ndarray | None = None,
) -> ReceiverRecord:
    pose = np.eye(4) if matrix is None else matrix
    return ReceiverRecord(kind, pose.tolist(), *edges, near_clip_m=1e-6)


def turned() -> np.ndarray:
    """A pose in general position."""
    rng = np.random.default_rng(4)
    rotation, _ = np.linalg.qr(rng.normal(size=(3, 3)))
    if np.linalg.det(rotation) < 0:
        rotation[:, 0] *= -1
    pose = np.eye(4)
    pose[:3, :3], pose[:3, 3] = rotation, (3.0, -7.0, 11.0)
    return pose


def rectangle_sr(left: float, right: float, bottom: float, top: float) -> float:
    """Solid angle of a rectangle of tangents, by the arctangent of its corners."""

    def corner(u: float, v: float) -> float:
        return math.atan(u * v / math.sqrt(1 + u * u + v * v))

    return corner(right, top) - corner(left, top) - corner(right, bottom) + corner(left, bottom)


@pytest.mark.parametrize(
    ("edges", "size", "bound"),
    [
        ((-1.0, 1.0, -1.0, 1.0), (64, 64), 3e-8),  # 90 degrees: the fourth-order remainder
        ((-1.0, 1.0, -0.5, 0.5), (256, 128), 2e-10),
        ((0.2, 0.9, -0.8, -0.1), (64, 32), 2e-8),  # shifted lens
        ((-0.01, 0.01, -0.01, 0.01), (8, 8), 1e-12),
    ],
)
def test_perspective_adds_up_to_the_frame(
    edges: tuple[float, float, float, float], size: tuple[int, int], bound: float
) -> None:
    total = solid_angles_sr(camera(edges=edges), *size).sum()
    assert total == pytest.approx(rectangle_sr(*edges), rel=bound)


def test_perspective_pixel_by_pixel() -> None:
    """Each pixel against the closed form, at 90 degrees where it is hardest."""
    n = 64
    found = solid_angles_sr(camera(), n, n)
    edge = np.linspace(-1, 1, n + 1)
    want = np.array(
        [
            [rectangle_sr(edge[i], edge[i + 1], -edge[j + 1], -edge[j]) for i in range(n)]
            for j in range(n)
        ]
    )
    # Row 0 is the top: the closed form's row j spans v from -edge[j+1] to -edge[j].
    np.testing.assert_allclose(found, want, rtol=2e-6)


def test_tiny_pixels_keep_their_digits() -> None:
    """Microradian pixels, far off the axis: the closed form of corners has no digits left there."""
    edges = (0.5, 0.5 + 64e-6, 0.3, 0.3 + 64e-6)
    found = solid_angles_sr(camera(edges=edges), 64, 64)
    u, v = 0.5 + 32e-6, 0.3 + 32e-6
    want = (64e-6) ** 2 * (1 + u * u + v * v) ** -1.5
    assert found.sum() == pytest.approx(want, rel=1e-9)


def test_perspective_directions() -> None:
    """Unit vectors along (u, v, -1), row 0 on top, turned by the pose; all from one point."""
    pose = turned()
    rays = pixel_rays(camera(edges=(-0.4, 0.6, -0.3, 0.2), matrix=pose), 10, 5)
    assert rays.origin_m == pytest.approx([3.0, -7.0, 11.0])
    np.testing.assert_allclose(np.linalg.norm(rays.direction, axis=-1), 1, atol=1e-15)
    local = rays.direction @ pose[:3, :3]
    tangents = local[..., :2] / -local[..., 2:]
    np.testing.assert_allclose(tangents[0, 0], [-0.35, 0.15], atol=1e-15)
    np.testing.assert_allclose(tangents[4, 9], [0.55, -0.25], atol=1e-15)
    np.testing.assert_allclose(rays.near_cosine, -local[..., 2], atol=1e-15)


def test_equirectangular_sphere() -> None:
    """A full panorama covers 4 pi, each pixel sin(top) - sin(bottom) times its longitudes."""
    edges = (-math.pi, math.pi, -math.pi / 2, math.pi / 2)
    rays = pixel_rays(camera("equirectangular", edges, turned()), 36, 18)
    assert rays.solid_angle_sr.sum() == pytest.approx(4 * math.pi, rel=1e-14)
    lat = np.linspace(math.pi / 2, -math.pi / 2, 19)
    want = (np.sin(lat[:-1]) - np.sin(lat[1:])) * (2 * math.pi / 36)
    np.testing.assert_allclose(rays.solid_angle_sr[:, 5], want, rtol=1e-13)
    # Weighted with their solid angles the directions of a sphere cancel.
    mean = np.einsum("hw,hwc->c", rays.solid_angle_sr, rays.direction)
    np.testing.assert_allclose(mean, 0, atol=1e-12)


def test_equirectangular_directions() -> None:
    """Longitude grows to the right, latitude upwards, the middle looks along the boresight."""
    edges = (-math.pi / 2, math.pi / 2, -math.pi / 4, math.pi / 4)
    rays = pixel_rays(camera("equirectangular", edges), 181, 91)
    np.testing.assert_allclose(rays.direction[45, 90], [0, 0, -1], atol=1e-15)
    assert rays.direction[45, 180] == pytest.approx(
        [math.sin(math.pi / 2 * 180 / 181), 0, -math.cos(math.pi / 2 * 180 / 181)]
    )
    assert rays.direction[0, 90][1] == pytest.approx(math.sin(math.pi / 4 * 90 / 91))


def test_orthographic() -> None:
    """Parallel rays that start side by side; the area of the pixels adds up to the frame's."""
    pose = turned()
    rays = pixel_rays(camera("orthographic", (-2.0, 4.0, -1.0, 2.0), pose), 12, 6)
    assert rays.solid_angle_sr.sum() == pytest.approx(18.0, rel=1e-14)
    np.testing.assert_allclose(
        rays.direction, np.broadcast_to(-pose[:3, 2], rays.direction.shape), atol=1e-15
    )
    local = (rays.origin_m - pose[:3, 3]) @ pose[:3, :3]
    np.testing.assert_allclose(local[0, 0], [-1.75, 1.75, 0], atol=1e-14)
    np.testing.assert_allclose(local[5, 11], [3.75, -0.75, 0], atol=1e-14)


def test_unknown_kind_is_named() -> None:
    with pytest.raises(SchemaError, match=r"'fisheye'.*perspective, orthographic"):
        pixel_rays(camera("fisheye"), 4, 4)
    with pytest.raises(SchemaError, match="fisheye"):
        solid_angles_sr(camera("fisheye"), 4, 4)


@pytest.mark.parametrize("kind", ["perspective", "orthographic", "equirectangular"])
def test_kept_rays_are_those_of_their_receiver(kind: str, monkeypatch: pytest.MonkeyPatch) -> None:
    """Each number of a receiver changes them; whoever changed kept ones would change all frames."""
    edges, pose = (-0.5, 0.6, -0.4, 0.3), turned()
    moved = pose + np.array([[0, 0, 0, 1e-9], [0] * 4, [0] * 4, [0] * 4])
    asked = [
        (camera(kind, edges, pose), 6, 4),
        (camera(kind, (-0.5, 0.6, -0.4, np.nextafter(0.3, 1.0)), pose), 6, 4),
        (camera(kind, edges, moved), 6, 4),
        (camera(kind, edges, pose), 4, 6),
    ]
    names = ("origin_m", "direction", "near_cosine", "solid_angle_sr")
    first = [pixel_rays(*one) for one in asked]
    again = [pixel_rays(*one) for one in asked]
    monkeypatch.setattr(cameras, "_KEPT_PX", 0)
    for one, rays, same in zip(asked, first, again, strict=True):
        fresh = pixel_rays(*one)
        for name in names:
            assert getattr(same, name) is getattr(rays, name)
            assert getattr(rays, name).tobytes() == getattr(fresh, name).tobytes()
            with pytest.raises(ValueError, match="read-only"):
                getattr(rays, name)[...] = 0.0


def test_points_in_the_view_of_a_camera_and_of_a_panorama() -> None:
    pose = np.eye(4)
    pose[:3, :3] = np.array([[1, 0, 0], [0, 0, -1], [0, 1, 0]], dtype=float)
    points = np.array([[0, 10, 0], [4.9, 10, 0], [5.1, 10, 0], [0, 10, 3], [0, -10, 0.0]])
    seen = in_view(points, camera("perspective", (-0.5, 0.5, -0.2, 0.2), pose))
    assert seen.tolist() == [True, True, False, False, False]
    seen = in_view(points, camera("equirectangular", (-0.47, 3.2, -0.2, 0.2), pose))
    assert seen.tolist() == [True, True, True, False, True]
