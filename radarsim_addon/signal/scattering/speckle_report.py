# SPDX-License-Identifier: GPL-3.0-or-later
"""What the scatterers of a frame's surfaces are like, and what to know of them."""

from __future__ import annotations

from dataclasses import dataclass

from ...findings import Finding, finding

#: Scatterers in a resolution cell from which its intensity is taken to be exponential.
ENOUGH_SCATTERERS = 40


@dataclass(frozen=True)
class SpeckleReport:
    """What the cells of a frame are like.

    Attributes
    ----------
    cell_m
        Edge of a cell [m]; larger where a material's correlation length is.
    cells
        Cells that paths hit.
    median_scatterers
        Effective number of scatterers in a range cell, (sum P)^2 / sum P^2 over its cells: the
        median over the power.
    undersampled_power_fraction
        Fraction of the power in range cells of fewer than `ENOUGH_SCATTERERS`.
    coherent_power_fraction
        Fraction of the power that the roughness leaves coherent, mean of m^2: not formed as such.
    coherent_objects
        Names of the objects of which more than 1 % of the power is.
    """

    cell_m: float
    cells: int
    median_scatterers: float
    undersampled_power_fraction: float
    coherent_power_fraction: float = 0.0
    coherent_objects: tuple[str, ...] = ()

    @property
    def findings(self) -> list[Finding]:
        """Too few scatterers for speckle, and coherent parts left out, where it is so."""
        found = []
        if self.undersampled_power_fraction >= 0.2:
            found.append(
                finding(
                    "few-scatterers",
                    fraction=self.undersampled_power_fraction,
                    enough=ENOUGH_SCATTERERS,
                    median=self.median_scatterers,
                )
            )
        if self.coherent_objects:
            found.append(
                finding(
                    "coherent-part-not-formed",
                    *self.coherent_objects,
                    fraction=self.coherent_power_fraction,
                )
            )
        return found
