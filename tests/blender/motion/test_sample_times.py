# SPDX-License-Identifier: GPL-3.0-or-later
"""Times of the samples of an animation: those that Blender's float32 frames can have."""

from __future__ import annotations

import numpy as np
import pytest

pytest.importorskip("bpy")

from radarsim_addon.blender.motion.fits import _rounding_step
from radarsim_addon.blender.motion.samples import SamplingPlan


@pytest.mark.parametrize(
    ("keys", "window"),
    [
        ([-40, -30, 9, 11, 60], (9.0, 11.0)),  # up to the next keys
        ([-40, 9, 10.2, 60], (9.0, 12.2)),  # one within the burst: two frames of both its pieces
        ([], (9.24, 11.24)),
    ],
)
def test_samples_stay_between_the_nearest_keys(
    keys: list[float], window: tuple[float, float]
) -> None:
    plan = SamplingPlan(10, 24.0, 0.48 / 24, 1.0, 0.004, 17, keys=keys)
    assert plan.window == pytest.approx(window)


@pytest.mark.parametrize(("frame", "digits"), [(1, 23), (32, 18), (250, 16), (10_000, 10)])
def test_samples_are_dated_as_blender_evaluates_them(frame: int, digits: int) -> None:
    """A float32 frame from 128 to 256 has 16 binary digits after the point: 0.6 us at 24 fps."""
    plan = SamplingPlan(frame, 24.0, 0.02, 1.0, 0.004, 17)
    for fraction in (0.0, 0.1381966, 0.3, 0.7639, 0.99):
        at_s, instant = plan.at(fraction)
        steps = at_s * 24 * 2**digits
        assert steps == pytest.approx(round(steps), abs=1e-4)
        assert abs(at_s - fraction * 0.02) * 24 <= 0.8 * 2.0**-digits
        assert instant.frame + instant.subframe == pytest.approx(
            frame + at_s * 24, abs=0.8 * 2.0**-digits
        )
    assert np.ptp([plan.at(f)[0] for f in (0.0, 1.0)]) == pytest.approx(0.02, rel=1e-2)


@pytest.mark.parametrize(
    ("metres_per_unit", "step_units"), [(1.0, 2.0**-23), (0.01, 2.0**-16), (1000.0, 2.0**-33)]
)
def test_places_are_rounded_in_the_units_of_the_scene(
    metres_per_unit: float, step_units: float
) -> None:
    """1.5 m are 1.5 m, 150 cm or 0.0015 km, of which float32 has 24 binary digits."""
    places_m = np.array([[0.2, -1.5, 0.0]])
    found_m = _rounding_step(places_m, metres_per_unit)
    assert found_m == pytest.approx(step_units * metres_per_unit, rel=1e-12)
