# SPDX-License-Identifier: GPL-3.0-or-later
"""Findings that a render left in the records of its frames."""

from __future__ import annotations

from collections.abc import Iterable
from pathlib import Path

from ... import contract
from ...findings import Finding
from ...sidecar import read_record


def frame_findings(folder: Path, frames: Iterable[int]) -> list[Finding]:
    """Return the findings of these frames as far as they are done, by whatever session.

    Parameters
    ----------
    folder
        Of the run.
    frames
        Their numbers.

    Returns
    -------
    list of Finding
        None of rings, whose renders have no findings of their own.
    """
    found: list[Finding] = []
    for frame in frames:
        path = folder / contract.frame_dir(frame) / contract.PATHS_FILE
        if path.is_file():
            found += read_record(path, contract.PathsRecord).findings
    return found
