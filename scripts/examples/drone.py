# SPDX-License-Identifier: GPL-3.0-or-later
"""Micro-Doppler of a drone: four rotors of two blades, seen from the ground at 24 GHz."""

from __future__ import annotations

import math
from typing import Any

import bpy

from radarsim_addon import blender as radarsim
from radarsim_addon.blender.nodes import make_material

from .shared import add_box, coloured, move, spin

#: Revolutions per second of each rotor; neighbours turn against each other.
TURNS_PER_S = (80.0, -78.0, 82.0, -84.0)
BLADE_M = 0.15
#: Height above the radar and distance on the ground [m].
HEIGHT_M, DISTANCE_M = 10.0, 17.0
#: Velocity of the drone: it comes closer, level [m/s].
VELOCITY_MPS = (0.0, -4.0, 0.0)
ARM_M = 0.25
SECONDS = 1.0

#: Turn of each rotor at frame 1 [rad]: blades of the fastest one are across the line of sight.
START_RAD = (0.4, 0.8, -0.4, 0.0)


def body_rate_mps() -> float:
    """Return the range rate of the drone: its velocity along the line of sight."""
    return VELOCITY_MPS[1] * DISTANCE_M / math.hypot(DISTANCE_M, HEIGHT_M)


def tip_rate_mps() -> float:
    """Return 2 pi f r cos(elevation): range rate of the fastest blade tips against the drone."""
    fastest = max(map(abs, TURNS_PER_S))
    return 2 * math.pi * fastest * BLADE_M * DISTANCE_M / math.hypot(DISTANCE_M, HEIGHT_M)


def build() -> Any:
    """Build the scene in the current, empty file; return the radar."""
    middle = (0.0, DISTANCE_M, HEIGHT_M)
    radar = radarsim.add_radar(
        (0, 0, 0), look_at=middle, preset="doppler_24ghz", field_of_view_deg=3.5,
        prf_hz=30e3, pulses=512, adc_samples=64, adc_rate_hz=2e6, width_px=160, height_px=160,
        replicates=2, range_start_m=15.0, range_stop_m=25.0, transmit_power_w=1.0,
    )  # fmt: skip
    shell = coloured(make_material("Shell", 1e4, 1e4, specularity=0.0), (0.8, 0.8, 0.82))
    blade = coloured(make_material("Blade", 1e4, 1e4, specularity=0.0), (0.05, 0.05, 0.06))
    body = add_box("Drone", (-0.12, -0.12, -0.05), (0.12, 0.12, 0.05), shell)
    move(body, middle, VELOCITY_MPS, SECONDS)
    for number, turns in enumerate(TURNS_PER_S):
        angle = math.pi / 4 + number * math.pi / 2
        x, y = ARM_M * math.cos(angle), ARM_M * math.sin(angle)
        arm = add_box(f"Arm {number + 1}", (0.1, -0.01, -0.02), (ARM_M, 0.01, 0.0), shell)
        arm.rotation_euler.z, arm.parent = angle, body
        rotor = add_box(
            f"Rotor {number + 1}", (-BLADE_M, -0.012, -0.001), (BLADE_M, 0.012, 0.001), blade
        )
        rotor.location, rotor.parent = (x, y, 0.03), body
        spin(rotor, turns, SECONDS, start=START_RAD[number])
    bpy.context.view_layer.update()
    return radar
