# SPDX-License-Identifier: GPL-3.0-or-later
"""Physical constants (SI)."""

#: Speed of light in vacuum [m/s], exact by definition of the metre.
SPEED_OF_LIGHT_MPS = 299_792_458.0
