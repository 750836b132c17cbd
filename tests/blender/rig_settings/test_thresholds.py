# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits are crossed: just below and just above."""

from __future__ import annotations

from pathlib import Path

import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.plan import PRESETS
from radarsim_addon.blender.rig_settings.presets import load_preset, save_preset
from radarsim_addon.errors import ConfigError

pytestmark = pytest.mark.blender


def test_length_of_a_preset(tmp_path: Path) -> None:
    path, preset = tmp_path / "long.py", next(iter(PRESETS.values()))
    save_preset(path, preset)
    text = path.read_text(encoding="utf-8")
    path.write_text(text.ljust(1 << 20), encoding="utf-8")
    assert load_preset(path) == preset
    path.write_text(text.ljust((1 << 20) + 1), encoding="utf-8")
    with pytest.raises(ConfigError, match="it is too long"):
        load_preset(path)
