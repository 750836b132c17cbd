# SPDX-License-Identifier: GPL-3.0-or-later
"""Binary phase codes: Barker codes and maximum-length sequences, as tuples of +1 and -1."""

from __future__ import annotations

from ...errors import ConfigError

#: Barker codes by length (Skolnik, Radar Handbook, ch. 8); sidelobes of the aperiodic
#: autocorrelation are at most 1 in magnitude.
BARKER = {
    2: "+-",
    3: "++-",
    4: "++-+",
    5: "+++-+",
    7: "+++--+-",
    11: "+++---+--+-",
    13: "+++++--++-+-+",
}

#: Exponents, apart from the degree and 0, of one primitive polynomial over GF(2) for each degree
#: (Peterson and Weldon, Error-Correcting Codes, appendix C).
_PRIMITIVE = {
    2: (1,), 3: (1,), 4: (1,), 5: (2,), 6: (1,), 7: (1,), 8: (4, 3, 2), 9: (4,), 10: (3,),
    11: (2,), 12: (6, 4, 1), 13: (4, 3, 1), 14: (10, 6, 1), 15: (1,), 16: (12, 3, 1),
}  # fmt: skip

_DEGREES = (min(_PRIMITIVE), max(_PRIMITIVE))


def barker(length: int) -> tuple[int, ...]:
    """The Barker code of a length, (length,)."""
    if length not in BARKER:
        raise ConfigError(
            f"Barker code of length {length!r}; there are codes of {', '.join(map(str, BARKER))}."
        )
    return tuple(1 if sign == "+" else -1 for sign in BARKER[length])


def m_sequence(degree: int) -> tuple[int, ...]:
    """A maximum-length sequence, (2**degree - 1,).

    Its periodic autocorrelation is N at lag 0 and -1 at every other (Golomb, Shift Register
    Sequences).
    """
    if not isinstance(degree, int) or degree not in _PRIMITIVE:
        raise ConfigError(
            f"Degree of the m-sequence is {degree!r}; expected a whole number from {_DEGREES[0]} "
            f"to {_DEGREES[1]} (a code of 2^degree - 1 chips)."
        )
    # s[n + degree] = s[n] + sum s[n + e] mod 2
    state = [1] * degree
    taps = (0, *_PRIMITIVE[degree])
    bits = []
    for _ in range(2**degree - 1):
        bits.append(state[0])
        state = [*state[1:], sum(state[tap] for tap in taps) % 2]
    return tuple(1 - 2 * bit for bit in bits)
