"""φ_J of packings that were cooled, and of such as are sheared: the tables and the picture of run/figure paper1.

    .venv/bin/python -m papers.tables.densities figures/paper1-quick --picture x.png

Means over samples with their standard errors. Of sheared and of random states φ_J and its width are those of the step
of f(φ), the share that jams, which is the distribution of their φ_J.
"""

from dataclasses import dataclass

import numpy as np

import jampetsc
from benchmarks.common import saved_page
from jampetsc.analysis.correlated_series import Average, mean_of_averages
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.jamming.stepwise_shear import ENERGY_CUT
from jampetsc.plots import style
from jampetsc.plots.jamming_plots import samples_of
from papers.programs import folder_and_picture

MIXED, SEPARATED = "mixed", "separated"
DECADES = np.arange(-44.0, 0.5, 1.0)  # of U/N in the picture
LOOSE = 0.4  # error of a ratio of ⟨p⟩ from which on few states jam, and it tells nothing
STEEP = 0.02  # share of ones, or of zeros, below which a point tells nothing of where the step is


def jamming_step(phi, shares) -> tuple:
    """(φ where f = ½, width w, their standard errors) of f(φ) = Φ((φ − φ½)/w), Φ the normal distribution.

    f is the share of φ_J that lie below φ, w so the standard deviation of φ_J. phi (M,), shares: M of `Share`; those
    that are 0 or 1 within STEEP tell nothing and are left out; all nan where fewer than two are left.
    """
    from scipy.special import ndtri

    value = np.array([share.value for share in shares])
    told = (value > STEEP) & (value < 1.0 - STEEP)
    if np.count_nonzero(told) < 2:
        return (np.nan,) * 4
    x, value = np.asarray(phi, float)[told], value[told]
    z = ndtri(value)
    half = np.array([0.5 * (share.high - share.low) for share in shares])[told]
    error = half * np.sqrt(2.0 * np.pi) * np.exp(0.5 * z**2)
    (slope, level), covariance = np.polyfit(x - x.mean(), z, 1, w=1.0 / error, cov="unscaled")
    # derivatives of φ½ and w by slope and level
    by = np.array([[level / slope**2, -1.0 / slope], [-1.0 / slope**2, 0.0]])
    errors = np.sqrt(np.diag(by @ covariance @ by.T))
    return float(x.mean() - level / slope), float(1.0 / slope), float(errors[0]), float(errors[1])


@dataclass(frozen=True)
class Densities:
    """φ_J of packings cooled at a rate from one kind of liquid, some of them sheared before their φ_J is looked for."""

    n: int
    rate: float
    start: str
    strain: float
    phi_J: np.ndarray
    segregation: np.ndarray

    @property
    def mean(self):
        """(⟨φ_J⟩, standard error)."""
        return mean(self.phi_J)

    @property
    def width(self):
        """(standard deviation of φ_J, standard error)."""
        deviation = np.std(self.phi_J, ddof=1) if len(self.phi_J) > 1 else np.nan
        return deviation, deviation / np.sqrt(2.0 * max(len(self.phi_J) - 1, 1))


@dataclass(frozen=True)
class Step:
    """f(φ) of random or of sheared states."""

    name: str  # RAND or QS
    n: int
    start: str
    phi: np.ndarray
    shares: list  # of `analysis.jammed_samples.Share`
    pressure: np.ndarray  # (φ, 2) mean over all states, 0 where they are not jammed, and its standard error

    @property
    def fit(self):
        """(φ½, w, their standard errors), see `jamming_step`."""
        return jamming_step(self.phi, self.shares)


def mean(values):
    """(mean, error) of independent values; nan for none."""
    return tuple(map(float, mean_with_error(values))) if len(values) else (np.nan, np.nan)


def start_of(result):
    """Whether the disks of a file were separated by size where they started."""
    return SEPARATED if result.attributes.get("separated", False) else MIXED


def of_protocol(table, name):
    """The files of a protocol of `jam` in a study."""
    return [one for one in table.where(command="jam").results() if one.attributes["protocol"] == name]


def densities(table) -> list[Densities]:
    """Those that were cooled, by N, start, strain and rate."""
    found = []
    for result in of_protocol(table, "compress"):
        a, known = result.attributes, np.isfinite(result["phi_J"])
        found.append(
            Densities(
                int(a["particle_count"]), float(a["cooling_rate"]), start_of(result), float(a.get("strain", 0.0)),
                result["phi_J"][known], result["segregation"][known],
            )
        )  # fmt: skip
    return sorted(found, key=lambda one: (one.n, one.start, one.strain, one.rate))


def steps(table, step=None) -> list[Step]:
    """RAND and QS by N and start; step: Δγ of QS, by default the largest in the study."""
    sheared = of_protocol(table, "shear")
    step = step or max((one.attributes["step"] for one in sheared), default=None)
    sheared = [one for one in sheared if one.attributes["step"] == step]
    groups = {}
    for name, results in (("RAND", of_protocol(table, "random")), ("QS", sheared)):
        for one in results:
            groups.setdefault((name, int(one.attributes["particle_count"]), start_of(one)), []).append(one)
    found = []
    for key, results in sorted(groups.items()):
        (samples,) = samples_of(results)
        phi = sorted(samples.runs)
        pressures = [mean_pressure(samples.runs[one]) for one in phi]
        found.append(Step(*key, np.array(phi), [samples.share(one) for one in phi], np.array(pressures)))
    return found


def mean_pressure(runs):
    """(⟨p⟩, standard error) of runs [(jammed (T,), p (T,)), …], p = 0 of what is not jammed."""
    series = [np.where(jammed == 1, p, 0.0) for jammed, p in runs]
    if all(len(one) == 1 for one in series):
        return mean(np.concatenate(series))
    averages = [Average.of(one) for one in series]
    return mean_of_averages(averages)


def energies(table):
    """U/(N k_e) of all random and sheared states, (S,)."""
    some = [one["energy"] for name in ("random", "shear") for one in of_protocol(table, name)]
    # as double: what is kept is single, whose least is the lowest bin
    some = np.concatenate([*some, np.zeros(0)])
    return some[np.isfinite(some)]


def pm(value, error, digits=5):
    """Mean ± error."""
    return f"{value:.{digits}f} ± {error:.{digits}f}" if np.isfinite(error) else f"{value:.{digits}f}"


def print_tables(table):
    """φ_J, its width and the segregation of what was cooled; the steps of f(φ)."""
    print("| N | liquid | cooled at | sheared by | samples | φ_J | width of φ_J | segregation |")
    print("|---|---|---|---|---|---|---|---|")
    for one in densities(table):
        numbers = pm(*one.mean), pm(*one.width), pm(*mean(one.segregation), 3)
        which = f"{one.n} | {one.start} | {one.rate:g} | {one.strain:g} | {len(one.phi_J)}"
        print(f"| {which} | {' | '.join(numbers)} |")
    print("\n| states | N | start | φ where f = ½ | width of φ_J |\n|---|---|---|---|---|")
    for one in steps(table):
        middle, width, *errors = one.fit
        print(f"| {one.name} | {one.n} | {one.start} | {pm(middle, errors[0])} | {pm(width, errors[1])} |")


def draw(table, path):
    """φ_J by rate, its distributions, f(φ), ⟨p⟩ from two starts, widths against N, and a histogram of ln U/N."""
    cold, jammed = densities(table), steps(table)
    least = min((one.n for one in cold), default=0)
    small = [one for one in cold if one.n == least]
    with saved_page(path) as page:
        axes = page.panels(3, 2, style.PAGE, 7.8)
        _draw_rates(axes[0], small)
        _draw_distributions(axes[1], small)
        _draw_steps(axes[2], jammed)
        _draw_starts(axes[3], jammed)
        _draw_widths(axes[4], cold, jammed)
        _draw_energies(axes[5], energies(table))


def _look(one):
    """Colour, line and marker by the start, and by whether it was sheared."""
    fill = {} if one.strain else {"mfc": "white"}
    dark, light = style.colours(2)
    return {"color": dark if one.start == MIXED else light, "marker": "s" if one.strain else "o", **fill}


def _told(one):
    return one.start + (f", then sheared by {one.strain:g}" if one.strain else "")


def _draw_rates(ax, cold):
    groups = {}
    for one in cold:
        groups.setdefault((one.start, one.strain), []).append(one)
    for some in groups.values():
        middle, error = np.transpose([one.mean for one in some])
        ax.errorbar(
            [one.rate for one in some], middle, error, capsize=1.5, label=_told(some[0]), **_look(some[0])
        )
    ax.set(xscale="log", xlabel=r"decrease of $\ln T$ per sweep", ylabel=r"$\langle\phi_J\rangle$")
    if cold:
        ax.legend(title=f"$N={cold[0].n}$")


def _draw_distributions(ax, cold):
    """The share of samples with less φ_J: those cooled most slowly, and those that were sheared."""
    chosen = {(one.start, one.strain): one for one in reversed(cold)}
    for one in chosen.values():
        values, look = np.sort(one.phi_J), _look(one)
        share = (np.arange(len(values)) + 0.5) / max(len(values), 1)
        line = "-" if one.strain else "--"
        ax.plot(values, share, ls=line, color=look["color"], label=f"{_told(one)} ({one.rate:g})")
    ax.set(xlabel=r"$\phi_J$", ylabel=r"share with less $\phi_J$")
    ax.set_ylim(-0.04, 1.6)  # with room for the legend
    ax.set_yticks(np.linspace(0.0, 1.0, 6))
    ax.legend(title="cooled at (rate)", fontsize=7.5, loc="upper left")


def _draw_steps(ax, jammed):
    """f(φ) of QS from both starts, points about the step of the mixed one; of RAND the steps alone."""
    from scipy.special import ndtr

    sizes = sorted({one.n for one in jammed})
    for one in jammed:
        colour = style.colours(len(sizes))[sizes.index(one.n)]
        look, label = _look_of_states(one), style.hidden(f"{_kind(one)}, N = {one.n}")
        if one.name == "QS":
            value, low, high = np.transpose([(share.value, share.low, share.high) for share in one.shares])
            inside = (value > STEEP) & (value < 1.0 - STEEP)
            bars = np.array([value - low, high - value])[:, inside]
            points = {"ms": 4, "capsize": 1.5, "elinewidth": 0.6, "color": colour}
            ax.errorbar(one.phi[inside], value[inside], bars, label=label, **points | look | {"ls": "none"})
        middle, width, *_ = one.fit
        if one.start == MIXED and np.isfinite(width):
            phi = np.linspace(one.phi[0], one.phi[-1], 200)
            ax.plot(phi, ndtr((phi - middle) / width), color=colour, ls=look["ls"], lw=0.9, label=label)
    ax.set(xlabel=r"$\phi$", ylabel=r"$f(\phi)$")
    ax.set_ylim(-0.04, 1.6)  # with room for the legend
    ax.set_yticks(np.linspace(0.0, 1.0, 6))
    handles = [
        style.entry(f"$N={n}$", colour) for n, colour in zip(sizes, style.colours(len(sizes)), strict=True)
    ]
    looks = {_kind(one): _look_of_states(one) for one in jammed}
    handles += [style.entry(words, **look) for words, look in sorted(looks.items())]
    ax.legend(handles=handles, fontsize=7.5, loc="upper left", ncol=2)


def _kind(one):
    return one.name + (", separated" if one.start == SEPARATED else "")


def _look_of_states(one):
    """Marker and line by ensemble and start."""
    if one.name == "RAND":
        return {"ls": "--"}
    return (
        {"marker": "o", "ls": "none", "mfc": "white"}
        if one.start == SEPARATED
        else {"marker": "o", "ls": "-"}
    )


def _draw_starts(ax, jammed):
    """⟨p⟩ along shear from separated over that from mixed sizes, at every φ where its error is below LOOSE."""
    sheared = {(one.n, one.start): one for one in jammed if one.name == "QS"}
    sizes = sorted({n for n, _ in sheared if (n, MIXED) in sheared and (n, SEPARATED) in sheared})
    for n, colour, marker in zip(sizes, style.colours(len(sizes)), style.MARKERS, strict=False):
        phi, value, error = ratios(sheared[n, SEPARATED], sheared[n, MIXED])
        close = error < LOOSE
        phi, value, error = phi[close], value[close], error[close]
        ax.errorbar(phi, value, error, color=colour, marker=marker, capsize=1.5, label=f"$N={n}$")
    ax.axhline(1.0, color=style.GREY, lw=0.6, ls=":")
    ax.set(xlabel=r"$\phi$", ylabel=r"$\langle p\rangle$, separated over mixed")
    ax.set_ylim(0.0, 1.05 * (1.0 + LOOSE) + 0.2)
    if sizes:
        ax.legend(title=f"QS, errors below {LOOSE:g}", loc="lower right", ncol=2)


def ratios(one, other):
    """(φ, ⟨p⟩ of one ensemble over that of another, its standard error), where both are jammed at times."""
    phi, mine, theirs = np.intersect1d(one.phi, other.phi, return_indices=True)
    (p, dp), (q, dq) = one.pressure[mine].T, other.pressure[theirs].T
    known = (p > 0) & (q > 0) & (dp > 0) & (dq > 0)
    value = p[known] / q[known]
    return phi[known], value, value * np.hypot(dp[known] / p[known], dq[known] / q[known])


def _draw_widths(ax, cold, jammed):
    lines = {}
    for one in cold:
        if one.start == MIXED and not one.strain:
            lines.setdefault(f"cooled at {one.rate:g}", []).append((one.n, *one.width))
    for one in jammed:
        if one.start == MIXED:
            lines.setdefault(one.name, []).append((one.n, *one.fit[1::2]))
    points = {label: [point for point in some if np.isfinite(point).all()] for label, some in lines.items()}
    points = {label: some for label, some in points.items() if some}
    for (label, some), colour, marker in zip(
        points.items(), style.colours(len(points)), style.MARKERS, strict=False
    ):
        n, width, error = np.transpose(some)
        ax.errorbar(n, width, error, color=colour, marker=marker, capsize=1.5, label=label)
    ax.set(xscale="log", yscale="log", xlabel="$N$", ylabel=r"width of the distribution of $\phi_J$")
    if points:
        ax.legend()


def _draw_energies(ax, energy):
    ax.hist(np.log10(np.maximum(energy, 10.0 ** DECADES[0])), DECADES, color=style.colours(1)[0])
    ax.axvline(np.log10(ENERGY_CUT), color=style.GREY, lw=0.8, ls=":")
    ax.set(yscale="log", xlabel=r"$\log_{10}\,U/(N k_e)$; lowest bin: and below", ylabel="states")


def main():
    args = folder_and_picture(__doc__, "draw φ_J by rate, f(φ), widths and energies")
    table = jampetsc.load(args.folder)
    print_tables(table)
    if args.picture:
        draw(table, args.picture)


if __name__ == "__main__":
    main()
