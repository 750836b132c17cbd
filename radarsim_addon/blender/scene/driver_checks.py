# SPDX-License-Identifier: GPL-3.0-or-later
"""Drivers that Blender does not evaluate: the objects that they drive do not move."""

from __future__ import annotations

from collections.abc import Iterator
from typing import Any

import bpy

from ...findings import Finding, finding


def disabled_drivers() -> list[Finding]:
    """Find data-blocks with drivers that Blender has refused to evaluate, in the open file.

    Returns
    -------
    list of Finding
        At most one. Call it when the scene has been evaluated.
    """
    names: dict[str, None] = {}
    count = 0
    for item in _data_blocks():
        animation = getattr(item, "animation_data", None)
        for curve in animation.drivers if animation is not None else ():
            if not curve.mute and not (curve.is_valid and curve.driver.is_valid):
                names[item.name] = None
                count += 1
    return [finding("driver-disabled", *names, count=count)] if count else []


def _data_blocks() -> Iterator[Any]:
    """All data-blocks in use, and the node trees that are part of them."""
    for item in bpy.data.user_map():
        if item.users:
            yield item
            tree = getattr(item, "node_tree", None)
            if tree is not None:
                yield tree
