# SPDX-License-Identifier: GPL-3.0-or-later
"""Physical constants (SI)."""

#: Speed of light in vacuum [m/s], exact by definition of the metre.
SPEED_OF_LIGHT_MPS = 299_792_458.0

#: Boltzmann constant [J/K], exact by definition of the kelvin.
BOLTZMANN_J_PER_K = 1.380649e-23

#: Electric constant [F/m] (CODATA 2018).
VACUUM_PERMITTIVITY_F_PER_M = 8.8541878128e-12

#: Reference noise temperature T0 [K] (IEEE definition of noise figure).
REFERENCE_TEMPERATURE_K = 290.0

#: 0 degrees Celsius [K].
ZERO_CELSIUS_K = 273.15

#: Radius of the Earth with the refraction of the standard atmosphere, 4/3 of 6371 km [m].
STANDARD_EARTH_RADIUS_M = 8.495e6
