# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures: numbered points and their texts, numbers without "-0.0", scales and units."""

from __future__ import annotations

import dataclasses
import itertools
import re
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.signal import (
    Burst,
    Cfar,
    FmcwWaveform,
    Radar,
    RangeDopplerMap,
    Receiver,
    Waveform,
    apply_receiver,
    detect_targets,
    make_paths,
    map_noise_gain,
    open_run,
    plot_echo,
    plot_range_doppler,
    plot_range_profile,
    plot_rings,
    range_doppler,
    synthesize,
)
from radarsim_addon.signal.detection import Detection, LeadingEdge, Peak, target_count
from radarsim_addon.signal.maps import expected_power_profile, range_process
from radarsim_addon.signal.pictures import MapFile, animate_maps, common_scale, decimals_for, fixed
from radarsim_addon.signal.pictures.figure import cell_axis, frequency_unit, range_unit, strongest
from radarsim_addon.signal.pictures.map import foremost, map_axes, picture_floor_db
from radarsim_addon.signal.pipeline.cli import detection_lines, map_digits
from tests.signal.synthetic import Setup, points, write_run

RADAR = Radar(Waveform(5.3e9, 50e6, 2.5e-6, 60e6), Burst(1000.0, 64))
NEGATIVE_ZERO = re.compile(r"[-\N{MINUS SIGN}]0+(\.0+)?(?![\d.])")


def map_of(
    radar: Radar, range_m: list[float], rate_mps: list[float], power: list[float],
    range_limits_m: tuple[float, float], noise_figure_db: float | None = None,
) -> tuple[RangeDopplerMap, float]:  # fmt: skip
    """Map of point targets, and the mean noise of its cells."""
    paths = make_paths(np.array(power), 2 * np.array(range_m), np.array(rate_mps))
    echoes = synthesize(paths, radar, range_limits_m=range_limits_m)
    reception = apply_receiver(echoes, Receiver(noise_figure_db=noise_figure_db))
    found = range_doppler(range_process(reception.echoes))
    return found, reception.noise_power_w * map_noise_gain(radar)


def detection(range_m: float, velocity_mps: float, level_db: float) -> Detection:
    doppler_hz = -2 * velocity_mps / RADAR.waveform.wavelength_m
    noise_db = level_db - 30.0
    return Detection(range_m, velocity_mps, doppler_hz, level_db, noise_db, 30.0, noise_db, 0, 0)


def peak(range_m: float, velocity_mps: float, level_db: float) -> Peak:
    doppler_hz = -2 * velocity_mps / RADAR.waveform.wavelength_m
    return Peak(range_m, velocity_mps, doppler_hz, level_db, 50.0)


def labels(figure: Any) -> list[str]:
    """Texts of the numbered points, below the figure."""
    return [text.get_text() for legend in figure.legends for text in legend.get_texts()]


def numbers(figure: Any) -> list[Any]:
    return [text for text in figure.axes[0].texts if hasattr(text, "xyann")]


def boxes_of_numbers(figure: Any) -> list[Any]:
    """Where the letters of the numbers are in the finished picture."""
    from matplotlib.text import Text as matplotlib_text

    figure.canvas.draw()
    return [matplotlib_text.get_window_extent(note) for note in numbers(figure)]


def assert_apart(boxes: list[Any]) -> None:
    assert not any(a.overlaps(b) for a, b in itertools.combinations(boxes, 2))


def assert_inside(boxes: list[Any], frame: Any) -> None:
    for box in boxes:
        assert frame.x0 <= box.x0 and box.x1 <= frame.x1
        assert frame.y0 <= box.y0 and box.y1 <= frame.y1


@pytest.fixture(scope="module")
def plain_map() -> RangeDopplerMap:
    return map_of(RADAR, [600.0, 300.0], [5.0, 0.0], [1e-9, 1e-6], (0.0, 900.0))[0]


# -- labels ----------------------------------------------------------------------------------------


def test_numbers_of_close_peaks_do_not_overlap(plain_map: RangeDopplerMap) -> None:
    peaks = [peak(600.0 + 3 * i, 5.0 + 0.2 * i, -90.0) for i in range(5)]
    figure = plot_range_doppler(plain_map, peaks)
    boxes = boxes_of_numbers(figure)
    assert [note.get_text() for note in numbers(figure)] == ["1", "2", "3", "4", "5"]
    assert_apart(boxes)
    assert_inside(boxes, figure.axes[0].get_window_extent())
    assert [text.splitlines()[0] for text in labels(figure)] == [
        "600.0 m", "603.0 m", "606.0 m", "609.0 m", "612.0 m",
    ]  # fmt: skip
    (below,) = figure.legends
    assert below.get_window_extent().y1 < figure.axes[0].get_window_extent().y0


@pytest.mark.parametrize("place", [(1.0, -13.9), (899.0, -13.9), (1.0, 13.9), (899.0, 13.9)])
def test_numbers_stay_inside_at_the_corners(
    plain_map: RangeDopplerMap, place: tuple[float, float]
) -> None:
    peaks = [peak(place[0], place[1], -90.0), peak(place[0], place[1] * 0.98, -91.0)]
    targets = [detection(100.0 * i, 1.0, -95.0) for i in range(1, 9)]  # a legend in a corner
    figure = plot_range_doppler(plain_map, peaks, targets=targets)
    boxes = boxes_of_numbers(figure)
    assert len(boxes) >= 2
    assert_apart([*boxes, figure.axes[0].get_legend().get_window_extent()])
    assert_inside(boxes, figure.axes[0].get_window_extent())


def test_edges_of_a_profile_are_numbered_apart() -> None:
    paths = make_paths(np.full(4, 1e-9), 2 * np.array([300.0, 312.0, 324.0, 700.0]))
    echoes = synthesize(paths, RADAR, range_limits_m=(0.0, 900.0))
    profile = expected_power_profile(paths, RADAR, range_limits_m=(0.0, 900.0))
    level_db = 10 * np.log10(profile.power.max())
    edges = [LeadingEdge(r - 1.5, r, level_db, 20.0) for r in (300.0, 312.0, 324.0, 700.0)]
    figure = plot_range_profile(range_process(echoes), profile, edges, unit="dBW")
    assert_apart(boxes_of_numbers(figure))
    assert labels(figure) == ["298.5 m", "310.5 m", "322.5 m", "698.5 m"]


# -- what is labelled ------------------------------------------------------------------------------


def test_movers_come_first(plain_map: RangeDopplerMap) -> None:
    still = [detection(50.0 * i, 0.0, -60.0) for i in range(1, 17)]
    moving_targets = [detection(600.0, 5.0, -90.0), detection(200.0, -8.0, -95.0)]
    chosen = foremost(plain_map, [], [*still, *moving_targets])
    assert chosen[:2] == moving_targets
    assert len(chosen) == 4 and all(abs(item.velocity_mps) < 0.1 for item in chosen[2:])
    texts = labels(plot_range_doppler(plain_map, targets=chosen))
    assert texts[0].startswith("600.0 m\n+5.00 m/s\n\N{MINUS SIGN}177 Hz")


def test_sidelobes_of_a_mover_get_no_label(plain_map: RangeDopplerMap) -> None:
    target = peak(600.0, 5.0, -60.0)
    along = [detection(400.0 + 20 * i, 5.0, -100.0) for i in range(20)]
    assert foremost(plain_map, [target], [detection(600.1, 5.0, -60.0), *along]) == [target]
    other = detection(400.0, 5.0, -80.0)  # strong enough to be another target
    assert foremost(plain_map, [target], [other, *along])[:2] == [target, other]


def test_of_targets_side_by_side_the_stronger_is_labelled(plain_map: RangeDopplerMap) -> None:
    block = [detection(300.0, 0.0, -60.0), detection(315.0, 0.0, -61.0)]  # 900 m are shown
    assert foremost(plain_map, [], [*block, detection(600.0, 0.0, -70.0)]) == [
        block[0], detection(600.0, 0.0, -70.0),
    ]  # fmt: skip


def test_many_targets_have_small_marks(plain_map: RangeDopplerMap) -> None:
    def size(count: int) -> float:
        targets = [detection(3.0 * i, 0.0, -60.0) for i in range(count)]
        (marks,) = (
            line
            for line in plot_range_doppler(plain_map, targets=targets).axes[0].lines
            if len(line.get_xdata()) == count
        )
        return float(marks.get_markersize())

    assert size(256) < 3 < size(10)


def test_legend_tells_of_targets_beyond_the_most(plain_map: RangeDopplerMap) -> None:
    targets = [detection(3.0 * i, 0.0, -60.0) for i in range(256)]
    figure = plot_range_doppler(plain_map, targets=targets, left_out=44)
    legend = figure.axes[0].get_legend().get_texts()[0].get_text()
    assert legend == "CFAR: 256 strongest of 300 targets"
    assert target_count(1, 0) == "1 target" and target_count(0, 0) == "0 targets"


# -- numbers ---------------------------------------------------------------------------------------


def test_zero_has_no_sign() -> None:
    assert fixed(-1e-9, 1) == fixed(0.0, 1) == fixed(-0.0, 1, signed=True) == "0.0"
    assert fixed(1e-9, 2, signed=True) == "0.00" and fixed(-0.4, 0) == "0"
    assert fixed(-0.06, 1, signed=True) == "-0.1" and fixed(3.25, 2, signed=True) == "+3.25"
    assert not NEGATIVE_ZERO.search("-0.01 m") and NEGATIVE_ZERO.search("x -0.00 Hz")


def test_no_negative_zero_in_pictures_and_console(plain_map: RangeDopplerMap) -> None:
    targets = [
        dataclasses.replace(detection(100.0 * i, sign * 1e-7, -60.0), snr_db=-1e-9)
        for i, sign in enumerate((-1, 1, -1, 1), start=1)
    ]
    figure = plot_range_doppler(plain_map, targets=targets)
    figure.canvas.draw()
    texts = labels(figure)
    texts += detection_lines(targets, plain_map) + detection_lines(targets)
    assert len(texts) == 10
    for text in texts:
        assert not NEGATIVE_ZERO.search(text), text
        assert "+0.0" not in text, text


def test_digits_follow_the_cells() -> None:
    assert [decimals_for(s) for s in (100.0, 10.0, 2.5, 1.0, 0.15, 1e-3, 0.0)] == [
        0, 0, 1, 1, 2, 4, 0,
    ]  # fmt: skip
    tiny = Radar(FmcwWaveform(300e9, 40e9, 256, 5e6), Burst(10e3, 64))
    rd_map, _ = map_of(tiny, [0.1], [0.0], [1e-9], (0.0, 0.4))
    line = detection_lines([detection(0.10234, 0.0, -60.0)], rd_map)[0]
    assert "0.1023 m" in line
    assert map_digits(None).range_text(12.345) == "     12.35 m"


# -- scales ----------------------------------------------------------------------------------------


def test_units_fit_the_ranges() -> None:
    names = [range_unit(r).name for r in (0.3, 0.5, 5250.0, 20e3, 0.0)]
    assert names == ["mm", "m", "m", "km", "m"]
    assert [frequency_unit(f).name for f in (0.0, 500.0, 2e4, 3e7)] == ["Hz", "Hz", "kHz", "MHz"]


@pytest.mark.parametrize(("far_m", "label"), [(0.4, "[mm]"), (900.0, "[m]"), (60e3, "[km]")])
def test_axes_are_in_those_units(far_m: float, label: str, plain_map: RangeDopplerMap) -> None:
    rescaled = dataclasses.replace(plain_map, range_m=plain_map.range_m * far_m / 900.0)
    figure = plot_range_doppler(rescaled, [peak(0.5 * far_m, 5.0, -90.0)])
    figure.canvas.draw()
    axis = figure.axes[0]
    assert label in axis.get_ylabel()
    assert axis.yaxis.get_offset_text().get_text() == ""  # no "+3e2" beside the ticks
    low, high = axis.get_ylim()
    size = range_unit(far_m).size
    assert low < 0 < high and high * size == pytest.approx(far_m, rel=0.01)
    assert numbers(figure)[0].xy[1] * size == pytest.approx(0.5 * far_m)


def test_scale_shows_the_noise() -> None:
    rd_map, noise_w = map_of(
        RADAR, [600.0, 300.0], [5.0, 0.0], [1e-12, 1e-9], (0.0, 900.0), noise_figure_db=3.0
    )
    top = rd_map.plane_power.max()
    noise_db = 10 * np.log10(noise_w / top)
    # the mean of what the map holds away from the targets
    empty = rd_map.plane_power[5:15, :150]
    assert 10 * np.log10(empty.mean() / top) == pytest.approx(noise_db, abs=1.0)
    floor_db = picture_floor_db(rd_map.plane_power, noise_w)
    assert noise_db - 15 <= floor_db <= noise_db - 10
    figure = plot_range_doppler(rd_map, noise_power=noise_w, unit="dBW")
    image = figure.axes[0].images[0]
    assert image.get_clim() == (floor_db, 0.0)
    bar = figure.axes[1]
    assert any(np.asarray(line.get_ydata())[0] == pytest.approx(noise_db) for line in bar.lines)
    level = f"{10 * np.log10(top):.1f}".replace("-", "\N{MINUS SIGN}")
    assert bar.get_ylabel() == f"power [dB re strongest cell = {level} dBW]"
    # a notebook that does not tell the noise sees it all the same
    assert picture_floor_db(rd_map.plane_power) == pytest.approx(floor_db, abs=5.0)


def test_rounding_of_the_adc_counts_as_noise() -> None:
    paths = make_paths(np.array([1e-9, 1e-9]), np.array([600.0, 1300.0]), np.array([3.3, -7.1]))
    echoes = synthesize(paths, RADAR, range_limits_m=(0.0, 900.0))
    reception = apply_receiver(echoes, Receiver(noise_figure_db=40.0, adc_bits=3))
    assert reception.step is not None
    assert reception.floor_power_w > 1.1 * reception.noise_power_w  # it matters
    error = reception.echoes.plane - echoes.plane
    measured = float(np.mean(np.abs(error) ** 2))
    assert measured == pytest.approx(reception.floor_power_w, rel=0.03)


def test_scale_without_noise_is_80_db(plain_map: RangeDopplerMap) -> None:
    assert picture_floor_db(plain_map.plane_power) == -80.0
    assert picture_floor_db(np.zeros((4, 5))) == -80.0
    assert picture_floor_db(np.ones((4, 5))) == -20.0


def test_a_single_row_is_not_lost_among_thousands() -> None:
    power = np.full((4, 5003), 1e-8)
    power[2, 3210] = 1.0
    axes = map_axes(np.arange(4.0) - 2, 2.0 * np.arange(5003), -0.03)
    joined = strongest(power, (axes.doppler.step, axes.ranges.step))
    assert joined.shape[1] <= 640 and joined.max() == 1.0
    row = int(joined.max(axis=0).argmax())
    width = (axes.ranges.high - axes.ranges.low) / joined.shape[1]
    low = axes.ranges.low + row * width
    assert low <= 2.0 * 3210 <= low + width
    assert axes.ranges.end == 2.0 * 5002 + 1.0
    axis = cell_axis(np.array([7.0]), 640, single=4.0)
    assert (axis.low, axis.high, axis.end, axis.step) == (5.0, 9.0, 9.0, 1)


# -- odd cases -------------------------------------------------------------------------------------


@pytest.mark.filterwarnings("error")
def test_empty_frame_says_so(tmp_path: Path) -> None:
    echoes = synthesize(make_paths(0.0, 600.0), RADAR, range_limits_m=(0.0, 900.0))
    compressed = range_process(echoes)
    rd_map = range_doppler(compressed)
    profile = expected_power_profile(make_paths(0.0, 600.0), RADAR, range_limits_m=(0.0, 900.0))
    for figure in (
        plot_range_doppler(rd_map, unit="dBW"),
        plot_range_profile(compressed, profile, unit="dBW"),
        plot_echo(echoes),
    ):
        figure.canvas.draw()
        assert "no echo" in [text.get_text() for text in figure.axes[0].texts]


@pytest.mark.filterwarnings("error")
def test_one_pulse_has_no_doppler_axis() -> None:
    radar = dataclasses.replace(RADAR, burst=Burst(1000.0, 1))
    rd_map, _ = map_of(radar, [600.0], [0.0], [1e-9], (0.0, 900.0))
    figure = plot_range_doppler(rd_map, [peak(600.0, 0.0, -90.0)])
    axis = figure.axes[0]
    assert "not resolved" in axis.get_xlabel() and not axis.child_axes
    assert labels(figure)[0] == "600.0 m"
    echoes = synthesize(make_paths(1e-9, 1200.0), radar, range_limits_m=(0.0, 900.0))
    assert len(plot_echo(echoes).axes[0].lines) == 1


def test_animation_has_one_scale(tmp_path: Path) -> None:
    from PIL import Image as image_module

    maps = []
    for number, strength in enumerate((1e-9, 1e-12), start=1):
        rd_map, noise_w = map_of(
            RADAR, [300.0 * number], [5.0], [strength], (0.0, 900.0), noise_figure_db=3.0
        )
        path = tmp_path / f"frame_{number}_map.npz"
        np.savez(
            path, doppler_hz=rd_map.doppler_hz, velocity_mps=rd_map.velocity_mps,
            range_m=rd_map.range_m, power=rd_map.power,
        )  # fmt: skip
        power = rd_map.power
        maps.append(MapFile(path, number, 0.1 * number, power.max(), np.median(power), noise_w))
    out = animate_maps(maps, tmp_path / "maps.gif", common_scale(maps, "dBW"))
    with image_module.open(out) as picture:
        assert getattr(picture, "n_frames", 1) == 2
        frames = []
        for number in range(2):
            picture.seek(number)
            frames.append(np.asarray(picture.convert("RGB"), dtype=float))
    assert np.abs(frames[0] - frames[1]).max() > 100


def test_cfar_of_a_noisy_map_can_be_drawn() -> None:
    rd_map, noise_w = map_of(
        RADAR, [600.0, 603.0, 300.0], [5.0, 6.0, 0.0], [1e-11, 1e-11, 1e-9], (0.0, 900.0), 3.0
    )
    found = detect_targets(rd_map, Cfar("os", 1e-6))
    assert len(found.targets) >= 2
    figure = plot_range_doppler(rd_map, targets=found.targets, noise_power=noise_w)
    assert_apart(boxes_of_numbers(figure))
    first = labels(figure)[0].splitlines()
    assert abs(float(first[1].split()[0]) - 5.5) < 0.6


def test_the_label_of_the_rings_colours_is_inside_the_picture(tmp_path: Path) -> None:
    """One row of wide, low images: the bar is as high as its label."""
    for rings in (1, 3):
        setup = Setup(rings=rings, width_px=64, height_px=12)
        run = open_run(
            write_run(tmp_path / str(rings), setup, points(setup, [(2, 3, 100.0, 0.0, 1e-6)]))
        )
        figure = plot_rings(run.frame(1))
        figure.draw_without_rendering()
        label = figure.axes[-1].yaxis.label.get_window_extent()
        assert figure.bbox.contains(label.x0, label.y0) and figure.bbox.contains(label.x1, label.y1)


def test_the_axis_of_the_range_rate_tells_where_it_folds() -> None:
    """5.3 GHz and 1 kHz hold lambda PRF / 4 = 14.1 m/s; a folded target has its true rate, too."""
    rd_map, _ = map_of(RADAR, [600.0], [40.0], [1e-6], (500.0, 700.0))
    folded = dataclasses.replace(peak(600.0, 11.72, -60.0), unfolded_velocity_mps=40.0)
    figure = plot_range_doppler(rd_map, [folded])
    upper = figure.axes[0].child_axes[0].get_xlabel()
    assert upper == r"range rate $v$ [m/s], folds at $\pm$14.1 m/s"
    assert "true +40.0" in labels(figure)[0]
    still = dataclasses.replace(folded, unfolded_velocity_mps=folded.velocity_mps)
    assert "true" not in labels(plot_range_doppler(rd_map, [still]))[0]
