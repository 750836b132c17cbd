# SPDX-License-Identifier: GPL-3.0-or-later
"""Level ground whose sigma0 falls with the grazing angle: neither combs nor gaps in its profile.

256 rows of pixels over 12 degrees from 0.5 m above the ground: they are 16 m apart at 100 m.
"""

from __future__ import annotations

import dataclasses
import math
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.arrays import Real
from radarsim_addon.signal import make_paths, open_run
from radarsim_addon.signal.decoding import FrameInput, frame_paths, open_frame
from radarsim_addon.signal.maps import expected_power
from radarsim_addon.signal.paths import PathRows, replicate_offset_px
from radarsim_addon.signal.scattering import FrameSpeckle
from tests.signal import path_runs as pr
from tests.signal.scattering.test_footprint_echoes import (
    CAMERA,
    EMITTER,
    GROUND,
    HEIGHT_M,
    RADAR,
    mean_power,
)

SIZE_PX, REPLICATES = 256, 2


def sigma0(model: str, sine: Real) -> Real:
    """Constant gamma of -15 dB, or NRL's sea, horizontal, sea state 3, 9.65 GHz."""
    if model == "gamma":
        return 10**-1.5 * sine
    psi, lg = np.degrees(np.arcsin(sine)), math.log10(9.65)
    db = -73.0 + 20.781 * np.log10(sine) + (27.5 + 7.351 * psi) * lg / (1 + 0.95 * psi)
    db += 25.65 * 4 ** (1 / (2 + 0.085 * psi + 0.099)) + 0.0054 * psi**2
    return np.asarray(10 ** (db / 10))


def ground(model: str, folder: Path) -> FrameInput:
    pitch, parts = (CAMERA.right - CAMERA.left) / SIZE_PX, []
    for number in range(REPLICATES):
        u, v = (pitch * x for x in replicate_offset_px(number))
        moved = dataclasses.replace(
            CAMERA, left=CAMERA.left + u, right=CAMERA.right + u, bottom=CAMERA.bottom + v,
            top=CAMERA.top + v,
        )  # fmt: skip
        rows = pr.trace([GROUND], moved, EMITTER, SIZE_PX)
        sine = HEIGHT_M / (rows["length_m"] / 2)
        # the plate is a Lambert one of albedo 1: sigma0 = 4 sin^2
        rows["power_w"] *= sigma0(model, sine) / (4 * sine**2) / REPLICATES
        rows["solid_angle_sr"] /= REPLICATES
        rows["replicate"] = number
        parts.append(rows)
    pr.write_run(
        folder, PathRows.joined(parts), ["Ground"], CAMERA, EMITTER, range_limits_m=1400.0,
        replicates=REPLICATES,
    )  # fmt: skip
    return open_frame(open_run(folder).frame(1), radar=RADAR, range_limits_m=(20.0, 150.0))


def integrated(model: str) -> Real:
    """Radiance E / (4 pi r^2) sigma0 / (4 pi sin psi) times solid angle h dr dphi / r^2, as the
    radar shows it by metres.

    The view is a pyramid: at a place y ahead and h below its half width is its tangent times depth.
    """
    step_m = 0.01
    range_m = np.arange(10.0, 250.0, step_m) + step_m / 2
    ahead_m = np.sqrt(range_m**2 - HEIGHT_M**2)
    down = math.radians(2.0)
    depth_m = ahead_m * math.cos(down) + HEIGHT_M * math.sin(down)
    azimuth = 2 * np.arctan(CAMERA.right * depth_m / ahead_m)
    sine = HEIGHT_M / range_m
    radiance = 5.0 / (4 * np.pi * range_m**2) * sigma0(model, sine) / (4 * np.pi * sine)
    solid_sr = HEIGHT_M * step_m * azimuth / range_m**2
    return mean_power(make_paths(radiance, 2 * range_m, solid_angle_sr=solid_sr))


@pytest.mark.parametrize("model", ["gamma", "sea"])
def test_neither_echoes_nor_expected_power_have_a_comb(model: str, tmp_path: Path) -> None:
    """As the radar shows them: points are as far apart as it tells two echoes from one another."""
    frame, truth = ground(model, tmp_path / "run"), integrated(model)
    paths = frame_paths(frame)
    single = mean_power(paths) / truth
    assert np.sqrt(np.mean((single - 1) ** 2)) > 0.5
    found: list[Real] = []
    expected_power(frame, points_to=lambda points: found.append(mean_power(points)))
    for spread in (mean_power(FrameSpeckle(frame, 0).apply(paths)), np.sum(found, axis=0)):
        ratio = spread / truth
        assert np.sqrt(np.mean((ratio - 1) ** 2)) < 0.02
        assert ratio.min() > 0.95 and abs(ratio.mean() - 1) < 0.01
