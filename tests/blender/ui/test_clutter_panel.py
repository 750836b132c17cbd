# SPDX-License-Identifier: GPL-3.0-or-later
"""The panel of a material's clutter: what it sets, shows and says."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender import rig_settings as properties
from radarsim_addon.blender.materials import clutter_of, fluctuation_of, set_clutter
from radarsim_addon.blender.materials.physical_materials import make_physical_material
from radarsim_addon.blender.ui import material_panel
from radarsim_addon.blender.ui import material_panel as plot
from radarsim_addon.blender.ui.material_panel import RADARSIM_PT_material_clutter as panel
from radarsim_addon.contract import FluctuationRecord
from radarsim_addon.physics import clutter
from radarsim_addon.physics.clutter import clutter_model
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender


@pytest.fixture
def material() -> Iterator[Any]:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    properties.register()
    rs.setup_rig(bpy.context.scene)
    rs.radar().carrier_ghz = 9.65
    try:
        yield make_physical_material("Sea", "sea_water", carrier_hz=9.65e9)
    finally:
        material_panel.forget_plots()
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

    def template_icon(self, *, icon_value: int, scale: float) -> None:
        self.shown.append(f"plot at {scale:.3g}")


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
    set_clutter(material, "nrl_sea", sea_state=2.0)  # by a script: nothing of the old model stays
    assert [key for key in material.keys() if "gamma" in key] == []


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


def test_plot_shows_both_curves_over_the_valid_angles() -> None:
    """Curves pass where sigma0 is; columns from 0.1 to 60 degrees are light."""
    sea, angles_rad = clutter_model("nrl_sea"), plot.plot_angles_rad()
    levels = np.array([
        sea.sigma0_db(9.65e9, angles_rad, side, sea_state=3) for side in ("horizontal", "vertical")
    ])  # fmt: skip
    picture = plot.draw_sigma0(levels, sea.is_valid(9.65e9, angles_rad))
    area = picture[plot.TOP : plot.SIDE - plot.BOTTOM, plot.LEFT : plot.SIDE - plot.RIGHT, :3]
    # from 10 dB at the top to -60 dB
    for level_db, colour in zip(levels, plot.COLOURS, strict=True):
        for column in (20, 120, 220):
            # away from the grey behind, towards the colour: the line's edges are smooth
            cover = (area[:, column] - area[:, column].mean(axis=1, keepdims=True)) @ (
                np.array(colour) - np.mean(colour)
            )
            cover = np.where(cover > 0.02, cover, 0.0)
            found_db = 10 - 70 * (cover @ np.arange(cover.size)) / cover.sum() / (cover.size - 1)
            assert found_db == pytest.approx(level_db[column], abs=0.6)
    corner = area[5, :, 0]
    light = np.degrees(angles_rad[corner > corner.min()])
    assert light.min() == pytest.approx(0.1, rel=0.02)
    assert light[light < 80].max() == pytest.approx(60, rel=0.03)


@pytest.mark.parametrize("table", [False, True])
def test_plot_is_drawn_again_only_after_a_change(
    material: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, table: bool
) -> None:
    """A table, here of 3000 rows, is read once as well."""
    drawn_pictures = []
    real = plot.draw_sigma0
    monkeypatch.setattr(
        material_panel, "draw_sigma0", lambda *given: drawn_pictures.append(1) or real(*given)
    )
    reads: list[Any] = []
    read = clutter.read_clutter_table  # type: ignore[attr-defined]
    monkeypatch.setattr(
        clutter, "read_clutter_table", lambda *given: reads.append(given) or read(*given)
    )
    fields, path = material.radarsim, tmp_path / "field.csv"
    fields.clutter = "table" if table else "nrl_sea"
    if table:
        rows = "".join(f"{angle:.3f},-20\n" for angle in np.linspace(0.1, 90, 3000))
        path.write_text("grazing_deg,sigma0_db\n" + rows)
        fields.clutter_path = str(path)
    assert "plot at 16" in drawn(material)
    for _ in range(3):
        drawn(material)
    assert len(drawn_pictures) == 1
    assert len(reads) == (1 if table else 0)
    if table:
        path.write_text("grazing_deg,sigma0_db\n1,-30\n2,-10\n")
        assert "0.3\u00b0:  -30.0" in drawn(material)
    else:
        fields.clutter_sea_state = 1.5
        drawn(material)
    assert len(drawn_pictures) == 2


def test_panel_is_for_physical_materials(material: Any) -> None:
    plain = bpy.data.materials.new("plain")
    assert panel.poll(SimpleNamespace(material=material))
    assert not panel.poll(SimpleNamespace(material=plain))
    assert not panel.poll(SimpleNamespace())
