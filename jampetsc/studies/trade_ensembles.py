"""One big packing against many small ones: the mean of G* at a given pressure, at equal numbers of disks."""

from dataclasses import replace

import numpy as np

from jampetsc.analysis.power_laws import moduli
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.commands.pack import Pack
from jampetsc.errors import InputError
from jampetsc.io.packing_file import read_packing
from jampetsc.minimise.sizes import SIZES
from jampetsc.studies.trade_settings import PHYSICS_ACCURACY, TradeRuns
from jampetsc.studies.trade_table import TradeRow

SHARES = (1, 4, 16)  # numbers of packings, each of N divided by that number
FIRST_SEED = 1001  # other packings than the one of the reference
MIN_DISKS = 16  # disks


def plan_ensembles(bench: TradeRuns) -> tuple[list[Pack], list[str]]:
    """(jobs that make the packings, lines on what is left out and why), once there is a reference."""
    disks, attributes = read_packing(bench.job.packing), bench.reference.result.attributes
    record, packs, left_out = disks.record, [], []
    if record.get("sizes") not in SIZES:  # imported, or from a file of radii
        reason = f"the radii of {bench.job.packing} cannot be drawn by `jampetsc pack`"
        return [], [f"ensemble: left out, {reason}"]
    for share in SHARES:
        if disks.n // share < MIN_DISKS:
            left_out.append(f"{share} packings: left out, fewer than {MIN_DISKS} disks each")
            continue
        try:
            pack = Pack(
                n=disks.n // share,
                pressure=record.get("requested_pressure", attributes["pressure"] / attributes["k"]),
                seeds=range(FIRST_SEED, FIRST_SEED + share),
                potential=disks.potential.kind,
                stiffness=disks.potential.stiffness,
                sizes=record["sizes"],
                stabilise=record.get("stabilise", "volume"),
            )
        except InputError as error:  # such as a pressure that `pack` has not
            return [], [f"ensemble: left out, {error}"]
        packs.append(pack)
    return packs, left_out


def measure(bench: TradeRuns, pack: Pack) -> TradeRow:
    """The row of the packings that a job makes, each at the pressure of the reference."""
    share, name = len(pack.seeds), f"{len(pack.seeds)} x N = {pack.n}"
    names = {seed: f"packing-{pack.n}-{seed}" for seed in pack.seeds}
    packings = {
        seed: bench.run(replace(pack, seeds=None, seed=seed), name=name) for seed, name in names.items()
    }
    paths = [bench.folder / f"{names[seed]}.h5" for seed, (_, disks) in packings.items() if disks is not None]
    runs = [bench.run(bench.sweep_with(packing=path, accuracy=PHYSICS_ACCURACY)) for path in paths]
    packing_seconds = sum(outcome.seconds for outcome, _ in packings.values())
    results = [result for _, result in runs if result is not None]
    outcomes = [outcome for outcome, _ in [*packings.values(), *runs]]
    if not results:
        return bench.failed("ensemble", name, outcomes[-1])
    notes = [f"packing took {packing_seconds:.1f} s"]
    if len(results) < share:
        why = next(outcome.error for outcome in outcomes if outcome.error)
        notes.append(f"only {len(results)} of {share}: {why}")
    if negative := sum(bool((result.G.real <= 0).any()) for result in results):
        notes.append(f"G' < 0 in {negative} of them")
    row = TradeRow(
        "ensemble",
        name,
        seconds=packing_seconds + sum(float(result.attributes["wall_seconds"]) for result in results),
        process_seconds=sum(outcome.seconds for outcome in outcomes),
        memory_mb=max(outcome.memory for outcome in outcomes),
        factorisations=sum(int(result.attributes["factorisations"]) for result in results),
        **_statistics(bench.reference, np.array([result.G for result in results])),
        note="; ".join(notes),
    )
    bench.progress.step(f"ensemble {name}: {row.seconds:.2f} s  deviation of the mean {row.error:.1e}")
    return row


def _statistics(reference, curves) -> dict:
    """Deviation of the mean of curves (n, M) from the reference, and its standard error."""
    statistics = reference.deviation(curves.mean(axis=0))
    if len(curves) < 2:
        return statistics
    # at ω → 0 the mean of G' can vanish: small packings with pre-stress need not be stable to shear
    seen = curves if reference.inside is None else curves[:, reference.inside]
    slopes = [slope for G in curves if (slope := reference.exponents(G))]
    for name, part in moduli(seen).items():
        middle, error = mean_with_error(part)
        statistics[f"stderr_{name}"] = float(np.max(error / np.abs(middle)))
        if len(slopes) > 1:
            scatter = mean_with_error([slope[f"exponent_{name}"] for slope in slopes])[1]
            statistics[f"exponent_{name}_error"] = float(scatter)
    return statistics
