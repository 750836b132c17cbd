# SPDX-License-Identifier: GPL-3.0-or-later
"""Which device Cycles renders on, and whether a check of it has passed.

What a measurement presumes of Cycles was found on the CPU. A GPU is checked once for each version
of Blender and radarsim, in a process of its own (`headless.selfcheck`): a kernel that crashes or
hangs takes no window along. The outcome is kept in the user's cache folder.
"""

from __future__ import annotations

import contextlib
import dataclasses
import hashlib
import json
import os
import subprocess
import sys
import tempfile
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import bpy

from ... import __version__, errors
from ...atomic_files import make_folder, write_json
from ...errors import RadarSimError

#: Kinds of devices that Cycles has, as its preferences name them.
KINDS = ("CPU", "CUDA", "OPTIX", "HIP", "ONEAPI", "METAL")
#: Longest check [s]. Kernels that Blender has to compile first take most of it.
_TIME_LIMIT_S = 300.0
NO_ANSWER = "the check ends"


@dataclass(frozen=True)
class Device:
    """A kind of device and the devices of it, by Cycles' own identifiers."""

    kind: str = "CPU"
    ids: tuple[str, ...] = ()


@dataclass(frozen=True)
class Verdict:
    """Outcome of a check: largest deviation and bound of each fact, and those that failed."""

    facts: dict[str, tuple[float, float]]
    failed: tuple[str, ...]


def chosen_device(scene: Any) -> Device:
    """Return what a scene and the user's preferences choose; the CPU where they choose none."""
    addon = bpy.context.preferences.addons.get("cycles")
    if scene.cycles.device != "GPU" or addon is None:
        return Device()
    kind = addon.preferences.compute_device_type
    used = [item for item in addon.preferences.devices if item.use]
    if not any(item.type == kind for item in used):
        return Device()  # Cycles takes the CPU, too
    return Device(kind, tuple(sorted(item.id for item in used)))


def choose_device(scene: Any, device: Device) -> None:
    """Set scene and preferences (in memory) to a device; no ids: to all devices of its kind.

    RadarSimError where Blender does not find it.
    """
    scene.cycles.device = "CPU" if device.kind == "CPU" else "GPU"
    if device.kind == "CPU":
        return
    preferences = bpy.context.preferences.addons["cycles"].preferences
    try:
        preferences.compute_device_type = device.kind
    except TypeError:
        raise RadarSimError(
            f"This Blender has no devices of kind {device.kind}. Choose another one, or CPU."
        ) from None
    preferences.refresh_devices()
    for item in preferences.devices:
        item.use = item.id in device.ids if device.ids else item.type == device.kind
    if chosen_device(scene).kind != device.kind:
        raise RadarSimError(
            f"Blender finds no device of kind {device.kind} on this machine. Install its driver, "
            "or choose CPU."
        )


def failed_facts(scene: Any) -> tuple[Device, tuple[str, ...]]:
    """Return the device that is chosen and the facts that do not hold on it; checked once."""
    device = chosen_device(scene)
    if device.kind == "CPU":
        return device, ()
    path = cache_file(device)
    verdict = _read(path)
    if verdict is None:
        verdict = check(device)
        keep(path, verdict)
    return device, verdict.failed


def check(device: Device) -> Verdict:
    """Check a device in a process of its own."""
    root = Path(errors.__file__).parent
    code = (
        f"import sys; sys.path.insert(0, {str(root.parent)!r}); "
        f"from {root.name}.blender.headless.selfcheck import check_here; check_here(sys.argv[-1])"
    )
    program = bpy.app.binary_path
    words = [sys.executable, "-c", code]
    if program:
        words = [program, "--background", "--factory-startup", "--python-expr", code, "--"]
    with tempfile.TemporaryDirectory(prefix="radarsim_") as name:
        order = Path(name, "check.json")
        write_json(order, dataclasses.asdict(device))
        said = ""
        with contextlib.suppress(OSError, subprocess.TimeoutExpired):
            done = subprocess.run(
                [*words, str(order)],
                timeout=_TIME_LIMIT_S,
                check=False,
                stdin=subprocess.DEVNULL,
                stdout=subprocess.DEVNULL,
                stderr=subprocess.PIPE,
                encoding="utf-8",
                errors="replace",
                creationflags=getattr(subprocess, "CREATE_NO_WINDOW", 0),
            )
            said = f" (exit code {done.returncode}) {done.stderr.strip()[-200:]}"
        return _read(order) or Verdict({}, (NO_ANSWER + said.rstrip(),))


def keep(path: Path, verdict: Verdict) -> None:
    """Write a verdict; a cache that cannot be written costs another check."""
    try:
        make_folder(path.parent.parent)
        make_folder(path.parent)
        write_json(path, dataclasses.asdict(verdict))
    except (OSError, RadarSimError):
        pass


def cache_file(device: Device) -> Path:
    """Return where the verdict on a device is kept: one for each build of Blender and radarsim."""
    key = [__version__, bpy.app.version_string, str(bpy.app.build_hash), device.kind, *device.ids]
    name = hashlib.sha256(json.dumps(key).encode()).hexdigest()[:16]
    home = Path.home()
    folder = {"win32": home / "AppData/Local", "darwin": home / "Library/Caches"}.get(
        sys.platform, home / ".cache"
    )
    given = os.environ.get("LOCALAPPDATA" if sys.platform == "win32" else "XDG_CACHE_HOME")
    return (Path(given) if given else folder) / "radarsim" / f"device-{name}.json"


def _read(path: Path) -> Verdict | None:
    """A verdict; None where there is none that can be read."""
    try:
        data = json.loads(path.read_text(encoding="utf-8"))
        facts = {str(k): (float(v[0]), float(v[1])) for k, v in data["facts"].items()}
        return Verdict(facts, tuple(map(str, data["failed"])))
    except (OSError, ValueError, KeyError, TypeError, AttributeError, IndexError):
        return None
