"""G* of packings at one pressure that were cooled, sheared or quenched from random places (docs/papers/results.md).

    .venv/bin/python -m papers.tables.preparation figures/preparation-quick --n 256 --seeds 4 --picture x.png

All are minima of the enthalpy at the same pressures in cells of fixed shape; before that, in a cell of φ = PHI,

    random  nothing: random places, quenched
    shear   quasistatic shear of a packing, states at equal strains
    cool    a liquid, cooled slowly

What is there already (table.csv) is read, not computed.
"""

from pathlib import Path

import numpy as np

from benchmarks.common import saved_page
from jampetsc.analysis.statistics import log_median
from jampetsc.io.reader import load
from jampetsc.plots import style
from papers.programs import folder_and_picture, read_rows, write_rows

PHI = 0.86
PRESSURES = 1e-3, 1e-4
OMEGA = "1e-6:1:25"
FIRST, EVERY, STEP = 1.0, 0.2, 2e-3  # strain before the first state and between two, of a step
TEMPERATURE, SWEEPS = 1e-3, 200  # of the liquid, in k d²
NAMES = {"random": "random", "shear": "sheared", "cool": "cooled"}
MEASURED = ("contacts", "stress", "G0", "eta0", "omega", "storage", "loss")
COLUMNS = (*"command file state preparation n phi seed pressure prestress".split(), *MEASURED)


def starts(preparation, n, seeds, rate):
    """Yield for each seed what is brought to the pressures: arguments of `pack`."""
    import jampetsc
    from jampetsc.minimisation.thermal import annealed

    disks = None
    for seed in range(1, seeds + 1):
        if preparation == "random":
            yield {"n": n, "seed": seed}
        elif preparation == "shear":
            last = disks or jampetsc.pack(n=n, phi=PHI, seed=1)
            strain = EVERY if disks else FIRST
            disks = jampetsc.shear(last, step=STEP, strain=strain, discard=0.0).last
            yield {"from_": disks}
        else:
            liquid = jampetsc.pack(n=n, phi=PHI, seed=seed)
            generator = np.random.default_rng(seed)
            yield {"from_": annealed(liquid, TEMPERATURE * liquid.potential.k, rate, SWEEPS, generator)}


def compute(folder: Path, n, seeds, cooling):
    """Write the table, preparation by preparation."""
    import jampetsc

    path = folder / "table.csv"
    rows = read_rows(path)
    made = {row["preparation"] for row in rows}
    for preparation in NAMES:
        if preparation in made:
            continue
        for seed, start in enumerate(starts(preparation, n, seeds, cooling), 1):
            for pressure in PRESSURES:
                disks = jampetsc.pack(pressure=pressure, **start)
                start = {"from_": disks}
                for prestress in (True, False):
                    limit = jampetsc.quasistatic(disks, prestress=prestress)
                    sweep = jampetsc.sweep(disks, prestress=prestress, omega=OMEGA)
                    common = {
                        "command": "preparation", "state": "done", "preparation": preparation, "n": n, "seed": seed,
                        "phi": disks.phi, "pressure": pressure, "prestress": prestress,
                        "contacts": disks.record["coordination"], "stress": disks.record["shear_stress"],
                        "G0": limit.attributes["G0"], "eta0": limit.attributes["eta0"],
                    }  # fmt: skip
                    rows += [
                        common | {"omega": omega, "storage": G.real, "loss": G.imag}
                        for omega, G in zip(sweep["omega"], sweep["G"], strict=True)
                    ]
        write_rows(path, COLUMNS, rows)


def medians(rows, column):
    """(median, its error) of a positive column over packings, with pairs of numbers for each group."""
    value, error = log_median(rows[column])
    return float(np.exp(value)), float(np.exp(value) * error)


def packings(table, **chosen):
    """A row for each packing: those of the lowest frequency."""
    return table.where(omega=table["omega"].min(), **chosen)


def print_limits(table):
    """Medians of what each preparation gives at each pressure."""
    print(
        "| preparation | p | φ | Z | \\|σ₀\\|/p | G₀/√p | with pre-stress | η₀√p | with pre-stress | G₀ < 0 |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for p in PRESSURES:
        for preparation in NAMES:
            without, with_it = (
                packings(table, preparation=preparation, pressure=p, prestress=on) for on in (False, True)
            )
            cells = [f"{medians(without, 'G0')[i] / p**0.5:.2g}" for i in (0, 1)]
            cells = [" ± ".join(cells), f"{np.median(with_it['G0']) / p**0.5:.2f}"]
            of_eta = [f"{medians(without, 'eta0')[i] * p**0.5:.2g}" for i in (0, 1)]
            cells += [" ± ".join(of_eta), f"{np.median(with_it['eta0']) * p**0.5:.2f}"]
            share = np.mean(with_it["G0"] < 0)
            means = [f"{without['phi'].mean():.4f}", f"{without['contacts'].mean():.3f}"]
            means += [f"{np.median(np.abs(without['stress'])) / p:.3f}"]
            print(f"| {NAMES[preparation]} | {p:g} | {' | '.join(means + cells)} | {100 * share:.0f} % |")


def draw(table, path):
    """Medians of G′ and G″ over √p against ω/p without pre-stress, and over those of random packings."""
    with saved_page(path) as page:
        axes = page.panels(
            1, 2, style.PAGE, 2.9, log=["xy", "x"], x=r"$\omega/p$", y=[r"$G/p^{1/2}$", "over random"]
        )
        for (preparation, p), look in style.looks([(name, p) for name in NAMES for p in PRESSURES]):
            curves = {}
            for name in dict.fromkeys((preparation, "random")):
                rows = table.where(preparation=name, pressure=p, prestress=False)
                parts = [part for _, part in rows.groups(["omega"])]
                curves[name] = [[np.median(part[column]) for part in parts] for column in ("storage", "loss")]
            x = np.unique(table["omega"]) / p
            label = f"{NAMES[preparation]}, $p={style.number(p)}$"
            for values, random, line in zip(curves[preparation], curves["random"], ("-", "--"), strict=True):
                shown = label if line == "-" else style.hidden(f"{label}, loss")
                drawn = {"lw": 0.9, "ls": line, "ms": 2.5, "markevery": 3, **look}
                axes[0].plot(x, np.array(values) / p**0.5, label=shown, **drawn)
                if preparation != "random":
                    axes[1].plot(x, np.divide(values, random), label=style.hidden(shown), **drawn)
        axes[1].axhline(1.0, color=style.GREY, lw=0.5, ls=":")
        page.legend(axes[0], first="upper left", title="solid: $G'$, dashed: $G''$")


def main():
    args = folder_and_picture(__doc__, "draw G* of the three kinds of packings", n=256, seeds=4, cooling=1e-3)
    compute(args.folder, args.n, args.seeds, args.cooling)
    table = load(args.folder)
    print_limits(table)
    if args.picture:
        draw(table, args.picture)


if __name__ == "__main__":
    main()
