# SPDX-License-Identifier: GPL-3.0-or-later
"""Limits are crossed: just below and just above."""

from __future__ import annotations

import itertools
from pathlib import Path
from types import SimpleNamespace
from typing import Any
from unittest import mock

import numpy as np
import pytest

from radarsim_addon.blender.motion import burst_motion
from radarsim_addon.blender.motion.burst_motion import _approximated
from radarsim_addon.blender.motion.deforming import are_same_points
from radarsim_addon.blender.motion.fits import Fits
from radarsim_addon.blender.motion.samples import Sampler, SamplingPlan
from radarsim_addon.blender.state import SurfacePoints

pytestmark = pytest.mark.blender
_fits: Any = Fits
_sampler: Any = Sampler
_burst: Any = burst_motion.BurstMotion


def _plan(frames: float, *keys: float) -> SamplingPlan:
    return SamplingPlan(0, 1.0, frames, 1.0, 1.0, 100, keys=keys)


def _same(places: list[float], marks: float, on_grid: bool) -> bool:
    """Whether points at 1 are the same at `places`, with marks of 1 that slide by `marks`."""
    none = np.empty(0, dtype=np.int32)
    one, two = np.ones((1, 3), dtype=np.float32), np.array([places], dtype=np.float32)
    slid = (one + marks).astype(np.float32)
    return are_same_points(
        SurfacePoints(one, none, one), SurfacePoints(two, none, slid), on_grid=on_grid
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


def _leads_away(wavelengths: float) -> bool:
    """Whether a surface that changes is that far from where its matrix leads."""
    surface = SimpleNamespace(apart_m=lambda *_: wavelengths, rounding_m=0.0)
    scale = SimpleNamespace(to_scale=lambda: (1.0, 1.0, 1.0))
    shown = SimpleNamespace(evaluated=lambda _: SimpleNamespace(matrix_world=scale))
    plan = SimpleNamespace(
        rendered=(0.0, 0), rendered_fraction=0.0, at=lambda _: (1.0, 1), wavelength_m=1.0
    )
    burst = SimpleNamespace(
        _plan=plan, _show=lambda _: shown, _units=1.0, _apart_m=0.0, findings=[]
    )
    with mock.patch.object(burst_motion, "DeformingSurface", return_value=surface):
        _burst._say_not_followed(burst, {"Box": None})
    return bool(burst.findings[0].code == "surface-not-followed")


def _says_error(wavelengths: float) -> bool:
    """Whether a bound of the displacement error is said with the motion of a frame."""
    burst = mock.MagicMock(_bound_m=wavelengths, _apart_m=0.0, _approximated_w=0.0, findings=[])
    burst._plan.wavelength_m = burst._power_w = 1.0
    burst._scene.tracks = None
    with (
        mock.patch.object(burst_motion, "write_bodies", return_value=([], "", "")),
        mock.patch.object(burst_motion, "body_record"),
        mock.patch.object(burst_motion, "MotionRecord"),
        mock.patch.object(burst_motion, "write_record"),
    ):
        _burst.write(burst, Path(), 0.0, {})
    return "displacement-error" in {one.code for one in burst.findings}


def _fits_alone(samples: float) -> bool:
    """Whether a motion that is not followed is fitted again to so many samples of the burst."""
    moving = np.eye(4) * np.arange(1.0, samples + 2)[:, None, None]
    times_s = [-1.0, *np.linspace(0, 1, int(samples)).tolist()]
    fits: Any = object.__new__(Fits)
    sampler = SimpleNamespace(
        changing=np.array([2]),
        poses=lambda at_s, rows: moving[[times_s.index(at_s)]],
    )
    fits._plan, fits._sampler = SimpleNamespace(duration_s=1.0, rendered=(0.0, 0)), sampler
    fits._checks_s, fits._smooth, fits._fitted = [0.0], set(), False
    fits._missed, fits._motions, counts = {}, {}, []

    def fit_body(index: int, times: Any, poses: Any) -> Any:
        counts.append(len(times))
        fits._missed[index] = 1.0
        return SimpleNamespace(noise_m=1.0)

    fits._fit_body, fits._fit_surfaces = fit_body, lambda _: 0
    fits.fit(times_s)
    return len(counts) == 2


def _jumps(times_faster: float) -> bool:
    """Whether a step between steps of 1 m is a jump, which it stays when it is halved."""
    sampler = SimpleNamespace(
        changing=np.array([2]),
        surfaces=(),
        plan=_plan(10.0),
        _name=str,
        _steps_m=lambda rows, low_s, high_s: np.array([times_faster if 1 <= low_s < 2 else 1.0]),
        _around_jump=lambda *_: (1.4, 1.6),
        _least_jumps_m=lambda *_: np.zeros(1),
    )
    return bool(_sampler.jumps(sampler, [0.0, 1.0, 2.0, 3.0]))


def _stays(part: float) -> bool:
    """Whether a step of which this part is a jump, and the rest even motion, is located.

    After three halvings part + (1 - part) / 8 is left: half of the step at 3/7.
    """
    plan = SimpleNamespace(fps=1.0, moment=lambda at_s: (at_s, None))
    sampler = SimpleNamespace(
        plan=plan,
        take=lambda *_: None,
        _steps_m=lambda rows, low_s, high_s: np.array(
            [(high_s - low_s) * (1 - part) + part * (low_s <= 0.3 < high_s)]
        ),
    )
    return _sampler._around_jump(sampler, np.array([2]), 0, 0.0, 1.0) is not None


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
        pytest.param(_leads_away, 0.011, 0.009, id="not-followed"),
        pytest.param(_says_error, 0.011, 0.009, id="displacement"),
        pytest.param(_fits_alone, 13, 12, id="burst-alone"),
        pytest.param(_jumps, 4.1, 3.9, id="sudden"),
        pytest.param(_stays, 0.44, 0.42, id="jump-that-stays"),
    ],
)
def test_limit_decides(decides: Any, on: float, off: float) -> None:
    assert decides(on)
    assert not decides(off)
