# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel of a material's clutter: what it sets, shows and says."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import rig_settings as properties
from radarsim_addon.blender.materials import clutter_of, fluctuation_of
from radarsim_addon.blender.materials.physical_materials import make_physical_material
from radarsim_addon.blender.ui.clutter_panel import RADARSIM_PT_material_clutter as panel
from radarsim_addon.contract import FluctuationRecord
from radarsim_addon.physics.clutter import clutter_model
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


@pytest.fixture
def material() -> Iterator[Any]:
    bpy.ops.wm.read_factory_settings(use_empty=True)
    properties.register()
    rs.setup_rig(bpy.context.scene)
    rs.radar().carrier_ghz = 9.65
    try:
        yield make_physical_material("Sea", "sea_water", carrier_hz=9.65e9)
    finally:
        properties.unregister()


class Layout:
    """Keeps what is drawn."""

    def __init__(self, shown: list[str]) -> None:
        self.shown = shown

    def column(self, **_options: Any) -> Layout:
        return self

    def label(self, text: str = "", icon: str = "NONE") -> None:
        self.shown.append(f"{icon} {text}")

    def prop(self, _data: Any, name: str) -> None:
        self.shown.append(name)


def drawn(material: Any) -> str:
    shown: list[str] = []
    stand_in = SimpleNamespace(layout=Layout(shown))
    for name in ("_draw_model", "_draw_fluctuation"):
        part = getattr(panel, name)
        setattr(stand_in, name, lambda *rest, part=part: part(stand_in, *rest))
    context = SimpleNamespace(
        material=material,
        scene=bpy.context.scene,
        preferences=SimpleNamespace(system=SimpleNamespace(ui_scale=1.0)),
        region=SimpleNamespace(width=4000),
    )
    panel.draw(stand_in, context)
    return "\n".join(shown)


def test_fields_set_the_model_and_the_panel_shows_its_values(material: Any) -> None:
    fields = material.radarsim
    assert fields.clutter == "none" and clutter_of(material) is None
    assert "sigma0" not in drawn(material)
    fields.clutter, fields.clutter_sea_state = "nrl_sea", 5.0
    assert clutter_of(material).parameters == {"sea_state": 5.0}
    text = drawn(material)
    level = float(clutter_model("nrl_sea").sigma0_db(9.65e9, 0.017453292519943295, "horizontal",
                                                     sea_state=5.0))  # fmt: skip
    assert f"1\u00b0:  {level:.1f}" in text and "clutter_sea_state" in text
    assert "NRL/MR/5310" in text and "outside" not in text
    rs.radar().carrier_ghz = 77.0
    assert drawn(material).count("(outside the model)") == 6
    fields.clutter = "constant_gamma"
    assert fields.clutter_gamma_db == -15.0 and "outside" not in drawn(material)
    fields.clutter_gamma_db = -20.5
    assert clutter_of(material).parameters == {"gamma_db": -20.5}


def test_a_table_that_cannot_be_used_is_said(material: Any, tmp_path: Path) -> None:
    material.radarsim.clutter = "table"
    assert "ERROR" in drawn(material) and "no path" in drawn(material)
    bad = tmp_path / "bad.csv"
    bad.write_text("grazing_deg,sigma0_db\n3,-20\n1,-30\n")
    material.radarsim.clutter_path = str(bad)
    assert "line 3: grazing_deg is 1 after 3" in drawn(material)


def test_fields_of_texture_and_motion(material: Any) -> None:
    fields = material.radarsim
    assert fluctuation_of([material]) is None
    fields.texture = "k"
    assert fluctuation_of([material]) == FluctuationRecord("k", 1.0, 10.0)
    fields.texture_shape, fields.clutter_motion, fields.motion_fraction = 0.5, "sea", 0.75
    assert fluctuation_of([material]) == FluctuationRecord("k", 0.5, 10.0, "sea", 0.1, 0.75)
    text = drawn(material)
    assert all(name in text for name in ("texture_length_m", "motion_speed_mps", "motion_fraction"))
    fields.texture_length_m = 0.0
    assert "Length of the texture" in drawn(material)


def test_panel_is_for_physical_materials(material: Any) -> None:
    plain = bpy.data.materials.new("plain")
    assert panel.poll(SimpleNamespace(material=material))
    assert not panel.poll(SimpleNamespace(material=plain))
    assert not panel.poll(SimpleNamespace())
