# SPDX-License-Identifier: GPL-3.0-or-later
"""Closed forms of materials, surfaces, antennas, targets, weather, noise and the radar equation.

A material by name gives an index of refraction at the carrier (`materials`). From the index follow
reflection and transmission of a smooth boundary or slab (`fresnel`), of planar and curved mirrors
(`mirrors`) and of rough surfaces (`rough`). `clutter` has sigma0 of ground and sea instead, `rcs`
bodies of simple shape, `antennas` the gain against direction, `weather` rain, fog and gases, and
`round_earth` the path via the ground. `radar_equation` makes powers and SNR of them.

Numbers are in SI, angles in radians; arguments broadcast, and results have the broadcast shape.
A number that is not finite or out of range raises a `ConfigError` which names it (`checks`).
Time convention exp(-j w t): a passive medium has Im(n) >= 0 and Im(eps) >= 0; of an index that a
text writes n - jk, take the complex conjugate. The modules use numpy only (scipy for two tapers
and the fluctuation of clutter), and import neither bpy nor another room.
"""
