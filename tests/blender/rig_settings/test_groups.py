# SPDX-License-Identifier: GPL-3.0-or-later
"""Property groups made from declared settings: exact numbers, bounds, files, undo, keyframes."""

from __future__ import annotations

import dataclasses
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.plan import merged
from radarsim_addon.blender.rig_settings.radar import Settings, property_group
from radarsim_addon.errors import ConfigError, SettingNameError
from radarsim_addon.options import declared, setting
from tests.package.test_options import Example

pytestmark = pytest.mark.blender
EXAMPLE = merged(Example)


@pytest.fixture
def rig() -> Iterator[Any]:
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    changed: list[float] = []
    group = property_group(
        "RadarSimExample",
        merged(Example),
        changes={"carrier_hz": lambda owner: changed.append(owner["carrier_hz"])},
    )
    bpy.utils.register_class(group)
    bpy.types.Object.example = bpy.props.PointerProperty(type=group)
    item = bpy.data.objects.new("Radar", None)
    bpy.context.scene.collection.objects.link(item)
    Example.__test_changed__ = changed  # type: ignore[attr-defined]
    yield item
    del bpy.types.Object.example
    bpy.utils.unregister_class(group)


def test_declared_properties(rig: Any) -> None:
    for item in declared(Example).values():
        shown = rig.example.bl_rna.properties[item.shown_name]
        assert (shown.name, shown.description) == (item.shown_label, item.of.help)
    assert rig.example.bl_rna.properties["pulses"].hard_max == 4096
    assert [choice.identifier for choice in rig.example.bl_rna.properties["kind"].enum_items] == [
        "lfm",
        "fmcw",
    ]


def test_float64_in_and_out(rig: Any) -> None:
    view = Settings(rig.example, EXAMPLE)
    for value in (77e9, 76.512345678901e9, 5.3e9):
        view.carrier_hz = value
        assert view.carrier_hz == value
    assert rig.example.carrier_ghz == pytest.approx(5.3)
    if bpy.app.version >= (5, 0, 0):  # nothing among the custom properties that people see
        assert not list(rig.keys())
    rig.example.carrier_ghz = 77.1  # float32, as the window has it
    assert view.carrier_hz == 77.1e9
    assert Example.__test_changed__[-1] == 77.1e9  # type: ignore[attr-defined]
    assert view.snapshots == 2
    view.snapshots = 1
    assert (view.snapshots, rig.example.snapshots) == (1, "1")
    view.max_standard_error = 0.015
    assert rig.example.max_standard_error == pytest.approx(1.5)
    assert view.gain_dbi is None
    view.gain_dbi = 3.3
    assert (view.gain_dbi, rig.example.use_gain_dbi) == (3.3, True)
    view.gain_dbi = None
    assert view.record(Example, carrier_hz=1e9) == dataclasses.replace(
        Example(1e9), max_standard_error=0.015, snapshots=1
    )


def test_wrong_values_and_names_are_refused(rig: Any) -> None:
    view = Settings(rig.example, EXAMPLE)
    for name, value, message in (
        ("carrier_hz", -1.0, "Carrier is -1.0 Hz; expected a finite number above 0"),
        ("carrier_hz", "77 GHz", "Carrier is '77 GHz'"),
        ("pulses", 2.5, "expected a whole number from 1 to 4096"),
        ("kind", "am", "expected one of 'lfm', 'fmcw'"),
    ):
        with pytest.raises(ConfigError, match=message):
            setattr(view, name, value)
    with pytest.raises(SettingNameError, match="no setting 'carier_hz'; did you mean carrier_hz"):
        view.carier_hz = 1.0
    with pytest.raises(AttributeError, match="no setting 'carrier_ghz'"):
        view.carrier_ghz  # noqa: B018
    assert view.carrier_hz == 1e9


def test_kept_in_files_copies_and_linked_objects(rig: Any, tmp_path: Path) -> None:
    view = Settings(rig.example, EXAMPLE)
    view.carrier_hz, view.kind, view.pulses = 76.512345678901e9, "fmcw", 7
    assert Settings(rig.copy().example, EXAMPLE).carrier_hz == 76.512345678901e9
    path = str(tmp_path / "a.blend")
    bpy.ops.wm.save_as_mainfile(filepath=path)
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    for link in (False, True):
        with bpy.data.libraries.load(path, link=link) as (_, wanted):
            wanted.objects = ["Radar"]
        item = wanted.objects[0]
        view = Settings(item.example, EXAMPLE)
        assert (view.carrier_hz, view.kind, view.pulses) == (76.512345678901e9, "fmcw", 7)
        if link:
            with pytest.raises(ConfigError, match="linked from another file"):
                view.pulses = 8


def test_keyframes_move_a_setting(rig: Any) -> None:
    changed = Example.__test_changed__  # type: ignore[attr-defined]
    for frame, value in ((1, 77.0), (11, 78.0)):
        rig.example.carrier_ghz = value
        assert rig.example.keyframe_insert("carrier_ghz", frame=frame)
    bpy.context.scene.frame_set(1)
    assert Settings(rig.example, EXAMPLE).carrier_hz == 77e9
    told = list(changed)
    bpy.context.scene.frame_set(6)
    assert changed == told  # others are not changed in the middle of an evaluation
    assert Settings(rig.example, EXAMPLE).carrier_hz == pytest.approx(77.5e9)


def test_one_name_is_one_setting() -> None:
    @dataclasses.dataclass
    class Other:
        pulses: int = setting("Pulses", "Other", 3)

    with pytest.raises(TypeError, match=r"Other\.pulses is declared otherwise"):
        merged(Example, Other)
