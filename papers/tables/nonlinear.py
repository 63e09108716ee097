"""Power-law damping as it is, beside BT's equivalent linear damping (docs/theory/linear_response.md).

    .venv/bin/python -m papers.tables.nonlinear figures/bt-nonlinear-quick       # after run/figure bt-nonlinear

Exponents of G* in ω and σ are those of a plane through ln G* of a regime, with an offset for each packing; errors are
those of a bootstrap over packings. Beside what was measured stands what two linear dampings give at the same points:

BT               BT 25, 26: the motion of a contact is u₀ = σ/k, a spring's under the force of the stress
self-consistent  u₀ = γ₀ |Δu| with γ₀ = σ/|G*| and the rms |Δu| that dissipates G'', as the linear packing itself moves

effective        Ω with which the linear packing has the measured G'': what a single dashpot would have to be. Its
                 exponents are free of the bends of G*(Ω); G' at that Ω tells whether one dashpot does for both moduli

Motions of slow shear grow as |Δu| ~ p^(−1/4), those at Ω as Ω^(−1/4), so that the second has Ω ∝ X p^(3(1−α)/4) in the
quasistatic and Ω ∝ X^(4/(1+3α)) in the critical regime, with X = ω^α σ^(α−1); BT have Ω ∝ X in both.
"""

from collections import defaultdict
from dataclasses import dataclass
from functools import partial

import numpy as np
from scipy.optimize import brentq
from scipy.special import gamma

from benchmarks.common import saved_page
from jampetsc.analysis.statistics import draws_of
from jampetsc.io.reader import load
from jampetsc.laws.equivalent_damping import EquivalentDamping
from jampetsc.minimisation.sizes import radii_of
from jampetsc.plots import style
from papers.programs import folder_and_picture

DRAWS = 1000
PARTS = {"G'": np.real, "G''": np.imag}
QUASISTATIC = 0.1  # largest G''/G' there
CRITICAL = (2.0, 0.2)  # G' from this many times G₀ up to this many k
COLUMNS = ("measured", "BT", "self-consistent")


@dataclass(frozen=True)
class Packing:
    """One packing under one power law; arrays (points,)."""

    logs: np.ndarray  # (points, 2) ln ω, ln σ
    X: np.ndarray  # ω^α σ^(α−1)
    G: np.ndarray  # (3, points) of COLUMNS
    Omega: np.ndarray  # (3, points) of the linear packing: effective, BT's, self-consistent
    storage: np.ndarray  # G' of the linear packing at the effective Ω
    G0: float
    file: object

    def inside(self, regime):
        """Mask of the points of a regime, by the measured G*."""
        G = self.G[0]
        if regime == "quasistatic":
            return G.imag < QUASISTATIC * G.real
        return (G.real > CRITICAL[0] * self.G0) & (G.real < CRITICAL[1])


def read(folder, sweeps):
    """{α: {p: [Packing, …]}} of the oscillations in a folder, with the sweeps of another."""
    found = defaultdict(lambda: defaultdict(list))
    linear = {sweep.attributes["packing"]: sweep for sweep in map(load, sorted(sweeps.glob("sweep-*.h5")))}
    for path in sorted(folder.glob("oscillate-*.h5")):
        measured = load(path)
        packing = measured.attributes["packing"]
        sweep = linear[packing]
        told = measured.attributes
        alpha = float(told["alpha"])
        area = np.sum(np.pi * radii_of("bidisperse", told["particle_count"]) ** 2) / told["phi"]
        contacts = 0.5 * told["coordination"] * (told["particle_count"] - told["rattlers"]) / area
        omega, stress = (
            grid.ravel() for grid in np.meshgrid(measured["omega"], measured["amplitude"], indexing="xy")
        )
        G, spectrum = measured["G"].ravel(), sweep.spectrum
        Omega = (
            effective(spectrum, G),
            np.concatenate(
                [
                    EquivalentDamping(alpha, float(s)).frequency(measured["omega"])
                    for s in measured["amplitude"]
                ]
            ),
            self_consistent(spectrum, contacts, omega, stress, alpha),
        )
        found[alpha][float(f"{told['pressure']:.3g}")].append(
            Packing(
                np.log(np.column_stack((omega, stress))),
                omega**alpha * stress ** (alpha - 1.0),
                np.array([G, *(spectrum.modulus(one) for one in Omega[1:])]),
                np.array(Omega),
                spectrum.modulus(Omega[0]).real,
                spectrum.G0,
                measured,
            )
        )
    return found


def self_consistent(spectrum, contacts_per_area, omega, stress, alpha):
    """Ω with one linear dashpot for all contacts that dissipates what they do at the rms of their own motion."""
    factor = 2.0 / np.sqrt(np.pi) * gamma(1 + alpha / 2) / gamma(1.5 + alpha / 2)

    def excess(log_Omega, w, s):
        Omega = np.exp(log_Omega)
        G = spectrum.modulus(Omega)
        motion = s / abs(G) * np.sqrt(G.imag / (Omega * contacts_per_area))
        return np.log(w * factor * (motion * w) ** (alpha - 1)) - log_Omega

    pairs = zip(omega, stress, strict=True)
    return np.exp([brentq(excess, -60.0, 40.0, args=pair) for pair in pairs])


def effective(spectrum, G):
    """Ω at which the linear packing has this G''."""

    def excess(log_Omega, loss):
        return np.log(spectrum.modulus(np.exp(log_Omega)).imag / loss)

    return np.exp([brentq(excess, -60.0, 5.0, args=(loss,)) for loss in G.imag])


def slopes(sets):
    """Slopes (columns of x,) of one plane through the points [(x, y), …] of all packings, each with its offset."""
    x = np.concatenate([x - x.mean(axis=0) for x, _ in sets])
    y = np.concatenate([y - y.mean() for _, y in sets])
    return np.linalg.lstsq(x, y, rcond=None)[0]


def bootstrap(sets, statistic):
    """(value, standard error) of statistic(list of packings)."""
    draws = [statistic([sets[k] for k in row]) for row in draws_of(len(sets), DRAWS)]
    return statistic(sets), np.std(draws, axis=0)


def exponents(packings, value, regime, along=lambda one: one.logs):
    """((E,) exponents, their errors, points) of value(packing) (points,) in a regime, by default in ω and σ.

    along   (points, E) logarithms of what the exponents are in
    """
    sets = []
    for one in packings:
        inside = one.inside(regime)
        if np.count_nonzero(inside) >= 3 and np.ptp(one.logs[inside, 0]) > 1.0:
            sets.append((along(one)[inside], np.log(value(one)[inside])))
    if len(sets) < 2:
        return None
    return *bootstrap(sets, slopes), sum(len(y) for _, y in sets)


def prefactor_exponent(data, value):
    """(exponent in p, its error) of value(packing) (points,) over X at the least X, {p: [Packing, …]}, quasistatic."""
    sets = []
    for row in zip(*data.values(), strict=False):
        prefactors = [(value(one) / one.X)[np.argmin(one.X)] for one in row]
        sets.append((np.log(list(data))[:, None], np.log(prefactors)))
    (slope,), (error,) = bootstrap(sets, slopes)
    return slope, error


def expected(alpha, regime):
    """(BT's, self-consistent) exponent of G* in X, in the limit p → 0."""
    return (1.0, 1.0) if regime == "quasistatic" else (0.5, 2.0 / (1.0 + 3.0 * alpha))


def print_exponents(alpha, data):
    """Exponents in ω and σ of all regimes and pressures."""
    print(f"\nalpha = {alpha:g}")
    print(
        "| regime | part | p | in | measured | BT's damping | self-consistent | BT 27-29 | p → 0 | points |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for regime, names in (("quasistatic", ("G''", "Ω")), ("critical", ("G'", "G''", "Ω"))):
        for name in names:
            for p, packings in sorted(data.items()):

                def value(one, column, name=name):
                    return one.Omega[column] if name == "Ω" else PARTS[name](one.G[column])

                fits = [exponents(packings, partial(value, column=c), regime) for c in range(len(COLUMNS))]
                if None in fits:
                    continue
                for axis, (symbol, per_X) in enumerate((("ω", alpha), ("σ", alpha - 1.0))):
                    cells = [f"{values[axis]:.3f} ± {errors[axis]:.3f}" for values, errors, _ in fits]
                    twice = 2.0 if name == "Ω" and regime == "critical" else 1.0  # there G* ∝ Ω^½
                    cells += [f"{twice * per_X * x:.3f}" for x in expected(alpha, regime)]
                    print(f"| {regime} | {name} | {p:g} | {symbol} | {' | '.join(cells)} | {fits[0][2]} |")


def print_prefactors(alpha, data):
    """Quasistatic prefactors against p, and measured over predicted, medians over points and packings."""
    print("quasistatic G'' against p: exponent of the prefactor G''/X")
    for column, motion in enumerate((0.75 * (1 - alpha), 0.0, 0.75 * (1 - alpha))):
        told = []
        for theory, value in (
            (motion - 0.5, lambda one, c: one.G[c].imag),
            (motion, lambda one, c: one.Omega[c]),
        ):
            slope, error = prefactor_exponent(data, partial(value, c=column))
            told.append(f"{slope:.3f} ± {error:.3f}, as p → 0 {theory:.3f}")
        print(f"  {COLUMNS[column]}: {told[0]}; of Ω/X: {told[1]}")
    for p, packings in sorted(data.items()):
        off = [(one.storage / one.G[0].real)[one.inside("critical")] for one in packings]
        if sum(map(len, off)):
            print(
                f"  p = {p:g}, critical: G' of the linear packing where it has the measured G'', over the measured G', "
                f"median {np.median(np.concatenate(off)):.3f}"
            )
    for column in (1, 2):
        print(f"measured over {COLUMNS[column]}, median (least to largest)")
        for p, packings in sorted(data.items()):
            cells = []
            for regime, names in (("quasistatic", ("G''",)), ("critical", ("G'", "G''"))):
                for name in names:
                    ratios = np.concatenate(
                        [PARTS[name](one.G[0]) / PARTS[name](one.G[column]) for one in packings]
                    )
                    kept = ratios[np.concatenate([one.inside(regime) for one in packings])]
                    if len(kept):
                        told = f"{np.median(kept):.2f} ({kept.min():.2f} to {kept.max():.2f})"
                        cells.append(f"{regime} {name} {told}")
            print(f"  p = {p:g}: " + ", ".join(cells))


def print_certainty(alpha, data, finer):
    """Harmonics, estimated errors, softening, energy, and what more steps change."""
    for regime in ("quasistatic", "critical"):
        kept = {
            name: [] for name in ("error", "error of G''", "softening", "energy balance", "third harmonic")
        }
        for one in (one for packings in data.values() for one in packings):
            inside = one.inside(regime)
            size = abs(one.G[0])
            kept["error"].append((one.file["error"].ravel() / size)[inside])
            kept["error of G''"].append((one.file["error"].ravel() / one.G[0].imag)[inside])
            kept["softening"].append((one.file["regularisation_effect"].ravel() / size)[inside])
            kept["energy balance"].append(abs(one.file["energy_balance"].ravel())[inside])
            kept["third harmonic"].append(abs(one.file["harmonics"][..., 0]).ravel()[inside])
        if not sum(map(len, kept["error"])):
            continue
        print(
            f"{regime}, largest: "
            + ", ".join(f"{name} {np.concatenate(values).max():.1e}" for name, values in kept.items())
        )
    for p, packings in finer.items():
        for fine, coarse in zip(packings, data[p], strict=False):
            for regime, name in (("quasistatic", "G''"), ("critical", "G'"), ("critical", "G''")):
                inside = fine.inside(regime)
                if np.count_nonzero(inside) < 3:
                    continue
                sets = [(one.logs[inside], np.log(PARTS[name](one.G[0][inside]))) for one in (coarse, fine)]
                few, many = (slopes([one]) for one in sets)
                worst = abs(np.exp(sets[0][1] - sets[1][1]) - 1).max()
                print(
                    f"{coarse.file.attributes['steps']} → {fine.file.attributes['steps']} steps, p = {p:g}, {regime} "
                    f"{name}: {100 * worst:.2f} % at most, exponents {few.round(4)} → {many.round(4)}"
                )


def draw(data, path):
    """Effective Ω against X, a panel for each α < 1, the lowest pressure in each: measured, BT, self-consistent."""
    exponents = [alpha for alpha in sorted(data) if alpha < 1.0]
    with saved_page(path) as page:
        axes = np.ravel(page.panels(1, len(exponents), style.PAGE, 2.7))
        for ax, alpha in zip(axes, exponents, strict=True):
            p = min(data[alpha])
            for n, one in enumerate(data[alpha][p]):
                order = np.argsort(one.X)
                effective, theirs, ours = (Omega[order] for Omega in one.Omega)
                names = ("measured", "BT 25, 26", "self-consistent") if n == 0 else (None,) * 3
                ax.loglog(
                    one.X[order], effective, "o", mfc="none", mew=0.5, ms=2.5, color="k", label=names[0]
                )
                ax.loglog(one.X[order], theirs, "--", color=style.GREY, label=names[1])
                ax.loglog(one.X[order], ours, "-", lw=0.6, color=style.colours(2)[1], label=names[2])
            ax.set_xlabel(rf"$X = (\omega\tau_1)^\alpha (\sigma/k)^{{\alpha-1}}$,   $\alpha = {alpha:.2g}$")
            ax.set_ylabel(r"$\Omega\,\tau_1$")
            ax.legend()


def main():
    args = folder_and_picture(__doc__, "draw the effective frequency")
    folder = args.folder
    data, finer = read(folder, folder), read(folder / "steps", folder)
    for alpha, packings in sorted(data.items()):
        print_exponents(alpha, packings)
        print_prefactors(alpha, packings)
        print_certainty(alpha, packings, finer.get(alpha, {}))
    if args.picture:
        draw(data, args.picture)


if __name__ == "__main__":
    main()
