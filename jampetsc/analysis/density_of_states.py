"""Density of states of complete mode spectra."""

import numpy as np

BINS_PER_DECADE = 8  # of frequency


def density_of_states(frequencies, states: int):
    """(ω, D) in logarithmic bins that hold a mode: modes per unit frequency, divided by the number of states.

    frequencies   (m,) positive, of all spectra together
    states        degrees of freedom of all spectra together
    """
    low = np.floor(np.log10(frequencies.min()) * BINS_PER_DECADE)
    high = np.ceil(np.log10(frequencies.max()) * BINS_PER_DECADE)
    edges = 10.0 ** (np.arange(low, high + 1) / BINS_PER_DECADE)
    counts, _ = np.histogram(frequencies, edges)
    filled = counts > 0
    return np.sqrt(edges[1:] * edges[:-1])[filled], (counts / np.diff(edges) / states)[filled]
