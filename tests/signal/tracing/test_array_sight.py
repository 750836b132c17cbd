# SPDX-License-Identifier: GPL-3.0-or-later
"""What the outermost elements of an array do not see, behind a screen near the radar."""

from __future__ import annotations

import numpy as np
import pytest

from radarsim_addon.contract import TransmitterRecord
from radarsim_addon.signal.paths import IMAGE_DTYPE, PATH_DTYPE, PathRows
from radarsim_addon.signal.radar import Channel, Element
from radarsim_addon.signal.scene import Surface
from radarsim_addon.signal.tracing import HiddenPower, array_sight, hidden_power
from tests.signal.tracing.mirror_scenes import PANE, ROUGH, mesh, obstacles, panorama

#: The radar looks along +Y; the screen covers x > 0.1 m at 1 m, and so x > 1 m at 10 m.
SCREEN = mesh([(0.1, 1, -5), (5, 1, -5), (5, 1, 5), (0.1, 1, 5)])
WALL = mesh([(-9, 10, -5), (9, 10, -5), (9, 10, 5), (-9, 10, 5)])
#: Right of the antenna's boresight, in its axes (x right, y up, z back) and the world's alike.
SIDE = 0.02


def seen(
    *channels: Channel, count: int = 1000, dtype: np.dtype = PATH_DTYPE, screen: Surface = ROUGH,
    far: float = 1.0, **columns: object,
) -> HiddenPower:  # fmt: skip
    """Of a wall's points from -1 m to `far`, and as many of the screen with twice the power."""
    rows = PathRows.zeros(2 * count, dtype)
    x = np.concatenate([np.linspace(-1, far, count, endpoint=False), np.full(count, 0.5)])
    y = np.repeat([10.0, 1.0], count)
    rows["first_scatterer_m"] = np.stack([x, y, 0 * x], axis=1)
    rows["last_scatterer_m"] = rows["first_scatterer_m"]
    rows["last_object"], rows["power_w"] = np.repeat([1, 2], count), np.repeat([1.0, 2.0], count)
    for name, values in columns.items():
        rows[name] = values
    bodies = obstacles({"Wall": (WALL, ROUGH), "Screen": (SCREEN, screen)})
    chunks = [rows[start : start + 300] for start in range(0, 2 * count, 300)]
    here = panorama(np.zeros(3))
    return hidden_power(
        bodies, lambda: chunks, channels, here, TransmitterRecord(here.matrix_world, 1.0)
    )


def at(right_m: float) -> Element:
    return Element((right_m, 0.0, 0.0))


# An element at d to the right sees up to 1 m - 9 d of the wall: d = 0.02 loses 9 % of 2 m.
@pytest.mark.parametrize(
    ("channels", "fraction"),
    [
        ([Channel(at(0), at(SIDE))], 0.09),
        ([Channel(at(SIDE), at(0))], 0.09),
        ([Channel(at(0), at(-SIDE))], 0.0),
        ([Channel(at(-SIDE), at(0.01)), Channel(at(0.01), at(-SIDE))], 0.045),
        ([Channel(at(x), at(-x)) for x in (-SIDE, 0.0, SIDE)], 0.09),
    ],
)
def test_an_element_to_the_side_loses_the_part_behind_the_edge(
    channels: list[Channel], fraction: float
) -> None:
    found = seen(*channels)
    assert found.fraction == pytest.approx(fraction / 3, abs=1e-3)
    assert found.of_objects.get("Wall", 0.0) == pytest.approx(fraction, abs=1e-3)
    assert "Screen" not in found.of_objects
    assert found.most_of == ("Wall" if fraction else "")


def test_a_fraction_of_the_rows_gives_the_same(monkeypatch: pytest.MonkeyPatch) -> None:
    """About 2000 rows of each object: 0.09 within three standard errors of 0.0064."""
    monkeypatch.setattr(array_sight, "_ROWS", 4000)
    found = seen(Channel(at(0), at(SIDE)), count=20_000)
    assert found.of_objects["Wall"] == pytest.approx(0.09, abs=0.02)
    assert found.fraction == pytest.approx(found.of_objects["Wall"] / 3, rel=0.2)


def test_findings_name_the_object_and_a_cure() -> None:
    power, thing = seen(Channel(at(0), at(SIDE))).findings
    assert [power.code, thing.code] == ["array-hides-power", "array-hides-object"]
    assert power.subjects == thing.subjects == ("Wall",)
    assert "fewer elements" in thing.remedy
    # 4 % of the object, 1.3 % of the power
    (only,) = seen(Channel(at(0), at(0.04 * SIDE / 0.09))).findings
    assert only.code == "array-hides-power"
    assert seen(Channel(at(0), at(0.02 * SIDE / 0.09))).findings == []


def test_ways_that_are_no_evidence_do_not_count() -> None:
    channel = Channel(at(SIDE), at(SIDE))
    both = {"receiver_image": 1, "transmitter_image": 1}
    assert seen(channel, dtype=IMAGE_DTYPE).fraction == pytest.approx(0.03, abs=1e-3)
    assert seen(channel, dtype=IMAGE_DTYPE, **both).fraction == 0
    assert seen(channel, dtype=IMAGE_DTYPE, receiver_image=1).fraction > 0
    # an obstacle that waves pass
    assert seen(channel, screen=PANE).fraction == 0
    # points that the origin does not see by these rays, though a render gave them
    assert seen(channel, far=3.0).of_objects["Wall"] == pytest.approx(0.045, abs=1e-3)
    # few paths of an object are no measure of it
    assert seen(channel, count=9).of_objects == {}
