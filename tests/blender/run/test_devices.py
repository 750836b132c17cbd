# SPDX-License-Identifier: GPL-3.0-or-later
"""Whether a device is used, by its check; the check itself on the CPU and on simulated devices."""

from __future__ import annotations

import dataclasses
import itertools
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

pytest.importorskip("bpy")

import bpy

from radarsim_addon import blender as radarsim
from radarsim_addon.blender.headless import selfcheck
from radarsim_addon.blender.nodes import make_material
from radarsim_addon.blender.run import scene_state
from radarsim_addon.blender.run.scene_state import Device, Verdict
from radarsim_addon.blender.views import PathScene, View
from radarsim_addon.errors import RadarSimError

pytestmark = pytest.mark.blender

GPU = Device("CUDA", ("CUDA_simulated",))
PASSED = Verdict({"pixel centres": (1e-5, 1e-3)}, ())
FAILED = Verdict({"pixel centres": (0.5, 1e-3)}, ("pixel centres",))


@pytest.fixture(autouse=True)
def cache(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    for name in ("XDG_CACHE_HOME", "LOCALAPPDATA"):
        monkeypatch.setenv(name, str(tmp_path / "cache"))
    return tmp_path / "cache"


def test_all_facts_hold_on_the_cpu() -> None:
    """In a process of its own, as for any device."""
    verdict = scene_state.check(Device())
    assert verdict.failed == ()
    assert len(verdict.facts) == 27


def _spoil(view: View, **changes: Callable[[Any], Any]) -> View:
    values = {name: change(getattr(view, name)) for name, change in changes.items()}
    return dataclasses.replace(view, **values)


PIXEL = 2 * 0.35 / 24  # tangent
RENDERS = itertools.count()


@pytest.mark.parametrize(
    ("fact", "change"),
    [
        ("pixel centres", {"position": lambda p: p + 0.01 * PIXEL * 10}),
        ("object numbers", {"object_index": lambda n: 3 - n}),
        ("power of one reflection", {"blue": lambda b: 1.01 * b}),
        ("shadows", {"blue": lambda b: b + 1e-6}),
        ("range code, one reflection", {"red": lambda r: r * 1.001}),
        ("second range code, one reflection", {"green": lambda g: g * 1.001}),
        ("reflections counted", {"blue": lambda b: b + 1e-3 * b.max()}),
        ("renders repeated", {"blue": lambda b: b * (1 + 1e-6 * next(RENDERS))}),
    ],
)
def test_a_device_that_spoils_a_fact(
    fact: str,
    change: dict[str, Callable[[Any], Any]],
    tmp_path: Path,
    monkeypatch: pytest.MonkeyPatch,
) -> None:
    end = PathScene.end
    monkeypatch.setattr(PathScene, "end", lambda self: _spoil(end(self), **change))
    monkeypatch.setattr(selfcheck, "CASES", selfcheck.CASES[:1])
    found = {one.name: one.holds for one in selfcheck.measure_facts(tmp_path)}
    assert not found[fact]
    assert not all(found.values())


def _measured(tmp_path: Path) -> tuple[Any, list[str]]:
    """The job of a small run, and the devices that its renders were set to."""
    from radarsim_addon.blender.headless import make_job

    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
    rig = radarsim.add_radar(preset="paper", sampling_mode="paths", width_px=8, height_px=8)
    mesh = bpy.data.meshes.new("Plate")
    mesh.from_pydata([(-5, 9, -5), (5, 9, -5), (5, 9, 5), (-5, 9, 5)], [], [(0, 1, 2, 3)])
    mesh.materials.append(make_material("Metal", 1e4, 1e4))
    scene = bpy.context.scene
    scene.collection.objects.link(bpy.data.objects.new("Plate", mesh))
    scene.cycles.device = "GPU"
    seen: list[str] = []

    def look(*_: Any) -> None:
        seen.append(scene.cycles.device)

    bpy.app.handlers.render_init.append(look)
    try:
        job: Any = make_job(scene, bpy.context.view_layer, tmp_path / "run", radar=rig)
        with job:
            for task in job.pending():
                job.start(task)
                job.render(task)
                job.finish(task)
    finally:
        bpy.app.handlers.render_init.remove(look)
    assert scene.cycles.device == "GPU"  # the user's choice is given back
    return job, seen


def _simulate(monkeypatch: pytest.MonkeyPatch, verdict: Verdict) -> list[Device]:
    checks: list[Device] = []

    def check(device: Device) -> Verdict:
        checks.append(device)
        return verdict

    monkeypatch.setattr(scene_state, "chosen_device", lambda scene: GPU)
    monkeypatch.setattr(scene_state, "check", check)
    return checks


def test_a_failing_device_is_not_used(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    checks = _simulate(monkeypatch, FAILED)
    job, seen = _measured(tmp_path)
    assert set(seen) == {"CPU"}
    (found,) = [item for item in job.findings if item.code == "device-unfit"]
    assert found.subjects == ("pixel centres",)
    assert "CUDA" in found.message and "'pixel centres'" in found.message
    assert "device" not in job.versions
    assert checks == [GPU]


def test_a_passing_device_is_used_and_checked_once(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    checks = _simulate(monkeypatch, PASSED)
    for name in ("a", "b"):
        (tmp_path / name).mkdir()
        job, seen = _measured(tmp_path / name)
        assert set(seen) == {"GPU"}
        assert not [item for item in job.findings if item.code == "device-unfit"]
        assert job.versions["device"] == "CUDA"
    assert checks == [GPU]


def test_what_the_cache_distinguishes(cache: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    _simulate(monkeypatch, PASSED)
    files = {scene_state.cache_file(one) for one in (GPU, Device("OPTIX", GPU.ids), Device("CUDA"))}
    monkeypatch.setattr(scene_state, "__version__", "99")
    files.add(scene_state.cache_file(GPU))
    assert len(files) == 4 and all(cache in file.parents for file in files)


@pytest.mark.parametrize("text", ["", "[]", "{}", '{"facts": {"a": 1}, "failed": []}'])
def test_a_cache_that_cannot_be_read(text: str, monkeypatch: pytest.MonkeyPatch) -> None:
    checks = _simulate(monkeypatch, FAILED)
    file = scene_state.cache_file(GPU)
    file.parent.mkdir(parents=True)
    file.write_text(text)
    assert scene_state.failed_facts(bpy.context.scene) == (GPU, ("pixel centres",))
    assert scene_state.failed_facts(bpy.context.scene) == (GPU, ("pixel centres",))
    assert len(checks) == 1


def test_a_check_that_crashes(monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setattr("sys.executable", "/bin/false")
    (failed,) = scene_state.check(GPU).failed
    assert failed.startswith(scene_state.NO_ANSWER)


def test_no_choice_is_the_cpu(empty_scene: Any) -> None:
    assert scene_state.failed_facts(empty_scene) == (Device(), ())
    empty_scene.cycles.device = "GPU"  # no device is chosen in the preferences
    assert scene_state.chosen_device(empty_scene) == Device()


def test_a_device_that_is_not_there(capsys: pytest.CaptureFixture[str], empty_scene: Any) -> None:
    with pytest.raises(RadarSimError, match=r"CUDA.*(driver|Choose)"):
        scene_state.choose_device(empty_scene, Device("CUDA"))
    assert selfcheck.main("CUDA") != 0
    assert "CUDA" in capsys.readouterr().err
