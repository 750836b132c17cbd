# SPDX-License-Identifier: GPL-3.0-or-later
"""Where waves enter objects and come out again, and where they do not: measured behind a wall."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import nodes
from radarsim_addon.blender.materials import make_physical_material, read_surface, settle_interiors
from radarsim_addon.blender.nodes.materials import volume_link
from radarsim_addon.blender.state import SettingsRestorer
from radarsim_addon.errors import ConfigError
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender import render_helpers as rh

pytestmark = pytest.mark.blender

STEEL = {"conductivity_s_per_m": 1.45e6}


def rough(medium: str, carrier_hz: float, **options: Any) -> Any:
    return make_physical_material(medium, medium, carrier_hz=carrier_hz, rms_slope=0.3, **options)


def behind(folder: Path, material: Any, carrier_hz: float, open_mesh: bool = False) -> Any:
    """Measure a plate behind 2 m of a material: the run, and the power of both objects [W]."""
    ph.field_of_view(10)
    ph.plate_at(20, 30, ph.rough_metal()).name = "Behind"
    wall = rh.add_box((-9.3, 9, -8.1), (8.7, 11, 9.9), material)
    wall.name = "Wall"
    if open_mesh:
        faces = [list(face.vertices) for face in wall.data.polygons][:-1]
        points = [tuple(vertex.co) for vertex in wall.data.vertices]
        wall.data.clear_geometry()
        wall.data.from_pydata(points, [], faces)
    waveform = dataclasses.replace(rs.WAVEFORM, carrier_hz=carrier_hz)
    run = ph.run_paths(folder, width_px=8, height_px=8, waveform=waveform)
    rows, names = run.table(), run.record().objects
    power = {
        name: float(rows["power_w"][rows["last_object"] == number].sum())
        for number, name in enumerate(names, 1)
    }
    return run, power


@pytest.mark.parametrize("kind", ["physical", "simple"])
def test_a_wall_without_volume_is_opaque(tmp_path: Path, kind: str) -> None:
    """2 m of concrete let 1e-78 through both ways, whether or not Volume is connected."""
    echoes = []
    for penetrable in (True, False):
        rs.new_scene()
        if kind == "physical":
            wall = rough("concrete", 5.3e9, penetrable=penetrable)
        else:
            wall = nodes.make_material("concrete", 2.3, 0.13, 0.0, penetrable=penetrable)
        run, power = behind(tmp_path / str(penetrable), wall, 5.3e9)
        if kind == "physical" or not penetrable:
            assert power.get("Behind", 0.0) < 1e-70 * power["Wall"]
        echoes.append(power["Wall"])
        named = [item.subjects for item in run.job.findings if item.code == "opaque-without-volume"]
        assert named == ([] if penetrable else [("concrete",)])
        group = nodes.materials.group_node(wall)
        assert group.inputs["Transmission"].default_value == pytest.approx(
            1.0, abs=0.2 * (kind == "physical")
        )
    np.testing.assert_allclose(echoes[1], echoes[0], rtol=1e-5 if kind == "physical" else 1e-2)


@pytest.mark.parametrize("medium", ["metal", "conductor"])
@pytest.mark.parametrize("carrier_hz", [5e9, 10e9, 77e9])
def test_metals_have_no_interior_at_any_carrier(
    tmp_path: Path, medium: str, carrier_hz: float
) -> None:
    """An index of 411 + 411j (steel, 77 GHz) reflects 99.5 %; the rest ends within micrometres."""
    rs.new_scene()
    made = rough(medium, carrier_hz, **(STEEL if medium == "conductor" else {}))
    assert volume_link(made) is None
    # A file of an earlier version, or of another carrier, may have it connected.
    node, output = nodes.materials.group_node(made), made.node_tree.get_output_node("CYCLES")
    made.node_tree.links.new(node.outputs["Volume"], output.inputs["Volume"])
    assert not read_surface(made).has_interior
    run, power = behind(tmp_path, made, carrier_hz, open_mesh=True)
    assert "Behind" not in power or power["Behind"] == 0.0
    assert power["Wall"] > 0
    assert not [item for item in run.job.findings if item.code.startswith("mesh-")]
    assert volume_link(made) is not None  # as the user had it


def test_a_simple_conductor_gets_no_volume() -> None:
    rh.new_scene()
    assert volume_link(nodes.make_material("Metal", 1e4, 1e4)) is None
    assert volume_link(nodes.make_material("Wall", 2.3, 0.1)) is not None


def test_one_group_cannot_be_open_and_closed() -> None:
    rh.new_scene()
    first, second = (nodes.make_material(name, 2.3, 0.1) for name in ("First", "Second"))
    around = bpy.data.node_groups.new("Around", "ShaderNodeTree")
    for name in ("Surface", "Volume"):
        around.interface.new_socket(name, in_out="OUTPUT", socket_type="NodeSocketShader")
    inside, out = around.nodes.new("ShaderNodeGroup"), around.nodes.new("NodeGroupOutput")
    inside.node_tree = nodes.ensure_group("radar_material")
    for material in (first, second):
        tree = material.node_tree
        node = next(item for item in tree.nodes if item.bl_idname == "ShaderNodeGroup")
        node.node_tree = around
        output = tree.get_output_node("CYCLES")
        for name in ("Surface", "Volume"):
            around.links.new(inside.outputs[name], out.inputs[name])
            tree.links.new(node.outputs[name], output.inputs[name])
    recorder = SettingsRestorer()
    assert settle_interiors(recorder, [first, second]) == []
    second.node_tree.links.remove(volume_link(second))
    with pytest.raises(ConfigError, match="use one node group, but only 'First' has its Volume"):
        settle_interiors(recorder, [first, second])


def test_a_thin_walled_house_is_not_named_for_its_size(tmp_path: Path) -> None:
    """10 m across, walls of 10 cm: what is named is the wall's loss, not that of 10 m."""
    rs.new_scene()
    concrete = rough("concrete", 5.3e9)
    house = rh.add_box((-5, 10, -5), (5, 20, 5), concrete)
    solid = house.modifiers.new("Walls", "SOLIDIFY")
    solid.thickness, solid.use_even_offset = 0.1, True
    run = ph.run_paths(tmp_path / "thin", width_px=8, height_px=8)
    assert "absorption-below-float32" not in {item.code for item in run.job.findings}
    solid.thickness = 2.0
    run = ph.run_paths(tmp_path / "thick", width_px=8, height_px=8)
    (found,) = [i for i in run.job.findings if i.code == "absorption-below-float32"]
    # exp(-4 pi kappa d / wavelength) both ways through 2 m: -780 dB or so.
    kappa = complex(np.sqrt(5.24 + 1j * 17.98 * 0.0462 * 5.3**0.7822 / 5.3)).imag
    loss_db = 2 * 4.343 * 4 * np.pi * kappa * 2.0 / (0.299792458 / 5.3)
    assert found.numbers["loss_db"] == pytest.approx(loss_db, rel=2e-3)
