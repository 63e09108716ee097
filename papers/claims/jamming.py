"""Jamming and its exponents: papers I, II and III, and what packings at a pressure say of isostaticity and φ_c.

Primary estimators. φ_J of protocols: means over samples, or φ where f = ½. Exponents: finite-size collapse with
corrections to scaling; systematic: half of the largest change where the smallest N are left out.
"""

from dataclasses import replace

import numpy as np

import jampetsc
from jampetsc.analysis.correlated_series import Average
from jampetsc.analysis.scaling_collapse import BOUNDS
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.jamming.stepwise_shear import ENERGY_CUT
from papers.claims.flow import PHI_J
from papers.claims.shared import (
    SYMBOLS,
    Row,
    bearing,
    check,
    claim,
    exponent,
    fitted,
    independent,
    line_fit,
    medians_in_pressure,
    power_law,
    size_of,
)
from papers.claims.verdicts import EXACT_MARGIN, Estimate, between, number
from papers.tables.densities import MIXED, SEPARATED, densities, energies, mean, of_protocol, ratios, steps
from papers.tables.pressures import pressures

HALF = "½ = difference of α − 1"
COMPARED = (  # (ensemble, potential), less another, what for
    (("RAND", "hertzian"), ("RAND", "harmonic"), HALF),
    (("QS", "harmonic"), ("RAND", "harmonic"), "V: y > 1 under shear alone"),
    (("QS", "hertzian"), ("RAND", "hertzian"), "the same of Hertzian disks"),
)
PHI_MARGIN = 1e-3  # of φ_J
PHI_C = {2: 0.84, 3: 0.64}  # of BT and V, in D dimensions
FEWEST_DISKS, FEWEST_STATES = 128, 20  # for exponents of N without corrections to scaling, and for a mean
ENSEMBLES = {"random": "RAND", "shear": "QS"}
RESIDUAL = 0.01  # of p: shear stress that counts as none
LEAST_N = {"RAND": 128, "QS": 64}  # from which ν without corrections to scaling does not drift
OHERN = 0.71, 0.08  # ν of O'Hern et al., PRE 68, 011306 (2003), an earlier value than V's, who prints none


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


@claim("paper2")
def finite_size(table):
    found = {}
    for corrections in (True, False):
        form = "with" if corrections else "without"
        for ensemble, name in ENSEMBLES.items():
            for observable, symbol, parameter in (("", "f", "nu"), ("-pressure", "⟨p⟩", "y")):
                file = f"{ensemble}{observable}{'-corrected' * corrections}"
                estimates = fitted(table, file)
                if not estimates:
                    continue
                result = jampetsc.load(table.path / f"{file}.h5")
                n = result["N"]
                what = f"{symbol}(φ, N), {name}, {form} corrections to scaling"
                ours = estimates[parameter]
                size = f"N = {n.min():g} … {n.max():g}, χ²/dof {ours.chi2 / ours.dof:.2f}"
                note = "; ".join(filter(None, (drift_of(result, parameter, 2), at_bound(result))))
                if corrections:
                    last = drift_of(result, parameter, 2).rpartition(", ")[2]
                    found[name, parameter] = ours, last, size
                on = {"nu": "nu", "y": "ensembles"}[parameter]
                yield check(f"{what}: {SYMBOLS[parameter]}", ours.value, ours.inflated, note, size, bears=on)
                phi = estimates["phi_J"]
                note = drift_of(result, "phi_J", 4)
                yield check(f"{what}: φ_J", phi.value, phi.inflated, note, size, bears="phi_J")
    for ensemble, name in ENSEMBLES.items():
        ours = undrifted(
            table.path / f"{ensemble}.h5", table.path / f"{ensemble}-corrected.h5", LEAST_N[name]
        )
        if ours is not None:
            note, size = f"with corrections and all N {found[name, 'nu'][0]}", f"N ≥ {LEAST_N[name]}"
            beyond = Estimate(
                ours.value - OHERN[0],
                float(np.hypot(ours.statistical, OHERN[1])),
                ours.systematic,
                ours.chi2,
                ours.dof,
            )
            earlier = f"{OHERN[0]:g}({100 * OHERN[1]:.0f}) of O'Hern et al."
            what = f"{name}: ν of N ≥ {LEAST_N[name]}, less the earlier {earlier}"
            yield Row(
                what,
                "well above: > 0",
                beyond,
                between(low=0.0),
                f"ν = {ours}; {note}",
                size,
                bears="nu",
                part=name,
            )
    if ("QS", "y") in found:
        ours, note, size = found["QS", "y"]
        yield check("QS: y, with corrections", ours.value, ours.inflated, note, size, "> 1", bears="y")
        other, *_ = found["RAND", "y"]
        change = Estimate(
            ours.value - other.value,
            float(np.hypot(ours.inflated, other.inflated)),
            float(np.hypot(ours.systematic, other.systematic)),
        )
        note = f"QS {ours}, RAND {other}"
        what, words = "y of QS less y of RAND", "exponents differ: > 0"
        yield Row(what, words, change, between(low=0.0), note, size, bears="ensembles", part=None)


@claim("paper2", on="ensembles")
def pressure_at_phi_J(table):
    """y/ν of both ensembles from ⟨p⟩ of jammed states at φ_J, which falls as N^(−y/2ν): paper III has y > 1 of QS."""
    found = {}
    for ensemble, name in ENSEMBLES.items():
        levels = mean_pressures(table.where(command="jam", protocol=ensemble), FEWEST_DISKS)
        curves = {phi: size_exponent(levels, phi) for phi in (PHI_J, PHI_J - PHI_MARGIN)}
        if None in curves.values():
            return
        ours, lower = curves.values()
        ours = replace(ours, systematic=0.5 * abs(ours.value - lower.value))
        found[name] = ours
        what = f"{name}, φ = {PHI_J}: y/ν of ⟨p⟩ ~ N^(−y/2ν), jammed states, N ≥ {FEWEST_DISKS}"
        note = f"{lower.value:.2f} at φ = {PHI_J - PHI_MARGIN:.4f}; χ² = {ours.chi2:.1f} for {ours.dof}"
        yield check(
            what, ours.value, ours.inflated, note, f"N = {', '.join(f'{n:g}' for n in sorted(levels))}"
        )
    one, other = found["QS"], found["RAND"]
    spread = one.systematic + other.systematic  # half of the range of the four differences
    change = Estimate(one.value - other.value, float(np.hypot(one.inflated, other.inflated)), spread)
    what = "y/ν of QS less that of RAND, from the fall of ⟨p⟩ with N at φ_J"
    note = (
        f"QS {one.value:.2f}, RAND {other.value:.2f}; P(p → 0) at finite N is that of the potential in both"
    )
    size = f"N ≥ {FEWEST_DISKS}"
    words = "paper III, y > 1 under shear alone: > 0"
    yield Row(what, words, change, between(low=0.0), note, size, part=None)


def mean_pressures(jams, fewest) -> dict:
    """{N: (φ, ln⟨p⟩ of jammed states, its error), each (F,)} of samples in the order in which shear passes them."""
    found = {}
    for result in jams.results():
        n = int(result.attributes["particle_count"])
        for phi in np.unique(result["phi"]) if n >= fewest else ():
            p = result["pressure"][(result["phi"] == phi) & (result["jammed"] == 1)]
            if len(p) >= FEWEST_STATES:
                mean = Average.of(p)
                found.setdefault(n, []).append((phi, np.log(mean.mean), mean.error / mean.mean))
    return {n: np.transpose(sorted(rows)) for n, rows in found.items()}


def size_exponent(levels, phi) -> Estimate | None:
    """y/ν of ⟨p⟩ ~ N^(−y/2ν) at φ, ln⟨p⟩ interpolated between the two φ beside it; None with fewer than three N."""
    points = []
    for n, (known, logs, errors) in levels.items():
        right = np.searchsorted(known, phi)
        if 0 < right < len(known):
            share = (phi - known[right - 1]) / (known[right] - known[right - 1])
            weights = np.array([1 - share, share])
            pair = slice(right - 1, right + 1)
            points.append((n, np.exp(weights @ logs[pair]), np.hypot(*(weights * errors[pair]))))
    if len(points) < 3:
        return None
    n, p, relative = np.transpose(sorted(points))
    fall = power_law(n, p, relative * p)
    return replace(fall, value=-2.0 * fall.value, statistical=2.0 * fall.statistical)


def undrifted(plain, corrected, least) -> Estimate | None:
    """ν of the collapse without corrections of N ≥ least; None where one of the two files of fits is missing.

    Systematic: half of the largest change with corrections, or of larger N with an error within three of this one.
    """
    if not plain.exists() or not corrected.exists():
        return None
    fits, changes = [jampetsc.load(path) for path in (plain, corrected)], []
    for fit in fits:
        column = str(fit.attributes["fitted"]).split(",").index("nu")
        values, errors = fit["drift/parameters"][:, column], fit["drift/errors"][:, column]
        rows = np.flatnonzero(fit["drift/cut"] > 0.99 * least)
        if not len(rows):
            return None
        if fit is fits[0]:
            value = values[rows[0]]
            own = errors[rows[0]] * max(1.0, fit["drift/chi2_per_dof"][rows[0]]) ** 0.5
            changes += [v - value for v, e in zip(values[rows], errors[rows], strict=True) if e < 3 * own]
        else:
            changes.append(values[rows[0]] - value)
    return Estimate(float(value), float(own), 0.5 * float(np.max(np.abs(changes))))


def at_bound(result):
    """Where ω of a fit with corrections is at the end of its range, in words; "" where it is not."""
    names = str(result.attributes["fitted"]).split(",")
    if "omega" not in names:
        return ""
    low, high = BOUNDS["omega"]
    omega, cuts = result["drift/parameters"][:, names.index("omega")], result["drift/cut"]
    ends = [
        f"N ≥ {cut:.0f}" for cut, one in zip(cuts, omega, strict=True) if not 1.01 * low < one < 0.99 * high
    ]
    return f"ω at an end of its range, {low:g} to {high:g}, for {', '.join(ends)}" if ends else ""


def drift_of(result, name, digits):
    """The values of a parameter where the smallest N are left out, in words."""
    column = str(result.attributes["fitted"]).split(",").index(name)
    parts = [
        f"N ≥ {cut:.0f}: {value:.{digits}f} ± {error:.{digits}f}"
        for cut, value, error in zip(
            result["drift/cut"],
            result["drift/parameters"][:, column],
            result["drift/errors"][:, column],
            strict=True,
        )
        if cut > 1.01 * result["N"].min() and np.isfinite(error)  # nan: the data do not tell
    ]
    return ", ".join(parts)


@claim("paper3", on="potential")
def soft_states(table):
    found = {(one.name, one.potential, one.n): one for one in pressures(table)}
    for (name, potential, n), one in found.items():
        end = one.end
        cuts = ", ".join(f"{y:.2f}({100 * error:.0f})" for y, error in zip(end.y, end.error, strict=True))
        size = f"N = {n}, {len(one.values)} jammed, below the last cut as many as {one.independent:.0f}"
        what = f"{name}, {potential}, N = {n}, φ = {one.phi:g}: y of P(p) ~ p^(1/y − 1), limit of small cuts"
        yield check(what, end.limit, end.limit_error, f"below ⟨p⟩/2, /4, /8: {cuts}", size)
    for n in sorted({n for _, _, n in found}):
        for one, other, says in COMPARED:
            if (*one, n) not in found or (*other, n) not in found:
                continue
            first, second = found[*one, n].end, found[*other, n].end
            change, error = apart((first.limit, first.limit_error), (second.limit, second.limit_error))
            wide, wide_error = apart((first.y[1], first.error[1]), (second.y[1], second.error[1]))
            what = f"y of {', '.join(one)} less that of {', '.join(other)}, N = {n}, limit of small cuts"
            note = f"below ⟨p⟩/4 {text(wide, wide_error)}"
            if says == HALF:
                ours = Estimate(change, error, 0.5 * abs(wide - change))
                yield Row(what, HALF, ours, number(0.5), note, f"N = {n}", part=f"N = {n}")
            elif one == ("QS", "harmonic"):
                ours, words = Estimate(change, error, 0.5 * abs(wide - change)), "above that of RAND: > 0"
                yield Row(what, words, ours, between(low=0.0), note, f"N = {n}", bears="y", part=f"N = {n}")
            else:
                yield check(what, change, error, f"{says}; {note}", f"N = {n}", bears="y")
