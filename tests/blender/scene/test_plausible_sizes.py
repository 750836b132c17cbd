# SPDX-License-Identifier: GPL-3.0-or-later
"""Sizes and up axes that do not fit a name are found; the example files have none."""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import Any

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.scene import check_sizes
from radarsim_addon.blender.scene.ground_truth import rendered_surfaces
from radarsim_addon.blender.scene.plausible_sizes import KINDS, kind_of
from radarsim_addon.blender.state import evaluated_snapshot
from radarsim_addon.findings import Finding, merge
from tests.blender import radar_scenes as rs

pytestmark = pytest.mark.blender
EXAMPLES = sorted((Path(__file__).resolve().parents[3] / "blend_examples").glob("*.blend"))
#: Usual sizes along x, y and z [m].
CAR, PERSON = (1.8, 4.5, 1.5), (0.5, 0.3, 1.75)


def add(name: str, size: Sequence[float], parent: Any = None, at: float = 10.0) -> Any:
    bpy.ops.mesh.primitive_cube_add(size=1, location=(0, at, 0))
    item = bpy.context.object
    item.name, item.scale, item.parent = name, size, parent
    return item


def found(metres_per_unit: float = 1.0) -> dict[str, Finding]:
    bpy.context.view_layer.update()
    items = check_sizes(
        rendered_surfaces(evaluated_snapshot(bpy.context.view_layer)), metres_per_unit
    )
    return {item.code: item for item in merge(items)}


@pytest.fixture(autouse=True)
def _scene() -> None:
    rs.new_scene()


@pytest.mark.parametrize("path", EXAMPLES, ids=lambda path: path.stem)
def test_the_example_files_have_no_such_finding(path: Path) -> None:
    bpy.ops.wm.open_mainfile(filepath=str(path))
    assert found(bpy.context.scene.unit_settings.scale_length) == {}


def test_there_are_seven_examples() -> None:
    assert len(EXAMPLES) == 7


@pytest.mark.parametrize(
    ("name", "kind"),
    [
        ("Car", "car"), ("Car.001", "car"), ("Car Ahead", "car"), ("SportsCar_01", "car"),
        ("parked-car", "car"), ("PEDESTRIAN", "person"), ("Oak Tree 3", "tree"),
        ("Cars", ""), ("Car Wheel", ""), ("Bus Stop", ""), ("Carpet", ""), ("Street", ""),
        ("Treehouse", ""), ("House Left 1", "house"), ("Cube", ""), ("", ""),
    ],
)  # fmt: skip
def test_words_of_a_name_state_a_kind(name: str, kind: str) -> None:
    stated = kind_of(name)
    assert ("" if stated is None else stated.name) == kind


def test_usual_sizes_are_no_finding() -> None:
    for number, kind in enumerate(KINDS):
        for size_m in (kind.least_m, kind.most_m):
            small = 0.4 * size_m
            shape = (small, small, size_m) if kind.shape == "tall" else (small, size_m, small)
            add(f"{kind.name}.{number}", shape)
    assert found() == {}


@pytest.mark.parametrize(
    ("factor", "advised"),
    # 11.9 m: the geometric mean of 3 and 6 m over it is 0.36; the others are units of files
    [(11.9 / 4.5, 0.4), (100.0, 0.01), (1000.0, 0.001), (1 / 0.0254, 0.0254), (0.01, 100.0)],
)
def test_a_car_of_another_unit_is_named(factor: float, advised: float) -> None:
    add("Car", [factor * side for side in CAR])
    (item,) = found().values()
    assert item.code == "size-implausible" and item.severity == "caution"
    assert item.subjects == ("Car",)
    assert f"a car of {4.5 * factor:.3g} m, where 3 to 6 m are usual" in item.text
    assert f"(scale by {advised:g})" in item.text
    assert "Unit Scale" in item.remedy
    assert found(1 / factor) == {}  # with the unit scale that the file should have


def test_turned_objects_keep_their_size() -> None:
    add("Car", CAR).rotation_euler = (0, 0, math.radians(37))
    add("Person", PERSON).rotation_euler = (0, 0, math.radians(37))
    assert found() == {}


def test_what_lies_or_stands_on_end_is_named() -> None:
    add("Car", CAR).rotation_euler = (math.radians(90), 0, 0)  # a file with Y up, as it is
    add("Person", PERSON).rotation_euler = (math.radians(-90), 0, 0)
    (item,) = found().values()
    assert (item.code, item.severity) == ("lies-on-its-side", "caution")
    assert set(item.subjects) == {"Car", "Person"}


def parented(factor: float) -> str:
    """An empty that holds the parts, as importers make it."""
    root = bpy.data.objects.new("Car", None)
    bpy.context.scene.collection.objects.link(root)
    add("Body", [factor * side for side in CAR], root)
    add("Wheel", [factor * side for side in (0.2, 0.6, 0.6)], root)
    return "Car"


def whole_and_part(factor: float) -> str:
    """A wheel is no small car: it belongs to one."""
    body = add("Car", [factor * side for side in CAR])
    add("Car Wheel", (0.1, 0.1, 0.4), body)
    return "Car"


def instanced(factor: float) -> str:
    item = add("Shell", [factor * side for side in CAR])
    rs.instance_of(item, name="Asset").instance_collection.name = "Sports car"
    return "Asset"


def collected(factor: float) -> str:
    made = bpy.data.collections.new("Car")
    bpy.context.scene.collection.children.link(made)
    for name, sides in (("Shell", CAR), ("Door panel", (0.1, 1.0, 0.8))):
        made.objects.link(add(name, [factor * side for side in sides]))
    return "Shell"


@pytest.mark.parametrize("build", [parented, whole_and_part, instanced, collected])
def test_names_of_parents_instances_and_collections_count(build: Callable[[float], str]) -> None:
    build(1.0)
    assert found() == {}
    for factor in (0.01, 100.0):
        rs.new_scene()
        name = build(factor)
        (item,) = found().values()
        assert (item.code, item.subjects) == ("size-implausible", (name,)), factor


def test_an_empty_that_holds_many_cars_is_no_large_car() -> None:
    root = bpy.data.objects.new("Car", None)
    bpy.context.scene.collection.objects.link(root)
    for number in range(5):
        add(f"Car {number}", CAR, root, at=20.0 * number)
    assert found() == {}


@pytest.mark.parametrize(("size", "implausible"), [(0.005, True), (0.5, False), (2e6, True)])
def test_scenes_of_implausible_extent_are_named(size: float, implausible: bool) -> None:
    add("Cube", (size, size, size), at=0.0)
    assert set(found()) == ({"scene-size-implausible"} if implausible else set())


def test_a_run_and_the_checklist_say_so(tmp_path: Path) -> None:
    """A caution: the run is measured all the same."""
    from radarsim_addon import blender as radarsim

    item = add("Car", [10 * side for side in CAR], at=60.0)
    radarsim.assign_material(
        item, radarsim.material("concrete", rms_height_m=0.01, correlation_length_m=0.1)
    )
    rig = bpy.data.objects["Radar"]
    with pytest.warns(UserWarning, match="size-implausible: The size of 'Car' does not fit"):
        run = radarsim.measure(rig, tmp_path / "run", frames=[1], width_px=16, height_px=16)
    assert "size-implausible" in {one.code for one in run.record.findings}
