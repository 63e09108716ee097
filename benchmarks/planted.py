"""Sets of an observable planted with known exponents, and whether what `collapse` says of them holds."""

import numpy as np

from jampetsc.analysis.collapse_fit import estimate
from jampetsc.analysis.scaling_collapse import Form, Points, scaled
from jampetsc.commands.collapse_points import MIN_PROBABILITY

PHIS = (0.835, 0.838, 0.84, 0.842, 0.8433, 0.845, 0.848, 0.85)
RATES = np.geomspace(1e-6, 1e-3, 6)
OMEGA = 0.3
FEWEST = 10  # sets without a note that a share is taken of
LAWS = {  # ln f₀ and zν; the first is in the class that is fitted
    "cubic": (lambda x: 0.5 + 6 * x - 8 * x**2 + 4 * x**3, 3.5),
    "arctan": (lambda x: 2.5 * np.arctan(4 * x), 3.5),
    "wide arctan": (lambda x: 2.0 * np.arctan(1.5 * x), 2.5),
}
SETS = {  # (law, size of corrections, degree, noises, planted sets, share of the squared errors common to a rate)
    "cubic": ("cubic", 0.0, 5, (0.01, 0.05, 0.1, 0.2), 50, 0.0),
    "arctan": ("arctan", 0.0, 5, (0.01, 0.05, 0.1, 0.2), 50, 0.0),
    "wide arctan": ("wide arctan", 0.0, 5, (0.05, 0.1), 50, 0.0),
    "cubic, corrections": ("cubic", 2.0, 3, (0.003, 0.01), 20, 0.0),
    "cubic, half common to a rate": ("cubic", 0.0, 5, (0.02,), 100, 0.5),
    "cubic, nine tenths common": ("cubic", 0.0, 5, (0.02,), 100, 0.9),
}


def planted(law, noise, corrections, seed, common=0.0):
    """(points, {parameter: its true value}) of φ_J = 0.8433, y = 1.1 and normal errors of a share of each value."""
    ln_f0, kappa = LAWS[law]
    phi, rate = np.repeat(PHIS, len(RATES)), np.tile(RATES, len(PHIS))
    truth = {"phi_J": 0.8433, "y": 1.1, "kappa": kappa, "omega": OMEGA}
    x = scaled(Points(phi, rate, None, None), truth["phi_J"], kappa)
    f = np.exp(ln_f0(x)) + corrections * rate**OMEGA * np.exp(0.3 + 3 * x)
    value = rate ** (truth["y"] / kappa) * f
    rng = np.random.default_rng(seed)
    own, shared = rng.standard_normal(len(phi)), np.tile(rng.standard_normal(len(RATES)), len(PHIS))
    noisy = value * (1 + noise * (np.sqrt(1 - common) * own + np.sqrt(common) * shared))
    return Points(phi, rate, np.maximum(noisy, 0.0), noise * value), truth


def collapse():
    """Exponents of planted sets: the share without a note and what their errors cover; of all, what ends of 2σ hold."""
    print(
        "| function | noise | parameter | no note | 1σ | 2σ | farthest | claimed/true | 2σ ends, all sets |"
    )
    print("|---|---|---|---|---|---|---|---|---|")
    for title, (law, corrections, degree, noises, sets, common) in SETS.items():
        form = Form({}, corrections > 0, degree)
        for noise in noises:
            fits = []
            for seed in range(sets):
                points, truth = planted(law, noise, corrections, seed, common)
                fits.append((*estimate(points, form), points.phi))
            for name in form.free:
                rows = np.array([facts(fit, found, phi, name, truth[name]) for fit, found, phi in fits])
                plain, held = rows[:, 3] == 1, rows[:, 2].mean()
                off, claimed = rows[plain, 0], rows[plain, 1]
                numbers = [plain.mean(), *[np.nan] * 4]
                if plain.sum() >= FEWEST:
                    z = np.abs(off / claimed)
                    numbers[1:] = np.mean(z < 1), np.mean(z < 2), z.max(), np.median(claimed) / off.std()
                shown = " | ".join(f"{number:.2f}" for number in [*numbers, held])
                print(f"| {title} | {noise:.1%} | {name} | {shown} |", flush=True)


def facts(fit, found, phi, name, truth):
    """(deviation, error, whether the ends of 2σ hold the truth, whether the command writes it without a note)."""
    one, sound = found[name], fit.probability >= MIN_PROBABILITY
    told = all(other.decided for other in found.values())  # else a note is on all of them
    plain = sound and told and not one.uneven and not one.left_to_degree
    inside = name != "phi_J" or phi.min() < one.value < phi.max()
    return one.value - truth, one.error, one.low <= truth <= one.high, plain and inside
