# SPDX-License-Identifier: GPL-3.0-or-later
"""Several renders of a burst, and several bursts along an animation."""

from __future__ import annotations

from pathlib import Path

import bpy
import numpy as np
import pytest
from PIL import Image

from radarsim_addon import contract, signal
from radarsim_addon.blender.motion.burst_motion import _approximated
from radarsim_addon.blender.run.shared_folder import clear_run
from radarsim_addon.contract import MotionRecord
from radarsim_addon.signal.decoding import frame_paths, open_frame
from radarsim_addon.signal.echoes import render_times_s
from radarsim_addon.signal.pictures.frame_pictures import FRAMES_PER_SECOND
from radarsim_addon.signal.pipeline import FrameResult, ProcessOptions, main, process_run
from radarsim_addon.signal.radar import Burst
from radarsim_addon.typed_json import read_record
from tests.blender import motion_helpers as mh
from tests.blender import path_helpers as ph
from tests.blender import radar_scenes as rs

CARRIER_HZ = 77e9
BURST = Burst(5000.0, 128)
PLAIN = ProcessOptions(speckle_seed=None, plots=False, products=False)


def samples(folder: Path) -> np.ndarray:
    """Echoes of the first frame as they are processed."""
    return next(e for e in process_run(folder, PLAIN) if isinstance(e, FrameResult)).echoes.plane


def test_each_render_has_the_tables_lengths_when_it_was_made(tmp_path: Path) -> None:
    mh.scene_at(20.0, 2.0)
    target = mh.facets("Target", [(0, 0, 0)], 1.0)
    mh.key(target, "location", (1, (0, 20, 0)), (25, (3.0, 37.3, 0)))
    mh.interpolation(target, "LINEAR")
    mh.measured(tmp_path, CARRIER_HZ, BURST, visibility_updates=3)
    frame = signal.open_run(tmp_path).frame(1)
    assert frame.visibility_updates == 3 and frame.missing() == []
    shown = render_times_s(open_frame(frame))
    np.testing.assert_allclose(shown, [0, 0.0128, 0.0256], atol=1e-7)
    for number, at_s in enumerate(shown):
        paths = frame_paths(frame.of_burst(number))
        assert len(paths) > 20
        found = paths.lengths.lengths_m(np.array([at_s]), slice(None))[:, 0]
        np.testing.assert_array_equal(found, paths.length_m)
        # points of the plate at each render, moved to the burst's beginning: all in its plane
        assert paths.geometry is not None
        np.testing.assert_allclose(
            paths.geometry.last_scatterer_m[:, 1], 20 + 17.3 * at_s, atol=1e-5
        )
        times_s = np.arange(BURST.pulses) / BURST.prf_hz
        along = (times_s - at_s)[:, None] * np.array([3.0, 17.3, 0])
        want = 2 * np.linalg.norm(paths.geometry.last_scatterer_m[:, None] + along, axis=-1)
        found = paths.lengths.lengths_m(times_s, slice(None))
        np.testing.assert_allclose(found, want, atol=1e-6)
        rate = paths.geometry.direction @ np.array([3.0, 17.3, 0])
        np.testing.assert_allclose(paths.range_rate_mps, rate, atol=1e-4)
    clear_run(tmp_path)
    assert not list(tmp_path.rglob("*.npy")) and not list(tmp_path.rglob("motion*"))


def test_what_stands_still_is_the_same_however_often_it_is_rendered(tmp_path: Path) -> None:
    mh.scene_at(20.0, 2.0)
    mh.facets("Target", [(0, 20, 0), (0.5, 21, 0.3)], 0.6)
    for number in (1, 3):
        mh.measured(tmp_path / str(number), CARRIER_HZ, BURST, visibility_updates=number)
    one, three = samples(tmp_path / "1"), samples(tmp_path / "3")
    assert np.abs(three - one).max() < 1e-6 * np.abs(one).max()


def test_no_jump_of_phase_between_renders(tmp_path: Path) -> None:
    """A receding facet: phase runs on as in continuous time over all of the burst."""
    mh.scene_at(20.0, 2.0)
    target = mh.facets("Target", [(0, 0, 0)], 0.3)
    mh.key(target, "location", (1, (0, 20, 0)), (25, (0, 33.0, 0)))
    mh.interpolation(target, "LINEAR")
    mh.measured(tmp_path, CARRIER_HZ, BURST, visibility_updates=4, width_px=64, height_px=64)
    echoes = samples(tmp_path)
    # the middle of the chirp, where its own frequency is the carrier's
    power = np.abs(echoes[0]) ** 2
    middle = round(float(np.sum(power * np.arange(power.size)) / power.sum()))
    peak = echoes[:, middle]
    wavelength_m = 299_792_458.0 / CARRIER_HZ
    step = -4 * np.pi * 13.0 / BURST.prf_hz / wavelength_m
    off = np.angle(peak[1:] / peak[:-1] * np.exp(-1j * step))
    # the plate's edges lie in other pixels at other times: amplitudes fade, phases hardly change
    assert np.abs(off).max() < 5e-3
    assert np.ptp(np.abs(peak)) < 0.2 * np.abs(peak).max()


def test_target_that_comes_out_from_behind_a_wall(tmp_path: Path) -> None:
    """Hidden at first, in sight at the end: its echo grows with the weight of that render."""
    mh.scene_at(20.0, 2.0)
    wall = ph.plate_at(10, 3, ph.lambert(0.5))
    wall.name = "Wall"
    mh.key(wall, "location", (1, (0, 10, 0)), (2, (4.0, 10, 0)))
    mh.interpolation(wall, "CONSTANT")
    mh.facets("Target", [(0, 20, 0)], 0.5)
    burst = Burst(128 * 24.0, 128)  # a frame of the animation, to the next key
    mh.measured(tmp_path, CARRIER_HZ, burst, visibility_updates=2)
    frame = signal.open_run(tmp_path).frame(1)
    seen = []
    for number in range(2):
        record = read_record(
            tmp_path / contract.burst_dir(1, number) / contract.PATHS_FILE, contract.PathsRecord
        )
        paths = frame_paths(frame.of_burst(number))
        assert paths.geometry is not None
        names = np.array(["", *record.objects])
        seen.append(set(names[paths.geometry.last_object]))
    assert seen == [{"Wall"}, {"Target"}]
    result = next(e for e in process_run(tmp_path, PLAIN) if isinstance(e, FrameResult))
    weight = np.arange(128)[:, None] / 128
    radar, range_limits_m = result.echoes.radar, result.echoes.range_limits_m
    wall_alone, target_alone = (
        signal.synthesize(
            frame_paths(frame.of_burst(n)), radar, range_limits_m=range_limits_m
        ).plane
        for n in range(2)
    )
    assert np.ptp(np.abs(target_alone), axis=0).max() < 1e-12 + 1e-5 * np.abs(target_alone).max()
    want = (1 - weight) * wall_alone + weight * target_alone
    assert np.abs(result.echoes.plane - want).max() < 1e-5 * np.abs(want).max()
    # the target's range cell fills up, the wall's empties
    cells = [np.argmin(np.abs(result.compressed.range_m - r)) for r in (10.0, 20.0)]
    wall, target = np.abs(result.compressed.plane[:, cells]).T
    assert wall[0] > 20 * wall[-1] and target[-1] > 5 * target[0]


def test_stopped_between_renders_of_a_burst(tmp_path: Path) -> None:
    """The same files as in one go; what is there is not rendered again."""

    def build() -> None:
        mh.scene_at(20.0, 2.0)
        rs.move_steadily(mh.facets("Target", [(0, 20, 0)], 0.6), (2.0, 9.0, 0))

    options = {"visibility_updates": 2}
    build()
    ph.run_paths(tmp_path / "whole", burst=BURST, options=options)
    build()
    tables = tmp_path / "stopped"
    for limit in range(1, 40):
        if (tables / contract.burst_dir(1, 1) / contract.PATHS_FILE).exists():
            break
        ph.run_paths(tables, identity="file", burst=BURST, options=options, limit=limit)
    for number in range(2):
        name = Path(contract.burst_dir(1, number)) / contract.PATHS_TABLE
        assert (tables / name).read_bytes() == (tmp_path / "whole" / name).read_bytes()


def test_a_stopped_burst_of_a_scene_in_memory_is_replaced(tmp_path: Path) -> None:
    mh.scene_at(20.0, 2.0)
    rs.move_steadily(mh.facets("Target", [(0, 20, 0)], 0.6), (2.0, 9.0, 0))
    options = {"visibility_updates": 2}
    ph.run_paths(tmp_path, burst=BURST, options=options, limit=3)
    (tmp_path / contract.burst_dir(1, 1) / contract.TILES_DIR).mkdir(parents=True, exist_ok=True)
    run = ph.run_paths(tmp_path, burst=BURST, options=options)
    assert run.job.done == run.job.total and (tmp_path / contract.burst_dir(1, 1)).is_dir()


def test_a_longer_burst_is_sampled_anew(tmp_path: Path) -> None:
    mh.scene_at(20.0, 2.0)
    rs.move_steadily(mh.facets("Target", [(0, 20, 0)], 0.6), (2.0, 9.0, 0))
    ph.run_paths(tmp_path, identity="file", burst=Burst(5000.0, 64))
    again = ph.run_paths(tmp_path, identity="file", burst=Burst(5000.0, 32))
    assert again.job.path_scene is not None and again.job.path_scene.renders == 0
    ph.run_paths(tmp_path, identity="file", burst=Burst(5000.0, 512))
    motion = read_record(tmp_path / contract.frame_dir(1) / contract.MOTION_FILE, MotionRecord)
    assert motion.duration_s == pytest.approx(512 / 5000)
    assert (
        frame_paths(signal.open_run(tmp_path).frame(1))
        .lengths.lengths_m(np.array([0.1]), slice(None))
        .shape[1]
        == 1
    )


def test_bursts_along_an_animation_make_a_gif_or_a_movie(tmp_path: Path) -> None:
    mh.scene_at(20.0, 4.0)
    target = mh.facets("Target", [(0, 0, 0)], 0.6)
    mh.key(target, "location", (1, (0, 20, 0)), (25, (0, 50, 0)))
    mh.interpolation(target, "BEZIER")
    run = ph.run_paths(tmp_path, waveform=mh.waveform(CARRIER_HZ), burst=BURST, frames=(1, 7, 13))
    assert bpy.context.scene.frame_current == 1
    assert run.folder == tmp_path
    options = ProcessOptions(plots=False, products=False, animate=True)
    events = list(process_run(tmp_path, options))
    results = [e for e in events if isinstance(e, FrameResult)]
    assert [r.frame for r in results] == [1, 7, 13]
    gif = tmp_path / "products" / "range_doppler.gif"
    with Image.open(gif) as picture:
        assert picture.format == "GIF" and getattr(picture, "n_frames", 1) == 3
        pictures = []
        for number in range(3):
            picture.seek(number)
            pictures.append(np.asarray(picture.convert("RGB")).astype(int))
    # axes and colour bar stay where they are, the target does not
    # (each picture of a GIF has its own 256 colours)
    assert all(np.abs(p[:, -60:] - pictures[0][:, -60:]).mean() < 3 for p in pictures)
    assert np.abs(pictures[2] - pictures[0]).max() > 100
    assert main(["process", str(tmp_path), "--no-plots", "--no-products", "--animate",
                 "--animation-format", "mp4"]) == 0  # fmt: skip
    assert not gif.exists()
    movie = str(gif.with_suffix(".mp4"))
    clip, first = bpy.data.movieclips.load(movie), bpy.data.images.load(movie)
    assert clip.frame_duration == 3 and clip.fps == FRAMES_PER_SECOND
    values = np.empty(first.size[0] * first.size[1] * 4, dtype=np.float32)
    first.pixels.foreach_get(values)
    shown = 255 * values.reshape(first.size[1], first.size[0], 4)[::-1, :, :3]
    assert np.abs(shown - pictures[0]).mean() < 3


@pytest.mark.parametrize(
    ("fraction", "severities"), [(0.0005, []), (0.006, ["info"]), (0.02, ["caution"])]
)
def test_little_power_with_approximated_motion_is_information(
    fraction: float, severities: list[str]
) -> None:
    """Without this power, levels would be 10 lg(1 - fraction) lower: 0.03 and 0.09 dB."""
    assert [item.severity for item in _approximated(fraction)] == severities
