# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim merge`` without Blender: the plan of the whole run."""

import shutil
from dataclasses import replace
from pathlib import Path

import pytest

from radarsim_addon.contract import (
    DEFORMING_SURFACES_FILE,
    MOTION_FILE,
    PATHS_FILE,
    PATHS_TABLE,
    RUN_FILE,
    RunRecord,
)
from radarsim_addon.findings import finding
from radarsim_addon.signal.pipeline import main
from radarsim_addon.typed_json import read_record, write_record
from tests.fuzz.corpus import make_corpus
from tests.signal.synthetic import Setup, points, write_run

SETUP = Setup(rings=2, frames=(1, 2))


def test_a_merged_plan_is_that_of_its_parts(tmp_path: Path) -> None:
    """Byte for byte: counts stay whole numbers, for readers that ask for such."""
    part = write_run(tmp_path / "part", SETUP, points(SETUP, []))
    assert main(["merge", str(tmp_path / "whole"), str(part)]) == 0
    assert (tmp_path / "whole" / RUN_FILE).read_bytes() == (part / RUN_FILE).read_bytes()


def test_findings_of_all_parts_are_kept(tmp_path: Path) -> None:
    """One of each part alone, and one of both, whose frames are joined."""
    parts = []
    for frame, own in ((1, "adc-clipped"), (2, "orthographic-power")):
        part = write_run(tmp_path / str(frame), SETUP, points(SETUP, []))
        numbers = {"count": 5, "samples": 70} if own == "adc-clipped" else {}
        found = [finding(own, **numbers), finding("ground-truth-missing")]
        record = read_record(part / RUN_FILE, RunRecord)
        findings = [item.in_frame(frame) for item in found]
        write_record(part / RUN_FILE, replace(record, findings=findings))
        parts.append(str(part))
    for order in (parts, parts[::-1]):
        whole = tmp_path / f"whole {Path(order[0]).name}"
        assert main(["merge", str(whole), *order]) == 0
        merged = read_record(whole / RUN_FILE, RunRecord).findings
        frames = {item.code: sorted(item.frames) for item in merged}
        assert frames == {
            "adc-clipped": [1],
            "orthographic-power": [2],
            "ground-truth-missing": [1, 2],
        }


@pytest.fixture(scope="module")
def corpus(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Whole runs: rings (frames 1 and 32) and paths with motion."""
    folder = tmp_path_factory.mktemp("merge") / "corpus"
    make_corpus(folder)
    return folder


@pytest.mark.parametrize(
    ("kind", "name", "change"),
    [
        ("rings", "frames/frame_0032/ring_001_t1.json", "truncated"),
        *(
            (kind, f"frames/{name}", change)
            for kind, name in (
                ("rings", "frame_0032/ring_001_t1.exr"),
                ("paths", f"frame_0001/{PATHS_TABLE}"),
                ("paths", f"frame_0001/{MOTION_FILE}"),
                ("paths", f"frame_0001/{DEFORMING_SURFACES_FILE}"),
            )
            for change in ("truncated", "one bit")
        ),
    ],
)
def test_a_damaged_part_is_named_before_anything_is_written(
    corpus: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    kind: str,
    name: str,
    change: str,
) -> None:
    part = Path(shutil.copytree(corpus / kind, tmp_path / "part"))
    assert main(["merge", str(tmp_path / "whole"), str(part)]) == 0
    data = bytearray((part / name).read_bytes())
    if change == "truncated":
        del data[-20:]
    else:
        data[-len(data) // 3] ^= 1
    (part / name).unlink()  # the whole run is a hard link of it
    (part / name).write_bytes(data)
    capsys.readouterr()
    assert main(["merge", str(tmp_path / "other"), str(part)]) == 1
    assert (part / name).name in capsys.readouterr().err
    assert not (tmp_path / "other").exists()


@pytest.mark.parametrize(
    ("kind", "name", "old", "new"),
    [
        ("rings", "frames/frame_0001/ground_truth.json", b"299.0", b"298.0"),
        ("rings", "frames/frame_0032/ring_001_t1.json", b'"seed": 0', b'"seed": 1'),
        ("paths", f"frames/frame_0001/{PATHS_FILE}", b'"carrier_hz": 5', b'"carrier_hz": 6'),
        ("paths", "products/frame_0001_summary.json", b'"time_s": 0.0', b'"time_s": 9.0'),
        ("paths", "products/frame_0001_profile.npz", b"range_m", b"range_n"),
        ("paths", "products/frame_0001_map.npz", None, b""),
    ],
)  # fmt: skip
def test_a_changed_record_or_product_is_named(
    corpus: Path,
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    kind: str,
    name: str,
    old: bytes | None,
    new: bytes,
) -> None:
    part = Path(shutil.copytree(corpus / kind, tmp_path / "part"))
    assert main(["process", str(part), "--no-plots"]) == 0
    data = (part / name).read_bytes()
    assert old is None or old in data
    (part / name).write_bytes(data[:-20] if old is None else data.replace(old, new, 1))
    capsys.readouterr()
    assert main(["merge", str(tmp_path / "whole"), str(part)]) == 1
    assert (part / name).name in capsys.readouterr().err
    assert not (tmp_path / "whole").exists()
    (part / name).write_bytes(data)
    assert main(["merge", str(tmp_path / "whole"), str(part)]) == 0


def test_a_part_inside_another_one_keeps_its_own_frames(corpus: Path, tmp_path: Path) -> None:
    outer = Path(shutil.copytree(corpus / "rings", tmp_path / "outer"))
    inner = Path(shutil.copytree(outer, outer / "part_2"))
    shutil.rmtree(outer / "frames" / "frame_0032")
    assert main(["merge", str(tmp_path / "whole"), str(outer), str(inner)]) == 0
    assert sorted(p.name for p in (tmp_path / "whole" / "frames").iterdir()) == [
        "frame_0001",
        "frame_0032",
    ]
    assert not (tmp_path / "whole" / "part_2").exists()
