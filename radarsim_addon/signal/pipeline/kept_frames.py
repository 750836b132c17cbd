# SPDX-License-Identifier: GPL-3.0-or-later
"""Frames that are processed already: their products are kept where nothing has changed.

A frame's summary is written last. It holds the fingerprint of all that the products are made of:
settings, the frame's files, and this software. Before a frame is processed again its summary is
removed, so that products next to a summary are always those that it was written for.
"""

from __future__ import annotations

import contextlib
import dataclasses
import functools
import hashlib
import importlib.metadata
import json
import re
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from ... import __version__
from ...contract import frame_dir
from ...errors import FrameFileError, RadarSimError
from ...findings import Finding, from_json
from ...typed_json import read_json
from ..pictures import MapFile
from ..products import SUMMARY_ENDING
from ..radar import make_system
from ..results import frame_file
from ..runs import RadarFrame, Run, shared_plan
from .options import ResolvedOptions

#: Packages besides numpy whose versions change products.
_PACKAGES = ("finufft", "matplotlib")
#: Fields of a run's plan that change where frames are added to it.
_OF_ALL_FRAMES = ("frames", "frame_times_s")
#: Options that change no file of a frame; `plots` is settled by who draws.
_OF_NO_FRAME = ("animate", "animation_format", "plots")
_MOST_BYTES = 1 << 26
#: In a frame's record: no product depends on it, and the record's digest does.
_RENDER_TIME = re.compile(rb'"(render_time_s|record_sha256)": *[^,}\s]*')


@dataclass(frozen=True)
class KeptFrame:
    """A frame whose products were there already.

    Attributes
    ----------
    frame
        Its number.
    files
        Its products.
    findings
        What to know before you trust the frame.
    map
        Its map, for the animation.
    """

    frame: int
    files: tuple[Path, ...]
    findings: list[Finding]
    map: MapFile


class Fingerprints:
    """Fingerprints of a run's frames, processed with these options; `draws`: with pictures."""

    def __init__(self, run: Run, options: ResolvedOptions, draws: bool) -> None:
        plan = shared_plan(run.record)
        settings = {
            field.name: getattr(options, field.name) for field in dataclasses.fields(options)
        }
        budget = options.link_budget
        shared = {
            "plan": {key: value for key, value in plan.items() if key not in _OF_ALL_FRAMES},
            "settings": {key: v for key, v in settings.items() if key not in _OF_NO_FRAME},
            # patterns that are read from files
            "antennas": budget and make_system(budget, options.radar.waveform.wavelength_m),
            "draws": draws,
            "software": _software(),
        }
        self._shared = hashlib.sha256(json.dumps(_plain(shared), sort_keys=True).encode())

    def of(self, frame: RadarFrame) -> str:
        """Return the fingerprint of a frame: SHA-256 in hexadecimal digits."""
        digest, folder = self._shared.copy(), frame.run.path / frame_dir(frame.number)
        digest.update(f"{frame.number} {frame.time_s!r}".encode())
        for path in sorted(folder.rglob("*")):
            if path.suffix in (".json", ".npy", ".npz", ".exr") and path.name[0] != ".":
                digest.update(f"\0{path.relative_to(folder)}\0".encode())
                # what cannot be read is named by who needs its content
                with contextlib.suppress(OSError):
                    if path.suffix == ".json":  # the records hold hashes of all that is large
                        digest.update(_RENDER_TIME.sub(b"", path.read_bytes()))
                    else:
                        digest.update(str(path.stat().st_size).encode())
        return digest.hexdigest()


def kept_frame(folder: Path, frame: RadarFrame, fingerprint: str) -> KeptFrame | None:
    """Return what an earlier process left of a frame in `folder`; None where it has to be done."""
    path = frame_file(folder, frame.number, SUMMARY_ENDING)
    try:
        summary = read_json(path, _MOST_BYTES, "", FrameFileError)
        if summary.get("fingerprint") != fingerprint:
            return None
        sizes = {folder / name: size for name, size in summary["files"].items()}
        if any(not file.is_file() or file.stat().st_size != size for file, size in sizes.items()):
            return None
        findings = [from_json(item, str(path)) for item in summary["findings"]]
        shown = MapFile(
            frame_file(folder, frame.number, "_map.npz"),
            frame.number,
            frame.time_s,
            **{name: float(value) for name, value in summary["map"].items()},
        )
    # whatever is wrong with it: the frame is processed
    except (RadarSimError, OSError, KeyError, TypeError, ValueError, AttributeError):
        return None
    return KeptFrame(frame.number, (*sizes, path), findings, shown)


def _plain(value: Any) -> Any:
    """A value as JSON that is the same for equal values, arrays by their hash."""
    if isinstance(value, np.ndarray):
        return [str(value.dtype), value.shape, hashlib.sha256(value.tobytes()).hexdigest()]
    if isinstance(value, dict):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if value is None or isinstance(value, bool | int | float | str):
        return repr(value)
    if hasattr(value, "__dict__"):
        return [type(value).__qualname__, _plain(vars(value))]
    return repr(value)


@functools.cache
def _software() -> dict[str, str]:
    """Versions, and the hash of the source: a checkout changes without its version."""
    root = Path(__file__).resolve().parents[2]
    found = {"radarsim": __version__, "numpy": np.__version__}
    for name in _PACKAGES:
        with contextlib.suppress(importlib.metadata.PackageNotFoundError):
            found[name] = importlib.metadata.version(name)
    digest = hashlib.sha256()
    for path in sorted(root.rglob("*.py")):
        if path.relative_to(root).parts[0] != "blender":
            digest.update(path.read_bytes())
    return found | {"source": digest.hexdigest()}
