# SPDX-License-Identifier: GPL-3.0-or-later
"""Findings: made from the catalogue, merged over frames and objects, stored and read."""

from __future__ import annotations

import ast
import dataclasses
import json
import math
import re
import string
from pathlib import Path

import numpy as np
import pytest

from radarsim_addon.contract import RunRecord
from radarsim_addon.errors import FrameFileError
from radarsim_addon.findings import (
    Finding,
    exit_code,
    finding,
    finding_about,
    finding_lines,
    frames_text,
    frequency_text,
    from_json,
    length_text,
    merge,
    to_json,
)
from radarsim_addon.findings.__main__ import reference_page
from radarsim_addon.findings.catalogue import CATALOGUE, TOPICS, Kind, read_topics
from radarsim_addon.signal.pipeline import main
from radarsim_addon.typed_json import read_record, write_record
from tests.signal.synthetic import Setup, points, run_record, write_run

ROOT = Path(__file__).resolve().parents[2]
PACKAGE = ROOT / "radarsim_addon"


# -- one finding -----------------------------------------------------------------------------------
def test_numbers_and_names_are_in_the_text() -> None:
    found = finding("absorption-below-float32", "Sea", loss_db=94.4, limit_db=60.0)
    assert (found.code, found.severity, found.subjects) == (
        "absorption-below-float32",
        "caution",
        ("Sea",),
    )
    assert found.numbers == {"loss_db": 94.4, "limit_db": 60.0}
    assert "through 'Sea' is more than the 60 dB" in found.text
    assert found.message == f"{found.text} {found.cause} {found.remedy}"


@pytest.mark.parametrize(
    ("count", "text"),
    [(1, "has 1 path out"), (3, "has 3 paths out"), (12345, "has 12,345 paths out")],
)
def test_counts_have_their_noun(count: int, text: str) -> None:
    assert text in finding("paths-outside-range-limits", count=count).text


def test_percentages_have_two_digits() -> None:
    texts = [finding("mixed-pixels", fraction=f).text for f in (0.00123, 0.0996, 0.372, 1.0)]
    assert [text.split(" of")[0] for text in texts] == ["0.12 %", "10 %", "37 %", "100 %"]


def test_lengths_and_frequencies_choose_their_unit() -> None:
    assert [length_text(x) for x in (0.0, 1.5, 9999.0, 12345.6)] == [
        "0 m",
        "1.5 m",
        "9999 m",
        "12.346 km",
    ]
    assert [frequency_text(x) for x in (77e9, 150e6, 1e3, 60.0)] == [
        "77 GHz",
        "150 MHz",
        "1 kHz",
        "60 Hz",
    ]


def test_numpy_scalars_become_plain_numbers() -> None:
    found = finding("adc-clipped", count=np.int64(3), samples=np.int32(10))
    assert [type(value) for value in found.numbers.values()] == [int, int]
    endless = finding("displacement-error", displacement_error_bound_m=math.inf, wavelengths=1.0)
    assert "up to inf m" in endless.text
    assert json.loads(json.dumps(to_json(endless), allow_nan=False))["numbers"][
        "displacement_error_bound_m"
    ] == "inf"  # fmt: skip


def test_more_than_three_names_are_counted() -> None:
    assert "to 'A', 'B', 'C'." in finding("no-radar-material", "A", "B", "C", "A").text
    assert "to 'A', 'B', 'C' and 2 more." in finding("no-radar-material", *"ABCDE").text


def test_a_finding_can_be_given_subjects_and_frame() -> None:
    found = finding("kirchhoff-steep-slopes", slope=0.5).about("Gravel").in_frame(3)
    assert found.subjects == ("Gravel",) and found.frames == (3,)
    assert "'Gravel'" in found.text


def test_unknown_codes_and_missing_numbers_are_refused() -> None:
    with pytest.raises(KeyError):
        finding("no-such-code")
    with pytest.raises(KeyError, match="samples"):
        finding("adc-clipped", count=1)


# -- merged ----------------------------------------------------------------------------------------
def test_findings_of_a_code_become_one() -> None:
    found = merge(
        finding("mixed-pixels", fraction=share).in_frame(frame)
        for frame, share in ((1, 0.37), (2, 0.09), (3, 0.12))
    )
    assert len(found) == 1
    assert found[0].frames == (1, 2, 3)
    assert found[0].numbers == {"fraction": (0.09, 0.37)}
    assert found[0].text.startswith("9 to 37 % of the received power")


def test_objects_are_joined_and_order_is_kept() -> None:
    found = merge(
        [
            finding("absorption-below-float32", "Sea", loss_db=94.0, limit_db=60.0),
            finding("no-echo"),
            finding("absorption-below-float32", "Wall", loss_db=70.0, limit_db=60.0),
            finding("no-echo"),
        ]
    )
    assert [item.code for item in found] == ["absorption-below-float32", "no-echo"]
    assert found[0].subjects == ("Sea", "Wall")
    assert found[0].numbers == {"loss_db": (70.0, 94.0), "limit_db": 60.0}
    assert "'Sea', 'Wall' is more than the 60 dB" in found[0].text
    assert found[1] == finding("no-echo")


def test_one_finding_about_many_is_what_a_merge_makes_of_theirs() -> None:
    numbers = {
        name: {"loss_db": loss, "limit_db": 60.0} for name, loss in (("A", 70.5), ("B", 62.0))
    }
    (merged,) = merge(finding("absorption-below-float32", n, **v) for n, v in numbers.items())
    assert finding_about("absorption-below-float32", numbers) == merged
    (one, *_) = numbers
    alone = finding_about("absorption-below-float32", {one: numbers[one]})
    assert alone == finding("absorption-below-float32", one, **numbers[one])


def test_the_worst_severity_of_a_code_stays() -> None:
    slight = finding(
        "reflections-truncated", fraction=0.01, fraction_stderr=0.001, fraction_upper=0.3
    )
    grave = finding(
        "reflections-truncated", fraction=0.2, fraction_stderr=0.001, fraction_upper=0.3
    )
    assert (slight.as_information().severity, grave.severity) == ("info", "caution")
    for group in ([slight.as_information(), grave], [grave, slight.as_information()]):
        (both,) = merge(group)
        assert both.severity == "caution"
        assert both.text.startswith("1 to 20 % of")
    assert merge([slight.as_information()] * 2)[0].severity == "info"


def test_merging_twice_changes_nothing() -> None:
    once = merge(finding("adc-clipped", count=n, samples=n * n).in_frame(n) for n in (2, 3, 5))
    assert merge(once) == once
    assert merge([*once, finding("adc-clipped", count=7, samples=1)])[0].numbers == {
        "count": (2, 7),
        "samples": (1, 25),
    }


def test_units_and_words_of_spans() -> None:
    spans = merge(
        finding(
            "scene-beyond-unambiguous-range",
            farthest_m=1.0,
            unambiguous_range_m=x,
            limit=limit,
        )
        for x, limit in ((10.0, "PRF"), (20.0, "PRF"), (30.0, "code length"))
    )
    assert "range of 10 to 30 m" in spans[0].text
    assert "the PRF or code length sets" in spans[0].remedy
    cells = merge(
        finding("one-range-cell", bandwidth_hz=b, range_resolution_m=1.0, farthest_m=1.0)
        for b in (2e3, 5e6)
    )
    assert "bandwidth of 2 kHz to 5 MHz" in cells[0].text


def test_unknown_codes_are_one_where_texts_are_equal() -> None:
    others = [Finding("of-a-later-version", "info", text=text) for text in ("a", "b", "a")]
    merged = merge([*others, others[1].in_frame(2)])
    assert [item.text for item in merged] == ["a", "b"]


def test_numbers_of_another_version_keep_its_texts() -> None:
    old = Finding("mixed-pixels", "caution", numbers={"share": 0.1}, text="10 % of it.")
    (found,) = merge([old.in_frame(1), old.in_frame(2)])
    assert (found.frames, found.text) == ((1, 2), "10 % of it.")


def test_frames_that_follow_one_another_are_joined() -> None:
    assert frames_text([3], [1, 2, 3]) == "frame 3"
    assert frames_text([1, 2, 3], [1, 2, 3]) == "frames 1-3"
    assert frames_text([1, 2, 4, 6], [1, 2, 3, 4, 5, 6]) == "frames 1-2, 4, 6"
    # every second frame: 2 was not measured
    assert frames_text([1, 3, 7], [1, 3, 5, 7]) == "frames 1, 3, 7"
    assert frames_text(range(2, 21, 2), range(2, 31, 2)) == "frames 2-20 (every 2nd)"
    assert frames_text([1, 2, 3, 8], [1, 2, 3, 8, 9]) == "frames 1-3, 8"
    scattered = [n * n for n in range(1, 101)]
    assert frames_text(scattered, range(1, 10_001)) == (
        "frames 1, 4, 9, 16, 25, 36, 49, 64 and 92 more"
    )
    assert frames_text([9, 1], [1]) == "frames 1, 9"


def test_lines_name_code_severity_and_frames() -> None:
    found = [finding("paths-outside-range-limits", count=n).in_frame(n) for n in (1, 2)]
    (line,) = finding_lines(found, frames=[1, 2, 3])
    assert line.startswith("info: frames 1-2: The frame has 1 to 2 paths outside")
    assert line.endswith("[paths-outside-range-limits]")
    (line,) = finding_lines(found[:1], frames=[1])
    assert line.startswith("info: The frame has 1 path outside")


def test_names_cannot_steer_a_terminal() -> None:
    (line,) = finding_lines([finding("no-radar-material", "a\x1b[2Jb\nc")])
    assert "'a\\x1b[2Jb\\nc'" in line and line.isprintable()


# -- stored ----------------------------------------------------------------------------------------
def test_json_gives_the_same_finding_back() -> None:
    for found in [
        finding("no-echo").in_frame(7),
        *merge(finding("adc-clipped", count=n, samples=9).in_frame(n) for n in (1, 2)),
        finding("range-ambiguous-paths", count=1, unambiguous_range_m=3.5, limit="PRF"),
    ]:
        stored = json.loads(json.dumps(to_json(found), allow_nan=False))
        assert from_json(stored, "run.json: findings[0]") == found


@pytest.mark.parametrize(
    ("change", "message"),
    [
        ({"severity": "fatal"}, "severity is 'fatal'; expected one of info, caution, error"),
        ({"text": 3}, "text is 3; expected text"),
        ({"subjects": "Wall"}, "subjects is 'Wall'; expected a list of str"),
        ({"frames": [True]}, "frames is .* expected a list of int"),
        ({"numbers": [1]}, r"numbers is \[1\]; expected a JSON object"),
        ({"numbers": {"a": None}}, "a is None; expected a number"),
        ({"numbers": {"a": [1, 2, 3]}}, r"a is \[1, 2, 3\]; expected a number"),
    ],
)
def test_damaged_findings_are_named(change: dict[str, object], message: str) -> None:
    with pytest.raises(FrameFileError, match=message):
        from_json({**to_json(finding("no-echo")), **change}, "run.json: findings[0]")
    with pytest.raises(FrameFileError, match="expected a JSON object"):
        from_json(3, "run.json: findings[0]")


# -- the catalogue ---------------------------------------------------------------------------------
def test_the_reference_page_is_current() -> None:
    page = (ROOT / "docs" / "findings.md").read_text(encoding="utf-8")
    assert page == reference_page(), "run: python -m radarsim_addon.findings > docs/findings.md"


def test_codes_are_declared_once_and_have_texts() -> None:
    codes = [code for kinds in TOPICS.values() for code in kinds]
    assert len(codes) == len(set(codes))
    for code, kind in CATALOGUE.items():
        assert code == code.lower() and set(code) <= set(
            string.ascii_lowercase + string.digits + "-"
        )
        assert kind.text and kind.cause and kind.remedy, code
        for text in (kind.text, kind.cause, kind.remedy):
            assert not text or text[-1] in ".}", code
            assert not set("\n\t") & set(text)


_ONE = "\n# Old\n\n## one (info)\n\nText\nresumes.\n\nCause.\n\nRemedy.\n\n# New\n\n## "


def test_a_catalogue_is_read() -> None:
    topics = read_topics(f"{_ONE}two (error)\n\nText.\n\nCause.\n\nRemedy.\n")
    assert topics["Old"] == {"one": Kind("info", "Text resumes.", "Cause.", "Remedy.")}
    assert topics["New"] == {"two": Kind("error", "Text.", "Cause.", "Remedy.")}


@pytest.mark.parametrize(
    ("entry", "found"),
    [
        ("two (info)\n\nText.\n\nCause.", r"'two \(info\)' has 2 paragraphs"),
        ("two (dire)\n\nText.\n\nCause.\n\nRemedy.", r"'two \(dire\)' has 3 paragraphs"),
        ("one (error)\n\nText.\n\nCause.\n\nRemedy.", r"'one \(error\)' has 3 paragraphs"),
    ],
)
def test_an_entry_of_the_catalogue_that_does_not_fit_is_named(entry: str, found: str) -> None:
    with pytest.raises(ValueError, match=found):
        read_topics(_ONE + entry)


def test_a_verb_has_the_number_of_its_names() -> None:
    one = finding("mirror-without-image", "Cube")
    assert one.text.startswith("'Cube' is smooth and planar, so it acts as a mirror, but")
    assert "for it: its material is" in one.text and "via this mirror to" in one.cause
    two = one.about("Cube", "Ball")
    assert two.text.startswith("'Cube', 'Ball' are smooth and planar, so they act as mirrors, but")
    assert "for them: their material is" in two.text and "via these mirrors to" in two.cause
    (joined,) = merge([one, one.about("Ball")])
    assert joined.text.startswith("'Cube', 'Ball' are smooth")


def test_texts_with_names_fit_one_name(subtests: pytest.Subtests) -> None:
    """A sentence that begins with names has the verb of one name, or that of several."""
    for code in (c for c, kind in CATALOGUE.items() if "{subjects}" in kind.text):
        with subtests.test(code):
            kind = CATALOGUE[code]
            assert re.findall(r"(?:^|[.:] )\{subjects\} (?!\{they:)", kind.text) == []
            for text in (kind.text, kind.cause, kind.remedy):
                fixed = re.sub(r"\{\w+:[^}]*\|.*?\}", "", text)
                assert not re.search(
                    r"(?i)these (pairs of )?(objects|mirrors|materials|surfaces)", fixed
                )


def codes_used() -> tuple[set[str], list[str]]:
    """Codes that the package gives to `finding` and the like, and calls without a literal one."""
    used: set[str] = set()
    strange = []
    for path in PACKAGE.rglob("*.py"):
        for node in ast.walk(ast.parse(path.read_text(encoding="utf-8"))):
            if not (isinstance(node, ast.Call) and isinstance(node.func, ast.Name)):
                continue
            if node.func.id not in ("finding", "finding_about"):
                continue
            choices = [node.args[0]]
            while choices:
                choice = choices.pop()
                if isinstance(choice, ast.IfExp):
                    choices += [choice.body, choice.orelse]
                elif isinstance(choice, ast.Constant):
                    used.add(str(choice.value))
                else:
                    strange.append(f"{path}:{node.lineno}")
    return used, strange


def test_the_package_uses_every_code_and_no_other() -> None:
    used, strange = codes_used()
    assert not strange, "give `finding` a literal code"
    assert used == set(CATALOGUE)


# -- where they are shown --------------------------------------------------------------------------
def test_records_hold_findings(tmp_path: Path) -> None:
    found = merge([finding("single-snapshot"), finding("no-radar-material", "Wall")])
    path = tmp_path / "run.json"
    write_record(path, dataclasses.replace(run_record(Setup()), findings=found))
    assert read_record(path, RunRecord).findings == found
    assert json.loads(path.read_text())["findings"] == [to_json(item) for item in found]
    path.write_text(path.read_text().replace('"info"', '"dire"'))
    with pytest.raises(FrameFileError, match=r"findings\[0\]: severity is 'dire'"):
        read_record(path, RunRecord)


def test_process_shows_each_finding_once(
    tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    """On the console merged over the frames; in each frame's summary its own."""
    setup = Setup(frames=(1, 2, 3, 4))
    # beyond +-14.1 m/s at 1000 Hz, in every frame
    folder = write_run(tmp_path / "run", setup, points(setup, [(5, 6, 600.0, 30.0, 1e-6)]))
    next((folder / "frames" / "frame_0003").glob("*.exr")).unlink()
    assert main(["process", str(folder), "--no-plots", "--allow-incomplete"]) == 0
    lines = [line for line in capsys.readouterr().out.splitlines() if line.endswith("]")]
    doppler, incomplete = lines
    assert doppler.startswith("caution: frames 1-2, 4: The frame has 1 path faster")
    assert doppler.endswith("[doppler-ambiguous-paths]")
    assert incomplete.startswith(
        "caution: frame 3: radarsim skipped the frame because it lacks 1 render."
    )
    for frame in (1, 2, 4):
        path = folder / "products" / f"frame_{frame:04d}_summary.json"
        (stored,) = json.loads(path.read_text())["findings"]
        assert (stored["code"], stored["frames"]) == ("doppler-ambiguous-paths", [frame])
        assert from_json(stored, path.name).numbers["count"] == 1


@pytest.mark.parametrize(
    ("errors", "frames", "code"),
    [
        ([], (1, 2), 0),
        ([1], (1, 2), 0),
        ([1, 2], (1, 2), 3),
        ([None], (1, 2), 3),
        ([], (), 0),
    ],
)
def test_exit_code_tells_scripts_of_errors_that_concern_everything(
    errors: list[int | None], frames: tuple[int, ...], code: int
) -> None:
    """Errors of some frames are no failure of an animation; cautions never are."""
    found = [
        finding("mesh-open", "A") if n is None else finding("no-echo").in_frame(n) for n in errors
    ]
    caution = finding("mixed-paths", fraction=0.5).in_frame(1)
    assert exit_code([caution, *found], frames) == code
