# SPDX-License-Identifier: GPL-3.0-or-later
"""Timers that may change data: what they return, and what they raise."""

from __future__ import annotations

from collections.abc import Iterator

import pytest

bpy = pytest.importorskip("bpy")

from radarsim_addon.blender.ui import fields

pytestmark = pytest.mark.blender


@pytest.fixture(autouse=True)
def registered() -> Iterator[None]:
    before = hasattr(bpy.types.WindowManager, "radarsim_timer")
    fields.register_timer_writes()
    yield
    if not before:
        fields.unregister_timer_writes()


@pytest.mark.parametrize("pause_s", [None, 0.25])
def test_a_timer_runs_in_the_update_of_a_property(pause_s: float | None) -> None:
    seen = []

    @fields.may_write
    def timer() -> float | None:
        seen.append(bpy.context.window_manager.radarsim_timer)
        return pause_s

    assert timer() == timer() == pause_s
    assert seen == [not seen[1], seen[1]]  # the property was set before
    assert not fields._calls


def test_its_error_is_raised() -> None:
    @fields.may_write
    def timer() -> float | None:
        raise RuntimeError("no file")

    with pytest.raises(RuntimeError, match="no file"):
        timer()


@pytest.mark.parametrize(
    "words",
    [
        "Writing to ID classes in this context is not allowed: Scene",
        "Calling operator error, can't modify blend data in this state (drawing/rendering)",
    ],
)
def test_what_blender_refuses_is_done_again_in_the_update(words: str) -> None:
    seen = []

    @fields.may_write_at_need
    def timer() -> float | None:
        seen.append(bpy.context.window_manager.radarsim_timer)
        if words and len(seen) == 1:
            raise AttributeError(words)
        return 0.5

    assert timer() == 0.5 and len(seen) == 2 and seen[0] != seen[1]
    assert timer() == 0.5 and seen[2] == seen[1]  # nothing was refused, nothing is drawn again
    seen.clear()
    words = "no such attribute"
    with pytest.raises(AttributeError, match="no such attribute"):
        timer()
    assert len(seen) == 1
