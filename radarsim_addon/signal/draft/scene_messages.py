# SPDX-License-Identifier: GPL-3.0-or-later
"""Meshes, scenes and drafts as messages, and back."""

from __future__ import annotations

import dataclasses
import math
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...contract import LinkBudget, ReceiverRecord, TransmitterRecord
from ...typed_json import from_json
from ..radar import Radar, Weather, burst_from_dict, waveform_from_dict, waveform_to_dict
from .draft import Draft
from .messages import Message
from .polygons import DraftPolygons
from .scene import DraftMesh, DraftScene
from .surfaces import DraftSurface

MESH, SCENE, DRAFT, FAULT = "mesh", "scene", "draft", "fault"
"""Kinds of messages: the field "kind"."""


def mesh_message(key: int, mesh: DraftPolygons) -> Message:
    """Return the message with a mesh.

    Parameters
    ----------
    key
        By which scenes name it.
    mesh
        Mesh.

    Returns
    -------
    Message
    """
    arrays = {item.name: getattr(mesh, item.name) for item in dataclasses.fields(mesh)}
    return Message({"kind": MESH, "key": key}, arrays)


def scene_message(scene: DraftScene) -> Message:
    """Return the message with a scene.

    Parameters
    ----------
    scene
        Scene; its meshes have messages of their own, which go before.

    Returns
    -------
    Message
    """
    budget = scene.link_budget
    fields = {
        "kind": SCENE,
        "waveform": waveform_to_dict(scene.radar.waveform),
        "burst": dataclasses.asdict(scene.radar.burst),
        "link_budget": None if budget is None else dataclasses.asdict(budget),
        "weather": dataclasses.asdict(scene.weather),
        "receiver": dataclasses.asdict(scene.receiver),
        "transmitter": dataclasses.asdict(scene.transmitter),
        "range_limits_m": list(scene.range_limits_m),
        "surfaces": [dataclasses.asdict(one) for one in scene.surfaces],
        "meshes": list(scene.meshes),
        "slots": [list(one) for one in scene.slots],
        "interval_s": scene.interval_s,
    }
    return Message(fields, {"matrices": scene.matrices, "moves": scene.moves})


def mesh_of(message: Message) -> DraftMesh:
    """Return the mesh of a message."""
    return DraftPolygons(**message.arrays).triangulated()


def scene_of(message: Message) -> DraftScene:
    """Return the scene of a message."""
    fields = message.fields
    waveform = waveform_from_dict(fields["waveform"])
    budget = fields["link_budget"]
    start_m, stop_m = fields["range_limits_m"]
    return DraftScene(
        radar=Radar(waveform, burst_from_dict(fields["burst"], waveform)),
        link_budget=None if budget is None else from_json(LinkBudget, budget, "Link budget"),
        weather=from_json(Weather, fields["weather"], "Weather"),
        receiver=ReceiverRecord(**fields["receiver"]),
        transmitter=TransmitterRecord(**fields["transmitter"]),
        range_limits_m=(start_m, stop_m),
        surfaces=[DraftSurface(**one) for one in fields["surfaces"]],
        meshes=fields["meshes"],
        matrices=message.arrays["matrices"],
        slots=fields["slots"],
        moves=message.arrays["moves"],
        interval_s=fields["interval_s"],
    )


def draft_message(draft: Draft, level: int, triangles: int) -> Message:
    """Return the message with a draft.

    Parameters
    ----------
    draft
        Draft.
    level
        Number of its level.
    triangles
        Triangles of the scene.

    Returns
    -------
    Message
        Powers in float32.
    """
    gaps = draft.gaps_from_m
    fields = {
        "kind": DRAFT,
        "level": level,
        "triangles": triangles,
        "pulses": draft.pulses,
        "rays": draft.rays,
        "peak_error_db": draft.peak_error_db,
        "noise_w": draft.noise_w,
        "map_noise_w": draft.map_noise_w,
        "gaps_from_m": None if math.isinf(gaps) else gaps,
    }
    arrays: dict[str, NDArray[Any]] = {
        "range_m": draft.range_m,
        "velocity_mps": np.ascontiguousarray(draft.velocity_mps),
        "profile_w": draft.profile_w,
        "map_w": draft.map_w.astype(np.float32),
    }
    return Message(fields, arrays)
