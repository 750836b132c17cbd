# SPDX-License-Identifier: GPL-3.0-or-later
"""Node groups that come from a file after their first time: drawing takes longer than a render."""

from __future__ import annotations

from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any
from unittest.mock import patch

import bpy

from radarsim_addon.blender.nodes import groups


@contextmanager
def kept_groups(folder: Path) -> Iterator[None]:
    """Keep the groups that are drawn within the context in files of a folder."""
    draw, known = groups.new_group, tuple(groups.DEFINITIONS.values())

    def new_group(definition: Any) -> Any:
        path = folder / f"{definition.kind}.blend"
        if not any(definition is item for item in known):
            return draw(definition)
        if not path.exists():
            tree = draw(definition)
            bpy.data.libraries.write(str(path), {tree})
            return tree
        before = set(bpy.data.libraries)
        with bpy.data.libraries.load(str(path), link=False) as (found, chosen):
            chosen.node_groups = found.node_groups
        for library in set(bpy.data.libraries) - before:
            bpy.data.libraries.remove(library)
        return chosen.node_groups[0]

    with patch.object(groups, "new_group", new_group):
        yield
