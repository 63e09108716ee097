"""Harmonics of what answers to a sine."""

import numpy as np

HARMONICS = 2  # kept: third and fifth


def harmonics_of(values, times, weights, drift: float = 0.0):
    """Complex first, third and fifth harmonic of values (n,) at times (n,) of a cycle of length 1, less a ramp.

    weights: (n,), or one number, of a quadrature over the cycle
    Of a sine they are 1, 0, 0: their origin is the time at which it is largest, as for fixed contacts.
    """
    orders = 2 * np.arange(HARMONICS + 1) + 1
    waves = np.exp(-1j * np.outer(2.0 * np.pi * times - 0.5 * np.pi, orders))
    return (2.0 * weights * (values - drift * times)) @ waves
