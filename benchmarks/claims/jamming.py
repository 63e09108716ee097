"""Jamming and its exponents: papers I, II and III."""

import numpy as np
from densities import MIXED, SEPARATED, densities, energies, mean, of_protocol, ratios, steps
from pressures import pressures

import jampetsc
from claims.shared import WITHIN, Row, claim
from jampetsc.analysis.collapse import BOUNDS
from jampetsc.flows.quasistatic_shear import ENERGY_CUT

HALF = "½ = difference of α − 1"
COMPARED = (  # (ensemble, potential), less another, what for
    (("RAND", "hertzian"), ("RAND", "harmonic"), HALF),
    (("QS", "harmonic"), ("RAND", "harmonic"), "V: y > 1 under shear alone"),
    (("QS", "hertzian"), ("RAND", "hertzian"), "the same of Hertzian disks"),
)
CLOSE_PHI, CLOSE_P, CLOSE_Y = 1e-3, 0.05, 0.1  # errors that are small enough to say that two numbers agree
ENSEMBLES = {"random": "RAND", "shear": "QS"}
NAMES = {"nu": "ν", "y": "y"}
SAID = {
    ("nu", "RAND"): "V: well above an earlier value, 0.71(8) of O'Hern et al.; ",
    ("nu", "QS"): "V: well above an earlier value, 0.71(8) of O'Hern et al.; ",
    ("y", "RAND"): "one packing under compression has 1; ",
    ("y", "QS"): "V: y > 1 under shear; ",
}
OHERN = 0.71, 0.08  # ν of O'Hern et al., PRE 68, 011306 (2003), an earlier value than V's, who prints none


def exceeds(value, error, least=0.0):
    """Whether a number is more than `least`: yes or no beyond WITHIN errors, open where they do not tell."""
    if not (np.isfinite(error) and abs(value - least) > WITHIN * error):
        return "open"
    return "yes" if value > least else "no"


@claim("paper1")
def densities_of_jamming(table):
    yield from cooling(table)
    yield from shearing(table)
    yield from cut_of_energy(table)


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
        yield Row(
            f"cooled, sizes {start} in the liquid: rise of φ_J per decade of slower cooling", None, slope, error,
            f"V: φ_J depends on the rate; over {decades:.1f} decades", size, exceeds(abs(slope), error),
        )  # fmt: skip
    slowest = {one.start: one for one in reversed(before)}
    if len(slowest) == 2:
        change, error = apart(slowest[SEPARATED].mean, slowest[MIXED].mean)
        note = f"V: φ_J depends on the initial liquid; at the slowest rate, {slowest[MIXED].rate:g}"
        what = "cooled: φ_J of a liquid of separated sizes less that of a mixed one"
        yield Row(what, None, change, error, note, size, exceeds(abs(change), error))
    starts = {one.start: one for one in after}
    if len(starts) == 2 and len(before) > 1:
        yield from mixing(before, starts, size)
    for one in (one for one in cold if one.rate == (after or cold)[0].rate):
        sheared = f", sheared by {one.strain:g}" if one.strain else ""
        what = f"cooled at {one.rate:g}, N = {one.n}, sizes {one.start}{sheared}: width of φ_J"
        yield Row(what, None, *one.width, "standard deviation of samples", f"{len(one.phi_J)} samples")


def mixing(before, starts, size):
    """What shear leaves of the start: φ_J and segregation."""
    means = sorted(one.mean for one in before)
    broad, broad_error = apart(means[-1], means[0])
    sheared = f"N = {starts[MIXED].n}, {len(starts[MIXED].phi_J)} samples, strain {starts[MIXED].strain:g}"
    change, error = apart(starts[SEPARATED].mean, starts[MIXED].mean)
    narrower = exceeds(broad - abs(change), np.hypot(broad_error, error))
    what = "cooled: range of ⟨φ_J⟩ over rates and liquids"
    yield Row(
        what, None, broad, broad_error, "V: broad when cooled, narrow when sheared (next row)", size, narrower
    )
    what = "the same after shear: ⟨φ_J⟩ from separated less that from mixed sizes"
    note = "V: sheared states have no memory of their start"
    yield Row(what, None, change, error, note, sheared, same(change, error, CLOSE_PHI))
    cooled = next(one for one in before if one.start == SEPARATED and one.rate == starts[SEPARATED].rate)
    for one, when in ((cooled, "before"), (starts[SEPARATED], "after")):
        note = "assortativity of neighbours, 0 mixed; V: shear mixes sizes"
        what = f"segregation of a liquid of separated sizes, {when} shear"
        yield Row(what, None, *mean(one.segregation), note, sheared)


def shearing(table):
    """φ_J and its width of sheared and of random states; from two starts, and by two steps."""
    found = steps(table)
    for one in (one for one in found if one.start == MIXED):
        middle, width, *errors = one.fit
        if not np.isfinite(middle):
            continue
        size = f"N = {one.n}, {one.shares[0].samples} states a φ"
        yield Row(f"{one.name}, N = {one.n}: φ where f = ½", None, middle, errors[0], "", size)
        what = f"{one.name}, N = {one.n}: width of φ_J"
        note = "of the step of f(φ): states at fixed φ"
        yield Row(what, None, width, errors[1], note, size)
    starts = {(one.n, one.start): one for one in found if one.name == "QS"}
    for n in sorted({n for n, start in starts if start == SEPARATED}):
        mixed, separated = starts[n, MIXED], starts[n, SEPARATED]
        size = f"N = {n}, {mixed.shares[0].samples} states a φ"
        change, error = apart(separated.fit[::2], mixed.fit[::2])
        note = "V: sheared states have no memory of their start"
        what = f"QS, N = {n}: φ where f = ½, from separated less from mixed sizes"
        yield Row(what, None, change, error, note, size, same(change, error, CLOSE_PHI))
        change, error = ratio(separated, mixed)
        what = f"QS, N = {n}: ⟨p⟩ from separated over mixed sizes"
        decided = same(change - 1.0, error, CLOSE_P)
        yield Row(what, None, change, error, note, size, decided)
    taken = sorted({one.attributes["step"] for one in of_protocol(table, "shear")})
    if len(taken) == 2:
        fine = next(one for one in steps(table, taken[0]) if one.name == "QS")
        change, error = ratio(fine, starts[fine.n, fine.start])
        what = f"QS: ⟨p⟩ with Δγ = {taken[0]:.2g} over that with {taken[1]:.2g}"
        size = f"N = {fine.n}, {fine.shares[0].samples} states"
        decided = same(change - 1.0, error, CLOSE_P)
        yield Row(what, None, change, error, "V: small Δγ does not matter", size, decided)


def cut_of_energy(table):
    """How many states the cut would class otherwise were it another."""
    energy = energies(table)
    if len(energy):
        near = np.count_nonzero((energy > 1e-2 * ENERGY_CUT) & (energy < 1e2 * ENERGY_CUT))
        what = "RAND, QS: share of states with U/N between 1e-18 and 1e-14, the cut times and by 100"
        note = f"{near} states: f changes by no more; V: the cut separates jammed from not"
        decided = "yes" if near < 1e-3 * len(energy) else "no"
        yield Row(what, None, near / len(energy), None, note, f"{len(energy)} states", decided)


def apart(one, other):
    """Difference of two numbers with errors."""
    return one[0] - other[0], float(np.hypot(one[1], other[1]))


def same(change, error, close):
    """Whether nothing differs: no beyond WITHIN errors, open where an error is more than `close`."""
    if not error <= close:
        return "open"
    return "yes" if abs(change) <= WITHIN * error else "no"


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
    for corrections in (False, True):
        found = {}
        for ensemble, name in ENSEMBLES.items():
            for observable, symbol, exponent in (("", "f", "nu"), ("-pressure", "⟨p⟩", "y")):
                path = table.path / f"{ensemble}{observable}{'-corrected' * corrections}.h5"
                if not path.exists():  # a fit that did not converge, or that is under way
                    continue
                result = jampetsc.load(path)
                a, n = result.attributes, result["N"]
                form = "with" if corrections else "without"
                what = f"{symbol}(φ, N), {name}, {form} corrections to scaling"
                size = f"N = {n.min():g} … {n.max():g}, χ²/dof {a['chi2'] / a['dof']:.2f}"
                yield Row(
                    f"{what}: φ_J", None, a["phi_J"], a["phi_J_error"], drift_of(result, "phi_J", 4), size
                )
                value, error = a[exponent], a[f"{exponent}_error"]
                note = f"{SAID[exponent, name]}{drift_of(result, exponent, 2)}"
                decided = ""
                if corrections and BOUNDS["omega"][0] * 1.01 < a["omega"] < BOUNDS["omega"][1] * 0.99:
                    found[name, exponent] = value, error
                    least, its_error = OHERN if exponent == "nu" else (1.0, 0.0)
                    decided = (
                        ""
                        if (name, exponent) == ("RAND", "y")
                        else exceeds(value, np.hypot(error, its_error), least)
                    )
                elif corrections:
                    decided, note = "open", f"{note}; ω at the end of its range: more data are needed"
                yield Row(f"{what}: {NAMES[exponent]}", None, value, error, note, size, decided)
        for exponent, symbol in NAMES.items():
            if {("QS", exponent), ("RAND", exponent)} <= found.keys():
                change, error = apart(found["QS", exponent], found["RAND", exponent])
                note = "V: exponents differ between sheared and compressed ensembles"
                what = f"{symbol} of QS less that of RAND"
                decided = exceeds(abs(change), error)
                yield Row(what, None, change, error, note, "", decided)


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


@claim("paper3")
def soft_states(table):
    found = {(one.name, one.potential, one.n): one for one in pressures(table)}
    for (name, potential, n), one in found.items():
        end = one.end
        cuts = ", ".join(f"{y:.2f}({100 * error:.0f})" for y, error in zip(end.y, end.error, strict=True))
        size = f"N = {n}, {len(one.values)} jammed, below the last cut as many as {one.independent:.0f}"
        what = f"{name}, {potential}, N = {n}, φ = {one.phi:g}: y of P(p) ~ p^(1/y − 1), limit of small cuts"
        says = "V: y > 1, P diverges; " if (name, potential) == ("QS", "harmonic") else ""
        note = f"{says}below ⟨p⟩/2, /4, /8: {cuts}"
        decided = exceeds(end.limit, end.limit_error, 1.0) if says else ""
        yield Row(what, None, end.limit, end.limit_error, note, size, decided)
    for n in sorted({n for _, _, n in found}):
        for one, other, note in COMPARED:
            if (*one, n) not in found or (*other, n) not in found:
                continue
            first, second = found[*one, n].end, found[*other, n].end
            change, error = apart((first.limit, first.limit_error), (second.limit, second.limit_error))
            wide, wide_error = apart((first.y[1], first.error[1]), (second.y[1], second.error[1]))
            decided = same(change - 0.5, error, CLOSE_Y) if note == HALF else exceeds(change, error)
            what = f"y of {', '.join(one)} less that of {', '.join(other)}, N = {n}, limit of small cuts"
            yield Row(what, None, change, error, f"{note}; below ⟨p⟩/4 {text(wide, wide_error)}", "", decided)
