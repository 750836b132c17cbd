# SPDX-License-Identifier: GPL-3.0-or-later
"""How bright surfaces are, by the same closed forms that the materials' shader nodes follow."""

from __future__ import annotations

from dataclasses import dataclass, field
from typing import Literal

import numpy as np

from ...array_types import Real
from ...physics.clutter import clutter_model
from ...physics.fresnel import unpolarised_reflectance
from ...physics.rough import facet_brightness, slope_from_roughness

SurfaceKind = Literal["silent", "lambert", "simple", "physical"]


@dataclass(frozen=True)
class Angles:
    """Cosines of n rays at a surface, each (n,).

    Attributes
    ----------
    to_transmitter, to_receiver
        Of the angles from the shading normal.
    to_facet
        From the shading normal to the facet half way between both antennas.
    at_facet
        From that facet's normal to an antenna.
    to_receiver_flat
        From the normal of the triangle to the receiver.
    """

    to_transmitter: Real
    to_receiver: Real
    to_facet: Real
    at_facet: Real
    to_receiver_flat: Real


@dataclass(frozen=True)
class DraftSurface:
    """A material at the carrier.

    Attributes
    ----------
    kind
        "silent" returns nothing; "lambert" is diffuse; "simple" and "physical" are the two groups
        of Radar Materials.
    n, kappa
        Complex index n + j kappa.
    specularity, roughness
        Of the group "simple": fraction in the specular lobe; roughness of Cycles, 0 for a mirror.
    albedo
        Of "lambert".
    clutter, clutter_path, clutter_parameters, polarisation
        Clutter model of "physical" with its file; "" for none.
    """

    kind: SurfaceKind
    n: float = 1.0
    kappa: float = 0.0
    specularity: float = 0.0
    roughness: float = 0.0
    albedo: float = 0.0
    clutter: str = ""
    clutter_path: str = ""
    clutter_parameters: dict[str, float] = field(default_factory=dict)
    polarisation: str = "average"

    def brightness(self, angles: Angles, carrier_hz: float) -> Real:
        """Return 4 pi f cos_in of n rays, f the BRDF, as of `facet_brightness`.

        Parameters
        ----------
        angles
            Of the rays.
        carrier_hz
            Carrier, for clutter models [Hz].

        Returns
        -------
        ndarray
            (n,) [m^2/m^2].
        """
        lambert = 4 * np.maximum(angles.to_transmitter, 0.0)
        if self.kind == "silent":
            return np.zeros(lambert.shape)
        if self.kind == "lambert":
            return np.asarray(self.albedo * lambert)
        index = complex(self.n, self.kappa)
        facets = np.zeros(lambert.shape)
        if self.roughness > 0:
            slope = slope_from_roughness(self.roughness)
            facets = facet_brightness(
                slope, angles.to_transmitter, angles.to_receiver, angles.to_facet
            )
        if self.kind == "simple":
            part = self.specularity
            reflected = unpolarised_reflectance(index, angles.to_receiver)
            return np.asarray(reflected * (part * facets + (1 - part) * lambert))
        total = unpolarised_reflectance(index, angles.at_facet) * facets
        return np.asarray(total + self._clutter(angles, carrier_hz))

    def _clutter(self, angles: Angles, carrier_hz: float) -> Real:
        """sigma0 over the cosine of the triangle, which a pixel's area cancels, (n,)."""
        if not self.clutter:
            return np.zeros(angles.to_receiver.shape)
        model = clutter_model(self.clutter, self.clutter_path or None)
        grazing_rad = np.arcsin(np.clip(angles.to_receiver, 0.0, 1.0))
        level_db = model.sigma0_db(
            carrier_hz, grazing_rad, self.polarisation, **self.clutter_parameters
        )
        return np.asarray(10 ** (level_db / 10) / np.maximum(angles.to_receiver_flat, 1e-12))
