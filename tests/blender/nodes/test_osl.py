# SPDX-License-Identifier: GPL-3.0-or-later
"""The OSL twins in shaders/ against the node groups: two implementations of the same equations."""

from __future__ import annotations

import math
import sys
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials import EXACT_FACETS
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.nodes.build import TreeBuilder
from tests.blender import render_helpers as rh
from tests.blender.slab_scene import physical_material

pytestmark = [pytest.mark.blender, pytest.mark.slow]

SHADERS = Path(__file__).parents[3] / "shaders"


@pytest.fixture(autouse=True)
def osl_query() -> Iterator[None]:
    """Blender's own oslquery module, without which script nodes get no sockets."""
    local = Path(bpy.utils.resource_path("LOCAL"))
    folders = [str(p) for p in local.glob("python/lib/python3*/site-packages")]
    sys.path.extend(folders)
    yield
    for folder in folders:
        sys.path.remove(folder)


def script(build: TreeBuilder, name: str, inputs: dict[str, Any]) -> Any:
    """A Script node with one of our shaders, compiled; its only output."""
    text = bpy.data.texts.get(name) or bpy.data.texts.load(str(SHADERS / f"{name}.osl"))
    text.name = name
    node = build.node("ShaderNodeScript", name, mode="INTERNAL", script=text)
    assert len(node.inputs) >= len(inputs), f"{name}.osl did not compile"
    for key, source in inputs.items():
        build.connect(source, node.inputs[key])
    return node.outputs[0]


def twin_material(n: float, kappa: float, s: float, roughness: float, penetrable: bool) -> Any:
    """What `nodes.make_material` makes, by OSL."""
    material = bpy.data.materials.new("OSL")
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    build = TreeBuilder(material.node_tree)
    inverse_k = build.scene_attribute(attributes.ATTR_INVERSE_CODE_LENGTH)
    index = {"Index": n, "Extinction": kappa, "InverseCodeLength": inverse_k}
    surface = {**index, "Specularity": s, "Roughness": roughness}
    output = {"Surface": script(build, "radar_material", surface)}
    if penetrable:
        length = build.scene_attribute(attributes.ATTR_EXTINCTION_LENGTH)
        output["Volume"] = script(build, "radar_volume", {**index, "ExtinctionLength": length})
    build.node("ShaderNodeOutputMaterial", "output", output)
    return material


def twin_emitter() -> None:
    """What `render_helpers.add_emitter` adds, by OSL."""
    light = rh.add_emitter().data
    light.node_tree.nodes.clear()
    build = TreeBuilder(light.node_tree)
    inputs = {
        "RingMin": attributes.ATTR_RING_MIN,
        "RingMax": attributes.ATTR_RING_MAX,
        "InverseCodeLength": attributes.ATTR_INVERSE_CODE_LENGTH,
    }
    values = {key: build.scene_attribute(name) for key, name in inputs.items()}
    emission = script(build, "ring_emitter", values)
    build.node("ShaderNodeOutputLight", "output", {"Surface": emission})


MATERIALS = {
    "ground": ((3.57, 0.25, 0.1, 0.8), False),
    "slab": ((1.4, 0.01, 0.5, 0.5), True),
    "metal": ((1e4, 1e4, 0.7, 0.4), False),
}


def build_scene(osl: bool) -> Any:
    """Ground that leans, a half-transparent slab, and a metal plate behind it."""
    scene = rh.new_scene(size=48, fov_deg=40, max_bounces=3)
    if osl:
        scene.cycles.shading_system = True
        twin_emitter()
    else:
        rh.add_emitter()

    def material(name: str) -> Any:
        values, penetrable = MATERIALS[name]
        if osl:
            return twin_material(*values, penetrable)
        return nodes.make_material(name, *values, penetrable=penetrable)

    ground = Matrix.Translation((0, -3, -12)) @ Matrix.Rotation(math.radians(-75), 4, "X")
    rh.add_plate(40, ground, material("ground"))
    rh.add_box((-3.1, -1.3, -9.2), (1.7, 2.9, -8.1), material("slab"))
    tilt = Matrix.Translation((0.3, 1, -14)) @ Matrix.Rotation(math.radians(25), 4, "Y")
    rh.add_plate(3, tilt, material("metal"))
    return scene


@pytest.mark.parametrize(
    ("code_length", "ring", "extinction_length"),
    [(0.0, (0.0, 0.0), 0.0), (12.0, (0.0, 0.0), 0.5), (12.0, (8.5, 13.5), 0.5)],
)
def test_osl_twins_render_the_same(
    code_length: float, ring: tuple[float, float], extinction_length: float
) -> None:
    ours = rh.render(build_scene(False), code_length, ring, extinction_length)
    twin = rh.render(build_scene(True), code_length, ring, extinction_length)
    lit = ours[..., 2] > 0
    assert 0.2 < lit.mean() < (1.0 if ring[1] else 1.1)
    # Both take the same random numbers: a path changes only where rounding tips a choice of lobe.
    # What is left is OSL's exp, which is good to 1e-5 only.
    ratio = np.ones_like(ours, dtype=np.float64)
    np.divide(twin, ours, out=ratio, where=ours > 0)
    same = (np.abs(ratio - 1) < 1e-4).all(axis=-1) & ((twin[..., 2] > 0) == lit)
    assert same.mean() > 0.995, f"{(~same).sum()} of {same.size} pixels differ"
    assert np.abs(ratio[same] - 1).max() < 1e-4


# -- the physical material -------------------------------------------------------------------------

PHYSICAL = {
    "ground": ((9.0, 3.0, 0.5), False),
    "wall": ((2.2926, 0.1259, 0.0), True),
    "rough wall": ((1.6, 0.01, 0.4), True),
    "metal": ((1e4, 1e4, 0.6), False),
}
_ATTRIBUTES = {
    "Polarisation": attributes.ATTR_POLARISATION,
    "InverseCodeLength": attributes.ATTR_INVERSE_CODE_LENGTH,
    "SurfaceDepth": attributes.ATTR_SURFACE_DEPTH,
    "SurfaceStop": attributes.ATTR_SURFACE_STOP,
}


def physical_twin(n: float, kappa: float, roughness: float, penetrable: bool) -> Any:
    """What `slab_scene.physical_material` makes, by OSL: one conductor closure instead of three."""
    material = bpy.data.materials.new("OSL")
    if material.node_tree is None:
        material.use_nodes = True
    material.node_tree.nodes.clear()
    build = TreeBuilder(material.node_tree)
    values = {key: build.scene_attribute(name) for key, name in _ATTRIBUTES.items()}
    index = {"Index": n, "Extinction": kappa}
    surface = {**index, "Roughness": roughness, **values}
    output = {"Surface": script(build, "radar_physical", surface)}
    if penetrable:
        normal = build.node(
            "ShaderNodeAttribute",
            "normal",
            attribute_type="OBJECT",
            attribute_name=attributes.OBJECT_LAYER_NORMAL,
        )
        inputs = {
            **index,
            "LayerNormal": normal.outputs["Vector"],
            "Wavelength": build.scene_attribute(attributes.ATTR_WAVELENGTH),
            "InverseCodeLength": values["InverseCodeLength"],
        }
        output["Volume"] = script(build, "radar_physical_volume", inputs)
        material.cycles.volume_step_rate = 1000.0
    build.node("ShaderNodeOutputMaterial", "output", output)
    return material


def physical_scene(osl: bool) -> Any:
    """A leaning ground, two oblique walls one behind the other, and a metal plate behind them."""
    scene = rh.new_scene(size=48, fov_deg=40)
    scene.cycles.shading_system = osl
    if osl:
        twin_emitter()
    else:
        rh.add_emitter()

    def material(name: str) -> Any:
        values, penetrable = PHYSICAL[name]
        return (physical_twin if osl else physical_material)(*values, penetrable=penetrable)

    lean = Matrix.Translation((0, -3, -12)) @ Matrix.Rotation(math.radians(-75), 4, "X")
    rh.add_plate(40, lean, material("ground"))
    for name, place, angle in (("wall", -7.0, 35), ("rough wall", -9.5, -20)):
        box = rh.add_box((-2.1, -1.3, -0.03), (1.7, 2.9, 0.04), material(name))
        turn = Matrix.Rotation(math.radians(angle), 4, "Y")
        box.matrix_world = Matrix.Translation((0.1, 0.2, place)) @ turn
        box[attributes.OBJECT_LAYER_NORMAL] = [0.0, 0.0, 1.0]
    tilt = Matrix.Translation((0.3, 1, -14)) @ Matrix.Rotation(math.radians(5), 4, "Y")
    rh.add_plate(3, tilt, material("metal"))
    return scene


@pytest.mark.parametrize("polarisation", [0, 1, 2])
@pytest.mark.parametrize("surfaces", [0, 2, 4])
def test_physical_twins_render_the_same(polarisation: int, surfaces: int) -> None:
    """Gate by gate, so that no lot is drawn: what is seen, first and through one and two walls.

    The lamp stands at the camera, so that facets which reflect are met head-on: there the twin's
    conductor and the group agree in both of the group's forms, also before Blender 5.0, where
    `EXACT_FACETS` is False and the group takes F(0).
    """

    def image(osl: bool, exact_facets: bool) -> np.ndarray:
        scene = physical_scene(osl)
        scene[attributes.ATTR_POLARISATION] = float(polarisation)
        scene[attributes.ATTR_WAVELENGTH] = 0.0566
        scene[attributes.ATTR_FACET_FRESNEL] = float(exact_facets)
        scene[attributes.ATTR_SURFACE_DEPTH] = scene[attributes.ATTR_SURFACE_STOP] = surfaces + 0.5
        return rh.render(scene, 12.0).astype(np.float64)

    twin = image(True, EXACT_FACETS)
    for exact_facets in {False, EXACT_FACETS}:
        ours = image(False, exact_facets)
        lit = ours[..., 2] > 0
        assert lit.mean() > 0.05
        assert np.array_equal(lit, twin[..., 2] > 0)
        # OSL's exp is good to 1e-5; its 1 - |r|^2 subtracts near-equal numbers.
        assert np.abs(twin[lit] / ours[lit] - 1).max() < 2e-4


def test_osl_sources_state_their_equations() -> None:
    """Each shader names the equations of the paper that it implements."""
    sources = sorted(SHADERS.glob("*.osl"))
    assert [p.stem for p in sources] == [
        "radar_material",
        "radar_physical",
        "radar_physical_volume",
        "radar_volume",
        "ring_emitter",
    ]
    for path in sources:
        head = path.read_text(encoding="utf-8").split("#include")[0]
        assert "Costa et al. 2020, Eq." in head


def test_twins_are_compared_by_osl_and_not_by_chance() -> None:
    """Without OSL the script nodes are black: the comparison above cannot pass on native nodes."""
    scene = build_scene(True)
    scene.cycles.shading_system = False
    assert rh.render(scene).max() == 0
