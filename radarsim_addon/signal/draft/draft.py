# SPDX-License-Identifier: GPL-3.0-or-later
"""Profile and map of a draft: the expected power of its paths, as of a rendered frame.

The rays of a draft become a path table in memory, so footprints, antennas, weather, tapers and
standard errors are those of the processing. Only the paths differ: one reflection, seen without
refraction, by few rays.
"""

from __future__ import annotations

import dataclasses
import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, NamedTuple, NoReturn, cast

import numpy as np

from ...arrays import Real
from ...contract import LinkBudget, ReceiverRecord, TransmitterRecord
from ...messages import Message
from ...typed_json import from_json
from ..decoding import FrameInput, FrameTable
from ..detection import FrameBudget
from ..maps import expected_power, map_noise_gain, range_noise_gain
from ..paths import PathRows, unrendered_record
from ..radar import Radar, Weather, burst_from_dict, waveform_from_dict, waveform_to_dict
from ..runs import RadarFrame
from ..scene import Mesh, Surface
from .scene import DraftScene, draft_rows

#: Most cells of a draft's map: more take longer than an update may.
MOST_CELLS = 1 << 19
#: Cells of range per sample of the echo.
_CELLS_PER_SAMPLE = 2
#: Kinds of messages: the field "kind".
MESH, SCENE, DRAFT, FAULT = "mesh", "scene", "draft", "fault"


class DraftLevel(NamedTuple):
    """How fine a draft is: about so many rays of a replicate, and replicates (grids of rays)."""

    rays: int
    replicates: int


#: From the first draft after a change to the last one of a scene that does not change.
LEVELS = (DraftLevel(4096, 2), DraftLevel(16384, 2), DraftLevel(16384, 8))


@dataclass(frozen=True)
class Draft:
    """Expected power of the paths of one reflection."""

    #: One-way range, (ranges,).
    range_m: Real
    #: Power and its standard error, (ranges,).
    profile_w: Real
    profile_error_w: Real
    #: Range rate of each row of the map, ascending, receding positive, (pulses,).
    velocity_mps: Real
    #: (pulses, ranges).
    map_w: Real
    #: Pulses of the map: fewer than the burst has where the map would have too many cells.
    pulses: int
    #: Rays that met a surface which returns power, in all replicates.
    rays: int
    #: Range from which on rays are further apart than range cells; infinite for none.
    gaps_from_m: float
    #: Mean thermal noise of a range bin of one pulse, and of a cell of the whole burst's map; 0
    #: without a link budget.
    noise_w: float = 0.0
    map_noise_w: float = 0.0

    @property
    def peak_error_db(self) -> float:
        """Standard error at the strongest range; infinite where it is as large as the power."""
        peak = int(np.argmax(self.profile_w))
        power_w, error_w = float(self.profile_w[peak]), float(self.profile_error_w[peak])
        return 10 * math.log10(1 + error_w / power_w) if power_w > 0 else 0.0


def make_draft(scene: DraftScene, meshes: Mapping[int, Mesh], level: DraftLevel) -> Draft:
    """Return the profile and the map of a scene. `meshes` has its meshes by their keys."""
    edges = scene.receiver
    aspect = (edges.right - edges.left) / (edges.top - edges.bottom)
    rows = max(round(math.sqrt(level.rays / aspect)), 1)
    columns = max(round(level.rays / rows), 1)
    table = draft_rows(scene, meshes, columns, rows, level.replicates)
    start_m, stop_m = scene.range_limits_m
    step_m = scene.radar.waveform.sample_spacing_m / _CELLS_PER_SAMPLE
    ranges = (min(stop_m, scene.radar.waveform.unambiguous_range_m) - start_m) / step_m
    pulses = min(scene.radar.burst.pulses, max(int(MOST_CELLS / max(ranges, 1)), 1))
    radar = scene.radar if pulses == scene.radar.burst.pulses else scene.radar.with_pulses(pulses)
    frame = _frame(scene, radar, table, level.replicates)
    budget = FrameBudget(frame, scene.weather)
    found = expected_power(frame, cells_per_sample=_CELLS_PER_SAMPLE, link=budget.link)
    sample_w = 0.0
    if budget.system is not None:
        sample_w = budget.system.noise_power_w(radar.waveform.sampling_rate_hz) / radar.slots
    velocity_mps = -found.doppler_hz * radar.waveform.wavelength_m / 2
    return Draft(
        found.range_m,
        found.profile,
        found.profile_error,
        velocity_mps[::-1],
        found.map[::-1],
        pulses,
        table.size,
        found.gaps_from_m,
        sample_w * range_noise_gain(scene.radar),
        sample_w * map_noise_gain(scene.radar),
    )


def _frame(scene: DraftScene, radar: Radar, table: PathRows, replicates: int) -> FrameInput:
    """Return a frame that belongs to no run."""
    names = [f"{number}" for number in range(len(scene.meshes))]
    record = unrendered_record(
        scene.receiver, scene.transmitter, radar.waveform.carrier_hz, table, names, replicates
    )
    return FrameInput(
        frame=cast(RadarFrame, None),  # expected power reads no run
        radar=radar,
        link_budget=scene.link_budget,
        range_limits_m=scene.range_limits_m,
        receiver=scene.receiver,
        transmitter=scene.transmitter,
        ground_truth=None,
        tables=(FrameTable(record, table, None),),
        images=_no_images,
    )


def _no_images(ring: int, snapshot: int) -> NoReturn:
    raise AssertionError("a draft has no ring images")


def mesh_message(key: int, mesh: Mesh) -> Message:
    """Return the message with a mesh, in float32; scenes name it by its key."""
    values = {item.name: getattr(mesh, item.name) for item in dataclasses.fields(mesh)}
    values["corner_edges"] = mesh.corner_edges[:0]
    numbers = {name: x for name, x in values.items() if x is not None}
    small = {n: x.astype(np.float32) if x.dtype == np.float64 else x for n, x in numbers.items()}
    return Message({"kind": MESH, "key": key}, small)


def mesh_of(message: Message) -> Mesh:
    return Mesh(**message.arrays)


def scene_message(scene: DraftScene) -> Message:
    """Return the message with a scene. The messages with its meshes must come before it."""
    # no more of surfaces than a draft needs
    surfaces = [dataclasses.replace(one, shaders=(), exponent=None) for one in scene.surfaces]
    arrays = {name: x for name, x in vars(scene).items() if isinstance(x, np.ndarray)}
    plain = dataclasses.replace(scene, surfaces=surfaces, radar=None, **dict.fromkeys(arrays))  # type: ignore[arg-type]
    fields = {name: x for name, x in dataclasses.asdict(plain).items() if name not in arrays}
    radar = waveform_to_dict(scene.radar.waveform), dataclasses.asdict(scene.radar.burst)
    return Message({**fields, "radar": radar, "kind": SCENE}, arrays)


#: Fields of a scene that are records.
_RECORDS: dict[str, type] = {
    "link_budget": LinkBudget,
    "weather": Weather,
    "receiver": ReceiverRecord,
    "transmitter": TransmitterRecord,
}


def scene_of(message: Message) -> DraftScene:
    names = [item.name for item in dataclasses.fields(DraftScene) if item.name in message.fields]
    fields: dict[str, Any] = {name: message.fields[name] for name in names} | message.arrays
    for name, kind in _RECORDS.items():
        if fields[name] is not None:
            fields[name] = from_json(kind, fields[name], name)
    waveform = waveform_from_dict(message.fields["radar"][0])
    fields["radar"] = Radar(waveform, burst_from_dict(message.fields["radar"][1], waveform))
    fields["surfaces"] = [from_json(Surface, one, "Surface") for one in message.fields["surfaces"]]
    fields["range_limits_m"] = tuple(message.fields["range_limits_m"])
    return DraftScene(**fields)


def draft_message(draft: Draft, level: int, triangles: int) -> Message:
    """Return the message with a draft, the number of its level and its number of triangles. The map
    is float32.
    """
    values = {**vars(draft), "map_w": draft.map_w.astype(np.float32)}
    arrays = {name: x for name, x in values.items() if isinstance(x, np.ndarray)}
    fields = {name: x for name, x in values.items() if name not in arrays}
    own = {"kind": DRAFT, "level": level, "triangles": triangles}
    return Message({**fields, **own, "peak_error_db": draft.peak_error_db}, arrays)
