# SPDX-License-Identifier: GPL-3.0-or-later
"""Fixtures that all tests share. Nothing here imports bpy until a test asks for it."""

from __future__ import annotations

import os
import sys
import tempfile
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

ROOT = Path(__file__).resolve().parents[1]
# Whatever the environment says: to compile all tests again takes as long as to collect them.
sys.dont_write_bytecode = False
_plain_approx = pytest.approx


def _strict_approx(
    expected: Any, rel: float | None = None, abs: float | None = None, nan_ok: bool = False
) -> Any:
    """As pytest.approx, whose absolute tolerance of 1e-12 passes any two powers of picowatts."""
    if rel is None and abs is None:
        rel = 1e-6
    if rel is not None and abs is None:
        try:
            largest = float(np.max(np.abs(np.asarray(expected, dtype=np.complex128)), initial=0.0))
        except (TypeError, ValueError):
            largest = 1.0
        abs = min(1e-12, 1e-12 * largest) if largest > 0 else 1e-12
    return _plain_approx(expected, rel=rel, abs=abs, nan_ok=nan_ok)


pytest.approx = _strict_approx  # type: ignore[assignment]


def pytest_configure(config: pytest.Config) -> None:
    """Keep Blender away from this user's own preferences and extensions, whichever they are.

    Side by side, processes whose BLAS has a thread a core spend more time waiting than computing.
    Processes that tests start compile radarsim once, and not each for itself.
    """
    os.environ.pop("PYTHONDONTWRITEBYTECODE", None)
    if config.getoption("numprocesses", None):
        os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")  # the processes to come inherit it
    folder = tempfile.TemporaryDirectory(prefix="radarsim-blender-")
    config.add_cleanup(folder.cleanup)
    os.environ["BLENDER_USER_RESOURCES"] = folder.name


def pytest_collection_modifyitems(config: pytest.Config, items: list[pytest.Item]) -> None:
    """Side by side, slow files come first: the last ones then leave no process without work."""
    if hasattr(config, "workerinput"):
        slow = {item.path for item in items if item.get_closest_marker("slow")}
        items.sort(key=lambda item: item.path not in slow)


@pytest.fixture(autouse=True, scope="session")
def files_not_flushed() -> Iterator[None]:
    """No test cuts the power: written files need not reach the disk, which takes 1 to 5 ms each."""
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(os, "fsync", lambda handle: None)
        yield


@pytest.fixture(scope="session")
def root() -> Path:
    """The checkout."""
    return ROOT


@pytest.fixture
def bpy() -> Any:
    """Blender's module, with an empty factory scene: no object, no material, no add-on of ours."""
    import bpy

    # read_factory_settings loads preferences and add-ons as well: 30 ms more.
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
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
