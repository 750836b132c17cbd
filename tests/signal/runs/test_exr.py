# SPDX-License-Identifier: GPL-3.0-or-later
"""EXR files: exact round trip, and a named error for every bad one."""

import struct
import subprocess
import sys
import types
from pathlib import Path

import numpy as np
import OpenEXR
import pytest

from radarsim_addon.errors import FrameFileError, MissingDependencyError, OutputError
from radarsim_addon.signal.runs import exr
from radarsim_addon.signal.runs.exr import read_header


def some_channels(height: int = 37, width: int = 50) -> dict[str, np.ndarray]:
    rng = np.random.default_rng(5)
    return {name: rng.random((height, width), dtype=np.float32) for name in "RGB"}


def write_raw(path: Path, channels: dict[str, np.ndarray]) -> Path:
    """With the library alone, past our own checks."""
    header = {"compression": OpenEXR.ZIP_COMPRESSION, "type": OpenEXR.scanlineimage}
    with OpenEXR.File(header, dict(channels)) as file:  # it puts its own objects in
        file.write(str(path))
    return path


def test_round_trip_is_exact_with_space_and_umlaut_in_the_path(tmp_path: Path) -> None:
    channels = some_channels()
    channels["R"][0, :4] = [1e-45, 1.2e-38, 3e38, 0.0]  # denormal, tiny, huge
    path = tmp_path / "Läufe und Bahnen" / "Ring 0.exr"
    path.parent.mkdir()
    exr.write_exr(path, channels)
    found = exr.read_exr(path)
    assert list(found) == ["R", "G", "B"]
    for name, image in channels.items():
        assert found[name].dtype == np.float32
        assert np.array_equal(found[name], image)
    assert sorted(p.name for p in path.parent.iterdir()) == ["Ring 0.exr"]


def test_row_0_is_the_top_one(tmp_path: Path) -> None:
    image = np.zeros((3, 2), np.float32)
    image[0] = 1
    exr.write_exr(tmp_path / "a.exr", {"B": image})
    with OpenEXR.File(str(tmp_path / "a.exr"), separate_channels=True) as file:
        assert file.channels()["B"].pixels[0, 0] == 1


def test_more_channels_than_asked_for_are_left_alone(tmp_path: Path) -> None:
    channels = {f"ring.{i:03d}": np.full((4, 5), i, np.float32) for i in range(21)}
    exr.write_exr(tmp_path / "a.exr", channels)
    found = exr.read_exr(tmp_path / "a.exr", ["ring.020"])
    assert list(found) == ["ring.020"]
    assert (found["ring.020"] == 20).all()


def test_missing_file(tmp_path: Path) -> None:
    with pytest.raises(FrameFileError, match="is missing"):
        exr.read_exr(tmp_path / "none.exr")


def test_every_truncation_is_found(tmp_path: Path) -> None:
    whole = write_raw(tmp_path / "whole.exr", some_channels()).read_bytes()
    cut = tmp_path / "cut.exr"
    lengths = [*range(0, len(whole), 11), len(whole) - 1]
    for length in lengths:
        cut.write_bytes(whole[:length])
        with pytest.raises(FrameFileError, match=r"truncated|not an OpenEXR"):
            exr.read_exr(cut)


def test_zeros_where_the_end_was_are_found(tmp_path: Path) -> None:
    """A crash can leave a file of full length whose last blocks were never written."""
    # coarse values: noise would be stored uncompressed, where zeros are pixels like any other
    coarse = {name: np.round(plane * 9) for name, plane in some_channels(80, 64).items()}
    path = write_raw(tmp_path / "a.exr", coarse)
    whole = path.read_bytes()
    path.write_bytes(whole[:-500] + bytes(500))
    with pytest.raises(FrameFileError, match=r"damaged|decoded"):
        exr.read_exr(path)


def test_not_an_exr(tmp_path: Path) -> None:
    path = tmp_path / "a.exr"
    path.write_bytes(b"\x89PNG\r\n\x1a\n" + bytes(100))
    with pytest.raises(FrameFileError, match="not an OpenEXR"):
        exr.read_exr(path)


def test_wrong_channels_names_what_was_found(tmp_path: Path) -> None:
    image = np.zeros((4, 4), np.float32)
    write_raw(tmp_path / "a.exr", {"Y": image, "Z": image})
    with pytest.raises(FrameFileError, match=r"lacks channel R, G, B; found Y, Z"):
        exr.read_exr(tmp_path / "a.exr")


def test_half_float(tmp_path: Path) -> None:
    write_raw(tmp_path / "a.exr", {c: np.zeros((4, 4), np.float16) for c in "RGB"})
    with pytest.raises(FrameFileError, match=r"channel R is half; expected 32 bit float"):
        exr.read_exr(tmp_path / "a.exr")


@pytest.mark.parametrize("value", [np.nan, np.inf, -np.inf])
def test_nan_and_inf_say_where_and_how_many(tmp_path: Path, value: float) -> None:
    channels = some_channels()
    channels["G"][7, 11] = channels["G"][30, 2] = value
    write_raw(tmp_path / "a.exr", channels)
    with pytest.raises(FrameFileError, match=r"channel G holds 2 .* row 7, column 11"):
        exr.read_exr(tmp_path / "a.exr")


def test_oversized_header_is_refused_before_pixels_are_made(tmp_path: Path) -> None:
    path = write_raw(tmp_path / "a.exr", some_channels())
    data = bytearray(path.read_bytes())
    for name in (b"dataWindow\0box2i\0", b"displayWindow\0box2i\0"):
        at = data.index(name) + len(name) + 4
        struct.pack_into("<iiii", data, at, 0, 0, 2**20, 2**20)
    path.write_bytes(data)
    with pytest.raises(FrameFileError, match=r"1048577 x 1048577 pixels; at most 268435456"):
        exr.read_exr(path)


def test_multi_part_file_is_refused(tmp_path: Path) -> None:
    image = np.zeros((4, 4), np.float32)
    parts = [
        OpenEXR.Part({"name": n, "type": OpenEXR.scanlineimage}, {"B": image}) for n in ("a", "b")
    ]
    with OpenEXR.File(parts) as file:
        file.write(str(tmp_path / "a.exr"))
    with pytest.raises(FrameFileError, match="single-part"):
        exr.read_exr(tmp_path / "a.exr")


def test_header_is_read_without_a_library(tmp_path: Path) -> None:
    header = read_header(write_raw(tmp_path / "a.exr", some_channels(9, 7)))
    assert (header.width_px, header.height_px) == (7, 9)
    assert header.channels == {"B": "float", "G": "float", "R": "float"}


def test_output_folder_missing(tmp_path: Path) -> None:
    with pytest.raises(OutputError, match=r"Cannot write .*No such file"):
        exr.write_exr(tmp_path / "none" / "a.exr", some_channels())


def test_output_folder_cannot_hold_files(tmp_path: Path) -> None:
    (tmp_path / "file").touch()
    with pytest.raises(OutputError, match="Cannot write"):
        exr.write_exr(tmp_path / "file" / "a.exr", some_channels())


def test_full_disk_leaves_the_old_file_and_no_half_one(
    tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    path = tmp_path / "a.exr"
    exr.write_exr(path, some_channels())
    before = path.read_bytes()

    def stop_halfway(module: object, target: Path, planes: object) -> None:
        target.write_bytes(before[: len(before) // 2])  # what a library leaves that checks nothing

    monkeypatch.setattr(exr, "_write_openexr", stop_halfway)
    with pytest.raises(OutputError, match="has room"):
        exr.write_exr(path, some_channels())
    assert path.read_bytes() == before
    assert [p.name for p in tmp_path.iterdir()] == ["a.exr"]


def test_inside_blender_only_its_own_library_is_tried(monkeypatch: pytest.MonkeyPatch) -> None:
    app = types.SimpleNamespace(binary_path="/opt/blender/blender")
    monkeypatch.setitem(sys.modules, "bpy", types.SimpleNamespace(app=app))  # type: ignore[arg-type]
    asked = []

    def find_spec(name: str) -> None:
        asked.append(name)

    monkeypatch.setattr("importlib.util.find_spec", find_spec)
    with pytest.raises(MissingDependencyError, match="OpenImageIO"):
        exr.exr_backend()
    assert asked == ["OpenImageIO"]
    app.binary_path = ""  # a bpy wheel in a plain Python
    with pytest.raises(MissingDependencyError, match="OpenImageIO"):
        exr.exr_backend()
    assert asked == ["OpenImageIO", "OpenEXR", "OpenImageIO"]


def test_a_python_without_openexr_takes_openimageio(monkeypatch: pytest.MonkeyPatch) -> None:
    """That of Blender, which processes a run of rings for the window."""
    there = types.ModuleType("OpenImageIO")
    monkeypatch.setitem(sys.modules, "OpenImageIO", there)
    monkeypatch.setattr(
        "importlib.util.find_spec", lambda name: None if name == "OpenEXR" else there
    )
    assert exr.exr_backend() == ("OpenImageIO", there)


_OIIO_TWIN = """
import glob, sys
import bpy
sys.path += glob.glob(bpy.utils.resource_path("LOCAL") + "/python/lib/python3*/site-packages")
import numpy as np
from radarsim_addon.signal.runs import exr
exr.inside_blender_program = lambda: True
assert exr.exr_backend()[0] == "OpenImageIO"
found = exr.read_exr(sys.argv[1])
exr.write_exr(sys.argv[2], found)
assert "OpenEXR" not in sys.modules
"""


@pytest.mark.blender
def test_openimageio_reads_and_writes_the_same(tmp_path: Path, root: Path) -> None:
    """The library inside Blender programs, taken from the bpy wheel."""
    pytest.importorskip("bpy")
    channels = some_channels()
    write_raw(tmp_path / "a ü.exr", channels)
    files = [str(tmp_path / "a ü.exr"), str(tmp_path / "b ü.exr")]
    command = [sys.executable, "-c", _OIIO_TWIN, *files]
    done = subprocess.run(command, cwd=root, capture_output=True, text=True, timeout=120)
    assert done.returncode == 0, done.stderr
    found = exr.read_exr(tmp_path / "b ü.exr")
    for name, image in channels.items():
        assert np.array_equal(found[name], image)
