# SPDX-License-Identifier: GPL-3.0-or-later
"""The plan and what follows from the numbers: no Blender needed."""

from __future__ import annotations

import dataclasses
import itertools
import math
import re
import struct
import zlib
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon import terminal
from radarsim_addon.blender.plan import (
    Extent,
    Measurement,
    config_findings,
    fingerprint,
    instant_at,
    make_plan,
    measurement,
    parse_frames,
)
from radarsim_addon.blender.plan.run_plan import range_encoding_length_m
from radarsim_addon.blender.rings.ring_job import verify_exr
from radarsim_addon.blender.scene.ground_truth import nearest_distances
from radarsim_addon.errors import ConfigError, OutputError, RenderError
from radarsim_addon.signal.radar import Burst, Channel, Element, Waveform

PAPER = Measurement(
    Waveform(5.3e9, 50e6, 2.5e-6, 60e6),
    Burst(1000.0, 128),
    (1,),
    21,
    250.0,
    snapshot_interval_s=0.01,
)


#: Two transmitters of a radar file, in turn.
TWO = tuple(Channel(Element((0.01 * n, 0.0, 0.0)), start_offset_s=2e-4 * n) for n in range(2))


def test_frames() -> None:
    assert parse_frames("7") == (7,)
    assert parse_frames("1:3") == (1, 2, 3)
    assert parse_frames("1:10:4,2") == (1, 5, 9, 2)
    assert parse_frames("2,2,1:2") == (2, 1)
    for text in ("", "a", "1:2:0", "1:2:3:4", "5:1", "1:2:-1", "1.5"):
        with pytest.raises(ConfigError, match=re.escape(repr(text))):
            parse_frames(text)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"ring_step_m": 0.0}, "Ring step is 0.0 m"),
        ({"ring_step_m": math.nan}, "Ring step is nan"),
        ({"rings": -1}, "Number of rings is -1"),
        ({"rings": 10_001}, "expected a whole number from 0 to 10000"),
        ({"snapshots": 3}, "Number of snapshots is 3"),
        ({"snapshot_interval_s": 0.0}, "Snapshot interval is 0.0 s"),
        ({"frames": ()}, "No frame"),
        ({"frames": (-1_000_000,)}, "Frames -1000000 to -1000000"),
        ({"width_px": 0}, "Width is 0"),
        ({"width_px": 65536, "height_px": 65536}, "65536 x 65536"),
        ({"samples": 0}, "Samples is 0"),
        ({"max_reflections": 0}, "Max reflections is 0"),
        ({"seed": -1}, "Seed is -1"),
        ({"extinction_length_m": -1.0}, "Extinction length is -1.0"),
        ({"burst": Burst(1e6, 1)}, "Chirp of 2.5e-06 s is longer"),
        ({"array_schedule": "bpm", "channels": TWO}, "schedule bpm is asked for, but the elements"),
    ],
)
def test_numbers_that_cannot_be_measured(change: dict[str, Any], message: str) -> None:
    with pytest.raises(ConfigError, match=message):
        dataclasses.replace(PAPER, **change)


def test_derived_numbers_of_the_paper() -> None:
    radar = PAPER.radar
    assert radar.waveform.range_resolution_m == pytest.approx(2.99792458)
    assert radar.unambiguous_range_m == pytest.approx(149896.229)
    velocity_mps = 299792458 / 5.3e9 * 1000 / 4
    assert radar.max_unambiguous_velocity_mps == pytest.approx(velocity_mps)
    assert radar.velocity_resolution_mps == pytest.approx(velocity_mps / 64)
    assert PAPER.renders(21) == 42


@pytest.mark.parametrize(
    ("change", "rings", "farthest_m", "interval_s", "code"),
    [
        ({}, 21, 6000.0, None, "scene-beyond-rings"),
        ({"ring_step_m": 2500.0}, 100, 200e3, None, "scene-beyond-unambiguous-range"),
        ({"ring_step_m": 1.0}, 21, None, None, "ring-step-below-resolution"),
        ({"snapshots": 1}, 21, None, None, "single-snapshot"),
        ({"snapshot_interval_s": 0.001}, 21, None, None, "short-snapshot-interval"),
        ({"frames": (1, 2)}, 21, None, 1 / 24, "bursts-overlap"),
    ],
)
def test_findings(
    change: dict[str, Any],
    rings: int,
    farthest_m: float | None,
    interval_s: float | None,
    code: str,
) -> None:
    found = config_findings(dataclasses.replace(PAPER, **change), rings, farthest_m, interval_s)
    assert [item.code for item in found] == [code]


def test_no_finding_where_all_fits() -> None:
    assert config_findings(PAPER, 21, 5000.0) == []
    # of paths rings and their step say nothing
    assert config_findings(PAPER, 1, 200e3 * 0.7, sampling_mode="paths") == []


def test_objects_faster_than_the_prf_holds_are_named_with_the_prf_that_does() -> None:
    """The paper's 5.3 GHz and 1 kHz hold 14.14 m/s."""
    speeds = {"Ground": 0.0, "Walker": 1.5, "Bus": 14.2, "Car": 30.0}
    (found,) = config_findings(PAPER, 21, 5000.0, speeds_mps=speeds)
    assert found.code == "scene-beyond-unambiguous-velocity"
    assert found.subjects == ("Car", "Bus")
    # 4 x 30 / 0.0565646
    assert "at least 2.13 kHz" in found.remedy
    faster = dataclasses.replace(PAPER, burst=Burst(2130.0, 128))
    assert config_findings(faster, 21, 5000.0, speeds_mps=speeds) == []


@pytest.mark.parametrize("sampling_mode", ["rings", "paths"])
def test_hertz_for_megahertz_is_told_with_what_it_does_to_the_scene(sampling_mode: str) -> None:
    narrow = dataclasses.replace(PAPER, waveform=Waveform(5.3e9, 150.0, 2.5e-6, 60e6))
    (found,) = config_findings(narrow, 21, 5200.0, sampling_mode=sampling_mode)
    assert "150 Hz resolves 999.31 km (c / 2B), but ranges end at 5200 m" in found.text
    slow = dataclasses.replace(PAPER, burst=Burst(1.0, 128))
    (found,) = config_findings(slow, 21, 5200.0, sampling_mode=sampling_mode, animation_s=10.4)
    assert (found.numbers["burst_s"], found.numbers["animation_s"]) == (128.0, 10.4)


def test_tasks_cover_frames_passes_and_rings_once() -> None:
    plan = make_plan(dataclasses.replace(PAPER, frames=(3, 1), rings=3), 100.0, 24.0, Extent())
    assert plan.extinction_length_m == 100.0  # a Blender unit
    tasks = list(plan.tasks())
    assert len(tasks) == plan.total == 12
    assert len({task.exr_path for task in tasks}) == 12
    assert [task.frame for task in tasks] == [3] * 6 + [1] * 6
    for before, after in itertools.pairwise(tasks):
        if after.ring:
            assert before.ring_max_m == after.ring_min_m
    assert tasks[4].sidecar_path == "frames/frame_0003/ring_001_t1.json"


def test_automatic_rings_reach_beyond_the_farthest_point() -> None:
    asked = dataclasses.replace(PAPER, rings=0)
    # A point exactly on an edge lies in the ring behind it.
    for farthest_m, rings in ((0.0, 1), (249.9, 1), (250.0, 2), (5200.0, 21)):
        assert make_plan(asked, 1.0, 24.0, Extent(farthest_m)).rings == rings
    with pytest.raises(ConfigError, match="expected at most 10000"):
        make_plan(asked, 1.0, 24.0, Extent(1e9))


@pytest.mark.parametrize("bounces", [0, 3])
def test_code_does_not_underflow_on_the_longest_path(bounces: int) -> None:
    extent = Extent(6000.0, 7000.0, 500.0, 9000.0)
    asked = dataclasses.replace(PAPER, max_reflections=bounces + 1)
    longest_m = 2 * 5250 + 500 + bounces * 9000.0 + (7000.0 if bounces else 0.0)
    k_m = range_encoding_length_m(asked, 21, extent)
    assert longest_m / k_m == pytest.approx(8.0)
    # Weak echoes too: 1e-15 W times G stays a normal float32.
    assert 1e-15 * math.exp(-2 * longest_m / k_m) > np.finfo(np.float32).tiny


def test_recorded_code_length_is_the_one_of_the_shader() -> None:
    """1/k reaches the shader in float32; the record holds the inverse of exactly that number."""
    plan = make_plan(dataclasses.replace(PAPER, rings=7, ring_step_m=33.3), 100.0, 24.0, Extent())
    inverse = np.float32(plan.metres_per_unit / plan.range_encoding_length_m)
    assert plan.metres_per_unit / float(inverse) == pytest.approx(
        plan.range_encoding_length_m, rel=1e-15
    )


def test_an_interval_below_blenders_steps_is_refused_before_the_render() -> None:
    fast = dataclasses.replace(PAPER, snapshot_interval_s=1e-5)
    plan = make_plan(fast, 1.0, 24.0, Extent())
    assert plan.instants(1)[1].time_s - plan.instants(1)[0].time_s == pytest.approx(1e-5, rel=0.01)
    with pytest.raises(ConfigError, match=r"1e-05 s, but at frame 10000 .* steps of 4.07e-05 s"):
        plan.instants(10_000)


def test_recorded_time_is_what_blender_evaluates() -> None:
    """Blender adds frame and subframe in float32."""
    moment = instant_at(250 + 0.01 * 24.0, 24.0)
    assert moment.frame == 250
    assert moment.time_s == float(np.float32(250) + np.float32(0.24)) / 24.0
    assert moment.time_s == pytest.approx(250.24 / 24, abs=7e-7)
    assert instant_at(3 - 1e-12, 24.0) == instant_at(3.0, 24.0)
    assert instant_at(1.0, 30 / 1.001).time_s == pytest.approx(1.001 / 30)


def test_fingerprint() -> None:
    """What changes pixels changes it; what comes in afterwards does not."""
    versions = {"blender": "5.2.3"}

    def print_of(change: dict[str, Any], digest: str = "a") -> str:
        plan = make_plan(dataclasses.replace(PAPER, **change), 100.0, 24.0, Extent())
        return fingerprint(plan, digest, versions)

    base = print_of({})
    assert base == print_of({"frames": (1, 2, 3), "burst": Burst(500.0, 64)})
    changes: list[dict[str, Any]] = [
        {"ring_step_m": 200.0},
        {"rings": 22},
        {"samples": 1},
        {"seed": 1},
        {"width_px": 128},
        {"max_reflections": 2},
        {"snapshot_interval_s": 0.02},
        {"extinction_length_m": 5.0},
    ]
    others = [print_of(change) for change in changes] + [print_of({}, "b")]
    assert len({base, *others}) == len(others) + 1


@pytest.mark.parametrize(("scale", "fps"), [(0.0, 24.0), (1.0, math.nan)])
def test_scale_and_rate_must_be_positive(scale: float, fps: float) -> None:
    with pytest.raises(ConfigError, match="expected a positive number"):
        make_plan(PAPER, scale, fps, Extent())


def test_no_more_renders_in_a_burst_than_pulses() -> None:
    asked = dataclasses.replace(PAPER, rings=3, burst=dataclasses.replace(PAPER.burst, pulses=4))
    assert make_plan(asked, 1.0, 24.0, Extent(), visibility_updates=4).visibility_updates == 4
    with pytest.raises(ConfigError, match=r"Visibility updates is 300; .* burst, 4"):
        make_plan(asked, 1.0, 24.0, Extent(), visibility_updates=300)


# -- nearest distance ------------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("corners", "expected"),
    [
        ([(-1, -1, 2), (2, -1, 2), (-1, 2, 2)], 2.0),  # foot inside
        ([(1, 0, 0), (3, 0, 0), (3, 1, 0)], 1.0),  # a corner
        ([(3, -1, 0), (3, 1, 0), (5, 0, 0)], 3.0),  # an edge
        ([(3, 4, -1), (3, 4, 1), (9, 12, 0)], 5.0),  # an edge, in a plane through the origin
        ([(0, 0, 2), (0, 0, 2), (0, 0, 5)], 2.0),  # no area
        ([(0, 0, 0), (1, 0, 0), (0, 1, 0)], 0.0),
    ],
)
def test_nearest_point_of_a_triangle(corners: list[Any], expected: float) -> None:
    vertices = np.array(corners, dtype=np.float64)
    for order in ([0, 1, 2], [2, 1, 0], [1, 2, 0]):
        (found,) = nearest_distances([vertices[[order]]])
        assert found == pytest.approx(expected, abs=1e-15)


def test_nearest_of_many_surfaces_at_once() -> None:
    """Surfaces of all sizes, also larger than the blocks that are computed together."""
    rng = np.random.default_rng(2)
    sizes = (3, 0, 150_000, 1, 300_000, 7)
    surfaces = [rng.normal(size=(size, 3, 3)) + 10 for size in sizes]
    found = nearest_distances(surfaces)
    one_by_one = [
        min(
            (nearest_distances([part])[0] for part in np.array_split(s, 5) if len(part)),
            default=np.inf,
        )
        for s in surfaces
    ]
    np.testing.assert_array_equal(found, one_by_one)
    assert found[1] == np.inf


# -- EXR files -------------------------------------------------------------------------------------


def plain_exr(width: int, height: int, value: float = 1.0, compression: int = 3) -> bytes:
    """An EXR file, byte by byte: float32 B, G, R, ZIP, 16 rows a chunk."""

    def attribute(name: str, kind: str, data: bytes) -> bytes:
        return name.encode() + b"\0" + kind.encode() + b"\0" + struct.pack("<i", len(data)) + data

    channels = b"".join(
        name + b"\0" + struct.pack("<iBxxxii", 2, 0, 1, 1) for name in (b"B", b"G", b"R")
    )
    header = (
        struct.pack("<ii", 20000630, 2)
        + attribute("channels", "chlist", channels + b"\0")
        + attribute("compression", "compression", bytes([compression]))
        + attribute("dataWindow", "box2i", struct.pack("<4i", 0, 0, width - 1, height - 1))
        + b"\0"
    )
    chunks = []
    for start in range(0, height, 16):
        rows = min(16, height - start)
        raw = np.full(rows * width * 3, value, dtype="<f4").view(np.uint8)
        split = np.concatenate([raw[0::2], raw[1::2]]).astype(np.int64)
        split[1:] = (np.diff(split) + 128) % 256
        packed = zlib.compress(split.astype(np.uint8).tobytes())
        chunks.append(struct.pack("<ii", start, len(packed)) + packed)
    offset = len(header) + 8 * len(chunks)
    offsets = []
    for chunk in chunks:
        offsets.append(struct.pack("<Q", offset))
        offset += len(chunk)
    return header + b"".join(offsets) + b"".join(chunks)


def test_whole_exr_passes(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(plain_exr(40, 37, value=3.25e-20))
    verify_exr(path, 40, 37)


@pytest.mark.parametrize("kept", [0, 7, 60, 150, -1, -40])
def test_truncated_exr_is_told(tmp_path: Path, kept: int) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(plain_exr(40, 37)[:kept])
    with pytest.raises(OutputError, match="disk is probably full"):
        verify_exr(path, 40, 37)


def test_missing_exr_is_told(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match="has not written"):
        verify_exr(tmp_path / "a.exr", 4, 4)


@pytest.mark.parametrize("value", [math.nan, math.inf])
def test_pixels_that_are_no_numbers_are_told(tmp_path: Path, value: float) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(plain_exr(8, 8, value=value))
    with pytest.raises(RenderError, match="NaN or infinite"):
        verify_exr(path, 8, 8)


def test_other_size_or_compression_is_told(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(plain_exr(8, 8))
    with pytest.raises(OutputError, match="8 x 8 pixels, expected 8 x 9"):
        verify_exr(path, 8, 9)
    path.write_bytes(plain_exr(8, 8, compression=4))
    with pytest.raises(OutputError, match="not ZIP"):
        verify_exr(path, 8, 8)


# -- the progress line -----------------------------------------------------------------------------


@pytest.mark.parametrize(
    ("done", "left", "expected"),
    [
        (0, None, "radarsim: 0/42 renders, 0 %"),
        (12, 18.2, "radarsim: 12/42 renders, 28 %, 0:18 left"),
        (12, 125.0, "radarsim: 12/42 renders, 28 %, 2:05 left"),
        (12, 7320.0, "radarsim: 12/42 renders, 28 %, 2:02 h left"),
        (42, 0.0, "radarsim: 42/42 renders, 100 %"),
    ],
)
def test_progress_text(done: int, left: float | None, expected: str) -> None:
    assert terminal.progress_text(done, 42, left) == expected


def test_max_rings_is_the_limit_of_file_names() -> None:
    assert measurement.MAX_RINGS == 10_000
