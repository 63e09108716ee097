"""How P(p) of jammed states goes as p → 0: the table and the picture of run/figure paper3.

    .venv/bin/python -m papers.tables.pressures figures/paper3-quick --picture x.png

y of P(p) ~ p^(1/y − 1) below cuts at ½, ¼ and ⅛ of ⟨p⟩, and its limit: `low_end`.
"""

from dataclasses import dataclass

import numpy as np

import jampetsc
from benchmarks.common import saved_page
from jampetsc.analysis.jammed_samples import memory
from jampetsc.packing.potentials import EXPONENTS
from jampetsc.plots import style
from jampetsc.plots.jamming_plots import samples_of
from papers.programs import folder_and_picture

NAMES = {"random": "RAND", "shear": "QS"}
BINS = 4  # per decade of p,
SHOWN = 4  # with as many independent states at least
CUTS = (1 / 2, 1 / 4, 1 / 8)  # of the mean, below which the lower end of a density is looked at,
FEWEST_BELOW = 5  # and samples below the last


@dataclass(frozen=True, eq=False)
class LowEnd:
    """y of P(p) ~ p^(1/y − 1) as p → 0, from samples below C cuts, and its limit as the cut goes to 0."""

    cuts: np.ndarray  # (C,) falling
    counts: np.ndarray  # (C,) samples below
    y: np.ndarray  # (C,)
    error: np.ndarray  # (C,) one standard error
    limit: float
    limit_error: float

    @property
    def power(self) -> tuple[float, float]:
        """(1/y − 1 in the limit, its standard error)."""
        return 1.0 / self.limit - 1.0, self.limit_error / self.limit**2


def low_end(values, alpha=2.0, memory=1.0) -> LowEnd:
    """How the density of positive samples (S,) of a pressure goes to zero or diverges at its lower end.

    Below a cut c the likelihood of a power law is largest at y = ⟨ln(c/p)⟩ (Hill, Ann. Stat. 3, 1163 (1975)), with the
    error y/√n of n independent samples. A packing at φ has p ∝ (φ − φ_J)^(α − 1) above its own φ_J, and the density of
    φ_J is smooth: P ~ p^(1/y − 1) (1 + a c^(1/(α − 1)) + …), the law by which y goes to its limit over the CUTS of the
    mean. The best estimate below a cut is efficient, so that the covariance of two is the variance at the larger cut.
    memory: samples that count as one. nan where a cut has too few samples.
    """
    p = np.asarray(values, float)
    cuts = np.mean(p) * np.array(CUTS) if len(p) else np.full(len(CUTS), np.nan)
    counts = np.array([np.count_nonzero(p < cut) for cut in cuts])
    if counts[-1] < FEWEST_BELOW:
        nothing = np.full(len(CUTS), np.nan)
        return LowEnd(cuts, counts, nothing, nothing, np.nan, np.nan)
    y = np.array([np.mean(np.log(cut / p[p < cut])) for cut in cuts])
    apart = np.diff(counts, append=0) != 0  # of cuts with the same samples below one will do
    variance = y[-1] ** 2 * memory / counts[apart]
    inverse = np.linalg.inv(np.minimum.outer(variance, variance))
    design = np.column_stack((np.ones(len(variance)), (cuts[apart] / cuts[0]) ** (1.0 / (alpha - 1.0))))
    covariance = np.linalg.pinv(design.T @ inverse @ design)
    limit = covariance @ design.T @ inverse @ y[apart]
    return LowEnd(
        cuts, counts, y, y * np.sqrt(memory / counts), float(limit[0]), float(np.sqrt(covariance[0, 0]))
    )


@dataclass(frozen=True)
class Pressures:
    """Jammed states at one φ."""

    name: str  # RAND or QS
    potential: str
    n: int
    phi: float
    values: np.ndarray  # p of the jammed, (S,)
    memory: float  # of them count as one
    end: LowEnd

    @property
    def independent(self) -> float:
        """Independent states below the smallest cut."""
        return self.end.counts[-1] / self.memory


def pressures(table) -> list[Pressures]:
    """Of every potential, N, φ and protocol."""
    groups = {}
    for one in table.where(command="jam").results():
        a = one.attributes
        key = int(a["particle_count"]), str(a["potential"]), str(a["protocol"])
        groups.setdefault(key, []).append(one)
    found = []
    for (n, potential, protocol), results in sorted(groups.items()):
        (samples,) = samples_of(results)
        for phi, runs in sorted(samples.runs.items()):
            values = samples.pressures(phi)
            edge = CUTS[0] * np.mean(values) if len(values) else 0.0
            remembered = memory([((jammed == 1) & (p < edge)).astype(float) for jammed, p in runs])
            end = low_end(values, EXPONENTS[potential], remembered)
            found.append(Pressures(NAMES[protocol], potential, n, phi, values, remembered, end))
    return found


def print_table(found):
    """y at every cut and in the limit."""
    print(
        "| states | potential | N | φ | jammed | count as one | y below ⟨p⟩/2 | ⟨p⟩/4 | ⟨p⟩/8 | limit | 1/y − 1 |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|---|")
    for one in found:
        end = one.end
        cuts = [f"{y:.3f} ± {error:.3f}" for y, error in zip(end.y, end.error, strict=True)]
        limit = f"{end.limit:.3f} ± {end.limit_error:.3f}", "{:.3f} ± {:.3f}".format(*end.power)
        which = f"{one.name} | {one.potential} | {one.n} | {one.phi:g} | {len(one.values)} | {one.memory:.1f}"
        print(f"| {which} | {' | '.join([*cuts, *limit])} |")


def draw(found, path):
    """(a), (b) P(p) of harmonic and of Hertzian disks, both logarithmic; (c) y against the cut, with its limit at 0."""
    kinds = {(one.name, one.n): None for one in found}
    looks = dict(zip(kinds, zip(style.colours(len(kinds)), style.MARKERS, strict=False), strict=False))
    with saved_page(path) as page:
        axes = page.panels(2, 2, style.PAGE, 5.4)
        for ax, low, potential in zip(axes, axes[2:], EXPONENTS, strict=False):
            for one in (one for one in found if one.potential == potential and len(one.values)):
                colour, marker = looks[one.name, one.n]
                _draw_density(
                    ax, one, {"color": colour, "marker": marker, "label": f"{one.name}, $N={one.n}$"}
                )
                _draw_cuts(low, one, {"color": colour, "marker": marker})
            y = EXPONENTS[potential] - 1.0
            _draw_guide(ax, round(1.0 / y - 1.0, 12))
            low.axhline(y, color=style.GREY, lw=0.6, ls=":")
            low.annotate(r"$\alpha-1$", (0.06, y), color=style.GREY, ha="center", va="bottom")
            ax.set_title(potential, pad=3)


def _draw_density(ax, one, look):
    """P(p)⟨p⟩ against p/⟨p⟩ in bins of the same width in ln p, errors of counting."""
    x = one.values / one.values.mean()
    edges = 10.0 ** (
        np.arange(np.floor(np.log10(x.min()) * BINS), np.ceil(np.log10(x.max()) * BINS) + 1) / BINS
    )
    counts = np.histogram(x, edges)[0]
    some = counts >= SHOWN * one.memory
    unit = (len(x) * np.diff(edges))[some]
    middle = np.sqrt(edges[1:] * edges[:-1])[some]
    bars = np.sqrt(one.memory * counts[some]) / unit
    ax.errorbar(middle, counts[some] / unit, bars, ls="none", capsize=1, elinewidth=0.5, **look)
    ax.set(xscale="log", yscale="log", xlabel=r"$p/\langle p\rangle$", ylabel=r"$P(p)\,\langle p\rangle$")
    ax.set_ylim(3e-2, 30.0)
    ax.legend()


def _draw_guide(ax, power):
    x = np.array([1e-3, 0.3])
    ax.plot(x, 0.12 * (x / x[-1]) ** power, color=style.GREY, lw=0.8, ls="--")
    text = f"${style.power_text('p', power)}$" if power else "flat"
    ax.annotate(text, (x[-1], 0.08), color=style.GREY, ha="right", va="top")


def _draw_cuts(ax, one, look):
    end = one.end
    ax.set(xlabel=r"cut$/\langle p\rangle$; open: limit", ylabel="$y$", xlim=(-0.03, 0.55))
    if not np.isfinite(end.limit):
        return
    ax.errorbar(
        end.cuts / one.values.mean(), end.y, end.error, capsize=1.5, ls="none", elinewidth=0.6, **look
    )
    limit = {"color": look["color"], "marker": look["marker"], "mfc": "white"}
    ax.errorbar([0.0], [end.limit], [end.limit_error], capsize=1.5, ls="none", elinewidth=0.6, **limit)


def main():
    args = folder_and_picture(__doc__, "draw P(p) and y against the cut")
    found = pressures(jampetsc.load(args.folder))
    print_table(found)
    if args.picture:
        draw(found, args.picture)


if __name__ == "__main__":
    main()
