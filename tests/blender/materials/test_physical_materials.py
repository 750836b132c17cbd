# SPDX-License-Identifier: GPL-3.0-or-later
"""Physical materials as users make them: medium, carrier, surface, layers, and their lobes."""

from __future__ import annotations

import math
from pathlib import Path
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from mathutils import Matrix

from radarsim_addon.blender import rig_settings as properties
from radarsim_addon.blender.materials import media_beyond_their_band, read_surface
from radarsim_addon.blender.materials import physical_materials as pm
from radarsim_addon.blender.materials.layers import layer_faces
from radarsim_addon.blender.materials.physical_materials import limits_of
from radarsim_addon.blender.nodes import attributes
from radarsim_addon.blender.nodes.groups import group_node
from radarsim_addon.blender.state import evaluated_snapshot
from radarsim_addon.errors import ConfigError
from radarsim_addon.physics.fresnel import excess_path_m, slab_power
from radarsim_addon.physics.materials import material as library
from radarsim_addon.physics.rough import sigma0
from radarsim_addon.signal.scene import RoughSurface
from radarsim_addon.signal.scene.walls import layer_normals
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs
from tests.blender import render_helpers as rh
from tests.blender.slab_scene import physical_material

pytestmark = pytest.mark.blender


@pytest.fixture(autouse=True)
def empty_file() -> None:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)


def index_of(material: Any) -> complex:
    node = group_node(material)
    return complex(
        node.inputs["Index of Refraction"].default_value,
        node.inputs["Extinction Coefficient"].default_value,
    )


MEDIA = {
    "concrete": {},
    "sea_water": {"temperature_c": 10.0, "salinity_psu": 32.0},
    "water": {"temperature_c": 15.0},
    "soil": {"moisture": 0.2},
    "ice": {},
    "debye": {
        "static_permittivity": 80.0,
        "infinite_permittivity": 5.0,
        "relaxation_frequency_hz": 17e9,
    },
    "conductor": {"conductivity_s_per_m": 5.8e7},
    "permittivity": {"eps_real": 4.0, "eps_imag": 0.2},
    "index": {"n": 1.7, "k": 0.01},
}


@pytest.mark.parametrize("medium", MEDIA)
def test_index_follows_the_carrier(medium: str) -> None:
    made = pm.make_physical_material("m", medium, carrier_hz=5.3e9, **MEDIA[medium])
    for carrier in (5.3e9, 9.6e9):
        pm.update_materials(carrier)
        expected = complex(library(medium, carrier, **MEDIA[medium]))
        if abs(expected) > 1e5:
            expected = complex(min(expected.real, 1e5), min(expected.imag, 1e5))
        assert index_of(made) == pytest.approx(expected, rel=1e-6)
    assert read_surface(made).is_opaque == (medium == "conductor")
    assert pm.medium_of(made) == pm.Medium(medium, MEDIA[medium])


def test_medium_survives_a_saved_file(tmp_path: Path) -> None:
    table = tmp_path / "wall.csv"
    table.write_text("frequency_ghz, eps_real, eps_imag\n2, 4.1, 0.2\n8, 4.0, 0.3\n")
    made = pm.make_physical_material(
        "Wall",
        "table",
        carrier_hz=5e9,
        path=str(table),
        rms_height_m=1.2345678e-3,
        correlation_length_m=0.02,
    )
    made.use_fake_user = True
    bpy.ops.wm.save_as_mainfile(filepath=str(tmp_path / "a.blend"))
    bpy.ops.wm.open_mainfile(filepath=str(tmp_path / "a.blend"))
    made = bpy.data.materials["Wall"]
    pm.update_materials(2e9)
    assert index_of(made) ** 2 == pytest.approx(4.1 + 0.2j, rel=1e-6)
    surface = pm.rough_surface_of(made)
    assert surface == RoughSurface(1.2345678e-3, 0.02)
    assert surface.slope == pytest.approx(math.sqrt(2) * 1.2345678e-3 / 0.02)
    with pytest.raises(ConfigError, match=r"'Wall'.*not defined at 9 GHz.*2 to 8 GHz"):
        pm.update_material(made, 9e9, "refuse")


def test_a_carrier_outside_the_band_is_held_and_said(tmp_path: Path) -> None:
    """Brick ends at 40 GHz: eps' = 3.91, sigma = 0.0238 f^0.16 S/m (ITU-R P.2040-3, Table 3)."""
    rs.new_scene()
    plate = rs.add_plate(10, preset=None)
    made = pm.make_physical_material("Wall", "brick", carrier_hz=77e9)
    plate.data.materials.append(made)

    def eps(f_hz: float) -> complex:
        return complex(3.91, 0.0238 * (f_hz / 1e9) ** 0.16 / (2 * np.pi * f_hz * 8.8541878e-12))

    for policy, at_hz in (("hold", 40e9), ("extrapolate", 77e9)):
        assert pm.update_materials(77e9, beyond_band=policy) == []
        (said,) = media_beyond_their_band(77e9, policy)
        assert (said.code, said.severity) == ("medium-beyond-band", "caution")
        assert said.subjects == ("Wall",) and "brick" in said.text and "1 to 40 GHz" in said.text
        assert "error class moderate" in said.cause
        assert said.numbers["absorption_ratio"] == pytest.approx((77 / 40) ** 0.84, rel=1e-3)
        assert index_of(made) ** 2 == pytest.approx(eps(at_hz), rel=1e-6)
    assert pm.update_materials(39e9) == media_beyond_their_band(39e9) == []
    waveform = rs.WAVEFORM.__class__(77e9, 50e6, 2.5e-6, 60e6)
    run = ph.run_paths(tmp_path / "run", width_px=8, height_px=8, waveform=waveform)
    codes = [item.code for item in run.job.findings]
    assert codes.count("medium-beyond-band") == 1


def test_beyond_band_refuse_stops_the_run_and_names_the_material(tmp_path: Path) -> None:
    rs.new_scene()
    plate = rs.add_plate(10, preset=None)
    plate.data.materials.append(pm.make_physical_material("Sea", "sea_water", carrier_hz=5e9))
    waveform = rs.WAVEFORM.__class__(24e9, 50e6, 2.5e-6, 60e6)
    refuse = {"width_px": 8, "height_px": 8, "waveform": waveform, "beyond_band": "refuse"}
    with pytest.raises(ConfigError, match=r"'Sea'.*24 GHz.*0.3 to 10 GHz"):
        ph.run_paths(tmp_path / "run", **refuse)
    # One that nothing in the render wears is no reason to stop.
    plate.hide_render = True
    other = rs.add_plate(12)
    assert other.material_slots[0].material is not None
    ph.run_paths(tmp_path / "other", **refuse)


def test_wrong_inputs_are_named() -> None:
    with pytest.raises(ConfigError, match="did you mean"):
        pm.make_physical_material("m", "concret", carrier_hz=5e9)
    with pytest.raises(ConfigError, match="moisure"):
        pm.make_physical_material("m", "soil", carrier_hz=5e9, moisure=0.1)
    with pytest.raises(ConfigError, match="needs moisture"):
        pm.make_physical_material("m", "soil", carrier_hz=5e9)
    with pytest.raises(ConfigError, match=r"at most 1"):
        pm.make_physical_material("m", "concrete", carrier_hz=5e9, rms_slope=0.8)
    with pytest.raises(ConfigError, match="at least 0"):
        pm.make_physical_material("m", "concrete", carrier_hz=5e9, rms_height_m=-1.0)
    assert len(bpy.data.materials) == 0


def test_kirchhoff_limits_are_told() -> None:
    fine = {"rms_height_m": 0.02, "correlation_length_m": 0.2}
    good = pm.make_physical_material("good", "concrete", carrier_hz=10e9, **fine)
    assert limits_of(good, 10e9) == ()
    limits = {item.code: item.subjects for item in limits_of(good, 1e9 / 4)}
    assert limits["kirchhoff-short-correlation"] == (good.name,)
    assert limits_of(pm.make_physical_material("s", "concrete", carrier_hz=5e9), 5e9) == ()


def test_panel_properties_show_what_is_kept() -> None:
    properties.register()
    rs.setup_rig(bpy.context.scene)
    try:
        made = pm.make_physical_material("m", "soil", carrier_hz=5.3e9, moisture=0.25)
        view = made.radarsim
        assert (view.medium, view.moisture) == ("soil", pytest.approx(0.25))
        view.rms_height_mm = 1.5
        view.correlation_length_mm = 30.0
        assert made["radarsim_rms_height_m"] == 1.5e-3
        assert pm.rough_surface_of(made).slope == pytest.approx(math.sqrt(2) * 0.05)
        roughness = group_node(made).inputs["Roughness"].default_value
        assert roughness == pytest.approx(math.sqrt(0.1), rel=1e-6)
        view.medium = "conductor"
        assert "radarsim_medium_moisture" not in made
        assert made["radarsim_medium_conductivity_s_per_m"] > 0
        view.medium = "concrete"
        rs.radar().carrier_ghz = 10.0
        assert index_of(made) == pytest.approx(complex(library("concrete", 10e9)), rel=1e-6)
        rs.radar().carrier_ghz = 500.0  # outside the band, which ends at 100 GHz
        assert index_of(made) == pytest.approx(complex(library("concrete", 100e9)), rel=1e-6)
        rs.radar().carrier_ghz = 20.0
        rs.radar().beyond_band = "refuse"
        rs.radar().carrier_ghz = 500.0  # numbers are kept, and the run is refused
        assert index_of(made) == pytest.approx(complex(library("concrete", 20e9)), rel=1e-6)
    finally:
        properties.unregister()


# -- layers ----------------------------------------------------------------------------------------


def test_layer_normals() -> None:
    rh.new_scene()
    wall = rh.add_box((-4, -0.1, -3), (4, 0.1, 3), physical_material(2, 0))
    wall.matrix_world = Matrix.Rotation(0.7, 4, "Z") @ Matrix.Diagonal((0.5, 3.0, 1.0, 1.0))
    cube = rh.add_box((0, 0, 0), (1, 1, 1), physical_material(2, 0))
    bpy.context.view_layer.update()
    snapshot = evaluated_snapshot(bpy.context.view_layer)
    normals = layer_faces(snapshot, [cube, wall]).layer_normals()
    assert np.isnan(normals[0]).all()
    assert np.abs(normals[1]) == pytest.approx([0, 1, 0], abs=1e-6)
    # Aslant in its own axes, then stretched: the normal stays that of its own faces.
    wall.data.transform(Matrix.Rotation(0.5, 4, "Z"))
    bpy.context.view_layer.update()
    faces = layer_faces(evaluated_snapshot(bpy.context.view_layer), [wall])
    (found,) = faces.layer_normals()
    assert np.abs(found @ [-math.sin(0.5), math.cos(0.5), 0]) == pytest.approx(1, abs=1e-6)
    low, high = faces.planes(np.stack([found]), 0.9)
    assert high - low == pytest.approx(0.2, abs=1e-6)
    rng = np.random.default_rng(1)
    sphere = rng.normal(size=(4000, 3))
    sphere /= np.linalg.norm(sphere, axis=1)[:, None]
    tilted = np.array([0.6, 0.0, 0.8])
    rough = np.concatenate([tilted + rng.normal(scale=1e-4, size=(50, 3)), [[0.0, 1.0, 0.0]] * 5])
    rough /= np.linalg.norm(rough, axis=1)[:, None]
    of = np.repeat([2, 0], [4000, 110])  # a surface without faces is between them
    found = layer_normals(np.concatenate([sphere, rough, -rough]), np.ones(4110), of, 3)
    assert np.isnan(found[1:]).all()
    assert abs(found[0] @ tilted) == pytest.approx(1, abs=1e-6)


def test_target_behind_an_oblique_wall(tmp_path: Path) -> None:
    """A whole run: the plate behind the wall has its apparent range and the slab's losses."""
    rs.new_scene()
    ph.field_of_view(2)
    carrier = rs.WAVEFORM.carrier_hz
    index, thickness = complex(library("concrete", carrier)), 0.1
    ph.plate_at(20, 8, physical_material(1e4, 1e4, 1.0, False))
    bare = ph.run_paths(tmp_path / "bare", width_px=8, height_px=8).table()
    concrete = pm.make_physical_material("Concrete", "concrete", carrier_hz=1e9)
    wall = rh.add_box((-9.3, -thickness / 2, -8.1), (8.7, thickness / 2, 9.9), concrete)
    turn = Matrix.Rotation(math.radians(40), 4, "Z")
    wall.matrix_world = Matrix.Translation((0.013, 10, 0.017)) @ turn
    before = dict(wall.items())
    run = ph.run_paths(tmp_path / "wall", width_px=8, height_px=8)
    assert dict(wall.items()) == before
    # The run evaluated at its own carrier, and gave the material back as it was.
    assert index_of(concrete) == pytest.approx(complex(library("concrete", 1e9)), rel=1e-6)
    rows = run.table()
    behind = rows[rows["transparent_depth"] == 2]
    assert behind.size == bare.size == 64
    normal = np.array([-math.sin(math.radians(40)), math.cos(math.radians(40)), 0.0])
    cosine = np.abs(bare["direction"] @ normal)
    slab = slab_power(index, thickness, 299_792_458.0 / carrier, cosine, "single-pass")
    lost = behind["power_w"] / bare["power_w"]
    assert np.abs(10 * np.log10(lost / slab.transmitted**2)).max() < 0.02
    extra = (behind["length_m"] - bare["length_m"]) / 2
    assert np.abs(extra - excess_path_m(index, thickness, cosine)).max() < 1e-5 * 20


def test_what_float32_cannot_carry_is_said(tmp_path: Path) -> None:
    rs.new_scene()
    made = pm.make_physical_material("Sea", "sea_water", carrier_hz=5.3e9)
    for name, depth in (("Puddle", 0.002), ("Sea", 5.0)):
        item = rh.add_box((-40, 10 - depth, -40), (40, 10, 40), made)
        item.name = name
    run = ph.run_paths(tmp_path, width_px=8, height_px=8)
    (found,) = [item for item in run.job.findings if item.code == "absorption-below-float32"]
    assert found.subjects == ("Sea",)
    alpha = 4 * math.pi * complex(library("sea_water", 5.3e9)).imag * 5.3e9 / 299_792_458.0
    assert found.numbers["loss_db"] == pytest.approx(20 * alpha * 5 / math.log(10), rel=1e-4)


# -- rough surfaces --------------------------------------------------------------------------------


@pytest.mark.parametrize("index", [1.4, 2.3 + 0.05j, 9 + 3j, 1e4 + 1e4j])
@pytest.mark.parametrize("slope", [0.1, 0.3])
def test_rough_surface_straight_back(index: complex, slope: float) -> None:
    """sigma0 of Kirchhoff's model within 1e-3 dB, and coded lengths within 1e-6."""
    index = complex(index)
    for angle in (0, 30, 60):
        scene = rh.new_scene(size=8, fov_deg=2)
        rh.add_emitter()
        made = physical_material(index.real, index.imag, math.sqrt(math.sqrt(2) * slope), False)
        place = np.array([0.03, 0.05, -10.0])
        tilt = Matrix.Rotation(math.radians(angle), 4, "X")
        rh.add_plate(40, Matrix.Translation(place) @ tilt, made)
        scene[attributes.ATTR_SURFACE_DEPTH] = scene[attributes.ATTR_SURFACE_STOP] = 0.5
        scene[attributes.ATTR_FACET_FRESNEL] = float(bpy.app.version >= (5, 0, 0))
        pixels = rh.render(scene, 10.0).astype(np.float64)
        rays = rh.pixel_directions(scene)
        normal = np.array([0, -math.sin(math.radians(angle)), math.cos(math.radians(angle))])
        cosine = np.abs(rays @ normal)
        expected = sigma0(index, slope, cosine, "cycles")
        if expected.min() < 1e-20:
            assert slope == 0.1 and angle == 60  # below -200 dB
            continue
        distance = (place @ normal) / (rays @ normal)
        irradiance = rh.EIRP_W / (4 * np.pi * distance**2)
        radiance = expected / (4 * np.pi * cosine) * irradiance
        assert np.abs(10 * np.log10(pixels[..., 2] / radiance)).max() < 1e-3
        length = rh.decode_length(pixels, 10.0) + rh.near_clip_length(scene)
        assert np.abs(length / (2 * distance) - 1).max() < 1e-6
        assert np.abs(rh.path_check(pixels) - 1).max() < 1e-5


class Layout:
    """Stands for Blender's layout: keeps what is drawn."""

    def __init__(self, shown: list[str]) -> None:
        self.shown = shown
        self.use_property_split = False

    def column(self, **_: Any) -> Layout:
        return self

    def label(self, text: str = "", icon: str = "NONE") -> None:
        self.shown.append(text)

    def prop(self, owner: Any, name: str, **_: Any) -> None:
        assert hasattr(owner, name)
        self.shown.append(name)

    def operator(self, name: str, **_: Any) -> None:
        self.shown.append(name)


def drawn(material: Any) -> str:
    """What the panel shows of a material."""
    from types import SimpleNamespace

    from radarsim_addon.blender.ui.material_panel import RADARSIM_PT_material_physical as panel

    shown: list[str] = []
    stand_in = SimpleNamespace(
        layout=Layout(shown), _draw_medium=panel._draw_medium, _draw_surface=panel._draw_surface
    )
    stand_in._draw_medium = lambda *rest: panel._draw_medium(stand_in, *rest)
    stand_in._draw_surface = lambda *rest: panel._draw_surface(stand_in, *rest)
    context = SimpleNamespace(
        material=material,
        scene=bpy.context.scene,
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
        region=SimpleNamespace(width=4000),
    )
    panel.draw(stand_in, context)
    return "\n".join(shown)


def test_panel_tells_index_band_and_limits() -> None:
    properties.register()
    rs.setup_rig(bpy.context.scene)
    try:
        rough = {"rms_height_m": 1e-3, "correlation_length_m": 5e-3}
        made = pm.make_physical_material("m", "sea_water", carrier_hz=5.3e9, **rough)
        text = drawn(made)
        assert "Klein" in text and "temperature_c" in text and "n = 8." in text
        assert "Kirchhoff model does not apply to 'm': k l = 0.555 is not above 6" in text
        rs.radar().carrier_ghz = 24.0
        assert "0.3 to 10 GHz" in drawn(made)
        plain = bpy.data.materials.new("plain")
        assert "radarsim.make_physical" in drawn(plain)
    finally:
        properties.unregister()


def test_panel_sets_the_scattered_lobe_and_says_where_it_cannot_be() -> None:
    properties.register()
    rs.setup_rig(bpy.context.scene)
    try:
        made = pm.make_physical_material("m", "metal", carrier_hz=5.3e9, rms_height_m=1e-3)
        assert made.radarsim.lobe_exponent == 0 and "lobe_exponent" in drawn(made)
        made.radarsim.lobe_exponent = 60
        assert made["radarsim_lobe_exponent"] == 60 and "expected an RMS height" not in drawn(made)
        made.radarsim.rms_height_mm = 0.0
        assert "expected an RMS height above 0" in drawn(made)
        made.radarsim.lobe_exponent = 0
        assert "radarsim_lobe_exponent" not in made and "expected" not in drawn(made)
        made["radarsim_lobe_exponent"] = "wide"
        assert made.radarsim.lobe_exponent == 0 and "'wide'; expected a whole number" in drawn(made)
    finally:
        properties.unregister()
