# SPDX-License-Identifier: GPL-3.0-or-later
"""Through a wall: a person walks in a room behind 0.2 m of concrete, seen at 2.4 GHz."""

from __future__ import annotations

from typing import Any

from radarsim_addon import blender as radarsim
from radarsim_addon.blender.nodes import make_material

from .shared import add_box, add_mesh, add_person, coloured

CARRIER_HZ, BANDWIDTH_HZ = 2.4e9, 1e9
#: Near face and thickness of the wall between radar and room [m].
WALL_M, THICKNESS_M = 1.0, 0.2
#: Near face of a metal cabinet, at normal incidence [m].
CABINET_M = 5.5
PERSON_M, PERSON_MPS = (-0.9, 4.0, 0.0), (0.25, -1.0, 0.0)


def build() -> Any:
    """Build the scene in the current, empty file; return the radar."""
    radar = radarsim.add_radar(
        (0, 0, 1.2), look_at=(0, 5, 1.2), preset="paper", waveform_kind="fmcw",
        field_of_view_deg=70, carrier_hz=CARRIER_HZ, bandwidth_hz=BANDWIDTH_HZ, adc_samples=128,
        adc_rate_hz=50e3, prf_hz=200.0, pulses=128, sampling_mode="paths", width_px=192,
        height_px=108, replicates=2, range_start_m=0.5, range_stop_m=8.0, max_reflections=2,
    )  # fmt: skip
    concrete = coloured(
        radarsim.material("itu_concrete", name="Concrete", rms_slope=0.05), (0.55, 0.55, 0.55)
    )
    add_box("Wall", (-4.0, WALL_M, -0.001), (4.0, WALL_M + THICKNESS_M, 2.5), concrete)
    plaster = coloured(
        make_material("Plaster", 1.6, 0.0, specularity=0.0, penetrable=False), (0.8, 0.77, 0.7)
    )
    room = ((-3.0, 1.3), (3.0, 1.3), (3.0, 7.0), (-3.0, 7.0))
    add_mesh("Floor", [(x, y, 0.0) for x, y in room], [(0, 1, 2, 3)], plaster)
    for name, one, two in (("Left", 3, 0), ("Back", 2, 3), ("Right", 1, 2)):
        corners = [(*room[one], 0), (*room[two], 0), (*room[two], 2.4), (*room[one], 2.4)]
        add_mesh(f"{name} Side", corners, [(0, 1, 2, 3)], plaster)
    steel = coloured(
        radarsim.material(name="Steel", n=1e4, kappa=1e4, rms_slope=0.3), (0.2, 0.3, 0.5)
    )
    add_box("Cabinet", (-0.5, CABINET_M, 0.2), (0.5, CABINET_M + 0.5, 2.0), steel)
    skin = coloured(
        make_material("Skin", 6.0, 1.0, specularity=0.0, penetrable=False), (0.75, 0.45, 0.3)
    )
    add_person("Walker", PERSON_M, PERSON_MPS, skin, seconds=2.0)
    return radar
