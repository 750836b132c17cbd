# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests in Blender share."""

from __future__ import annotations

from pathlib import Path
from typing import Any

import pytest


@pytest.fixture(scope="session")
def group_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("groups")


@pytest.fixture(autouse=True)
def groups_drawn_once(
    request: pytest.FixtureRequest, monkeypatch: pytest.MonkeyPatch, group_folder: Path
) -> None:
    """Node groups come from a file after their first time: drawing one takes longer than a render.

    Not where the groups themselves are tested.
    """
    if request.path.parent.name == "nodes":
        return
    import bpy

    from radarsim_addon.blender.nodes import groups

    draw, known = groups.new_group, tuple(groups.DEFINITIONS.values())

    def new_group(definition: Any) -> Any:
        path = group_folder / f"{definition.kind}.blend"
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

    monkeypatch.setattr(groups, "new_group", new_group)
