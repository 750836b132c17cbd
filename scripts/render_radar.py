# SPDX-License-Identifier: GPL-3.0-or-later
"""``radarsim render`` under a Blender program, and from a checkout without installing it.

blender -b scene.blend -P scripts/render_radar.py -- --out DIR [options]
python scripts/render_radar.py scene.blend --out DIR [options]      (Python with bpy)
"""

import sys
from pathlib import Path

repository = Path(__file__).resolve().parents[1]
if (repository / "radarsim_addon" / "__init__.py").is_file():
    # A checkout: its own package, also where another version is installed. Only scripts do that;
    # the package itself never touches sys.path.
    sys.path.insert(0, str(repository))

from radarsim_addon.__main__ import render_command  # noqa: E402

if __name__ == "__main__":
    inside_blender = "bpy" in sys.modules and bool(sys.modules["bpy"].app.binary_path)
    words = sys.argv[1:]
    if inside_blender:
        words = sys.argv[sys.argv.index("--") + 1 :] if "--" in sys.argv else []
    sys.exit(render_command(words, "render_radar.py", needs_blend=not inside_blender))
