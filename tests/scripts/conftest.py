# SPDX-License-Identifier: GPL-3.0-or-later
"""What tests of the scripts share with those in Blender."""

from __future__ import annotations

import importlib.util

if importlib.util.find_spec("bpy") is not None:
    from tests.blender.conftest import group_folder, groups_drawn_once  # noqa: F401
