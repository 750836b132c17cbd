# SPDX-License-Identifier: GPL-3.0-or-later
"""Which renders of a run need not be made again. Does not import bpy."""

from __future__ import annotations

from pathlib import Path

from ... import contract
from ...errors import RadarSimError
from ...sidecar import file_sha256, read_record
from ...signal.motion import read_motion


def render_is_whole(run: Path, frame: int, render: int, span_s: float, fingerprint: str) -> bool:
    """Return whether all files of a render of a burst are as this run wrote them.

    Parameters
    ----------
    run
        Folder of the run.
    frame, render
        Number of the radar frame, and of the render in its burst, from 0.
    span_s
        Length of the burst: motion of a shorter one is sampled again [s].
    fingerprint
        That of the run.

    Returns
    -------
    bool
        False also where the frame has no ground truth, which is written before the renders.
    """
    folder = run / contract.burst_dir(frame, render)
    try:
        record = read_record(folder / contract.PATHS_FILE, contract.PathsRecord)
        labels = read_record(
            run / contract.frame_dir(frame) / contract.GROUND_TRUTH_FILE, contract.GroundTruthRecord
        )
        if {record.run_fingerprint, labels.run_fingerprint} != {fingerprint}:
            return False
        motion = read_motion(folder, frame, record.motion_sha256)
        whole = motion.span_s >= span_s * (1 - 1e-9)
        return whole and file_sha256(folder / record.table_file) == record.table_sha256
    except (RadarSimError, OSError):
        return False
