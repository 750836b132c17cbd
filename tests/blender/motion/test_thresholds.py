# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits are crossed: just below and just above."""

from __future__ import annotations

import itertools
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from radarsim_addon.blender.motion.burst_motion import _approximated
from radarsim_addon.blender.motion.deforming import SurfacePoints, are_same_points
from radarsim_addon.blender.motion.fits import Fits
from radarsim_addon.blender.motion.samples import SamplingPlan

pytestmark = pytest.mark.blender
_fits: Any = Fits


def _plan(frames: float, *keys: float) -> SamplingPlan:
    return SamplingPlan(0, 1.0, frames, 1.0, 1.0, 100, keys=keys)


def _same(places: list[float], marks: float, on_grid: bool) -> bool:
    """Whether points at 1 are the same at `places`, with marks of 1 that slide by `marks`."""
    none = np.empty(0, dtype=np.int32)
    one, two = np.ones((1, 3), dtype=np.float32), np.array([places], dtype=np.float32)
    slid = (one + marks).astype(np.float32)
    return are_same_points(
        SurfacePoints(one, none, one, (), on_grid), SurfacePoints(two, none, slid, (), on_grid)
    )


def _slides(fraction: float) -> bool:
    return _same([2, 1, 1], fraction, False)


def _on_grid(steps: float) -> bool:
    return _same([1 + steps * 2.0**-23, 1, 1], 0.0, True)


def _biased(bias: float, stderr: float) -> bool:
    motion = SimpleNamespace(rate_bias_mps=bias, rate_stderr_mps=stderr)
    return bool(_fits.biased.fget(SimpleNamespace(_plan=_plan(1.0), _motions={0: motion})))


def _resolved(targets: float) -> bool:
    motion = SimpleNamespace(moving=True, displacement_error_bound_m=targets)
    return bool(
        _fits.resolved.fget(
            SimpleNamespace(
                _missed={},
                _missed_surfaces={},
                _smooth=(),
                _motions={0: motion},
                _target_of=lambda index: 1.0,
            )
        )
    )


def _off_line(fraction: float) -> bool:
    """Whether points that turn by 1 m per frame are off the straight line between frames."""
    plan = _plan(1.0)
    whole = [at_s for at_s, _ in plan.whole_frames()]
    places = dict(zip(whole, (0.0, 0.0, 1.0, 2.0), strict=True))
    for one, other in itertools.pairwise(whole):
        places[(one + other) / 2] = (places[one] + places[other]) / 2 + fraction
    sampled = {at_s: np.array([[x, 0, 0]]) for at_s, x in places.items()}
    return bool(_fits._off_whole_frames_mps(SimpleNamespace(_plan=plan), sampled) > 0)


@pytest.mark.parametrize(
    ("decides", "on", "off"),
    [
        pytest.param(lambda x: _approximated(x)[0].severity != "info", 0.011, 0.009, id="caution"),
        pytest.param(_slides, 0.019, 0.021, id="slide"),
        pytest.param(_on_grid, 15, 17, id="rounded"),
        pytest.param(lambda x: bool(_plan(x).corners_s), 63.0, 65.0, id="corners"),
        pytest.param(lambda x: _plan(20.0, 10.0).is_clear(10 + x), 2.2e-4, 1.5e-4, id="key"),
        pytest.param(lambda x: _biased(x, 0.01), 0.016, 0.014, id="rate"),
        pytest.param(lambda x: _biased(0.9, x), 0.059, 0.061, id="near-target"),
        pytest.param(_resolved, 7.9, 8.1, id="miss"),
        pytest.param(_off_line, 0.011, 0.009, id="on-frames"),
    ],
)
def test_limit_decides(decides: Any, on: float, off: float) -> None:
    assert decides(on)
    assert not decides(off)
