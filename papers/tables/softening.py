"""Where linear response ends: G* of oscillating shear against its strain (docs/howto/power_laws.md).

    .venv/bin/python -m papers.tables.softening figures/softening-quick          # after run/figure softening

Linear response is that of the smallest strain in a file. Means over packings with their errors; where response
ends, and the exponent of that strain in p, with those of a bootstrap over packings.
"""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from benchmarks.common import saved_page
from jampetsc.analysis.statistics import draws_of, mean_with_error
from jampetsc.io.reader import load
from jampetsc.plots import style
from papers.programs import folder_and_picture

CHANGED = 0.1  # of |G*|: what ends linear response
DRAWS = 1000
MOST = 0.75  # of packings: with fewer a point is not drawn, those that failed are the ones that rearrange


@dataclass(frozen=True)
class Packing:
    """One packing; arrays (strains,), nan where a point failed."""

    strain: np.ndarray
    G: np.ndarray
    third: np.ndarray  # |third harmonic|
    error: np.ndarray  # estimate of |ΔG*|
    balance: np.ndarray

    @property
    def ratio(self):
        """G* over that of linear response, storage and loss: (2, strains)."""
        return np.array([self.G.real / self.G[0].real, self.G.imag / self.G[0].imag])

    @property
    def end(self) -> float:
        """Smallest strain at which |G*| has changed by CHANGED of itself, between the points; nan if none has."""
        solved = np.isfinite(self.G)
        strain, off = self.strain[solved], abs(self.G[solved] / self.G[0] - 1.0)
        past = np.flatnonzero(off > CHANGED)
        if not len(past) or past[0] == 0:
            return np.nan
        n = past[0]
        share = (CHANGED - off[n - 1]) / (off[n] - off[n - 1])
        return float(strain[n - 1] * (strain[n] / strain[n - 1]) ** share)


def read(folder):
    """{p: [Packing, …]} of all oscillations of moving contacts in a folder and those below it."""
    found = defaultdict(list)
    for path in sorted(folder.rglob("oscillate-*.h5")):
        file = load(path)
        if file.attributes["contacts"] != "moving":
            continue
        balance = abs(file["energy_balance"][:, 0])
        G = np.where(np.isfinite(file["G"][:, 0]), file["G"][:, 0], complex(np.nan, np.nan))
        columns = (file["amplitude"], G, abs(file["harmonics"][:, 0, 0]), file["error"][:, 0], balance)
        if np.isfinite(columns[1][0]):
            found[float(f"{file.attributes['pressure']:.3g}")].append(Packing(*columns))
    return dict(sorted(found.items(), reverse=True))


def mean(values, digits=2):
    """Mean ± standard error."""
    middle, error = mean_with_error(values)
    return f"{middle:.{digits}f}" + (f" ± {error:.{digits}f}" if len(values) > 1 else "")


def bootstrap(values, statistic):
    """Standard error of statistic([values of each set]) when every set is drawn from itself."""
    sets = zip(*(one[draws_of(len(one), DRAWS, seed)] for seed, one in enumerate(values, 1)), strict=True)
    return float(np.std([statistic(some) for some in sets]))


def print_points(found):
    """Moduli, harmonics and what is known of errors at every strain."""
    print("| p | γ₀ k/p | packings | G′/G′(0) | G″/G″(0) | third harmonic, % | error, % | balance, % |")
    print("|---|---|---|---|---|---|---|---|")
    for p, packings in found.items():
        for a, strain in enumerate(packings[0].strain):
            solved = [one for one in packings if np.isfinite(one.G[a])]
            if not solved:
                print(f"| {p:g} | {strain / p:.2g} | 0 of {len(packings)} | | | | | |")
                continue
            storage, loss = np.array([one.ratio[:, a] for one in solved]).T
            columns = [(one.third[a], one.error[a] / abs(one.G[a]), one.balance[a]) for one in solved]
            share = 100.0 * np.median(columns, axis=0)
            told = " | ".join(f"{one:.2g}" for one in share)
            number = f"{len(solved)} of {len(packings)}"
            print(f"| {p:g} | {strain / p:.2g} | {number} | {mean(storage)} | {mean(loss)} | {told} |")


def print_end(found):
    """Strain at which |G*| has changed by CHANGED, and its exponent in p."""
    ends = {p: np.array([one.end for one in packings]) for p, packings in found.items()}
    ends = {p: values[np.isfinite(values)] for p, values in ends.items()}
    print(
        f"\n| p | packings | strain at which G* has changed by {100 * CHANGED:.0f} %, k/p: median | from | to |"
    )
    print("|---|---|---|---|---|")
    for p, values in ends.items():
        if len(values):
            error = bootstrap([values / p], lambda sets: np.median(sets[0]))
            middle = f"{np.median(values) / p:.2f} ± {error:.2f}"
            print(f"| {p:g} | {len(values)} | {middle} | {min(values) / p:.2f} | {max(values) / p:.2f} |")
    if len(ends) < 2 or min(map(len, ends.values())) < 2:
        return
    logs = np.log(list(ends))

    def exponent(sets):
        return np.polyfit(logs, [np.mean(np.log(one)) for one in sets], 1)[0]

    values = list(ends.values())
    print(f"\nThat strain ~ p^x, x = {exponent(values):.2f} ± {bootstrap(values, exponent):.2f}")


def draw(found, path):
    """(a) G' and (b) G'' over those of linear response against γ₀ k/p, means with standard errors."""
    with saved_page(path) as page:
        axes = page.panels(1, 2, style.PAGE, 2.7)
        for (p, packings), colour, marker in zip(
            found.items(), style.colours(len(found)), style.MARKERS, strict=False
        ):
            ratios = np.array([one.ratio for one in packings])
            drawn = np.flatnonzero(np.isfinite(ratios[:, 0]).sum(axis=0) >= MOST * len(packings))
            solved = (ratios[np.isfinite(ratios[:, 0, row]), :, row] for row in drawn)
            means = np.array([mean_with_error(some) for some in solved])  # (strains, 2, parts)
            middle, error = means.reshape(-1, 2, 2).transpose(1, 2, 0)
            look = {"fmt": f"-{marker}", "color": colour, "capsize": 1.5, "label": f"$p = {p:g}$"}
            for ax, value, bar in zip(axes, middle, error, strict=True):
                ax.errorbar(packings[0].strain[drawn] / p, value, bar, **look)
        for ax, name in zip(axes, (style.STORAGE, style.LOSS), strict=True):
            ax.set_xscale("log")
            ax.axhline(1.0, color=style.GREY, lw=0.5, ls=":")
            ax.set_xlabel(r"$\gamma_0 k/p$")
            ax.set_ylabel(f"{name}$(\\gamma_0)$/{name}$(0)$")
        axes[0].legend()


def main():
    args = folder_and_picture(__doc__, "draw G* against the strain")
    found = read(args.folder)
    print_points(found)
    print_end(found)
    if args.picture:
        draw(found, args.picture)


if __name__ == "__main__":
    main()
