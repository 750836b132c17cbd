# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed forms of antennas, materials, surfaces, slabs, targets, noise and the radar equation.

In: numbers in SI, angles in radians. Out: numbers or arrays of the broadcast shape. The modules use
numpy only and import neither bpy nor another room.
"""
