# SPDX-License-Identifier: GPL-3.0-or-later
"""What all tests in Blender share."""

from __future__ import annotations

from collections.abc import Iterator
from pathlib import Path

import pytest


@pytest.fixture(scope="session")
def group_folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    return tmp_path_factory.mktemp("groups")


@pytest.fixture(autouse=True)
def groups_drawn_once(request: pytest.FixtureRequest, group_folder: Path) -> Iterator[None]:
    """Not where the groups themselves are tested."""
    if request.path.name == "test_nodes.py":
        yield
        return
    from scripts.validation.kept_groups import kept_groups

    with kept_groups(group_folder):
        yield
