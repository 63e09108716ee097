"""Power-law damping as it is, beside BT's equivalent linear damping: the table of docs/nonlinear-damping.md.

    .venv/bin/python benchmarks/nonlinear.py figures/bt-nonlinear/n256       # after run/figures/bt-nonlinear

With fixed contacts G* depends on X = ω^α σ^(α−1) alone (frequencies in 1/τ₁, stress in k), so an exponent x in X is αx
in ω and (α−1)x in σ. BT 25 takes u₀ = σ/k for the motion of a contact. `self_consistent` takes what the linear law says
instead, u₀ = γ₀ |Δu| with γ₀ = σ/|G*| and the rms |Δu| that dissipates G'', and nothing else differs. Errors: bootstrap
over packings.
"""

import argparse
import re
from pathlib import Path

import numpy as np
from scipy.optimize import brentq
from scipy.special import gamma

from jampetsc.storage.reader import load

DRAWS = 1000
PARTS = {"G'": np.real, "G''": np.imag}
QUASISTATIC = 0.1  # largest G''/G' there
CRITICAL = (2.0, 0.2)  # G' from this many times G₀ up to this many k


def read(folder):
    """{(alpha, p): [(G measured, G of BT's damping, X, G₀, file, G self-consistent), …]}, one per packing."""
    found = {}
    for path in sorted(folder.glob("oscillate-*.h5")):
        alpha, p, seed = re.match(r"oscillate-([\d.]+)-(.+)-(\d+)\.h5", path.name).groups()
        other = folder / f"equivalent-{alpha}-{p}-{seed}.h5"
        if not other.exists():
            continue
        measured, equivalent = load(path), load(other)
        a, stress = float(measured.attributes["alpha"]), float(measured["amplitude"][0])
        X = measured["omega"] ** a * stress ** (a - 1.0)
        G0 = equivalent.spectrum.G0
        disks = load(folder / f"packing-{p}-{seed}.h5")
        told = measured.attributes
        contacts = 0.5 * told["coordination"] * (told["particle_count"] - told["rattlers"]) / disks.area
        ours = self_consistent(equivalent, contacts, measured["omega"], a, stress)
        found.setdefault((a, float(p)), []).append((measured["G"][0], equivalent.G, X, G0, measured, ours))
    return found


def self_consistent(equivalent, contacts_per_area, omega, alpha, stress):
    """G* with one linear dashpot for all contacts that dissipates what they do at the rms of their own motion."""
    factor = 2.0 / np.sqrt(np.pi) * gamma(1 + alpha / 2) / gamma(1.5 + alpha / 2)
    spectrum = equivalent.spectrum

    def excess(log_Omega, w):
        Omega = np.exp(log_Omega)
        G = spectrum.modulus(Omega)
        motion = stress / abs(G) * np.sqrt(G.imag / (Omega * contacts_per_area))
        return np.log(w * factor * (motion * w) ** (alpha - 1)) - log_Omega

    return np.array([spectrum.modulus(np.exp(brentq(excess, -60.0, 40.0, args=(w,)))) for w in omega])


def slope(logs_x, logs_y):
    """Slope of a straight line through the points of all packings, each with an offset of its own."""
    x = np.concatenate([u - u.mean() for u in logs_x])
    y = np.concatenate([u - u.mean() for u in logs_y])
    return x @ y / (x @ x)


def bootstrap(sets, statistic):
    """(value, standard error) of statistic(list of packings)."""
    rng = np.random.default_rng(1)
    draws = [statistic([sets[k] for k in rng.integers(len(sets), size=len(sets))]) for _ in range(DRAWS)]
    return statistic(sets), float(np.std(draws))


def exponent(packings, which, part, regime):
    """(x, error, points) of `part` of G* ∝ X^x in a regime of the measurement, for one of its columns in `read`."""
    sets = []
    for one in packings:
        G, X, G0 = one[0], one[2], one[3]
        if regime == "quasistatic":
            inside = G.imag < QUASISTATIC * G.real
        else:
            inside = (G.real > CRITICAL[0] * G0) & (G.real < CRITICAL[1])
        if np.count_nonzero(inside) >= 2:
            sets.append((np.log(X[inside]), np.log(part(one[which][inside]))))
    if not sets:
        return np.nan, np.nan, 0
    value, error = bootstrap(sets, lambda chosen: slope(*zip(*chosen, strict=True)))
    return value, error, sum(len(x) for x, _ in sets)


def loss_prefactor(one, which):
    """G''/X of the lowest frequency."""
    return one[which][0].imag / one[2][0]


def report(alpha, pressures, data):
    """Print what one exponent gives."""
    print(f"\nalpha = {alpha:g}: exponents in omega; in sigma they are (alpha-1)/alpha times as large")
    print("| regime | part | p | measured | BT's damping | self-consistent | BT 27-29 | points |")
    print("|---|---|---|---|---|---|---|---|")
    for regime, names in (("quasistatic", ("G''",)), ("critical", ("G'", "G''"))):
        theory = alpha if regime == "quasistatic" else alpha / 2
        for name in names:
            for p in pressures:
                fits = [exponent(data[p], which, PARTS[name], regime) for which in (0, 1, 5)]
                cells = " | ".join(f"{alpha * x:.3f} ± {alpha * error:.3f}" for x, error, _ in fits)
                print(f"| {regime} | {name} | {p:g} | {cells} | {theory:.3f} | {fits[0][2]} |")
    print("\nquasistatic G'' against p: exponent of the prefactor G''/X")
    better = (1 - 3 * alpha) / 4
    for which, name, theory in (
        (0, "measured", better),
        (1, "BT's damping", -0.5),
        (5, "self-consistent", better),
    ):
        rows = [[data[p][k] for p in pressures] for k in range(min(map(len, data.values())))]
        sets = [(np.log(pressures), np.log([loss_prefactor(one, which) for one in row])) for row in rows]
        value, error = bootstrap(sets, lambda chosen: slope(*zip(*chosen, strict=True)))
        print(f"  {name}: {value:.3f} ± {error:.3f}, as p → 0 {theory:.3f}")
    for which, what in ((1, "BT's damping"), (5, "self-consistent")):
        print(f"\nmeasured over {what}, median over packings, lowest omega first")
        for p in pressures:
            for name, part in PARTS.items():
                ratios = np.median([part(one[0]) / part(one[which]) for one in data[p]], axis=0)
                print(f"  p = {p:g}, {name}: " + ", ".join(f"{value:.2f}" for value in ratios))
    third = [
        np.median([abs(one[4]["harmonics"][0, :, 0]) for one in data[p]], axis=0).max() for p in pressures
    ]
    print("third harmonic of the strain, largest median: " + ", ".join(f"{100 * t:.1f} %" for t in third))


def main():
    words = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    words.add_argument("folder", type=Path)
    folder = words.parse_args().folder
    data = read(folder)
    alphas, pressures = (sorted({key[k] for key in data}) for k in (0, 1))
    worst = [max(np.max(one[4]["error"] / abs(one[4]["G"])) for one in group) for group in data.values()]
    balance = max(np.max(abs(one[4]["energy_balance"])) for group in data.values() for one in group)
    print(
        f"{sum(map(len, data.values()))} files; error of G* at most {max(worst):.1e}, energy balance {balance:.0e}"
    )
    for alpha in alphas:
        report(alpha, pressures, {p: data[alpha, p] for p in pressures})
    check = folder / "stress-0.5-1e-3.h5"
    if check.exists():
        found = load(check)
        print("\nthree stresses, one packing, alpha = 0.5: G* (rows: stress)")
        for stress, row in zip(found["amplitude"], found["G"], strict=True):
            print(f"  {stress:.0e}: " + ", ".join(f"{G:.6g}" for G in row))


if __name__ == "__main__":
    main()
