"""Harmonics of what answers to a sine."""

import numpy as np

HARMONICS = 2  # kept: third and fifth


def harmonics_of(values, drift: float = 0.0):
    """Complex first, third and fifth harmonic of values (steps,) at the ends of the steps of a cycle, less a ramp.

    Of a sine they are 1, 0, 0: their origin is the time at which it is largest, as for fixed contacts.
    """
    ends = np.arange(1, len(values) + 1) / len(values)
    orders = 2 * np.arange(HARMONICS + 1) + 1
    waves = np.exp(-1j * np.outer(2.0 * np.pi * ends - 0.5 * np.pi, orders))
    return (values - drift * ends) @ waves * (2.0 / len(values))
