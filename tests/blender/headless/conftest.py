# SPDX-License-Identifier: GPL-3.0-or-later
"""The command that renders, without a process of its own."""

from __future__ import annotations

import signal as signals
import subprocess
import sys
from collections.abc import Callable, Iterator
from typing import Any

import pytest

Done = subprocess.CompletedProcess[str]
Command = Callable[..., Done]


@pytest.fixture
def here(monkeypatch: pytest.MonkeyPatch, capfd: pytest.CaptureFixture[str]) -> Iterator[Command]:
    """The command in this process, as `radarsim render` has it in one of its own."""
    import bpy

    from radarsim_addon.__main__ import render_command
    from radarsim_addon.blender import rig_settings as properties
    from radarsim_addon.blender.headless import render

    def run(*words: Any) -> Done:
        capfd.readouterr()
        with pytest.raises(SystemExit) as end:
            render_command([str(word) for word in words], "render_radar.py")
        return Done(words, end.value.code, *capfd.readouterr())

    before = {number: signals.getsignal(number) for number in (signals.SIGINT, signals.SIGTERM)}
    monkeypatch.setattr(render, "leave_blender", sys.exit)
    yield run
    for number, handler in before.items():
        signals.signal(number, handler)
    if hasattr(bpy.types.Object, properties.RADAR_PROPERTY):
        properties.unregister()
    bpy.ops.wm.read_homefile(use_empty=True, use_factory_startup=True)
