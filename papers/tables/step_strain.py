"""Where t^-1/2 meets finite strain: G(t, γ) after step strains beside the smallest strain (docs/papers/results.md).

    .venv/bin/python -m papers.tables.step_strain figures/step-strain-quick      # after run/figure step-strain

Linear response is that of the smallest strain in a file. A strain departs from it at the first time at which G has
changed by CHANGED of itself. Medians over packings.
"""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

from benchmarks.common import saved_page
from jampetsc.io.reader import load
from jampetsc.plots import style
from jampetsc.plots.page import draw_guide
from papers.programs import folder_and_picture

CHANGED = 0.1  # of G(t): what counts as a departure from linear response
SLOPE = -0.5


@dataclass(frozen=True)
class Relaxations:
    """One packing; S strains, T times."""

    strain: np.ndarray  # (S,)
    time: np.ndarray  # (T,) in τ₁
    G: np.ndarray  # (S, T) in k
    error: np.ndarray  # (S, T)
    changed: np.ndarray  # (S,) contacts that differ at the end

    def departure(self, number: int) -> float:
        """First time at which G of a strain has changed by CHANGED; inf if it never has."""
        off = np.flatnonzero(abs(self.G[number] / self.G[0] - 1.0) > CHANGED)
        return float(self.time[off[0]]) if len(off) else np.inf

    def linear_slope(self, time: float) -> float:
        """d ln G/d ln t of linear response at a time."""
        shown = self.G[0] > 0.0
        log = np.log(self.time[shown])
        return float(np.interp(np.log(time), log, np.gradient(np.log(self.G[0][shown]), log)))


def read(folder):
    """{p: [Relaxations, …]} of all step strains in a folder and those below it."""
    found = defaultdict(list)
    for path in sorted(folder.rglob("relax-*.h5")):
        file = load(path)
        a = file.attributes
        changed = (file["contacts_opened"] + file["contacts_closed"])[:, -1]
        columns = (
            file["strain"],
            file["time"] / a["tau1"],
            file["G"] / a["k"],
            file["error"] / a["k"],
            changed,
        )
        found[float(f"{a['pressure']:.3g}")].append(Relaxations(*columns))
    return dict(sorted(found.items(), reverse=True))


def departures(packings, number: int):
    """Times at which the packings depart at a strain, (packings,) in τ₁, inf where one never does."""
    return np.array([packing.departure(number) for packing in packings])


def print_points(found):
    """When each strain departs from linear response, how steep that is there, where G ends, contacts and errors."""
    print(
        "| p | γ k/p | packings | departs at t/τ₁ | slope of linear G there | G/G_linear at the end |", end=""
    )
    print(" contacts changed | error of G, % of G(0+) |")
    print("|---|---|---|---|---|---|---|---|")
    for p, packings in found.items():
        for number, strain in enumerate(packings[0].strain):
            times = departures(packings, number)
            time = np.median(times)
            slope, when = "", "never"
            if np.isfinite(time):
                slopes = [packing.linear_slope(time) for packing in packings]
                slope, when = f"{np.median(slopes):.2f}", f"{time:.3g}"
            end = np.median([packing.G[number, -1] / packing.G[0, -1] for packing in packings])
            changed = np.median([packing.changed[number] for packing in packings])
            error = np.max([packing.error[number].max() / packing.G[number, 0] for packing in packings])
            columns = (
                f"{p:g}",
                f"{strain / p:.3g}",
                f"{len(packings)}",
                when,
                slope,
                f"{end:.2f}",
                f"{changed:g}",
            )
            print(f"| {' | '.join(columns)} | {100 * error:.2g} |")


def draw(found, path):
    """(a) G(t) at the lowest pressure; (b) over linear response at every pressure: medians over packings."""
    with saved_page(path) as page:
        left, right = page.panels(1, 2, style.PAGE, 2.7)
        for (p, packings), dash in zip(
            reversed(found.items()), ("-", style.DASHED, style.DOTTED), strict=False
        ):
            count = min(len(packing.time) for packing in packings)
            time, strains = packings[0].time[:count], packings[0].strain
            every = np.array([packing.G[:, :count] for packing in packings])
            ratios = np.median(every / every[:, :1], axis=0)
            for number, (strain, colour) in enumerate(zip(strains, style.colours(len(strains)), strict=True)):
                look = {"color": colour, "linestyle": dash}
                if number:
                    right.plot(time * p, ratios[number], **look)
                if dash == "-":
                    G = np.median(every[:, number], axis=0)
                    name = rf"$\gamma = {strain / p:.3g}\,p/k$"
                    left.plot(time, np.where(G > 0.0, G, np.nan), **look, label=name)
            right.plot([], [], color=style.GREY, linestyle=dash, label=f"$p = {p:g}$")
            if dash == "-":
                draw_guide(left, time, np.median(every[:, 0], axis=0), SLOPE, "t", True)
        left.set(xscale="log", yscale="log", xlabel=r"$t/\tau_1$", ylabel=r"$G(t,\gamma)/k$")
        left.legend()
        right.axhline(1.0, color=style.GREY, lw=0.5, ls=":")
        right.set(xscale="log", ylim=(0.0, None), xlabel=r"$t\,p/(k\tau_1)$", ylabel=r"$G(t,\gamma)/G(t)$")
        right.legend(loc="lower left")


def main():
    args = folder_and_picture(__doc__, "draw G(t) and when strains depart from linear response")
    found = read(args.folder)
    print_points(found)
    if args.picture:
        draw(found, args.picture)


if __name__ == "__main__":
    main()
