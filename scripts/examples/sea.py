# SPDX-License-Identifier: GPL-3.0-or-later
"""A ship on the sea: X band, 20 m above the water, sea state 3.

sigma0 of the sea is that of NRL (Gregers-Hansen and Mital, 2012), with K-distributed texture and
the two Bragg lines of waves that approach and recede.
"""

from __future__ import annotations

from typing import Any

import numpy as np

from radarsim_addon import blender as radarsim

from .shared import add_box, add_mesh, add_prism, coloured, move

HEIGHT_M = 20.0
SEA_STATE = 3
#: Stern of the ship [m] and its velocity [m/s]: it sails away from the radar.
STERN_M, SHIP_MPS = (0.0, 3000.0, 0.0), (0.0, 6.0, 0.0)
#: The sea: from and to along Y, and across [m].
SEA_Y_M, SEA_X_M = (300.0, 5000.0), (-200.0, 220.0)
#: Hull from the side, aft of the bow (y from the stern, z) [m].
_HULL = ((0.0, -1.0), (62.0, -1.0), (70.0, 7.0), (0.0, 5.0))


def build() -> Any:
    """Build the scene in the current, empty file; return the radar."""
    radar = radarsim.add_radar(
        (0, 0, HEIGHT_M), look_at=(0, 1000, 0), preset="marine_x_band", field_of_view_deg=3.6,
        polarisation="horizontal", width_px=192, height_px=256, replicates=2, pulses=128,
        range_start_m=500.0, range_stop_m=4500.0, max_reflections=2,
    )  # fmt: skip
    # sigma0 is the model's, whatever the medium is; an opaque one has no inside to look at.
    water = coloured(radarsim.material("metal", name="Sea", rms_slope=0.15), (0.03, 0.13, 0.2))
    radarsim.set_clutter(water, "nrl_sea", sea_state=SEA_STATE)
    radarsim.set_clutter_fluctuation(
        water, texture="k", texture_shape=1.0, texture_length_m=30.0,
        motion="sea", motion_speed_mps=0.4, motion_fraction=0.7,
    )  # fmt: skip
    # Strips, because Cycles rounds hit points on faces that are much larger than their range.
    y_m = np.linspace(*SEA_Y_M, 95).tolist()
    corners = [(x, y, 0.0) for y in y_m for x in SEA_X_M]
    faces = [(2 * i, 2 * i + 1, 2 * i + 3, 2 * i + 2) for i in range(len(y_m) - 1)]
    add_mesh("Sea", corners, faces, water)
    steel = coloured(
        radarsim.material(name="Ship Steel", n=1e4, kappa=1e4, rms_slope=0.3), (0.55, 0.1, 0.06)
    )
    hull = add_prism("Hull", _HULL, 6.0)
    bridge = add_box("Bridge", (-5.0, 6.0, 4.0), (5.0, 18.0, 16.0))
    mast = add_box("Mast", (-0.5, 11.0, 15.5), (0.5, 12.0, 26.0))
    radarsim.assign_material([hull, bridge, mast], steel)
    bridge.parent = mast.parent = hull
    move(hull, STERN_M, SHIP_MPS, seconds=2.0)
    return radar
