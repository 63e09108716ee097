"""Flow curves and starts of flows planted with known laws, and how often the intervals of their fits hold these."""

import math

import numpy as np

from jampetsc.analysis.flow_laws import FORMS, FlowCurve, FlowLaw, fit_flow_law
from jampetsc.analysis.overshoot import find_peak
from jampetsc.analysis.statistics import half_width

SETS = 300  # of each row
RATES = np.geomspace(1e-5, 1e-2, 7)
LAW = FlowLaw(1e-3, 0.03, 0.5)
ROW, MEMORY = 0.005, 0.05  # strain of a row, correlation strain of the noise
STRAIN = ROW * (np.arange(200) + 0.5)


def planted_curve(rng, noise, seeds):
    """Stresses of seeds at RATES, and errors of their means as of series of 40 independent values, with Student's t."""
    exact = LAW.stress(RATES)
    stresses = exact * (1.0 + noise * rng.standard_normal((seeds, len(RATES))))
    degrees = 7 * seeds
    own = noise * exact * np.sqrt(rng.chisquare(degrees, len(RATES)) / degrees / seeds)
    own *= half_width(degrees)
    return FlowCurve(RATES, stresses.mean(axis=0), own, own, stresses if seeds > 1 else None)


def laws():
    """95 % intervals of planted Herschel–Bulkley laws: shares that hold σ_y, A and n."""
    print("| seeds | noise of a mean | intervals | sigma_y | A | n |")
    print("|---|---|---|---|---|---|")
    form = FORMS["herschel-bulkley"]
    for seeds in (1, 2, 3, 4, 5, 8):
        for noise in (0.01, 0.1):
            rng, hits = np.random.default_rng(seeds), dict.fromkeys(form.free, 0)
            for _ in range(SETS):
                curve = planted_curve(rng, noise, seeds)
                for name, (low, high) in fit_flow_law(curve, form).intervals.items():
                    hits[name] += low <= getattr(LAW, name) <= high
            way = "jackknife" if curve.is_jackknifed else "profile"
            shares = " | ".join(f"{times / SETS:.2f}" for times in hits.values())
            print(f"| {seeds} | {noise:.0%} | {way} | {shares} |", flush=True)


def start(strain, height):
    """A rise to 1 with an overshoot that decays more slowly than it grows."""
    return 1.0 - np.exp(-strain / 0.05) + height * strain / 0.1 * np.exp(1.0 - strain / 0.1)


def planted_starts(rng, height, noise, seeds):
    """(starts (S, T), steady stresses (S,)) with noise of exponential memory, relative to the stress."""
    decay, x = math.exp(-ROW / MEMORY), rng.standard_normal((seeds, len(STRAIN)))
    for row in range(1, len(STRAIN)):
        x[:, row] = decay * x[:, row - 1] + math.sqrt(1.0 - decay**2) * x[:, row]
    steady = 1.0 + noise * math.sqrt(2 * MEMORY / 5) * rng.standard_normal(seeds)
    return start(STRAIN, height) * (1.0 + noise * x), steady


def overshoots():
    """Peaks of planted starts: shares of 68 % intervals that hold height and strain; overshoots beyond noise."""
    print("| overshoot | noise | seeds | height | strain | beyond noise |")
    print("|---|---|---|---|---|---|")
    fine = np.linspace(0.0, 1.0, 100_001)
    for height, noise, seeds in (
        (0.0, 0.1, 3), (0.0, 0.1, 5), (0.0, 0.1, 20), (0.18, 0.1, 5), (0.18, 0.1, 20), (0.3, 0.1, 3), (0.3, 0.1, 5),
        (0.3, 0.1, 20), (0.3, 0.03, 20), (0.8, 0.1, 10),
    ):  # fmt: skip
        rng, curve, hits = np.random.default_rng(seeds), start(fine, height), np.zeros(3)
        strain, stress = fine[np.argmax(curve)], curve.max()
        for _ in range(SETS):
            peak = find_peak(STRAIN, *planted_starts(rng, height, noise, seeds))
            inside = abs(peak.strain - strain) <= peak.strain_error
            hits += abs(peak.stress - stress) <= peak.stress_error, inside, peak.is_resolved
        shares = [f"{share:.2f}" for share in hits / SETS]
        if height == 0.0:
            shares[:2] = "", ""
        print(f"| {max(stress - 1.0, 0.0):.0%} | {noise:.0%} | {seeds} | {' | '.join(shares)} |", flush=True)
