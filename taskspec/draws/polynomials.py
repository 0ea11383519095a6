"""The float32 functions behind real draws, from + - * / sqrt, casts and integer bit tricks alone.

A library's functions differ in their last digits from machine to machine; these do not, as long as
every operation rounds once to float32 in the order written here. Integers are 32 bits wide. Each
function is elementwise and can be transcribed line by line for any backend (`view` reinterprets
bits, `astype` converts, to nearest even). A compiler that fuses a product with the sum that it
feeds changes last digits; where the product is exact, that is said.

Coefficients are minimax fits (Lawson iteration in float64), rounded to float32.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from taskspec.draws.threefry import Words

Reals = NDArray[np.float32]
Ints = NDArray[np.int32]

F = np.float32
LOG2E = F(1.44269504)
LN2 = F(0.693147181)
LN2_HIGH = F(0.693359375)  # 355/512: times a whole number below 2**15 it is exact
LN2_LOW = F(-2.12194440e-4)
SQRT_HALF_BITS = np.int32(0x3F3504F3)
FRACTION_BITS = np.int32(0x007FFFFF)
SIGN_BIT = np.uint32(0x80000000)

# log m = s (2 + z (L0 + z (L1 + z L2))), s = (m - 1)/(m + 1), z = s²; fit within 2e-11
L = tuple(map(F, (0.66666776, 0.39977533, 0.29872006)))
# exp f = 1 + f + f² (E0 + f (E1 + ...)), |f| <= log(2)/2; fit within 4e-9
E = tuple(map(F, (0.5, 0.16666518, 0.041666206, 0.008368954, 0.0013950604)))
# sin(πx/2) = x (S0 + z (S1 + ...)), z = x², |x| <= 1; fit within 4e-9
S = tuple(map(F, (1.5707963, -0.64596337, 0.079688482, -0.0046722279, 0.00015082053)))
# cos(πx/2) = C0 + z (C1 + ...); fit within 5e-8
C = tuple(map(F, (0.99999994, -1.2336982, 0.25365075, -0.020810629, 0.00085819111)))


def split(x: Reals) -> tuple[Ints, Reals]:
    """``(e, log m)`` with x = m 2^e and m in [√½, √2), for positive normal x."""
    bits = x.view(np.int32) - SQRT_HALF_BITS
    e = bits >> np.int32(23)
    m = ((bits & FRACTION_BITS) + SQRT_HALF_BITS).view(np.float32)
    s = (m - F(1)) / (m + F(1))
    z = s * s
    return e, s * (F(2) + z * (L[0] + z * (L[1] + z * L[2])))


def log(x: Reals) -> Reals:
    """Return the natural logarithm of positive normal x, within 2e-7 (1 + |log x|)."""
    e, log_m = split(x)
    return e.astype(np.float32) * LN2 + log_m


def exp(x: Reals) -> Reals:
    """Return the exponential of x, within 2e-7 of itself; 0 below -87, and that of 88 above 88."""
    y = np.minimum(np.maximum(x, F(-87)), F(88))
    k = np.rint(y * LOG2E)
    f = (y - k * LN2_HIGH) - k * LN2_LOW  # the first product is exact
    p = E[0] + f * (E[1] + f * (E[2] + f * (E[3] + f * E[4])))
    power = ((k.astype(np.int32) + np.int32(127)) << np.int32(23)).view(np.float32)
    result: Reals = np.where(x < F(-87), F(0), ((f * f) * p + f + F(1)) * power)
    return result


def uniform(words: Words) -> Reals:
    """(w >> 8) 2^-24, in [0, 1): exact."""
    return (words >> np.uint32(8)).view(np.int32).astype(np.float32) * F(2**-24)


def exponential(words: Words) -> Reals:
    """-log U, for U = (v + 1/2) 2^-31 and v the 31 upper bits of the inverted word: in [0, 22.2].

    It grows with the word. U lies in [2^-32, 1], so the logarithm is always finite; 31 bits and a
    half, against the 24 of a float32 uniform, carry the tail on to where the words themselves end.
    """
    v = (~words >> np.uint32(1)).view(np.int32).astype(np.float32) + F(0.5)
    e, log_m = split(v)
    return (np.int32(31) - e).astype(np.float32) * LN2 - log_m


def direction(words: Words) -> tuple[Reals, Reals]:
    """Return a point ``(cos, sin)`` of the unit circle for each word, within 3e-7.

    The lower 31 bits, as a signed fraction x of [-1, 1], give the angle πx/2 of a point of the
    right half circle, and the top bit moves it to the left half: no quadrants, no selection.
    """
    x = (words << np.uint32(1)).view(np.int32).astype(np.float32) * F(2**-31)  # exact
    z = x * x
    sine = x * (S[0] + z * (S[1] + z * (S[2] + z * (S[3] + z * S[4]))))
    cosine = C[0] + z * (C[1] + z * (C[2] + z * (C[3] + z * C[4])))
    return (cosine.view(np.uint32) ^ (words & SIGN_BIT)).view(np.float32), sine


def normal_pair(radius: Words, angle: Words) -> tuple[Reals, Reals]:
    """Return two independent standard normals for each pair of words, by Box and Muller; |x| <= 6.67."""
    r = np.sqrt(exponential(radius) * F(2))  # exact product
    cosine, sine = direction(angle)
    return r * cosine, r * sine
