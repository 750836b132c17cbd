# SPDX-License-Identifier: GPL-3.0-or-later
"""Range profiles of level surfaces with a clutter model: what pixels cover, not single rays."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import bpy
import numpy as np

from radarsim_addon import blender as radarsim
from radarsim_addon.arrays import Real
from radarsim_addon.contract import LinkBudget
from radarsim_addon.physics.clutter import clutter_model
from radarsim_addon.signal import expected_power_profile, make_paths, open_run
from radarsim_addon.signal.decoding import FrameInput, frame_paths, open_frame
from radarsim_addon.signal.detection import FrameBudget
from radarsim_addon.signal.maps import expected_power
from radarsim_addon.signal.paths import Paths
from radarsim_addon.signal.scattering import FrameSpeckle

from .case import Bench, Check, absolute_check, power_check, worst_of
from .scenes import EIRP_W, Acquired, acquire, add_mesh, new_scene, wavelength

CARRIER_HZ = 9.65e9
_STEP_M = 0.02


def _measure(
    bench: Bench,
    model: str,
    height_m: float,
    limits_m: tuple[float, float],
    view_deg: tuple[float, float],
    *,
    replicates: int,
    **settings: Any,
) -> tuple[Acquired, FrameInput, Real, Real]:
    """A level surface seen from a height: the run, its frame; ranges, and power at each by metres.

    `view_deg` is the vertical field of view and the depression of its middle; it is 8 times as high
    as it is wide.
    """
    new_scene(view_deg[0])
    radar = bpy.data.objects["Radar"]
    radar.location, radar.rotation_euler = (0, 0, height_m), (math.radians(90 - view_deg[1]), 0, 0)
    material = radarsim.material("metal")
    parameters: dict[str, Any] = {"sea_state": 3.0} if model == "nrl_sea" else {"gamma_db": -15.0}
    radarsim.set_clutter(material, model, **parameters)
    # Strips, since Cycles rounds hit points of faces that are much larger than the range. Wider to
    # one side: no ray meets the edge between two triangles along the middle.
    low_m, high_m = 0.9 * limits_m[0], 1.15 * limits_m[1]
    half_m, count = 0.1 * high_m, 100
    places = [
        (x, y, 0.0)
        for y in np.linspace(low_m, high_m, count + 1).tolist()
        for x in (-half_m, 1.1 * half_m)
    ]
    faces = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(count)]
    add_mesh("Surface", places, faces, material)
    run = acquire(
        bench,
        32,
        replicates,
        height_px=256,
        carrier_hz=CARRIER_HZ,
        polarisation="horizontal",
        prf_hz=1000.0,
        pulses=1,
        **settings,
    )
    frame = open_frame(open_run(run.folder).frame(1), range_limits_m=limits_m)
    ahead_m = np.arange(low_m, high_m, _STEP_M) + _STEP_M / 2
    down = math.radians(view_deg[1])
    depth_m = ahead_m * math.cos(down) + height_m * math.sin(down)
    width_m = 2 * run.record.receiver.right * depth_m  # the view is a pyramid
    range_m = np.hypot(ahead_m, height_m)
    psi = np.arcsin(height_m / range_m)
    db = clutter_model(model).sigma0_db(CARRIER_HZ, psi, "horizontal", **parameters)
    link = EIRP_W * wavelength(CARRIER_HZ) ** 2 / (4 * math.pi) ** 3
    return run, frame, range_m, link * 10 ** (db / 10) * width_m * _STEP_M / range_m**4


def level_ground(bench: Bench) -> list[Check]:
    """Rows of pixels up to 16 m apart: rms error of 1 m bins from 50 to 100 m, and empty ones.

    The bins hold the mean power of range profiles, with the response of the waveform.
    """
    checks = []
    for model in ("constant_gamma", "nrl_sea"):
        _, frame, range_m, power = _measure(
            bench, model, 0.5, (20.0, 150.0), (12.0, 2.0), replicates=2, bandwidth_hz=150e6,
            sampling_rate_hz=180e6, chirp_duration_s=1e-6,
        )  # fmt: skip
        seen = (range_m >= 20.0) & (range_m <= 150.0)
        scale = 4 * math.pi / wavelength(CARRIER_HZ) ** 2
        truth = _bins(frame, make_paths(scale * power[seen], 2 * range_m[seen]))
        paths = frame_paths(frame)
        echoes = FrameSpeckle(frame, 0).apply(paths)
        within = (echoes.length_m >= 40.0) & (echoes.length_m <= 300.0)
        found = expected_power(frame)
        profiles = {
            "single rays": _bins(frame, paths.select(paths.length_m <= 300.0)),
            "echoes": _bins(frame, echoes.select(within)),
            "expected power": _metres(found.range_m, found.profile),
        }
        for what, profile in profiles.items():
            ratio = profile / truth
            error, empty = float(np.sqrt(np.mean((ratio - 1) ** 2))), float(np.mean(ratio < 0.1))
            if what == "single rays":
                bench.lines.append(f"{model}, {what}: {error:.2f} rms, {empty:.0%} of bins empty")
                continue
            name, source = f"{what} of level ground, {model}", "integral over the ground"
            checks.append(absolute_check(f"{name}: rms", 0.0, error, 0.05, source))
            checks.append(absolute_check(f"{name}: empty bins", 0.0, empty, 1e-9, source))
    return checks


def _bins(frame: FrameInput, paths: Paths) -> Real:
    found = expected_power_profile(paths, frame.radar, range_limits_m=(20.0, 150.0))
    return _metres(found.range_m, found.power)


def _metres(range_m: Real, power: Real) -> Real:
    """Mean power in each metre from 50 to 100 m."""
    number = np.floor(range_m).astype(int) - 50
    here = (number >= 0) & (number < 50)
    return np.asarray(np.bincount(number[here], power[here]) / np.bincount(number[here]))


def sea_profile(bench: Bench) -> list[Check]:
    """Expected power of the sea from 0.5 to 8 km, 20 m below, by stretches of about 100 m."""
    _, frame, range_m, power = _measure(
        bench, "nrl_sea", 20.0, (450.0, 8300.0), (3.0, 1.55), replicates=16, bandwidth_hz=50e6,
        sampling_rate_hz=60e6, chirp_duration_s=2.5e-6,
    )  # fmt: skip
    found = expected_power(frame)
    cell_m = float(found.range_m[1] - found.range_m[0])
    edges_m = found.range_m[0] + cell_m * (80 * np.arange(200) - 0.5)
    edges_m = edges_m[(edges_m > 500) & (edges_m < 8000)]
    truth = np.histogram(range_m, edges_m, weights=power)[0]
    measured = np.histogram(found.range_m, edges_m, weights=found.profile)[0]
    # the profile has the peak of a point's response as its unit: what a point adds in all
    middle_m = 3000.0 + 1200 * cell_m
    point = expected_power_profile(
        make_paths(1.0, 2 * middle_m), frame.radar, range_limits_m=(3000.0, 5000.0), oversample=2
    ).power
    measured = measured / (point.sum() / point.max())
    stretches = [
        power_check(
            f"at {middle:.0f} m", float(one), float(other), 0.1, "integral of NRL's sigma0 over r^4"
        )
        for middle, one, other in zip(
            (edges_m[1:] + edges_m[:-1]) / 2, truth, measured, strict=True
        )
    ]
    for middle, check in zip((edges_m[1:] + edges_m[:-1]) / 2, stretches, strict=True):
        bench.point("sea_profile", range_m=float(middle), error_db=check.error)
    spread = float(point.sum() / point.max())
    return [
        worst_of("sea profile, NRL, sea state 3, 0.5 to 8 km", stretches),
        _to_noise(frame, edges_m, truth * spread),
    ]


def _to_noise(frame: FrameInput, edges_m: Real, clutter_w: Real) -> Check:
    """Clutter to noise in cells of the map with a transmitter of 5 kW and a noise figure of 4 dB.

    `clutter_w` are sums over the cells of each stretch at the light's EIRP.
    """
    budget = LinkBudget(transmit_power_w=5e3, noise_figure_db=4.0)
    measured = FrameBudget(dataclasses.replace(frame, link_budget=budget))
    found = expected_power(frame, link=measured.link)
    report = measured.report(1.0, expected=found)
    if report.clutter is None or report.clutter.noise_w is None or found.clutter_map is None:
        raise AssertionError("the sea is no clutter")
    ratio = found.clutter_map[0] / report.clutter.noise_w
    cells = np.histogram(found.range_m, edges_m)[0]
    mean = np.histogram(found.range_m, edges_m, weights=ratio)[0] / cells
    # a point's SNR is P T / (k T0 F), less the loss of the Hamming taper over the band
    window = np.hamming(4096)
    loss = np.mean(window**2) / np.mean(window) ** 2
    noise_w = 1.380649e-23 * 290.0 * 10**0.4 / 2.5e-6 * loss
    expected = clutter_w * 5e3 / EIRP_W / cells / noise_w
    stretches = [
        power_check(
            f"at {middle:.0f} m",
            float(one),
            float(other),
            0.1,
            "integral over k T F / T_pulse",
            unit="dB",
        )
        for middle, one, other in zip((edges_m[1:] + edges_m[:-1]) / 2, expected, mean, strict=True)
    ]
    return worst_of("clutter to noise of that sea in the map", stretches)
