"""Time and memory of every kind of work against the number of particles, each command in processes of its own.

    .venv/bin/python benchmarks/scaling.py FOLDER [--n 1000,4000,16000] [--ranks 1,2] [--commands pack,sweep,…]
    .venv/bin/python benchmarks/scaling.py SPHERES --dimension 3 --accuracy 1e-6 --ranks 1 --n 1000,4000,16000,100000
    .venv/bin/python benchmarks/scaling.py FOLDER --draw scaling.png

Packings at p = 1e-2 are made in FOLDER, one thread each, and swept (141 frequencies, to --accuracy), `shifts` and
`matrix` on several ranks; 50 modes are found; a steady flow, RD0, is begun with a strain of 0.5. FOLDER/scaling.csv has
a row for each run: seconds elapsed and of processor time, all ranks together, and the memory of the largest process.
What is in it is not run again: a folder is of one dimension and accuracy. For each N the estimated memory of one factor
of the displacements is printed first; a sweep of spheres keeps two of them, or three. The picture shows the table with
exponents between the two largest N.
"""

import argparse
import csv
import os
import sys
from pathlib import Path

import numpy as np
from common import environment, machine, saved_page

from jampetsc import load
from jampetsc.plots.style import PAGE, looks
from jampetsc.response.factor_memory import GIGABYTE, factor_bytes
from jampetsc.studies import trade_process
from jampetsc.studies.trade_errors import certified

PRESSURE, ACCURACY, COUNT, RATE, STRAIN = "1e-2", "1e-3", 50, "1e-3", "0.5"
COLUMNS = "command n ranks seconds processor memory G0 G_inf eta_inf certified".split()
NAMES = {
    "pack": "pack",
    "sweep": "sweep",
    "sweep --parallel shifts": "sweep, a shift per rank",
    "sweep --parallel matrix": "sweep, shared factors",
    "modes": "50 modes",
    "flow": "flow, strain 0.5",
}


def words(command, n, folder, out, dimension=2, accuracy=ACCURACY) -> list:
    """The command line of a run for N disks or spheres that writes `out`."""
    packing, (command, *how) = folder / f"n{n}.h5", command.split()
    if command == "pack":
        size = ["--n", n, "--dimension", dimension]
        return ["pack", *size, "--pressure", PRESSURE, "--threads", 1, "--out", packing]
    asked = {
        "sweep": ["--accuracy", accuracy, *how],
        "modes": ["--count", min(COUNT, n)],
        "flow": ["--model", "RD0", "--rate", RATE, "--strain", STRAIN, "--threads", 1],
    }
    return [command, packing, *asked[command], "--overwrite", "--out", out]


def commands_on(ranks: int) -> list[str]:
    """What is run on so many ranks."""
    return ["pack", "sweep", "modes", "flow"] if ranks == 1 else list(NAMES)[2:4]


def facts(out) -> dict:
    """Physics of a sweep: G₀ and G_∞ in k, η_∞ in kτ₁, the largest relative bound on G' and on G″."""
    sweep = load(out)
    return {
        "G0": sweep.spectrum.G0,
        "G_inf": float(sweep.G_storage[-1]),
        "eta_inf": sweep.spectrum.eta_inf,
        "certified": certified(sweep),
    }


def read(table: Path) -> list[dict]:
    """Rows of a table, numbers as such; none where there is no file."""
    if not table.exists():
        return []
    with table.open(newline="") as file:
        return [
            {name: text if name == "command" else float(text or "nan") for name, text in row.items()}
            for row in csv.DictReader(file)
        ]


def measure(folder: Path, sizes, ranks, commands, **settings) -> None:
    """Run what the table lacks, small sizes first; settings: of `words`."""
    folder.mkdir(parents=True, exist_ok=True)
    table = folder / "scaling.csv"
    known = {(row["command"], row["n"], row["ranks"]) for row in read(table)}
    dimension = settings.get("dimension", 2)
    for n in sorted(sizes):
        factor = factor_bytes(dimension, dimension * n, dimension) / GIGABYTE
        print(f"N = {n}: factor of the displacements about {factor:.2g} GB", flush=True)
    for n, size in ((n, size) for n in sorted(sizes) for size in ranks):
        for command in commands_on(size):
            if command.split()[0] not in commands or (command, n, size) in known:
                continue
            # A rank that waits for others takes no time then; alone, MUMPS would yield at every step.
            os.environ["OMPI_MCA_mpi_yield_when_idle"] = str(int(size > 1))
            out = folder / f"{command.split()[0]}.h5"
            done = trade_process.run(words(command, n, folder, out, **settings), size if size > 1 else None)
            if done.status:
                print(f"{command}, N = {n}, {size} ranks: {done.error}", flush=True)
                continue
            row = {"command": command, "n": n, "ranks": size, "memory": done.memory / 1024}
            row |= {"seconds": done.seconds, "processor": done.processor}
            row |= facts(out) if command.startswith("sweep") else {}
            append(table, row)
            print(", ".join(f"{name} {value}" for name, value in row.items()), flush=True)


def append(table: Path, row: dict) -> None:
    """Add a row to a table, which begins with its columns."""
    begins = not table.exists()
    with table.open("a", newline="") as file:
        writer = csv.DictWriter(file, COLUMNS)
        if begins:
            writer.writeheader()
        writer.writerow({name: f"{v:.7g}" if isinstance(v, float) else v for name, v in row.items()})


def exponent(n, values) -> float:
    """Slope of log values against log n, increasing, between the two largest; nan where there is one."""
    return np.log(values[-1] / values[-2]) / np.log(n[-1] / n[-2]) if len(n) > 1 else np.nan


def draw(rows, path) -> None:
    """Processor time and memory against N; each legend has the exponents."""
    with saved_page(path) as page:
        for ax, quantity, label in zip(
            page.panels(1, 2, PAGE, 3.4),
            ("processor", "memory"),
            ("processor time [s]", "memory of the largest process [GB]"),
            strict=True,
        ):
            for command, look in looks(NAMES):
                mine = sorted((row["n"], row[quantity]) for row in rows if row["command"] == command)
                if mine:
                    n, values = np.array(mine).T
                    slope = exponent(n, values)
                    name = NAMES[command] if np.isnan(slope) else f"{NAMES[command]}: {slope:.2f}"
                    ax.plot(n, values, markersize=4, label=name, **look)
            ax.set(xscale="log", yscale="log", xlabel="$N$", ylabel=label)
            page.legend(ax, first="upper left", title="exponents")


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--n", default="1000,4000,16000,64000,256000")
    parser.add_argument("--ranks", default="1,2")
    parser.add_argument("--commands", default="pack,sweep,modes,flow")
    parser.add_argument("--dimension", type=int, choices=(2, 3), default=2, help="2: disks, 3: spheres")
    parser.add_argument("--accuracy", default=ACCURACY, help="of the sweeps")
    parser.add_argument("--draw", metavar="PNG", help="draw the table instead")
    args = parser.parse_args()
    if args.draw:
        draw(read(args.folder / "scaling.csv"), args.draw)
        return
    print(machine())
    os.environ.update(environment())
    sizes, ranks = ([int(word) for word in words.split(",")] for words in (args.n, args.ranks))
    settings = {"dimension": args.dimension, "accuracy": args.accuracy}
    measure(args.folder, sizes, ranks, args.commands.split(","), **settings)


if __name__ == "__main__":
    sys.exit(main())
