# SPDX-License-Identifier: GPL-3.0-or-later
"""The Blender half: scene, rig, node groups, and the render job that writes a run's folder.

Nothing here is imported before :func:`radarsim_addon.register` is called, or a script asks for it.
"""
