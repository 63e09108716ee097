"""Jamming: paper I, and what packings at a pressure say of isostaticity and φ_c.

Primary estimators. φ_J of protocols: means over samples.
"""

import numpy as np

from jampetsc.analysis.statistics import mean_with_error
from jampetsc.jamming.stepwise_shear import ENERGY_CUT
from papers.claims.shared import (
    Row,
    bearing,
    check,
    claim,
    exponent,
    independent,
    line_fit,
    medians_in_pressure,
    size_of,
)
from papers.claims.verdicts import EXACT_MARGIN, Estimate, between, number
from papers.tables.densities import MIXED, SEPARATED, densities, energies, mean, of_protocol, ratios, steps

PHI_MARGIN = 1e-3  # of φ_J
PHI_C = {2: 0.84, 3: 0.64}  # of BT and V, in D dimensions
RESIDUAL = 0.01  # of p: shear stress that counts as none


@claim("bt-fig3")
def packings(table):
    """Isostaticity and φ_c of packings at a pressure, half of them large disks."""
    rows = table.where(command="pack", state="done")
    yield from bearing("isostatic", isostaticity(rows))
    yield from bearing("phi_c", random_starts(rows))
    for key, part in rows.groups(["pressure"]):
        ratio = mean_with_error(independent(part, "shear_stress") / key["pressure"])
        what, words = f"p = {key['pressure']:g}: ⟨σ₀⟩/p", "zero: 0 ± 0.01"
        target, part_of = number(0.0, absolute=RESIDUAL), f"p = {key['pressure']:g}"
        yield Row(what, words, Estimate(*ratio), target, "", size_of(part), bears="residual", part=part_of)


def isostaticity(rows):
    """Z of packings in D dimensions at several pressures."""
    if not rows.rows:
        return
    columns = {name: rows[name] for name in rows}
    D = dimension_of(rows)
    borne = rows["n"] - rows["rattlers"]
    excess = rows["coordination"] - 2 * D + 2 * D / borne
    points = medians_in_pressure(type(rows)(rows.path, columns | {"excess": excess}, None), "excess")
    if (found := exponent(*points)) is not None:
        p, y, error = points
        told = ", ".join(f"{np.exp(one):.4f} at {level:g}" for level, one in zip(p, y, strict=True))
        what = f"Z − {2 * D} + {2 * D}/N ~ p^x, rattlers left out"
        yield check(what, found.value, found.inflated, f"medians {told}", size_of(rows), "0.5")
        form = (np.sqrt(p), np.ones_like(p), p, p**1.5)
        limit, own, chi2, dof = line_fit(form, np.exp(y), error * np.exp(y))
        shorter = line_fit(form[:-1], np.exp(y), error * np.exp(y))[0]
        ours = Estimate(2 * D + limit, own, 0.5 * abs(shorter - limit), chi2, dof)
        what = f"Z + {2 * D}/N extrapolated to p = 0 by a + bp^½ + cp + dp^1.5, rattlers left out"
        note = f"{2 * D + shorter:.4f} without the last term; Z − {2 * D} + {2 * D}/N ~ p^{found}"
        target = number(2.0 * D, absolute=EXACT_MARGIN * float(np.exp(y[-1])))
        words = f"isostatic: {2 * D} ± {target.margin:.2g}"
        yield Row(what, words, ours, target, note, size_of(rows))


def random_starts(rows):
    """φ_c of packings quenched from random starts at several pressures."""
    groups = [
        (key["pressure"], *mean_with_error(independent(part, "phi")))
        for key, part in rows.groups(["pressure"])
    ]
    if len(groups) > 3:
        p, phi, error = np.transpose(groups)
        ones = np.ones_like(p)
        limit, own, chi2, dof = line_fit((p, ones, p**1.5), phi, error)
        ours = Estimate(limit, own, 0.5 * abs(phi[0] - limit), chi2, dof)
        told = f"{phi[0]:.5f} at p = {p[0]:g}"
        what = "random starts: φ(p) extrapolated to p = 0 by φ_c + ap + bp^(3/2)"
        theirs = PHI_C[dimension_of(rows)]
        target = between(theirs - 0.005, theirs + 0.005)  # what two digits stand for
        yield Row(what, f"≈ {theirs:g}", ours, target, told, size_of(rows))


def dimension_of(rows) -> int:
    """D of packings; tables of disks alone have no such column."""
    return int(rows["dimension"][0]) if "dimension" in rows else 2


@claim("paper1", on="cooled")
def densities_of_jamming(table):
    yield from cooling(table)
    yield from shearing(table)
    yield from bearing("energy-cut", cut_of_energy(table))


def cooling(table):
    """φ_J of liquids by rate and start, before and after shear."""
    cold = [one for one in densities(table) if len(one.phi_J) > 2]
    least = min((one.n for one in cold), default=0)
    before = [one for one in cold if one.n == least and not one.strain]
    after = [one for one in cold if one.n == least and one.strain]
    size = f"N = {least}, {len(before[0].phi_J)} samples a rate" if before else ""
    for start in (MIXED, SEPARATED):
        some = [one for one in before if one.start == start]
        if len(some) < 2:
            continue
        means, errors = np.transpose([one.mean for one in some])
        (slope, _), covariance = np.polyfit(
            -np.log10([one.rate for one in some]), means, 1, w=1.0 / errors, cov="unscaled"
        )
        error = np.sqrt(covariance[0, 0])
        decades = np.log10(some[-1].rate / some[0].rate)
        what = f"cooled, sizes {start} in the liquid: rise of φ_J per decade of slower cooling"
        note = f"over {decades:.1f} decades"
        if start == MIXED:
            yield Row(
                what,
                "depends on the rate: > 0",
                Estimate(slope, error),
                between(low=0.0),
                note,
                size,
                part="rise per decade",
            )
        else:
            yield check(what, slope, error, note, size)
    slowest = {one.start: one for one in reversed(before)}
    if len(slowest) == 2:
        change, error = apart(slowest[SEPARATED].mean, slowest[MIXED].mean)
        note = f"at the slowest rate, {slowest[MIXED].rate:g}; change {change:.4f}"
        what = "cooled: |difference| of φ_J of liquids of separated and of mixed sizes"
        yield Row(
            what,
            "depends on the start: > 0",
            Estimate(abs(change), error),
            between(low=0.0),
            note,
            size,
            part="cooled, separated less mixed sizes",
        )
    starts = {one.start: one for one in after}
    for start in (start for start in starts if len(before) > 1):
        least = min((one.width, one.rate) for one in before if one.start == start)
        change = Estimate(*apart(starts[start].width, least[0]))
        note = f"{Estimate(*starts[start].width)} after shear, {Estimate(*least[0])} cooled at {least[1]:g}"
        what = f"φ_J of liquids of {start} sizes: width after shear less that of cooled ones"
        part = f"{start} sizes"
        yield Row(what, "narrower: < 0", change, between(high=0.0), note, size, bears="narrower", part=part)
    if len(starts) == 2 and len(before) > 1:
        yield from mixing(before, starts, size)
    for one in (one for one in cold if one.rate == (after or cold)[0].rate):
        sheared = f", sheared by {one.strain:g}" if one.strain else ""
        what = f"cooled at {one.rate:g}, N = {one.n}, sizes {one.start}{sheared}: width of φ_J"
        yield check(what, *one.width, "standard deviation of samples", f"{len(one.phi_J)} samples")


def mixing(before, starts, size):
    """What shear leaves of the start: φ_J and segregation."""
    means = sorted(one.mean for one in before)
    broad, broad_error = apart(means[-1], means[0])
    sheared = f"N = {starts[MIXED].n}, {len(starts[MIXED].phi_J)} samples, strain {starts[MIXED].strain:g}"
    change, error = apart(starts[SEPARATED].mean, starts[MIXED].mean)
    what = "φ_J of sheared liquids: |from separated less from mixed sizes| over the range of cooled ones"
    ours = Estimate(abs(change) / broad, float(np.hypot(error, abs(change) / broad * broad_error)) / broad)
    part = "sheared over cooled, separated less mixed sizes"
    note = f"{change:.5f} after a strain of {starts[MIXED].strain:g}; cooled liquids cover {broad:.4f}"
    yield Row(
        what, "broad when cooled, narrow when sheared: < 1", ours, between(high=1.0), note, sheared, part=part
    )
    what = "φ_J of sheared liquids, from separated less from mixed sizes"
    ours, part = Estimate(change, error), "sheared, separated less mixed sizes"
    yield Row(
        what, "no memory of the start: 0", ours, number(0.0, absolute=PHI_MARGIN), "", sheared, part=part
    )
    cooled = next(one for one in before if one.start == SEPARATED and one.rate == starts[SEPARATED].rate)
    for one, when in ((cooled, "before"), (starts[SEPARATED], "after")):
        what = f"segregation of a liquid of separated sizes, {when} shear"
        yield check(what, *mean(one.segregation), "assortativity of neighbours, 0 mixed", sheared)


def shearing(table):
    """φ_J and its width of sheared and of random states; from two starts, and by two steps."""
    found = steps(table)
    for one in (one for one in found if one.start == MIXED):
        middle, width, *errors = one.fit
        if not np.isfinite(middle):
            continue
        size = f"N = {one.n}, {one.shares[0].samples} states a φ"
        yield check(f"{one.name}, N = {one.n}: φ where f = ½", middle, errors[0], "", size)
        note = "of the step of f(φ): states at fixed φ"
        yield check(f"{one.name}, N = {one.n}: width of φ_J", width, errors[1], note, size)
    starts = {(one.n, one.start): one for one in found if one.name == "QS"}
    for n in sorted({n for n, start in starts if start == SEPARATED}):
        mixed, separated = starts[n, MIXED], starts[n, SEPARATED]
        size = f"N = {n}, {mixed.shares[0].samples} states a φ"
        what = f"QS, N = {n}: φ where f = ½, from separated less from mixed sizes"
        yield check(what, *apart(separated.fit[::2], mixed.fit[::2]), "", size, "0")
        what = f"QS, N = {n}: ⟨p⟩ from separated over mixed sizes"
        yield check(what, *ratio(separated, mixed), "", size, "1")
    taken = sorted({one.attributes["step"] for one in of_protocol(table, "shear")})
    if len(taken) == 2:
        fine = next(one for one in steps(table, taken[0]) if one.name == "QS")
        what = f"QS: ⟨p⟩ with Δγ = {taken[0]:.2g} over that with {taken[1]:.2g}"
        size = f"N = {fine.n}, {fine.shares[0].samples} states"
        ours = Estimate(*ratio(fine, starts[fine.n, fine.start]))
        yield Row(what, "small Δγ does not matter: 1", ours, number(1.0), "", size, bears="strain-step")


def cut_of_energy(table):
    """How many states the cut would class otherwise were it another."""
    energy = energies(table)
    if len(energy):
        near = np.count_nonzero((energy > 1e-2 * ENERGY_CUT) & (energy < 1e2 * ENERGY_CUT))
        share = near / len(energy)
        what = f"RAND, QS: share of states with U/N within a factor of 100 of {ENERGY_CUT:g}"
        note = f"another cut would change the class of {near} states at most"
        error = float(np.sqrt(max(near, 1))) / len(energy)
        ours = Estimate(share, error)
        size = f"{len(energy)} states"
        yield Row(what, "the cut separates: < 0.001", ours, between(high=1e-3), note, size)


def apart(one, other):
    """Difference of two numbers with errors."""
    return one[0] - other[0], float(np.hypot(one[1], other[1]))


def text(value, error):
    """A number and its error."""
    return f"{value:.3f} ± {error:.3f}"


def ratio(one, other):
    """⟨p⟩ of one ensemble over that of another, the weighted mean over the φ that both have, and its error."""
    _, value, error = ratios(one, other)
    if not len(value):
        return np.nan, np.nan
    return float(np.average(value, weights=error**-2.0)), float(np.sum(error**-2.0) ** -0.5)
