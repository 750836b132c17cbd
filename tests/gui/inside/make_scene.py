# SPDX-License-Identifier: GPL-3.0-or-later
"""Save two small scenes: a plate at 10 m before the radar, and one without a radar.

blender -b --python make_scene.py -- FOLDER
"""

from __future__ import annotations

import sys
from pathlib import Path

import bpy

folder = Path(sys.argv[sys.argv.index("--") + 1])
for item in list(bpy.data.objects):
    bpy.data.objects.remove(item)
bpy.ops.mesh.primitive_plane_add(size=4.0, location=(0.0, 10.0, 0.0), rotation=(1.5707963, 0, 0))
bpy.ops.wm.save_as_mainfile(filepath=str(folder / "no radar.blend"))
plate = bpy.context.object
bpy.ops.radarsim.assign_material()
bpy.ops.radarsim.setup_rig()
next(item for item in bpy.data.objects if item.type == "EMPTY").location = (0.0, 0.0, 0.0)
settings = bpy.data.objects["Radar"].radarsim
settings.width_px = settings.height_px = 8
settings.samples = 1
bpy.ops.wm.save_as_mainfile(filepath=str(folder / "plate é.blend"))
