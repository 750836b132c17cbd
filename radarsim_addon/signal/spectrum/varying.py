# SPDX-License-Identifier: GPL-3.0-or-later
"""Spectra of paths whose amplitudes change during the burst, as where antenna gains do.

Lengths go the ways of :mod:`.spectrum.moving`. Amplitudes that K Chebyshev terms follow cost K
transforms of type 3 for all pulses, or pulse by pulse K products a path; the cheaper one is taken.
Where no polynomial follows them, amplitudes and lengths are taken at every pulse: about ten times
the cost of a transform pulse by pulse, most of it in vertices and gains.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from ..motion import PathMotion
from .amplitudes import AmplitudeHistory, fit_amplitudes
from .grid import Weights, check_finite
from .moving import MovingPathAccumulator


class VaryingPathAccumulator(MovingPathAccumulator):
    """As `MovingPathAccumulator`, for amplitudes that vary."""

    def add_varying(
        self,
        motion: PathMotion,
        rows: NDArray[np.intp],
        history: AmplitudeHistory,
        first: int,
    ) -> None:
        """Add these rows of a motion.

        `history` is of all rows of the motion; `first` is the number of its row 0 in errors.
        """
        basis, times_s = self._amplitude_basis, self._times_s
        follows = np.zeros(rows.size, dtype=bool)
        if basis is not None and times_s.size > basis.sample_times_s().size:
            values = history.at(basis.sample_times_s(), rows)
            check_finite(values, rows, "amplitude", first)
            terms, follows = fit_amplitudes(basis, values, self._tolerance)
            if follows.any():
                self.add(motion, rows[follows], terms[follows], first)
        if follows.all():
            return
        own, self._added = rows[~follows], first

        def at(part: slice, pulses: slice) -> Weights:
            found = history.at(times_s[pulses], own[part])
            check_finite(found, own[part], "amplitude", first)
            return np.ascontiguousarray(found.T)

        self._sampled(motion, own, np.zeros(own.size), at)
