# SPDX-License-Identifier: GPL-3.0-or-later
"""What docs/motion.md says of two passes and kinematics, measured again."""

from __future__ import annotations

from pathlib import Path

import numpy as np

from scripts.benchmarks import motion


def test_velocities_of_both_methods(tmp_path: Path) -> None:
    results = motion.run_motion(tmp_path)
    bin_mps = 299_792_458.0 / motion.CARRIER_HZ * motion.PRF_HZ / (2 * motion.PULSES)
    assert len(results) == 6
    for result in results:
        assert result["kinematic"]["points"] > 50, result["scene"]
        assert result["kinematic"]["worst"] < 1e-3 * bin_mps, result["scene"]
    two_passes = np.array([result["two-pass"]["rms"] for result in results])
    spread = np.array([r["kinematic"]["highest"] - r["kinematic"]["lowest"] for r in results])
    # crossing, spinning, flat ground: what slides along itself reads zero
    assert np.all(two_passes[[1, 2, 4]] > 0.15 * spread[[1, 2, 4]])
    # a receding plate: v / cos instead of v cos, one per cent
    assert 0.03 < two_passes[0] < 0.2
    assert motion.motion_table(results).count("\n") == 7
