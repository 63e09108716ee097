"""One big packing against many small ones: the mean of G* at a given pressure, at equal numbers of disks."""

import numpy as np

from jampetsc.analysis.statistics import mean_with_error
from jampetsc.io.packing_file import read_packing
from jampetsc.speed_accuracy import processes
from jampetsc.speed_accuracy.choices import PHYSICS_ACCURACY, Bench, deviation, words_of
from jampetsc.speed_accuracy.table import Row

SHARES = (1, 4, 16)  # so many packings of N over so many disks
FIRST_SEED = 1001  # other packings than the one of the reference
_SMALLEST = 16  # disks


def plan(packing) -> tuple[list[int], list[str]]:
    """(numbers of packings, lines on what is left out and why) for the packing that the trade is about."""
    disks = read_packing(packing)
    sizes = disks.record.get("sizes", "")
    if not sizes or sizes.startswith("radii of "):  # imported, or from a file of radii
        return [], [f"ensemble: left out, the radii of {packing} cannot be drawn anew by `jampetsc pack`"]
    shares = [share for share in SHARES if disks.n // share >= _SMALLEST]
    small = [f"{s} packings: left out, fewer than {_SMALLEST} disks each" for s in SHARES if s not in shares]
    return shares, small


def measure(bench: Bench, share: int) -> Row:
    """The row of `share` packings of N/share disks each, at the pressure of the reference."""
    disks = read_packing(bench.packing)
    n = disks.n // share
    name = f"{share} x N = {n}"
    paths = [bench.folder / f"packing-{n}-{seed}.h5" for seed in range(FIRST_SEED, FIRST_SEED + share)]
    made = processes.run(_pack_words(bench, disks, n, share), bench.ranks)
    there = [path for path in paths if path.exists()]
    if not there:
        return bench.failed("ensemble", name, made)
    seconds = process_seconds = made.seconds
    memory, factorisations, curves, errors = made.memory, 0, [], [made.error] if made.error else []
    for path in there:
        outcome, result = bench.sweep(path, words_of(bench.physics, accuracy=PHYSICS_ACCURACY))
        process_seconds += outcome.seconds
        memory = max(memory, outcome.memory)
        if result is None:
            errors.append(outcome.error)
            continue
        seconds += float(result.attributes["wall_seconds"])
        factorisations += int(result.attributes["factorisations"])
        curves.append(result.G)
    if not curves:
        return bench.failed("ensemble", name, outcome)
    notes = [f"packing took {made.seconds:.1f} s"]
    if len(curves) < share:
        notes.append(f"only {len(curves)} of {share}: {errors[0]}")
    negative = sum(bool((G.real <= 0).any()) for G in curves)
    if negative:
        notes.append(f"G' < 0 in {negative} of them")
    row = Row(
        "ensemble",
        name,
        seconds=seconds,
        process_seconds=process_seconds,
        memory_mb=memory,
        factorisations=factorisations,
        **_statistics(bench.reference, np.array(curves)),
        note="; ".join(notes),
    )
    bench.progress.step(f"ensemble {name}: {seconds:.2f} s  deviation of the mean {row.error:.1e}")
    return row


def _statistics(reference, curves) -> dict:
    """Deviation of the mean of curves (n, M) from the reference, and its standard error."""
    mean = curves.mean(axis=0)
    found = deviation(reference, mean)
    if len(curves) < 2:
        return found
    # at ω → 0 the mean of G' can vanish: small packings with pre-stress need not be stable to shear
    seen = curves if reference.inside is None else curves[:, reference.inside]
    for name, part in (("storage", seen.real), ("loss", seen.imag)):
        middle, error = mean_with_error(part)
        found[f"stderr_{name}"] = float(np.max(error / np.abs(middle)))
    slopes = [slope for G in curves if (slope := reference.exponents(G)) is not None]
    if len(slopes) < 2:
        return found
    for name in ("storage", "loss"):
        found[f"exponent_{name}_error"] = float(mean_with_error([getattr(s, name) for s in slopes])[1])
    return found


def _pack_words(bench, disks, n, share):
    record, attributes = disks.record, bench.reference.result.attributes
    pressure = record.get("requested_pressure", attributes["pressure"] / attributes["k"])
    seeds = f"{FIRST_SEED}:{FIRST_SEED + share - 1}"
    words = ["pack", "--n", n, "--pressure", repr(float(pressure)), "--seeds", seeds]
    words += ["--potential", disks.potential.kind, "--stiffness", disks.potential.stiffness]
    words += ["--sizes", record["sizes"], "--stabilise", record.get("stabilise", "volume")]
    return [*words, "--out", bench.folder / f"packing-{n}-{{seed}}.h5"]
