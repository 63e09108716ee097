"""Events of quasistatic shear of many random packings: none may follow a saddle, and work must be stored or dissipated.

    .venv/bin/python benchmarks/shear_events.py [--seeds 1:20] [--rows 30] [--load compression]
    .venv/bin/python benchmarks/shear_events.py --speed 1024:1e-3:1e-4:30
    .venv/bin/python benchmarks/shear_events.py --paths [--seeds 1:20] [--rows 30]

For each family of packings (disks, spheres, crystals, sizes 1:10, potentials) and seed: the packing is strained by the
load, simple shear if none is given, to and fro by `EventShear`. At each row the Hessian of the disks as they are is
built again and its eigenvalues are computed, dense; forces must vanish, and ∫ V σ dγ − ΔU − Σ drops, by the trapezium
rule between rows and events. A line for each family: packings, those that came apart, events by kind, the lowest
eigenvalue, the largest error of the energy balance, and whatever else stopped a run.

With --speed N:p:step:rows events per second, beside stepwise shear of the same packing with the same step. With --paths
the same families, larger: how many descents end in another minimum when their steps have a hundredth of the error.
"""

import argparse
from collections import Counter
from functools import partial

import common
import numpy as np
from common import processor

import jampetsc
from jampetsc.commands.shear import DESCENTS
from jampetsc.errors import ConvergenceError
from jampetsc.jamming.event_table import UNSTABLE
from jampetsc.jamming.instability import DESCENT_TOLERANCE, usual_overlap
from jampetsc.jamming.shear_events import EventShear
from jampetsc.jamming.stepwise_shear import StepwiseShear
from jampetsc.laws.loads import DEFAULT, LoadChoice
from jampetsc.minimisation.overdamped import OverdampedDescent
from jampetsc.packing.contacts import measure
from jampetsc.petsc import session
from jampetsc.petsc.hessian_solver import HessianSolver

TOLERANCE = 1e-10
KINDS = ("opens", "closes", "unstable", "touches", "leaves", "hidden")
FAMILIES = {  # name -> (settings of `pack`, strain between rows)
    "disks": ({"n": 24, "pressure": 1e-2}, 1e-3),
    "soft disks": ({"n": 24, "pressure": 1e-3}, 5e-4),
    "compressed disks": ({"n": 32, "pressure": 0.1}, 3e-3),
    "crystals": ({"n": 16, "pressure": 0.1, "sizes": "monodisperse"}, 5e-3),
    "sizes 1:10": ({"n": 32, "pressure": 1e-2, "sizes": "uniform:1:10"}, 1e-3),
    "spheres": ({"n": 24, "pressure": 1e-2, "dimension": 3}, 1e-3),
    "hertzian disks": ({"n": 24, "pressure": 1e-3, "potential": "hertzian"}, 1e-3),
    "hertzian spheres": ({"n": 20, "pressure": 1e-3, "potential": "hertzian", "dimension": 3}, 1e-3),
    "power 2.25": ({"n": 24, "pressure": 3e-3, "potential": "power", "exponent": 2.25}, 1e-3),
    "k/sigma^2": ({"n": 24, "pressure": 1e-2, "stiffness": "inverse-square-diameter"}, 1e-3),
}


def lowest_eigenvalue(disks):
    """Lowest eigenvalue of K of the load-bearing contacts of disks, dense."""
    contacts, d = measure(disks).contacts, disks.dimension
    along = contacts.normal[:, :, None] * contacts.normal[:, None]
    blocks = contacts.stiffness[:, None, None] * along
    blocks -= contacts.force_per_length[:, None, None] * (np.eye(d) - along)
    i, j, K = contacts.i, contacts.j, np.zeros((disks.n, disks.n, d, d))
    for row, column, sign in ((i, i, 1), (j, j, 1), (i, j, -1), (j, i, -1)):
        np.add.at(K, (row, column), sign * blocks)
    return float(np.linalg.eigvalsh(K.transpose(0, 2, 1, 3).reshape(d * disks.n, -1))[0])


def balance(shear, strains, stresses, energies):
    """|∫ V σ dγ − ΔU − Σ drops| over the largest V |σ| Δγ; strains, stresses, energies of the rows, the first at 0."""
    events = {name: shear.events.column(name) for name in ("strain", "shear_stress", "drop")}
    strain = np.concatenate((strains, np.repeat(events["strain"], 2)))
    stress = np.concatenate((stresses, events["shear_stress"].ravel()))
    order = np.argsort(shear.direction * strain, kind="stable")
    strain, stress = strain[order], stress[order]
    work = shear.first_volume * float(np.diff(strain) @ (0.5 * (stress[1:] + stress[:-1])))
    unit = shear.first_volume * np.abs(stress).max() * np.abs(strain).max()
    return abs(work - (energies[-1] - energies[0]) - events["drop"].sum()) / unit


def shear_to_and_fro(packing, step, rows, load):
    """(events by kind, lowest eigenvalue, largest force, error of the balance, words of what stopped the run)."""
    kinds, lowest, force, worst = Counter(), 0.0, 0.0, 0.0
    for direction in (step, -step):
        shear = EventShear(packing, direction, HessianSolver(), TOLERANCE, load=load)
        state = measure(shear.disks)
        table = [(0.0, np.sum(state.stress * load.gradient), state.energy)]
        stopped = ""
        try:
            for _ in range(rows):
                shear.advance()
                if shear.came_apart is not None:
                    stopped = "come apart"
                    break
                disks = shear.disks
                table.append((shear.strain, shear.minimum.shear_stress, shear.minimum.energy))
                lowest = min(lowest, lowest_eigenvalue(disks))
                force = max(force, measure(disks).max_force)
        except ConvergenceError as error:
            stopped = str(error)
        kinds.update(KINDS[int(kind)] for kind in shear.events.rows["kind"])
        if len(table) > 1 and not stopped:
            worst = max(worst, balance(shear, *np.transpose(table)))
        if stopped:
            break
        packing = shear.disks
    return kinds, lowest, force, worst, stopped


def check_families(seeds, rows, choice):
    """A line for each family; choice: a `LoadChoice`."""
    for name, (settings, step) in FAMILIES.items():
        kinds, lowest, force, worst, apart, stopped = Counter(), 0.0, 0.0, 0.0, 0, []
        for seed in seeds:
            packing = jampetsc.pack(**settings, seed=seed)
            *found, words = shear_to_and_fro(packing, step, rows, choice.of(packing.dimension)[0])
            kinds += found[0]
            lowest, force, worst = min(lowest, found[1]), max(force, found[2]), max(worst, found[3])
            if "come apart" in words:
                apart += 1
            elif words:
                stopped.append(f"seed {seed}: {words}")
        counts = ", ".join(f"{kinds[kind]} {kind}" for kind in KINDS)
        print(
            f"{name}: {len(seeds)} packings, {apart} came apart; {counts}; lowest eigenvalue {lowest:.1e}, force "
            f"{force:.1e}, energy balance {worst:.1e}; stopped {len(stopped)}",
            *stopped,
            sep="\n    ",
            flush=True,
        )


class FinerDescents(EventShear):
    """Counts descents, and those that end in another minimum with smaller steps."""

    falls = elsewhere = 0

    def _descend(self, disks):
        usual = super()._descend(disks)
        overlap = 0.01 * usual_overlap(disks, measure(disks).pressure)
        finer = OverdampedDescent(disks, self.solver, self._stiffness, overlap)
        energy = measure(finer.relax(DESCENT_TOLERANCE, self._separated_pressure)).energy
        self.falls += 1
        self.elsewhere += not np.isclose(energy, measure(usual).energy, rtol=1e-8)
        return usual


def check_paths(seeds, rows, choice):
    """A line for each family: descents that end elsewhere."""
    for name, (settings, step) in FAMILIES.items():
        falls = elsewhere = 0
        for seed in seeds:
            packing = jampetsc.pack(**settings | {"n": 4 * settings["n"]}, seed=seed)
            load = choice.of(packing.dimension)[0]
            shear = FinerDescents(packing, step, HessianSolver(), TOLERANCE, load=load)
            for _ in range(rows):
                shear.advance()
                if shear.came_apart is not None:
                    break
            falls, elsewhere = falls + shear.falls, elsewhere + shear.elsewhere
        print(f"{name}: {falls} descents, {elsewhere} elsewhere with a hundredth of the error", flush=True)


def measure_speed(n, pressure, step, rows, descent):
    """Lines of events, of stepwise shear, and their ratio."""
    packing = jampetsc.load(common.packing(n, pressure))
    runs = (partial(EventShear, descent=descent), StepwiseShear)
    seconds = {}
    for name, run in zip(("events", "steps"), runs, strict=True):
        shear = run(packing, step, HessianSolver(), 1e-6)
        shear.advance()  # compiles

        def follow(shear=shear):
            for _ in range(rows):
                shear.advance()

        seconds[name], _ = processor(follow)
        per_strain = seconds[name] / (rows * step)
        print(f"{name}: {per_strain:.0f} s of processor time per unit strain", flush=True)
        if shear.events is not None:
            kinds = Counter(shear.events.rows["kind"])
            print(
                f"    {len(shear.events) / (rows * step):.3g} events per unit strain, {kinds[UNSTABLE]} unstable of "
                f"{len(shear.events)}; {len(shear.events) / seconds[name]:.0f} events per second"
            )
    print(f"ratio {seconds['events'] / seconds['steps']:.2f}")


def main():
    """Print the lines."""
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0], allow_abbrev=False)
    parser.add_argument("--seeds", type=common.both_included, default=range(1, 21), metavar="A:B")
    parser.add_argument("--rows", type=int, default=30)
    parser.add_argument("--load", type=LoadChoice, default=LoadChoice(DEFAULT))
    parser.add_argument("--speed", metavar="N:P:STEP:ROWS")
    parser.add_argument("--paths", action="store_true")
    parser.add_argument("--descent", choices=DESCENTS, default=DESCENTS[0], help="of --speed")
    args = parser.parse_args()
    session.start("real", [])
    print(common.machine(), flush=True)
    if args.speed:
        n, pressure, step, rows = args.speed.split(":")
        measure_speed(int(n), pressure, float(step), int(rows), args.descent)
    elif args.paths:
        check_paths(args.seeds, args.rows, args.load)
    else:
        check_families(args.seeds, args.rows, args.load)


if __name__ == "__main__":
    main()
