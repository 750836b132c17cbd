# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim process`` by workers: the coordinator's part, and what a worker does."""

from __future__ import annotations

import argparse
import dataclasses
import sys
from pathlib import Path
from typing import Any

from ...findings import Finding, exit_code, from_json, to_json
from ...option_arguments import share_of
from ..distributed import Reply, run_frames
from ..pictures import MapFile, map_file
from ..results import FrameResult
from ..runs import open_run
from .console import frame_lines, kept_lines
from .process import Products, open_products, products_folder
from .process_arguments import chosen_frames, process_options


class FrameProcessor:
    """Processes frames of a run; see :class:`radarsim_addon.frame_worker`.

    Parameters
    ----------
    chosen
        Arguments of ``radarsim process``, parsed.
    """

    def __init__(self, chosen: argparse.Namespace) -> None:
        run = open_run(Path(chosen.folder).absolute())
        options = process_options(chosen).for_run(run)
        # the coordinator has made the folder
        folder = products_folder(run, chosen.out).absolute()
        resume = not chosen.again
        self._products = Products(run, options, folder, chosen.allow_incomplete, resume)

    def about(self) -> dict[str, Any]:
        """Return all frames of the run."""
        return {"frames": self._products.run.record.frames}

    def do(self, frame: int) -> dict[str, Any]:
        """Process a frame, and write its products."""
        source = self._products.run.frame(frame)
        skipped = self._products.skipped(source)
        if skipped is not None:
            return {"findings": [to_json(skipped)]}
        kept = self._products.kept(source)
        if kept is not None:
            return _reply(kept_lines(kept), kept.findings, kept.map) | {"earlier": True}
        *_, result = self._products.process(source)
        assert isinstance(result, FrameResult)
        shown = map_file(result, self._products.folder)
        return _reply(frame_lines(result), result.findings, shown)

    def stop(self) -> None:
        """End now: what is half written is removed on the way."""
        sys.exit()

    def close(self) -> None:
        """Nothing is kept open."""


def _reply(lines: list[str], findings: list[Finding], shown: MapFile) -> dict[str, Any]:
    described = dataclasses.asdict(shown) | {"path": str(shown.path)}
    return {"lines": lines, "findings": [to_json(f) for f in findings], "map": described}


def process_by_workers(chosen: argparse.Namespace, words: list[str]) -> int:
    """Process a run by workers; return the exit code."""
    maps: dict[int, MapFile] = {}
    findings: list[Finding] = []

    def show(reply: Reply) -> None:
        print("\n".join(reply.get("lines", ())))
        findings.extend(from_json(item, "worker") for item in reply.get("findings", ()))
        if "map" in reply:
            path = Path(reply["map"]["path"])
            maps[reply["frame"]] = MapFile(**(reply["map"] | {"path": path}))

    run = open_run(chosen.folder)
    options = process_options(chosen).for_run(run)
    with open_products(run, options, chosen.out, chosen.allow_incomplete) as products:
        about = {"frames": chosen.frames or run.record.frames}
        run_frames(words, share_of(chosen), sys.stdout, show, about=about)
        path = products.draw_common([maps[n] for n in chosen_frames(chosen) if n in maps])
    if path is not None:
        print(f"animation: {path}")
    return exit_code(findings, chosen_frames(chosen) or run.record.frames)
