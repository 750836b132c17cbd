# SPDX-License-Identifier: GPL-3.0-or-later
"""A street at 77 GHz: the radar's own car, three others and two pedestrians.

The own car drives along +Y at 10 m/s, so what is parked approaches, too.
"""

from __future__ import annotations

from typing import Any

from radarsim_addon import blender as radarsim
from radarsim_addon.blender.nodes import make_material

from .shared import add_mesh, add_person, add_prism, coloured, move

#: The radar, at the bumper [m], and its velocity [m/s].
RADAR_M, OWN_MPS = (0.0, 0.0, 0.6), (0.0, 10.0, 0.0)
#: Cars: place of the middle on the road [m], velocity [m/s].
CARS = {
    "Oncoming Car": ((-3.5, 45.0, 0.0), (0.0, -14.0, 0.0)),
    "Car Ahead": ((0.0, 28.0, 0.0), (0.0, 13.0, 0.0)),
    "Parked Car": ((3.4, 19.0, 0.0), (0.0, 0.0, 0.0)),
}
#: Pedestrians: one crosses the road, one comes along the pavement.
PEDESTRIANS = {
    "Crossing": ((1.5, 13.0, 0.0), (-1.4, 0.0, 0.0)),
    "Pavement": ((6.0, 16.0, 0.0), (0.0, -1.3, 0.0)),
}
SECONDS = 2.0
#: Side of a car, from the lower rear edge on [m].
_CAR = ((-2.2, 0.25), (2.2, 0.25), (2.1, 0.8), (1.1, 0.95), (0.4, 1.45), (-1.2, 1.45), (-1.9, 1.0),
        (-2.2, 0.9))  # fmt: skip
CAR_HALF_WIDTH_M = 0.9


def build() -> Any:
    """Build the scene in the current, empty file; return the radar."""
    radar = radarsim.add_radar(
        RADAR_M, look_at=(0, 30, 0.6), preset="automotive_77ghz", field_of_view_deg=60,
        width_px=256, height_px=60, replicates=2, range_stop_m=60.0, max_reflections=2,
    )  # fmt: skip
    move(radar, RADAR_M, OWN_MPS, SECONDS)
    # At 77 GHz typical indices, not measured ones; all but the cars scatter as Lambert's law says.
    road, wall, skin = (
        coloured(make_material(name, n, kappa, specularity=0.0, penetrable=False), colour)
        for name, n, kappa, colour in (
            ("Asphalt", 2.2, 0.1, (0.12, 0.12, 0.13)),
            ("House", 2.3, 0.1, (0.75, 0.66, 0.52)),
            ("Skin", 3.0, 1.5, (0.1, 0.2, 0.7)),
        )
    )
    add_mesh("Road", [(-9, -5, 0), (9, -5, 0), (9, 90, 0), (-9, 90, 0)], [(0, 1, 2, 3)], road)
    for number in range(4):
        for side, name in ((-1, "Left"), (1, "Right")):
            x, y = side * 8.0, 4.0 + 20.0 * number
            corners = [(x, y, 0), (x, y + 17, 0), (x, y + 17, 7 + number), (x, y, 7 + number)]
            add_mesh(f"House {name} {number + 1}", corners, [(0, 1, 2, 3)], wall)
    body = coloured(
        radarsim.material(name="Car Body", n=1e4, kappa=1e4, rms_slope=0.2), (0.6, 0.05, 0.04)
    )
    for name, (place, velocity_mps) in CARS.items():
        car = add_prism(name, _CAR, CAR_HALF_WIDTH_M)
        radarsim.assign_material(car, body)
        move(car, place, velocity_mps, SECONDS)
    for number, (name, (place, velocity_mps)) in enumerate(PEDESTRIANS.items()):
        add_person(name, place, velocity_mps, skin, SECONDS, phase=5 * number)
    return radar
