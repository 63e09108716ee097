"""Finite size and the exponents of jamming: papers II and III.

Primary estimators. φ_J: where f = ½ at any N. Exponents: finite-size collapse with corrections to scaling; systematic:
half of the largest change where the smallest N are left out.
"""

from dataclasses import replace

import numpy as np

import jampetsc
from jampetsc.analysis.correlated_series import Average
from jampetsc.analysis.scaling_collapse import BOUNDS
from papers.claims.flow import PHI_J
from papers.claims.jamming import apart, text
from papers.claims.shared import (
    SYMBOLS,
    Row,
    check,
    claim,
    fitted,
    power_law,
)
from papers.claims.verdicts import Estimate, between, difference, number
from papers.tables.pressures import NAMES, pressures

HALF = "½ = difference of α − 1"
COMPARED = (  # (ensemble, potential), less another, what for
    (("RAND", "hertzian"), ("RAND", "harmonic"), HALF),
    (("QS", "harmonic"), ("RAND", "harmonic"), "V: y > 1 under shear alone"),
    (("QS", "hertzian"), ("RAND", "hertzian"), "the same of Hertzian disks"),
)
PHI_MARGIN = 1e-3  # of φ_J
FEWEST_DISKS, FEWEST_STATES = 128, 20  # for exponents of N without corrections to scaling, and for a mean
LEAST_N = {"RAND": 128, "QS": 64}  # from which ν without corrections to scaling does not drift
OHERN = 0.71, 0.08  # ν of O'Hern et al., PRE 68, 011306 (2003), an earlier value than V's, who prints none


@claim("paper2")
def finite_size(table):
    found = {}
    for corrections in (True, False):
        form = "with" if corrections else "without"
        for ensemble, name in NAMES.items():
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
    for ensemble, name in NAMES.items():
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
        change = difference(ours, other)
        note = f"QS {ours}, RAND {other}"
        what, words = "y of QS less y of RAND", "exponents differ: > 0"
        yield Row(what, words, change, between(low=0.0), note, size, bears="ensembles", part=None)


@claim("paper2", on="ensembles")
def pressure_at_phi_J(table):
    """y/ν of both ensembles from ⟨p⟩ of jammed states at φ_J, which falls as N^(−y/2ν): paper III has y > 1 of QS."""
    found = {}
    for ensemble, name in NAMES.items():
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
