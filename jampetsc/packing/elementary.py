"""exp, log and a cosine from additions, multiplications and divisions alone.

The C library's differ in the last digit between its versions and between the processors that it finds, and last digits
decide which minimum a quench ends in. These are the same wherever IEEE 754 holds. numba compiles them as well, see
`bond`.
"""

import math

import numpy as np

MAX_EXPONENT = 700.0  # beyond it e^x is taken as infinite, and e^−x as 0
LN2_HIGH, LN2_LOW = (
    float.fromhex("0x1.62e42fee00000p-1"),
    float.fromhex("0x1.a39ef35793c76p-33"),
)  # ln 2 in two parts
TERMS = 17  # of e^x − 1 for |x| ≤ ½ ln 2
LOG_TERMS = 12  # of artanh z for |z| ≤ 0.18
HALF_SQRT = 0.7071067811865476
MAX_STEPS, MIN_STEP = 60, 1e-16  # of Newton's, which halve z near c = −1
SMALLEST_BASE = 2.0**-100  # of `power`, below what overlaps are rounded to
INVERSE_LN2 = float.fromhex("0x1.71547652b82fep+0")
MANTISSA = 52  # bits
BIAS, ROUND = 1023, 1.5 * 2.0**MANTISSA  # x + ROUND − ROUND is the whole number next to x
ROUND_BITS, HALF_SQRT_BITS = (int(np.float64(x).view(np.int64)) for x in (ROUND, HALF_SQRT))
ONE_BITS = BIAS << MANTISSA


def split_exponential(x):
    """(2ⁿ, e^r − 1) with x = n ln 2 + r and |r| ≤ ½ ln 2, such that e^x = 2ⁿ + 2ⁿ (e^r − 1)."""
    n = math.floor(x / (LN2_HIGH + LN2_LOW) + 0.5)
    r = (x - n * LN2_HIGH) - n * LN2_LOW
    series = 1.0
    for k in range(TERMS, 2, -1):
        series = 1.0 + r * series / k
    return math.ldexp(1.0, n), r + 0.5 * r * r * series


def exp(x):
    """e^x."""
    if not -MAX_EXPONENT < x < MAX_EXPONENT:
        return math.inf if x > 0.0 else 0.0 if x < 0.0 else x
    power, change = split_exponential(x)
    return power + power * change


def expm1(x):
    """e^x − 1, with all digits for small x."""
    if not -MAX_EXPONENT < x < MAX_EXPONENT:
        return math.inf if x > 0.0 else -1.0 if x < 0.0 else x
    power, change = split_exponential(x)
    return power * change + (power - 1.0)


def log(x):
    """ln x of a positive, finite number."""
    fraction, n = math.frexp(x)
    if fraction < HALF_SQRT:
        fraction, n = 2.0 * fraction, n - 1
    z = (fraction - 1.0) / (fraction + 1.0)
    series = 0.0
    for k in range(LOG_TERMS, -1, -1):
        series = 1.0 / (2 * k + 1) + z * z * series
    return n * LN2_HIGH + (n * LN2_LOW + 2.0 * z * series)


def bits_of(x):
    """The bits of doubles as whole numbers."""
    return np.asarray(x, float).view(np.int64)


def from_bits(bits):
    """The doubles of these bits."""
    return np.asarray(bits, np.int64).view(float)


def power(x, c):
    """x^c of x from 0 to 2^100, a number or an array, and a number c from 0 to 8; 0 counts as 2^−100.

    Without a branch, so that loops over pairs are vectorised: log and exp as above, in series that end in time.
    """
    bits = bits_of(x + SMALLEST_BASE)
    n = ((bits + (ONE_BITS - HALF_SQRT_BITS)) >> MANTISSA) - BIAS
    fraction = from_bits(bits - (n << MANTISSA))  # from √½ to √2
    whole = from_bits(n + ROUND_BITS) - ROUND  # n as a double
    z = (fraction - 1.0) / (fraction + 1.0)
    square, series = z * z, 1.0 / 21.0
    for k in range(9, -1, -1):
        series = 1.0 / (2 * k + 1) + square * series
    y = c * (whole * LN2_HIGH + (whole * LN2_LOW + 2.0 * z * series))
    rounded = y * INVERSE_LN2 + ROUND
    whole = rounded - ROUND
    r = (y - whole * LN2_HIGH) - whole * LN2_LOW
    series = 1.0 + r * (1.0 / 13.0)
    for k in range(12, 0, -1):
        series = 1.0 + r * series * (1.0 / k)
    return from_bits(bits_of(series) + ((bits_of(rounded) - ROUND_BITS) << MANTISSA))


def cosine_of_third(c):
    """cos(⅓ arccos c), |c| ≤ 1: y = ½ (1 + z) with z² (z + 3) = 2 (1 + c), by Newton's steps down from z = 1."""
    z = 1.0
    for _ in range(MAX_STEPS):
        step = (z * z * (z + 3.0) - 2.0 * (1.0 + c)) / (3.0 * z * (z + 2.0))
        if step < MIN_STEP:
            break
        z -= step
    return 0.5 + 0.5 * z
