# SPDX-License-Identifier: GPL-3.0-or-later
"""Paths through and off materials of every kind, against closed forms."""

from __future__ import annotations

import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.signal import PathFlag

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from radarsim_addon.blender.paths import view_tracer
from radarsim_addon.blender.views import TracedReplicate
from radarsim_addon.physics.fresnel import unpolarised_reflectance
from radarsim_addon.signal.decoding import TileReplicate
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender

SHEETS_M = [10 + 1.5 * number for number in range(8)]


# -- layers that let power through -----------------------------------------------------------------


def test_eight_sheets_of_radar_material(tmp_path: Path) -> None:
    """Every pixel of every gate: F/pi cos EIRP/(4 pi R^2) T^(2 t), and the sheet's own range."""
    rs.new_scene()
    ph.field_of_view(20)
    material = ph.bare_sheet(1.6, 0.0, 0.5)
    for y in SHEETS_M:
        ph.plate_at(y, 40, material)
    run = ph.run_paths(tmp_path, width_px=16, height_px=16)
    rows, record = run.table(), run.record()
    radiance = ph.radiance(rows)
    for t, y in enumerate(SHEETS_M):
        here = rows["transparent_depth"] == t
        assert here.sum() == 16 * 16
        cosine = rows["direction"][here][:, 1]
        reflected = unpolarised_reflectance(1.6, cosine)
        want = reflected * (1 - reflected) ** (2 * t) / np.pi * cosine * ph.irradiance(y / cosine)
        np.testing.assert_allclose(radiance[here], want, rtol=1e-6)
        np.testing.assert_allclose(rows["length_m"][here], 2 * y / cosine, rtol=3e-7)
        np.testing.assert_allclose(rows["last_scatterer_m"][here][:, 1], y, atol=2e-6)
        assert {record.objects[n - 1] for n in rows["last_object"][here]} == {
            "Plate" if t == 0 else f"Plate.{t:03d}"
        }
    assert rows.size == 8 * 16 * 16
    assert not np.any(rows["flags"])
    assert (
        record.range_encoding,
        record.mixed_power_fraction,
        record.truncated_transparency_fraction,
    ) == (
        "materials",
        0.0,
        0.0,
    )


def test_gates_hold_one_path(tmp_path: Path) -> None:
    """G B/R^2 in every pixel and gate within 1e-5, while the open render is far off."""
    from radarsim_addon.blender.views import PathScene

    rs.new_scene()
    ph.field_of_view(20)
    material = ph.bare_sheet(1.6, 0.3, 0.8)
    for y in SHEETS_M:
        ph.plate_at(y, 40, material)
    kept, views = [], []
    original, end = view_tracer.rows_of_replicate, PathScene.end
    view_tracer.rows_of_replicate = lambda traced, *rest: (
        kept.append(traced) or original(traced, *rest)
    )
    PathScene.end = lambda self: views.append(end(self)) or views[-1]
    try:
        ph.run_paths(tmp_path, width_px=32, height_px=32, options={"max_reflections": 3})
    finally:
        view_tracer.rows_of_replicate, PathScene.end = original, end
    (traced,) = kept

    def mixing(view: object, where: np.ndarray) -> np.ndarray:
        red, green, blue = (plane[where] for plane in view.channels())  # type: ignore[attr-defined]
        return green * blue / red**2

    # Tails hold several: the check is able to tell.
    assert max(mixing(view, view.blue > 0).max() for view in views if view.blue.any()) > 1.001
    # After one reflection a path hits the sheets from behind, where no lamp shines: no order 2.
    assert {layer.order for layer in traced.layers} == {1, 3}
    for layer in traced.layers:
        np.testing.assert_allclose(mixing(layer.encoded, layer.amplitude > 0), 1, atol=1e-5)


def test_eight_foreign_sheets_are_unbiased(tmp_path: Path) -> None:
    """Lobes left to chance: the share of pixels that pass t sheets is T^t within five sigma, what
    they carry is exact, and four shifts are four independent draws."""
    rs.new_scene()
    ph.field_of_view(20)
    passed, replicates, size = 0.6, 4, 32
    material = ph.half_transparent(passed)
    for y in SHEETS_M:
        ph.plate_at(y, 40, material)
    run = ph.run_paths(tmp_path, width_px=size, height_px=size, options={"replicates": replicates})
    rows, record = run.table(), run.record()
    assert record.range_encoding == "world"
    radiance = ph.radiance(rows)
    counts = np.zeros((replicates, len(SHEETS_M)))
    for t, y in enumerate(SHEETS_M):
        here = rows["transparent_depth"] == t
        cosine = rows["direction"][here][:, 1]
        want = (1 - passed) * passed**t / np.pi * cosine * ph.irradiance(y / cosine)
        np.testing.assert_allclose(radiance[here], want, rtol=2e-6)
        np.testing.assert_allclose(rows["length_m"][here], 2 * y / cosine, rtol=1e-6)
        counts[:, t] = np.bincount(rows["replicate"][here], minlength=replicates) / size**2
    share = passed ** np.arange(len(SHEETS_M))
    sigma = np.sqrt(share * (1 - share) / size**2)
    assert np.all(np.abs(counts - share) <= 5 * sigma)
    assert np.all(np.abs(counts.mean(axis=0) - share) <= 5 * sigma / math.sqrt(replicates))
    # Draws that repeat would agree to the last pixel in all gates.
    assert len({tuple(row) for row in counts}) == replicates
    assert not np.any(rows["flags"] & (PathFlag.MIXED | PathFlag.NO_RANGE))
    assert record.truncated_transparency_fraction < 1e-6


def test_a_small_target_behind_glass_is_never_lost(tmp_path: Path) -> None:
    """Three panes that reflect a fifth like mirrors, a target of a pixel: the same power at every
    seed, though the lots of a render that leaves lobes to chance would lose it in half of them."""
    rs.new_scene()
    ph.field_of_view(20)
    pane = ph.bare_sheet(2.3, 1.0, 0.0)
    for y in (5, 6, 7):
        ph.plate_at(y, 40, pane)
    ph.plate_at(20, 0.5, nodes.make_material("Target", 1e4, 1e4, 0.0, 0.5, penetrable=False))
    counts, powers = set(), []
    for seed in range(8):
        rows = ph.run_paths(tmp_path / str(seed), seed=seed, width_px=16, height_px=16).table()
        counts.add(rows.size)
        powers.append(rows["power_w"].sum())
    assert len(counts) == 1
    assert counts.pop() > 0
    np.testing.assert_allclose(powers, powers[0], rtol=1e-6)


@pytest.mark.parametrize("max_depth", [2, 64])
def test_a_wholly_transparent_layer_leaves_a_hole(tmp_path: Path, max_depth: int) -> None:
    """Panes that reflect nothing before a plate: gates 0 to 3 are empty, gate 4 holds it all."""
    rs.new_scene()
    ph.field_of_view(20)
    clear = ph.shader_material("Clear", ("ShaderNodeBsdfTransparent", {"Color": ph.grey(1.0)}))
    for y in (5, 6, 7, 8):
        ph.plate_at(y, 40, clear)
    ph.plate_at(10, 40, ph.lambert(0.5))
    run = ph.run_paths(tmp_path, width_px=8, height_px=8, options={"max_depth": max_depth})
    rows, record = run.table(), run.record()
    if max_depth < 4:
        assert rows.size == 0
        assert record.truncated_transparency_fraction == pytest.approx(1.0)
        (found,) = [item for item in record.findings if item.code == "transparency-truncated"]
        assert found.numbers["fraction"] == pytest.approx(1.0)
        return
    assert set(rows["transparent_depth"]) == {4}
    cosine = rows["direction"][:, 1]
    np.testing.assert_allclose(rows["length_m"], 20 / cosine, rtol=1e-6)
    want = 0.5 / np.pi * cosine * ph.irradiance(10 / cosine)
    np.testing.assert_allclose(ph.radiance(rows), want, rtol=2e-6)


def test_a_slab_delays(tmp_path: Path) -> None:
    """A plate behind 0.2 units of n = 2: power by four Fresnel passages, length by its delay."""
    rs.new_scene()
    ph.field_of_view(4)
    n, thick = 2.0, 0.2
    glass = nodes.make_material("Glass", n, 0.0, 0.0, 0.5)
    from tests.blender.render_helpers import add_box

    add_box((-9, 5, -9), (9, 5 + thick, 9), glass)
    ph.plate_at(10, 30, nodes.make_material("Plate", 1e4, 1e4, 0.0, 0.5, penetrable=False))
    run = ph.run_paths(tmp_path, width_px=8, height_px=8)
    rows = run.table()
    back = rows[rows["transparent_depth"] == 2]
    assert back.size == 64
    cosine = back["direction"][:, 1]
    # The ray runs straight on; the delay is (n - 1) times its way inside.
    want = 2 * (10 + (n - 1) * thick) / cosine
    np.testing.assert_allclose(back["length_m"], want, rtol=1e-6)
    assert np.all(back["flags"] == PathFlag.ENCODED_LENGTH)
    np.testing.assert_allclose(back["last_scatterer_m"][:, 1], 10, atol=1e-6)
    passage = (1 - unpolarised_reflectance(n, cosine)) ** 4
    metal = unpolarised_reflectance(1e4 + 1e4j, cosine)
    power = passage * metal / np.pi * cosine * ph.irradiance(10 / cosine)
    np.testing.assert_allclose(ph.radiance(back), power, rtol=1e-5)


# -- colours ---------------------------------------------------------------------------------------


def test_coloured_and_textured_materials(tmp_path: Path) -> None:
    """Principled, saturated and textured: the *coded* range of orders 1 and 2 against geometry."""

    rs.new_scene()
    ph.field_of_view(30)
    colours = [(0.8, 0.25, 0.05), (0.05, 0.3, 0.9), (0.0, 0.6, 0.0), (0.5, 0.5, 0.5)]
    for number, colour in enumerate(colours):
        x, y = -3 + 2 * number, 8 + 2 * number
        corners = [(x - 1, y, -3), (x + 1, y, -3), (x + 1, y, 3), (x - 1, y, 3)]
        ph.quad(f"Wall {number}", corners, ph.principled(f"Colour {number}", colour))
    textured = ph.principled("Texture", (1, 1, 1))
    tree = textured.node_tree
    noise = tree.nodes.new("ShaderNodeTexNoise")
    noise.inputs["Scale"].default_value = 3.0
    surface = next(n for n in tree.nodes if n.bl_idname == "ShaderNodeBsdfPrincipled")
    tree.links.new(noise.outputs["Color"], surface.inputs["Base Color"])
    ph.quad("Floor", [(-10, 2, -2), (10, 2, -2), (10, 40, -2), (-10, 40, -2)], textured)

    logs = []
    original = view_tracer.rows_of_replicate

    def spy(traced: TracedReplicate, shared: TileReplicate, *rest: object) -> object:
        from radarsim_addon.blender.views.path_classes import _coloured_ratio

        for layer in traced.layers:
            index = np.nonzero(layer.amplitude > 0)
            encoded, plain = (
                v.channels()[:, index[0], index[1]] for v in (layer.encoded, layer.plain)
            )
            logs.append(
                (layer.order, -shared.range_encoding_length_m * _coloured_ratio(encoded, plain))
            )
        return original(traced, shared, *rest)

    view_tracer.rows_of_replicate = spy
    try:
        run = ph.run_paths(tmp_path, width_px=32, height_px=32, options={"max_reflections": 2})
    finally:
        view_tracer.rows_of_replicate = original
    rows, record = run.table(), run.record()
    assert (record.range_encoding, record.coloured, record.unranged_power_fraction) == (
        "world",
        True,
        0.0,
    )
    for order in (1, 2):
        mine = rows[rows["order"] == order]
        assert mine.size > 150
        first, last = mine["first_scatterer_m"], mine["last_scatterer_m"]
        length = np.linalg.norm(first, axis=1) + np.linalg.norm(last, axis=1)
        if order == 2:
            length += np.linalg.norm(last - first, axis=1)
        encoded = np.concatenate([values for number, values in logs if number == order])
        np.testing.assert_allclose(encoded, length, rtol=1e-5)
        np.testing.assert_allclose(mine["length_m"], length, rtol=1e-5)
    assert set(rows["last_object"][rows["order"] == 1]) == {1, 2, 3, 4, 5}


@pytest.mark.parametrize("colour", [(0.9, 0, 0), (0, 0.9, 0), (0, 0, 0.9)], ids="RGB")
def test_one_channel_is_enough(tmp_path: Path, colour: tuple[float, float, float]) -> None:
    """Pure red, green or blue surfaces: two bounces have a length in whichever channel is lit."""
    rs.new_scene()
    ph.field_of_view(40)
    pure = ph.shader_material("Pure", ("ShaderNodeBsdfDiffuse", {"Color": (*colour, 1)}))
    ph.quad("Floor", [(-20, -5, -1), (20, -5, -1), (20, 12, -1), (-20, 12, -1)], pure)
    ph.quad("Wall", [(-20, 12, -1), (20, 12, -1), (20, 12, 20), (-20, 12, 20)], pure)
    channel = "RGB"[int(np.argmax(colour))]
    options = {"max_reflections": 2, "amplitude_channel": channel}
    run = ph.run_paths(tmp_path, width_px=16, height_px=16, options=options)
    rows, record = run.table(), run.record()
    assert record.unranged_power_fraction == 0
    two = rows[rows["order"] == 2]
    assert two.size > 30
    # No vertex without all three channels, but |C P1| + |P1 P2| + |P2 T| >= 2 |C P1|.
    assert np.all(
        two["length_m"] >= 2 * np.linalg.norm(two["first_scatterer_m"], axis=1) * (1 - 1e-6)
    )
    one = rows[rows["order"] == 1]
    cosine = np.abs(
        np.where(one["last_object"] == 1, one["direction"][:, 2], one["direction"][:, 1])
    )
    reach = np.where(one["last_object"] == 1, 1.0, 12.0) / cosine
    # A ray's direction is known to 1e-5 px; towards the horizon that is worth more of length.
    slack = 1e-6 + 1e-5 * np.radians(40) / 16 / cosine
    assert np.all(np.abs(one["length_m"] / (2 * reach) - 1) < slack)
    cosine *= 2 * reach / one["length_m"]
    reach = one["length_m"] / 2
    want = 0.9 / np.pi * cosine * ph.irradiance(reach)
    np.testing.assert_allclose(ph.radiance(one), want, rtol=3e-6)
