# SPDX-License-Identifier: GPL-3.0-or-later
"""Pictures that the window asks for: values at places, marks, and the process that draws."""

from __future__ import annotations

import io
import json
import shutil
import subprocess
import sys
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import image as matplotlib_image

from radarsim_addon import contract
from radarsim_addon.messages import Message, read_message, skip_greeting, write_message
from radarsim_addon.signal.maps import SpectrogramOptions
from radarsim_addon.signal.pictures import (
    FrameProfile,
    answer_request,
    new_figure,
    read_view,
    write_view,
)
from radarsim_addon.signal.pictures.figure import Sheet
from radarsim_addon.signal.pictures.map import ColourScale
from radarsim_addon.signal.pictures.view_pictures import draw_plan_position, draw_range_time
from radarsim_addon.signal.pipeline import ProcessOptions, process_run
from radarsim_addon.signal.products import FrameResult
from tests.signal import path_runs

YELLOW = np.array([0.993, 0.906, 0.144])  # the upper end of viridis


@pytest.fixture(scope="module")
def views(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """What pictures of two frames are drawn from: a plate that recedes, and one farther away."""
    folder = tmp_path_factory.mktemp("views")
    pose = path_runs.pose((0.0, 0.0, 0.0))
    receiver, emitter = path_runs.camera(pose, 20.0), contract.TransmitterRecord(pose, 1e3)
    plates = [path_runs.plate("Near", (0, 25, 0), 4.0), path_runs.plate("Far", (9, 45, 0), 6.0)]
    rows = path_runs.trace(plates, receiver, emitter, 48)
    rows["range_rate_mps"][rows["last_object"] == 1] = 6.0
    names = [plate.name for plate in plates]
    run = path_runs.write_run(folder / "run", rows, names, receiver, emitter, range_limits_m=60.0)
    options = ProcessOptions(plots=False, products=False, spectrogram=SpectrogramOptions(16))
    (result,) = (one for one in process_run(run, options) if isinstance(one, FrameResult))
    write_view(result, folder)
    record = json.loads((folder / "view_000001.json").read_text())
    (folder / "view_000002.json").write_text(json.dumps({**record, "frame": 2, "time_s": 0.1}))
    shutil.copy(folder / "view_000001.npz", folder / "view_000002.npz")
    return folder


def answer(folder: Path, kind: str, **changes: Any) -> Message:
    fields = {
        "number": 3, "folder": str(folder), "frames": [1, 2], "kind": kind, "frame": 1,
        "span_db": 80.0, "width_px": 900, "chosen": None,
    }  # fmt: skip
    return answer_request(Message({**fields, **changes}, {}))


def pixels(found: Message) -> np.ndarray:
    return np.asarray(matplotlib_image.imread(io.BytesIO(found.arrays["png"].tobytes())))


def values_at(places: np.ndarray, picture: np.ndarray, axes: dict[str, Any]) -> np.ndarray:
    """Values of pixels (row, column) along both axes."""
    left, low, right, high = axes["box"]
    height, width = picture.shape[:2]
    across = ((places[:, 1] + 0.5) / width - left) / (right - left)
    up = (1 - (places[:, 0] + 0.5) / height - low) / (high - low)
    (x0, x1), (y0, y1) = axes["x"], axes["y"]
    return np.stack([x0 + across * (x1 - x0), y0 + up * (y1 - y0)], axis=1)


def brightest(picture: np.ndarray, axes: dict[str, Any]) -> np.ndarray:
    """Places of the brightest colour between the axes."""
    left, low, right, high = axes["box"]
    height, width = picture.shape[:2]
    places = np.argwhere(np.abs(picture[..., :3] - YELLOW).max(axis=2) < 0.03)
    up, across = 1 - places[:, 0] / height, places[:, 1] / width
    inside = (across > left) & (across < right) & (up > low) & (up < high)
    return np.asarray(places[inside])


@pytest.mark.parametrize("width_px", [421, 900, 1200])
def test_a_map_has_its_strongest_cell_where_the_axes_say(views: Path, width_px: int) -> None:
    view = read_view(views, 1)
    found = answer(views, "MAP", width_px=width_px)
    picture, axes = pixels(found), found.fields["axes"]
    assert picture.shape[1] == width_px
    doppler_hz, range_m = values_at(brightest(picture, axes), picture, axes).mean(axis=0)
    target = view.targets[0]
    step_hz, step_m = (abs(ends[1] - ends[0]) / 200 for ends in (axes["x"], axes["y"]))
    assert doppler_hz == pytest.approx(
        -2 * target["map_velocity_mps"] / view.wavelength_m, abs=step_hz + 8
    )
    assert range_m == pytest.approx(target["map_range_m"], abs=step_m + 5)


@pytest.mark.parametrize("kind", ["MAP", "PROFILE", "SPECTROGRAM", "RANGE_TIME"])
def test_the_chosen_target_is_marked_at_its_place(views: Path, kind: str) -> None:
    view = read_view(views, 2)
    plain = answer(views, kind, frame=2)
    for target in view.targets:
        own = {key: value for key, value in target.items() if key != "lines_m"}
        found = answer(views, kind, frame=2, chosen=own)
        assert found.fields["axes"] == plain.fields["axes"]
        changed = np.argwhere(np.abs(pixels(found) - pixels(plain)).max(axis=2) > 0.1)
        x, y = values_at(changed, pixels(plain), plain.fields["axes"]).mean(axis=0)
        doppler_hz = -2 * target["map_velocity_mps"] / view.wavelength_m
        x_error, y_error = (
            abs(ends[1] - ends[0]) / 300
            for ends in (plain.fields["axes"]["x"], plain.fields["axes"]["y"])
        )
        if kind in ("MAP", "PROFILE"):
            place = doppler_hz if kind == "MAP" else target["range_m"]
            assert x == pytest.approx(place, abs=x_error)
        if kind != "PROFILE":
            places = {"MAP": target["map_range_m"], "SPECTROGRAM": doppler_hz}
            assert y == pytest.approx(places.get(kind, target["range_m"]), abs=y_error)
    again = answer(views, kind, frame=2)  # a mark does not stay
    np.testing.assert_array_equal(again.arrays["png"], plain.arrays["png"])


def test_the_profile_passes_through_its_values(views: Path) -> None:
    """Pixels of the curve, read back by the axes, are levels of the profile."""
    found, arrays = answer(views, "PROFILE", width_px=1200), read_view(views, 1).arrays
    picture, axes = pixels(found), found.fields["axes"]
    blue = np.abs(picture[..., :3] - [0.122, 0.467, 0.706]).max(axis=2) < 0.1
    _, low, _, high = axes["box"]
    places = np.argwhere(blue)
    up = 1 - places[:, 0] / picture.shape[0]
    values = values_at(places[(up > low) & (up < high)], picture, axes)
    peak = arrays["profile"].argmax()
    values = values[values[:, 1] < 3]  # above is the legend
    top = values[np.abs(values[:, 0] - arrays["profile_range_m"][peak]) < 20]
    assert top[:, 1].max() == pytest.approx(0.0, abs=0.5)  # the strongest is 0 dB
    levels = 10 * np.log10(arrays["profile"] / arrays["profile"].max())
    fitting = values[values[:, 1] > -60]
    away = np.abs(np.interp(fitting[:, 0], arrays["profile_range_m"], levels) - fitting[:, 1])
    assert np.median(away) < 2.0


def test_the_dynamic_range_is_that_of_the_colours(views: Path) -> None:
    wide, narrow = (pixels(answer(views, "MAP", span_db=span)) for span in (80.0, 20.0))
    assert (wide != narrow).any(axis=2).mean() > 0.2
    again = pixels(answer(views, "MAP", span_db=80.0))
    np.testing.assert_array_equal(again, wide)


@pytest.mark.parametrize("kind", ["MAP", "PROFILE", "ECHO", "SPECTROGRAM", "RANGE_TIME", "PPI"])
def test_a_frame_without_an_echo_can_be_drawn(views: Path, tmp_path: Path, kind: str) -> None:
    record = json.loads((views / "view_000001.json").read_text())
    nothing = {**record, "objects": {}, "tops": dict.fromkeys(record["tops"], 0.0)}
    (tmp_path / "view_000001.json").write_text(json.dumps(nothing))
    arrays = dict(np.load(views / "view_000001.npz"))
    for name, values in arrays.items():
        if name.endswith("_db") or name == "profile":
            arrays[name] = np.full_like(values, 0 if name == "profile" else -300)
    np.savez(tmp_path / "view_000001.npz", **arrays)
    found = answer(tmp_path, kind, frames=[1])
    picture, (left, low, right, high) = pixels(found), found.fields["axes"]["box"]
    height, width = picture.shape[:2]
    middle = picture[int((1 - high) * height) + 3 : int((1 - low) * height) - 3]
    middle = middle[:, int(left * width) + 3 : int(right * width) - 3, :3]
    assert np.abs(middle - YELLOW).max(axis=2).min() > 0.3  # nothing is strong
    assert middle.std() > 0.001 or kind == "PPI"  # "no echo"


@pytest.mark.parametrize("kind", ["PPI", "RANGE_TIME"])
def test_a_scan_shows_a_target_where_the_radar_looked(kind: str) -> None:
    """A scan of 36 directions; the echo at 40 m in the direction of 90 degrees: east, +X."""
    range_m = np.arange(100) + 0.5
    profiles = [
        FrameProfile(n * 0.1, range_m, np.where((n == 9) & (abs(range_m - 40.5) < 0.1), 1.0, 1e-9),
                     (10.0 * n + 180) % 360 - 180, 30.0)
        for n in range(36)
    ]  # fmt: skip
    figure, scale = new_figure(9.6, 6.4), ColourScale(1.0, -80.0)
    if kind == "PPI":
        axis = draw_plan_position(figure, profiles, scale)
    else:
        axis, _ = draw_range_time(figure, profiles, scale)
    picture = Sheet(figure, [], 100).picture() / 255
    box = axis.get_position()
    axes = {"box": list(box.extents), "x": axis.get_xlim(), "y": axis.get_ylim()}
    values = values_at(brightest(picture, axes), picture, axes)
    x, y = values.mean(axis=0)
    if kind == "PPI":
        assert (x, y) == pytest.approx((40.5, 0.0), abs=1.0)
        assert np.ptp(values[:, 1]) == pytest.approx(2 * 40.5 * np.tan(np.radians(5.0)), abs=1.0)
    else:
        assert x == pytest.approx(0.9, abs=0.02) and y == pytest.approx(40.5, abs=0.5)


def test_a_plan_position_is_grey_where_the_radar_did_not_look() -> None:
    range_m = np.arange(50) + 0.5
    profile = FrameProfile(0.0, range_m, np.ones(50), 90.0, 20.0)
    figure = new_figure(9.6, 6.4)
    axis = draw_plan_position(figure, [profile], ColourScale(1.0, -80.0))
    picture = Sheet(figure, [], 100).picture() / 255
    left, low, right, high = axis.get_position().extents

    def colour(x: float, y: float) -> np.ndarray:
        across = left + (x / 50 + 1) / 2 * (right - left)
        up = low + (y / 50 + 1) / 2 * (high - low)
        height, width = picture.shape[:2]
        return np.asarray(picture[int((1 - up) * height), int(across * width)])

    np.testing.assert_allclose(colour(30.0, 0.0), YELLOW, atol=0.03)
    for place in ((-30.0, 0.0), (0.0, 30.0), (0.0, -30.0), (30.0, 8.0)):
        np.testing.assert_allclose(colour(*place), 0.85, atol=0.02)


def answers_of_a_process(*requests: dict[str, Any]) -> dict[int, Message]:
    """What a new process answers to requests, by their numbers."""
    stream = io.BytesIO()
    for one in requests:
        write_message(stream, one, {})
    done = subprocess.run(
        [sys.executable, "-m", "radarsim_addon.signal.pictures.worker"],
        input=stream.getvalue(), capture_output=True, check=True,
    )  # fmt: skip
    assert not done.stderr
    answers, found = io.BytesIO(done.stdout), {}
    skip_greeting(answers)
    while (message := read_message(answers)) is not None:
        found[message.fields["number"]] = message
    return found


def test_the_process_answers_as_to_one_request_and_leaves_out_what_is_late(
    views: Path, tmp_path: Path
) -> None:
    fields = {
        "folder": str(views), "frames": [1, 2], "frame": 1, "width_px": 500, "chosen": None,
        "kind": "MAP",
    }  # fmt: skip
    requests = [
        {**fields, "place": "map", "span_db": span, "number": number}
        for number, span in enumerate((80.0, 70.0, 60.0, 50.0))
    ]
    requests.append({"place": "gif", "gif": str(tmp_path / "none" / "x.gif"), "files": [],
                     "seconds": 0.1, "number": 4})  # fmt: skip
    found = answers_of_a_process(*requests)
    assert found.keys() <= set(range(5))
    for number in sorted(found.keys() - {4}):
        if "late" in found[number].fields:
            assert not found[number].arrays and number < 3
            continue
        # of another process: other tests may have changed matplotlib's settings in this one
        same = answers_of_a_process(requests[number])[number]
        np.testing.assert_array_equal(found[number].arrays["png"], same.arrays["png"])
