# SPDX-License-Identifier: GPL-3.0-or-later
"""What pictures show, read back from what was drawn: places, signs, floors, noise, snapshots."""

from __future__ import annotations

import dataclasses
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from radarsim_addon.contract import LinkBudget
from radarsim_addon.physics.mirrors import MirrorMaterial
from radarsim_addon.signal import (
    Burst,
    FrameResult,
    ProcessOptions,
    Radar,
    RangeDopplerMap,
    Receiver,
    SpectrogramOptions,
    open_run,
    plot_echo,
    plot_range_doppler,
    plot_range_profile,
    plot_rings,
    process_frame,
)
from radarsim_addon.signal.maps import ExpectedPower, Spectrogram
from radarsim_addon.signal.pictures import frame_pictures, plot_coverage
from radarsim_addon.signal.pictures.map import plot_clutter, plot_spectrogram
from radarsim_addon.signal.radar import (
    ConstantGain,
    CoverageSetup,
    Mount,
    compute_coverage,
    coverage_curve,
)
from tests.signal import synthetic
from tests.signal import unequal as u

WAVELENGTH_M = u.WAVELENGTH_M
RADAR = Radar(u.FMCW.waveform, Burst(900.0, 9))
#: Nine Doppler cells of 100 Hz and seven ranges of 2 m; one cell for each quadrant.
DOPPLER_HZ, RANGE_M = 100.0 * np.arange(-4, 5), 40.0 + 2 * np.arange(7)
POWER = np.full((9, 7), 1e-14)
POWER[1, 5], POWER[7, 1] = 1e-8, 1e-10


def hot_spots(axis: Any, levels_db: tuple[float, ...]) -> list[tuple[float, float]]:
    """Middles of the cells of these levels in the axes of the only image."""
    (image,) = axis.images
    left, right, bottom, top = image.get_extent()
    cells = np.asarray(image.get_array())
    found = []
    for level_db in levels_db:
        ((row, column),) = np.argwhere(np.abs(cells - level_db) < 0.01)
        x = left + (column + 0.5) * (right - left) / cells.shape[1]
        found.append((x, bottom + (row + 0.5) * (top - bottom) / cells.shape[0]))
    return found


def noise_lines(axis: Any) -> list[float]:
    """Heights of level lines across the axes."""
    return [line.get_ydata()[0] for line in axis.lines if len(set(line.get_ydata())) == 1]


def unequal_map() -> RangeDopplerMap:
    values = np.sqrt(POWER)[None].astype(complex)
    return RangeDopplerMap(values, DOPPLER_HZ, RANGE_M, RADAR, "none", "none")


def assert_scaled(axis: Any, along: int, doppler_hz: list[float]) -> None:
    """The second scale has -lambda / 2 times the Doppler in the same places."""
    for one_hz in doppler_hz:
        places = [
            scale.transData.transform((number, 0.0) if along == 0 else (0.0, number))[along]
            for scale, number in ((axis, one_hz), (axis.child_axes[0], -WAVELENGTH_M / 2 * one_hz))
        ]
        assert places[1] == pytest.approx(places[0], abs=0.01)


def assert_rates(figure: Any, left_hz: float = 450.0) -> None:
    """The scale of range rates is -lambda / 2 times that of Doppler; receding is on the right."""
    figure.canvas.draw()
    axis = figure.axes[0]
    assert_scaled(axis, 0, [-400.0, 0.0, 300.0])
    assert axis.get_xlim() == pytest.approx((left_hz, -left_hz))
    rates = axis.child_axes[0].transData
    assert (rates.transform((5.0, 0.0))[0] > rates.transform((-5.0, 0.0))[0]) == (left_hz > 0)
    assert axis.get_ylim() == pytest.approx((39.0, 53.0))


def test_map_and_clutter() -> None:
    """Strongest at -300 Hz and 50 m, which recedes; 20 dB less at +300 Hz and 42 m."""
    expected = clutter_of_a_tenth()
    for figure in (
        plot_range_doppler(unequal_map(), noise_power=1e-12),
        plot_clutter(expected, RADAR, noise_power=1e-12),
    ):
        axis, bar = figure.axes[:2]
        np.testing.assert_allclose(
            hot_spots(axis, (0.0, -20.0)), [(-300.0, 50.0), (300.0, 42.0)], atol=1e-9
        )
        assert axis.images[0].get_clim() == (-50.0, 0.0)  # 10 dB below the noise
        assert noise_lines(bar) == pytest.approx([-40.0])
        assert_rates(figure)
    assert_rates(plot_range_doppler(unequal_map(), paper_axes=True), -450.0)


def clutter_of_a_tenth() -> ExpectedPower:
    """Clutter in the cells, and ten times as much power of all."""
    profile = POWER.sum(axis=0)
    return ExpectedPower(
        RANGE_M, DOPPLER_HZ, 10 * profile, profile, 10 * POWER[::-1], POWER,
        profile, profile / 2, POWER, POWER / 2,
    )  # fmt: skip


def test_spectrogram() -> None:
    time_s = 0.5 + 0.01 * np.arange(7)
    radar = Radar(u.FMCW.waveform, Burst(900.0, 90))
    shown = Spectrogram(
        power=POWER.T.copy(), time_s=time_s, doppler_hz=DOPPLER_HZ,
        range_limits_m=(39.0, 53.0), radar=radar,
        options=SpectrogramOptions(9, 0.5),
    )  # fmt: skip
    figure = plot_spectrogram(shown)
    figure.canvas.draw()
    axis = figure.axes[0]
    unit = {"ms": 1e-3, "s": 1.0}[axis.get_xlabel().split("[")[1].rstrip("]")]
    np.testing.assert_allclose(
        hot_spots(axis, (0.0, -20.0)), [(0.55 / unit, -300.0), (0.51 / unit, 300.0)]
    )
    assert_scaled(axis, 1, [-400.0, 0.0, 300.0])
    assert axis.get_ylim() == pytest.approx((450.0, -450.0))  # receding is above


@pytest.fixture(scope="module")
def result(tmp_path_factory: pytest.TempPathFactory) -> FrameResult:
    """Noise of the receiver and of the link budget differ, and clutter is a tenth of all power."""
    run = open_run(u.write_run(tmp_path_factory.mktemp("pictures") / "run", 3, 0.125))
    options = ProcessOptions(
        radar=u.FMCW, range_taper="none", doppler_taper="none", speckle_seed=None,
        receiver=Receiver(noise_figure_db=30.0), link_budget=LinkBudget(noise_figure_db=4.0),
        spectrogram=SpectrogramOptions(5, 0.4, object_name="Boat"),
    ).for_run(run)  # fmt: skip
    found = process_frame(options.open(run.frame(3)), options)
    assert found.expected is not None
    expected = dataclasses.replace(
        found.expected, clutter_map=found.expected.map / 10, clutter_map_error=found.expected.map
    )
    return dataclasses.replace(found, expected=expected, edges_left_out=2)


def test_pictures_get_their_own_numbers(
    result: FrameResult, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    given: dict[str, dict[str, Any]] = {}
    arguments: dict[str, tuple[Any, ...]] = {}
    for name in ("draw_range_profile", "draw_range_doppler", "plot_clutter", "plot_spectrogram"):
        real = getattr(frame_pictures, name)

        def noted(*args: Any, name: str = name, real: Any = real, **more: Any) -> Any:
            given[name], arguments[name] = more, args
            return real(*args, **more)

        monkeypatch.setattr(frame_pictures, name, noted)
    files = frame_pictures.draw_results(result, tmp_path)
    assert [path.name.removeprefix("frame_0003_") for path in files] == [
        "echo.png", "range_profile.png", "range_doppler.png", "spectrogram.png", "clutter.png",
    ]  # fmt: skip
    noise_w, budget_w = (1.380649e-23 * 290 * 10 ** (f / 10) * 2e6 for f in (30.0, 4.0))
    for name, expected_w in (
        ("draw_range_profile", noise_w / 251), ("draw_range_doppler", noise_w / 251 / 15),
        ("plot_clutter", budget_w / 251 / 15),
    ):  # fmt: skip
        assert given[name]["noise_power"] == pytest.approx(expected_w, rel=1e-6), name
        assert given[name]["unit"] == "dBW", name
    assert arguments["plot_spectrogram"][0] is result.spectrogram
    assert arguments["plot_clutter"][0] is result.expected
    texts = [text for args in arguments.values() for text in args if isinstance(text, str)]
    titles = [text for text in texts if text != "dBW"]
    assert len(titles) == 4 and all("frame 3, t = 0.125 s" in text for text in titles)
    assert any(text.startswith("Spectrogram of Boat") for text in titles)


def test_profile_and_echo(result: FrameResult) -> None:
    """Curves peak at the echoes; the noise of a profile is 251 times below that of a sample."""
    noise_w = result.profile_noise_power
    figure = plot_range_profile(
        result.compressed, result.profile, result.edges, expected=None, noise_power=noise_w
    )
    axis = figure.axes[0]
    top_w = float(max(result.compressed.mean_power.max(), result.profile.power.max()))
    assert noise_lines(axis) == pytest.approx([10 * np.log10(noise_w / top_w)])
    curves = [line for line in axis.lines if len(line.get_xdata()) > 100]
    for curve in curves:
        x, y = np.asarray(curve.get_xdata()), np.asarray(curve.get_ydata())
        assert x[y.argmax()] == pytest.approx(u.ECHOES[0].range_m, abs=0.8)
    levels = [float(np.max(line.get_ydata())) for line in curves]
    assert max(levels) == pytest.approx(0.0)
    (marks,) = (line for line in axis.lines if line.get_marker() == "v")
    np.testing.assert_allclose(marks.get_xdata(), [edge.range_m for edge in result.edges])
    echo = plot_echo(result.echoes)
    image = echo.axes[0].images[0]
    assert image.get_clim() == (-60.0, 0.0)
    left, right, bottom, top = image.get_extent()
    assert (bottom, top) == (-0.5, 14.5)
    # 251 samples of 0.5 us around their middles
    assert right - left == pytest.approx(251 * 0.5, rel=1e-9)
    real = echo.axes[1].images[0]
    shown = np.asarray(real.get_array())
    scale = float(np.median(result.echoes.plane.real / shown))
    np.testing.assert_allclose(shown * scale, result.echoes.plane.real, rtol=1e-6)
    assert real.get_clim()[0] == -real.get_clim()[1]


def test_rings_of_each_snapshot(tmp_path: Path) -> None:
    """Snapshot n has its echo in ring n + 1, row 2 + n and column 3 + 5 n, one of 10 dB less."""
    setup = synthetic.Setup(rings=3, snapshot_interval_s=0.02)

    def picture(frame: int, ring: int, snapshot: int) -> tuple[np.ndarray, np.ndarray]:
        range_m, radiance = synthetic.empty(setup)
        if ring == snapshot + 1:
            range_m[2 + snapshot, 3 + 5 * snapshot] = 250.0 * ring + 60
            radiance[2 + snapshot, 3 + 5 * snapshot] = 1e-6
        if ring == 0:
            range_m[9 - snapshot, 1], radiance[9 - snapshot, 1] = 100.0, 1e-7
        return range_m, radiance

    frame = open_run(synthetic.write_run(tmp_path / "run", setup, picture)).frame(1)
    for snapshot, later in ((0, False), (1, True)):
        figure = plot_rings(frame, snapshot, -45.0)
        images = [axis.images[0] for axis in figure.axes[:3]]
        for ring, (image, axis) in enumerate(zip(images, figure.axes, strict=False)):
            level = np.asarray(image.get_array())
            place = [tuple(one) for one in np.argwhere(level > -44.9)]
            known = {0: [(9 - snapshot, 1)], snapshot + 1: [(2 + snapshot, 3 + 5 * snapshot)]}
            assert place == known.get(ring, []), (snapshot, ring)
            assert level.max() == pytest.approx({0: -10.0, snapshot + 1: 0.0}.get(ring, -45.0))
            assert image.get_clim() == (-45.0, 0.0)
            assert axis.get_title() == f"{250 * ring}-{250 * ring + 250} m"
            texts = [text.get_text() for text in axis.texts]
            assert texts == ([] if ring in known else ["no echo"])
        assert ("second snapshot, 0.02 s later" in figure.get_suptitle()) is later


def test_the_white_line_of_a_coverage_is_the_echo_of_free_space_at_its_end() -> None:
    """20 dB below free space everywhere: as strong as at the end at a range 10^(1/2) nearer."""
    mount = Mount(ConstantGain(3.0), 10.0, np.eye(4)[[0, 2, 1, 3]] * [1, 1, -1, 1])
    ground = MirrorMaterial(3 + 0j, 1.0, True)
    setup = CoverageSetup(mount, mount, ground, 0.1, "vertical", np.inf)
    ranges_m = np.geomspace(5e2, 1e4, 81)
    found = compute_coverage(setup, np.array([5.0, 10.0, 20.0]), ranges_m)
    found = dataclasses.replace(found, factor=np.full(found.factor.shape, 0.01))
    left = plot_coverage(found, coverage_curve(found)).axes[0]
    (line,) = (one for one in left.collections if type(one).__name__ == "QuadContourSet")
    (places,) = (np.array(path.vertices) for path in line.get_paths())
    np.testing.assert_allclose(places[:, 0], 1e4 / 10**0.5, rtol=1e-3)
