# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures that all tests share. Nothing here imports bpy until a test asks for it."""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import pytest

ROOT = Path(__file__).resolve().parents[1]


def pytest_configure(config: pytest.Config) -> None:
    """Keep Blender away from this user's own preferences and extensions, whichever they are."""
    folder = tempfile.TemporaryDirectory(prefix="radarsim-blender-")
    config.add_cleanup(folder.cleanup)
    os.environ["BLENDER_USER_RESOURCES"] = folder.name


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout."""
    return ROOT


@pytest.fixture
def bpy() -> Any:
    """Blender's module, with an empty factory scene: no object, no material, no add-on of ours."""
    import bpy

    bpy.ops.wm.read_factory_settings(use_empty=True)
    return bpy


@pytest.fixture
def empty_scene(bpy: Any) -> Any:
    """An empty scene, rendered by Cycles on the CPU at 64x64 with one sample."""
    scene = bpy.context.scene
    scene.render.engine = "CYCLES"
    scene.cycles.device = "CPU"
    scene.cycles.samples = 1
    scene.render.resolution_x = scene.render.resolution_y = 64
    scene.render.resolution_percentage = 100
    return scene


@pytest.fixture
def addon(bpy: Any) -> Iterator[Any]:
    """The add-on registered from this checkout, and unregistered afterwards."""
    import radarsim_addon

    radarsim_addon.register()
    yield radarsim_addon
    radarsim_addon.unregister()
