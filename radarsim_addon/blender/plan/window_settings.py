# SPDX-License-Identifier: GPL-3.0-or-later
"""Settings as Blender's window holds them: several dataclasses together, numbers as float32."""

from __future__ import annotations

import math
from decimal import Decimal
from typing import Any

from ...options import Declared, declared


def merged(*kinds: type[Any]) -> dict[str, Declared]:
    """Return the settings of several dataclasses that the window shows; one name is one setting.

    Parameters
    ----------
    *kinds
        Dataclasses.

    Returns
    -------
    dict of str to Declared
        Settings by name, in the order of the dataclasses and their fields.

    Raises
    ------
    TypeError
        Two of the dataclasses declare the same name differently: a defect.
    """
    found: dict[str, Declared] = {}
    for kind in kinds:
        for name, item in declared(kind).items():
            if item.of.window and found.setdefault(name, item) != item:
                raise TypeError(f"{kind.__name__}.{name} is declared otherwise elsewhere.")
    return found


def shortest_decimal(value: float, exponent: int = 0) -> float:
    """Return the decimal number that was typed into a float32 field, times ``10**exponent``.

    Blender's float properties are float32: 77 GHz as 77e9 would read back 76999999488. Seven
    significant digits are what float32 keeps of any typed number.

    Parameters
    ----------
    value
        Value of the field, in the unit that is shown.
    exponent
        Power of ten from that unit to SI.

    Returns
    -------
    float
        Number in SI; NaN and infinity as they are.
    """
    if not math.isfinite(value):
        return value
    return float(Decimal(f"{value:.7g}").scaleb(exponent))
