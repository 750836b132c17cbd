#!/usr/bin/env python3
# SPDX-License-Identifier: GPL-3.0-or-later
"""Make blend_examples/canyon.blend: a street canyon that a radar sees in all directions.

Six blocks, three on each side of a street 20 m wide and 150 m long; between them, 2 m above the
street, a monostatic radar whose receiver covers the full sphere. All surfaces are opaque and
scatter as Lambert's law says. `make bench` measures it.

    python scripts/make_canyon.py [OUTPUT.blend]
"""

from __future__ import annotations

import argparse
import sys
from pathlib import Path
from typing import Any

if __package__ in (None, ""):  # run from a checkout: the package lies next to scripts/
    sys.path.insert(0, str(Path(__file__).resolve().parents[1]))

import bpy

from scripts.examples.shared import FOLDER, add_box, add_mesh, write

STREET_WIDTH_M, STREET_LENGTH_M = 20.0, 150.0
BLOCK_LENGTH_M, BLOCK_DEPTH_M = 42.0, 20.0
#: Heights of the blocks along the street, left and right [m].
HEIGHTS_M = ((20.0, 10.0, 26.0), (14.0, 30.0, 18.0))
RADAR_HEIGHT_M = 2.0
#: The blocks' foundations: no two faces lie in one plane.
_BELOW_GROUND_M = 1.0
#: Half the sides of the ground.
GROUND_M = (60.0, 100.0)
#: A million rays; pixels are as wide as they are high at the horizon.
WIDTH_PX, HEIGHT_PX = 1414, 707
# ITU-R P.2040-3, Table 3, at 5.3 GHz
CONCRETE, GROUND = (2.2926, 0.1259), (3.5721, 0.2519)


def blocks() -> list[tuple[tuple[float, float, float], tuple[float, float, float]]]:
    """Return lowest and highest corner of each block [m]; the street runs along Y."""
    found = []
    gap_m = (STREET_LENGTH_M - 3 * BLOCK_LENGTH_M) / 2
    for side, heights in zip((-1, 1), HEIGHTS_M):
        near, far = side * STREET_WIDTH_M / 2, side * (STREET_WIDTH_M / 2 + BLOCK_DEPTH_M)
        for place, height in enumerate(heights):
            start = place * (BLOCK_LENGTH_M + gap_m) - STREET_LENGTH_M / 2
            found.append(
                (
                    (min(near, far), start, -_BELOW_GROUND_M),
                    (max(near, far), start + BLOCK_LENGTH_M, height),
                )
            )
    return found


def build() -> Any:
    """Build the scene in the current, empty file; return the radar."""
    from radarsim_addon import blender as radarsim
    from radarsim_addon.blender.nodes import make_material

    scene = bpy.context.scene
    wall, ground = (
        make_material(name, *index, specularity=0.0, penetrable=False)
        for name, index in (("Wall", CONCRETE), ("Ground", GROUND))
    )
    x, y = GROUND_M
    corners = [(-x, -y, 0.0), (x, -y, 0.0), (x, y, 0.0), (-x, y, 0.0)]
    radarsim.assign_material(add_mesh("Ground", corners, [(0, 1, 2, 3)]), ground)
    radarsim.assign_material(
        [add_box(f"Block {number}", *block) for number, block in enumerate(blocks(), 1)], wall
    )
    radar = radarsim.add_radar(
        (0.0, 0.0, RADAR_HEIGHT_M),
        preset="paper",
        carrier_hz=5.3e9,
        bandwidth_hz=140e6,
        chirp_duration_s=2.5e-6,
        sampling_rate_hz=299_792_458.0 / 2,  # a sample a metre
        prf_hz=1000.0,
        pulses=128,
        sampling_mode="paths",
        width_px=WIDTH_PX,
        height_px=HEIGHT_PX,
        replicates=1,
    )
    camera = scene.camera.data
    camera.type = "PANO"
    panorama = camera if hasattr(camera, "panorama_type") else camera.cycles  # Cycles: up to 4.4
    panorama.panorama_type = "EQUIRECTANGULAR"
    return radar


def main(argv: list[str] | None = None) -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("output", nargs="?", type=Path, default=FOLDER / "canyon.blend")
    write(build, parser.parse_args(argv).output)
    return 0


if __name__ == "__main__":
    sys.exit(main())
