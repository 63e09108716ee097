"""Correlations of displacements: BT figure 7. C and its first root l, displacements in the phase of the stress."""

import numpy as np

from jampetsc.analysis.displacement_correlation import (
    MAX_LENGTH,
    MIN_LENGTH,
    length_spread,
    medium_collapse,
    stokes_collapse,
)
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.errors import InputError
from jampetsc.plots.correlation_plots import correlation_curve
from papers.claims.medium import correlation, dragged, first_root, solid
from papers.claims.shared import (
    Row,
    bearing,
    beside,
    check,
    claim,
)
from papers.claims.verdicts import Estimate, between, number

BEYOND = 0.1  # ωτ₁ below which contact-damped displacements are compared
APART = 0.03  # δ/L at which C of two sizes is compared
SPREAD = 0.1  # rms of the logarithm within which lengths count as one curve


def stokes(part, angle=0.0, phase="stress", length=1.0):
    """Factor a(k) at finite ω: `part` numpy.real or numpy.imag; angle φ of G*; length ℓ in units of L."""

    def factor(k):
        q = k * length
        turn = 1.0 if phase == "stress" else np.exp(1j * angle)
        return part(turn * q / (np.exp(1j * angle) * q**2 + 1j))

    return factor


@claim("bt-fig7")
def lengths(table):
    """Needs of each correlation: everything."""
    rows = table.where(command="correlate")
    laws = {"contact": {"law": "contact"}, "stokes": {"law": "stokes", "eta_f": 0.0}}
    found = {
        (law, phase): [(one, correlation_curve(one)) for one in rows.where(phase=phase, **words).results()]
        for law, words in laws.items()
        for phase in ("stress", "strain")
    }
    largest = max(curve.attributes["particle_count"] for _, curve in found["stokes", "stress"])
    large = {
        key: [(r, c) for r, c in pairs if c.attributes["particle_count"] == largest]
        for key, pairs in found.items()
    }
    packings = large["stokes", "stress"][0][1].attributes["packings"]
    size = f"N = {largest}, {packings} packings at each of {len(large['stokes', 'stress'])} pressures"
    yield from bearing("contact-size", _contact(found, large, size))
    yield from bearing("plateau", _plateaus(large, size))
    yield from bearing("lanes", _lanes(large, size))
    yield from bearing("spread-7d", _collapses(large, size))
    yield from _phases(large, size)
    yield from _growth_of_length(large, size)
    yield from bearing("minimum", _minima(large))


def _over_size(pairs, part, chosen=lambda omega: omega == omega.min()):
    """(mean, error) of l/L over files and the frequencies chosen; the error of one file's lengths, or their scatter."""
    values, errors = [], []
    for _, curve in pairs:
        at = chosen(curve.omega)
        values.append(np.nanmean(part(curve.G[at])) / curve.size)
        errors.append(np.nanmean(curve.bounds[int(part is np.imag), at]) / curve.size)
    own = np.sqrt(np.nanmean(np.square(errors)) / len(values))
    return float(np.mean(values)), float(np.fmax(own, mean_with_error(values)[1]))


def _ratio(one, other) -> Estimate:
    """Ratio of two numbers (value, error)."""
    value = one[0] / other[0]
    return Estimate(value, abs(value) * float(np.hypot(one[1] / one[0], other[1] / other[0])))


def _plateaus(large, size):
    """l/L as ω → 0 under drag; and whether Re and Im have the same."""
    for phase in ("stress", "strain"):
        pairs = large["stokes", phase]
        both = {name: _over_size(pairs, part) for part, name in ((np.real, "Re"), (np.imag, "Im"))}
        for part, name in ((np.real, "Re"), (np.imag, "Im")):
            value, error = both[name]
            expected = np.mean([first_root(_slow(curve, part, phase)) for _, curve in pairs])
            what = f"Stokes: l/L as ω → 0, {name} u_y, phase of the {phase}"
            if (phase, name) == ("stress", "Re"):
                note = (
                    f"a medium under random stresses has {expected:.3f}; Im u_y has {Estimate(*both['Im'])}"
                )
                yield Row(what, "≈ 1/4", Estimate(value, error), number(0.25), note, size)
            yield check(what, value, error, "", size, f"{expected:.3f}", predicted=True)
        if phase == "stress":
            what = "Stokes: l of Im u_y over l of Re u_y as ω → 0"
            note = "as ω → 0 drag gives u_k ~ 1/k for Re, 1/k³ for Im"
            ours, part = _ratio(both["Im"], both["Re"]), "Stokes, ω → 0"
            yield Row(what, "the same: 1", ours, number(1.0), note, size, bears="re-im", part=part)


def _slow(curve, part, phase):
    """u_k of a medium as ω → 0. In the phase of the stress Im has 1/k of η₀ beside 1/k³ of the drag."""
    if part is np.real:
        return solid
    if phase == "strain":
        return dragged
    low = curve.omega.argmin()
    viscosity = curve.modulus[low].imag / curve.omega[low]
    return lambda k: dragged(k) + viscosity / curve.attributes["particle_count"] * solid(k)


def _contact(found, large, size):
    """Contact damping: one C of δ/L at every N, p and ω, of both parts."""
    both = [_over_size(large["contact", "stress"], part, slow) for part in (np.real, np.imag)]
    for (value, error), name in zip(both, ("Re", "Im"), strict=True):
        what = f"contact: l/L at ω < {BEYOND:g}, {name} u_y"
        if name == "Re":
            yield Row(what, "≈ 1/4", Estimate(value, error), number(0.25), "", size, bears="swirls")
        yield check(what, value, error, "B ~ k² as K", size, f"{first_root(solid):.3f}", predicted=True)
    yield from beside(_lengths_at_pressures(large["contact", "stress"], size))
    yield from _form_of_contact([curve for _, curve in large["contact", "stress"]], size)
    pairs = found["contact", "stress"]
    sizes = sorted({curve.attributes["particle_count"] for _, curve in pairs})
    if len(sizes) < 2:
        return
    roots = [
        _over_size([pair for pair in pairs if pair[1].attributes["particle_count"] == n], np.real, slow)
        for n in (sizes[0], sizes[-1])
    ]
    ratio = _ratio(*roots)
    what = f"contact: l/L at N = {sizes[0]} over that at N = {sizes[-1]}, Re u_y"
    yield check(
        what, ratio.value, ratio.statistical, "the root alone", f"N = {sizes[0]} and {sizes[-1]}", "1"
    )
    yield from _collapse_in_size(pairs, sizes)


def slow(omega):
    """Whether contact-damped displacements are compared at each of these frequencies."""
    return omega < BEYOND


def _lengths_at_pressures(pairs, size):
    """Contact damping: l of Im u_y over l of Re u_y, and l at the lowest over l at the highest pressure."""
    both = [_over_size(pairs, part, slow) for part in (np.real, np.imag)]
    what = f"contact: l of Im u_y over l of Re u_y, ω < {BEYOND:g}"
    ours, part = _ratio(both[1], both[0]), "contact damping"
    yield Row(what, "the same: 1", ours, number(1.0), "", size, bears="re-im", part=part)
    levels = sorted((curve.pressure, _over_size([(r, curve)], np.real, slow)) for r, curve in pairs)
    if len(levels) > 1:
        what = f"contact: l at p = {levels[0][0]:.0e} over l at {levels[-1][0]:.0e}, Re u_y"
        told = "l/L = " + ", ".join(
            f"{value:.3f}({1000 * error:.0f}) at {p:.0e}" for p, (value, error) in levels
        )
        ours = _ratio(levels[0][1], levels[-1][1])
        yield Row(what, "the same: 1", ours, number(1.0), told, size, bears="contact-p")


@claim("bt-fig7-contact", on="contact-p")
def lengths_of_many_packings(table):
    """Needs of each correlation: everything."""
    pairs = [(one, correlation_curve(one)) for one in table.where(command="correlate").results()]
    attributes = pairs[0][1].attributes
    packings, n = attributes["packings"], attributes["particle_count"]
    yield from _lengths_at_pressures(
        pairs, f"N = {n}, {packings} packings at each of {len(pairs)} pressures, along x and y"
    )


def _form_of_contact(curves, size):
    """C of contact damping at L/2 less its least value; and C at one δ/L at the lowest ω over that at the highest."""
    rises, ends = [], []
    for curve in curves:
        known = np.isfinite(curve.C[-1, 0, 0])
        C = curve.C[-1, :, 0][:, known]
        rises += list(C[:, -1] - C.min(axis=1))
        x = curve.delta[-1][known] / curve.size
        ends.append([np.interp(APART, x, C[row]) for row in (curve.omega.argmin(), curve.omega.argmax())])
    what = "contact: C at L/2 less least C, Re u_y"
    note = f"mean over p and ω; {max(rises):.3f} at most"
    ours = Estimate(*mean_with_error(rises))
    yield Row(what, "monotonic: < 0.1", ours, between(high=0.1), note, size, bears="monotonic")
    if len(ends) > 1:
        low, high = (mean_with_error([pair[side] for pair in ends]) for side in (0, 1))
        rates = f"ω = {curve.omega.min():.0e} over that at {curve.omega.max():.0e}"
        what = f"contact: C(δ/L = {APART:g}) at {rates}, Re u_y"
        note = f"C = {Estimate(*low)} and {Estimate(*high)}"
        yield Row(what, "the same: 1", _ratio(low, high), number(1.0), note, size, bears="contact-omega")


def _growth_of_length(large, size):
    """l of drag at ω = 1e-4 over l at 1e-2, in the phase of the stress."""
    for _, curve in large["stokes", "stress"]:
        rows = [int(np.abs(np.log10(curve.omega) + power).argmin()) for power in (4, 2)]
        if np.abs(np.log10(curve.omega[rows]) + np.array([4, 2])).max() > 0.1:
            continue
        ends = [(curve.G[row].real, curve.bounds[0, row]) for row in rows]
        part = f"p = {curve.pressure:.0e}"
        what = f"Stokes, {part}: l at ω = 1e-4 over l at 1e-2, Re u_y"
        note = f"{ends[0][0]:.1f} and {ends[1][0]:.1f} d"
        yield Row(what, "grows: > 1", _ratio(*ends), between(low=1.0), note, size, bears="growth", part=part)


def _collapse_in_size(pairs, sizes):
    """C at one δ/L and ω = 1e-3, mean over pressures, at the smallest and the largest N."""
    means, media = [], []
    for n in (sizes[0], sizes[-1]):
        curves = [curve for _, curve in pairs if curve.attributes["particle_count"] == n]
        at = []
        for curve in curves:
            row = int(np.abs(np.log10(curve.omega) + 3).argmin())
            known = np.isfinite(curve.delta[-1])
            x = curve.delta[-1][known] / curve.size
            at.append([np.interp(APART, x, y[-1, row, 0][known]) for y in (curve.C, curve.errors)])
        values, errors = np.transpose(at)
        means.append((float(values.mean()), float(np.sqrt(np.sum(errors**2)) / len(errors))))
        waves = int(np.mean([curve.size for curve in curves]))
        media.append(correlation(solid, APART, waves) / correlation(solid, 0.0, waves))
    told = " and ".join(f"{value:.3f}({1000 * error:.0f})" for value, error in means)
    note = (
        f"C = {told}; a medium under random stresses has the ratio {media[0] / media[1]:.2f}, as ⟨u²⟩ ~ ln(L/d) "
        "normalises C"
    )
    what = f"contact: C(δ/L = {APART:g}) at N = {sizes[0]} over that at N = {sizes[-1]}, ω = 1e-3, Re u_y"
    size = f"N = {sizes[0]} and {sizes[-1]}, {len(curves)} pressures"
    yield Row(what, "one curve: 1", _ratio(*means), number(1.0), note, size)


def _lanes(large, size):
    """l of narrow lanes over l of wide ones."""
    lanes = np.concatenate([result["length"] for result, _ in large["stokes", "stress"]], axis=1)
    widths = large["stokes", "stress"][0][1].lanes
    for wide, narrow in zip(range(len(widths) - 1), range(1, len(widths)), strict=True):
        ratio = (lanes[narrow] / lanes[wide]).ravel()
        ratio = ratio[np.isfinite(ratio)]
        found = Estimate(float(np.mean(ratio)), float(np.std(ratio) / np.sqrt(len(ratio))))
        what = f"Stokes: l of lanes of {widths[narrow]:.2g} d over that of {widths[wide]:.2g} d"
        note = (
            f"mean over ω, p, Re and Im; single ratios are off by {np.median(np.abs(ratio - 1)):.3f} (median)"
        )
        if narrow == len(widths) - 1:
            target = between(0.98, 1.02)
            yield Row(what, "does not depend: 1 ± 0.02", found, target, note, size)
        else:
            yield check(what, found.value, found.statistical, note, size, "1")


def _spread(curves, take, exponent) -> Estimate:
    """Spread of l (−ln p)^exponent at equal ω/p^½, or for None of l at equal |G*|/ω; jackknife over pressures."""

    def of(chosen):
        if exponent is None:
            return length_spread([(c.omega, take(c), c.size, c.modulus) for c in chosen], medium_collapse)
        given = [(c.omega, take(c), c.size, c.pressure, exponent) for c in chosen]
        return length_spread(given, stokes_collapse)

    value = of(curves)
    without = [of(curves[:n] + curves[n + 1 :]) for n in range(len(curves))] if len(curves) > 2 else []
    error = np.sqrt((len(without) - 1) * np.var(without)) if without else np.nan
    return Estimate(value, float(error))


def _collapses(large, size):
    cases = {
        "l (−ln p)^0.65 at equal ω/p^½": 0.65,
        "l at equal ω/p^½": 0.0,
        "l (−ln p)^−0.65 at equal ω/p^½": -0.65,
        "l at equal |G*|/ω": None,
    }
    for phase in ("stress", "strain"):
        curves = [curve for _, curve in large["stokes", phase]]
        for take, name in ((lambda c: c.G.real + 0j, "Re"), (lambda c: 1j * c.G.imag, "Im")):
            try:
                found = {what: _spread(curves, take, power) for what, power in cases.items()}
            except InputError:  # cells so small that no length is free of their size
                continue
            for what, estimate in found.items():
                claimed = (phase, name) == ("stress", "Re") and cases[what] == 0.65
                claim = f"Stokes: spread (rms) of {what}, {name} u_y, phase of the {phase}"
                if claimed:
                    plain, inverse, medium = (estimate.value for estimate in list(found.values())[1:])
                    note = f"{plain:.2f} with no factor, {inverse:.2f} with its inverse, {medium:.2f} against |G*|/ω"
                    yield Row(
                        claim,
                        f"one curve: < {SPREAD:g}",
                        estimate,
                        between(high=SPREAD),
                        note,
                        size,
                    )
                else:
                    yield check(claim, estimate.value, estimate.statistical, "", size)


def _phases(large, size):
    """Coefficient of l = c √(|G*|/nω) in both phases where p ≪ ω ≪ 1, beside that of the medium."""
    for part, name in ((np.real, "Re"), (np.imag, "Im")):
        for phase in ("strain", "stress"):
            values, angles = [], []
            for _, curve in large["stokes", phase]:
                density = curve.attributes["particle_count"] / curve.size**2
                x, y = medium_collapse(curve.omega, part(curve.G), curve.modulus)
                free = (y > 2 * MIN_LENGTH) & (y < MAX_LENGTH * curve.size)
                free &= np.angle(curve.modulus) > np.pi / 6
                values += list(y[free] / x[free] * np.sqrt(density))
                angles += list(np.angle(curve.modulus[free]))
            if len(values) < 2:
                continue
            expected = first_root(stokes(part, np.mean(angles), phase, 0.04)) / 0.04
            note = f"a medium without disks, at the mean arg G* = {np.mean(angles):.2f}"
            what = f"Stokes, arg G* > π/6: l/√(|G*|/nω), {name} u_y, phase of the {phase}"
            yield check(
                what, *mean_with_error(np.array(values)), note, size, f"{expected:.2f}", predicted=True
            )


def _minima(large):
    """C at its minimum less C at L/2, in the phase of the stress: 0 where the minimum is lost (Fig. 7b)."""
    for result, curve in large["stokes", "stress"]:
        if abs(np.log10(curve.pressure) + 4) > 0.1:
            continue
        size = f"N = {curve.attributes['particle_count']}, {curve.attributes['packings']} packings"
        lanes = int(np.argmax(np.isfinite(curve.C[:, 0, 0]).sum(axis=1)))
        for power in (-6.5, -5.5, -4.5, -3.5):
            row = int(np.abs(np.log10(curve.omega) - power).argmin())
            if abs(np.log10(curve.omega[row]) - power) > 0.05:
                continue
            C, error = curve.C[lanes, row, 0], curve.errors[lanes, row, 0]
            known = np.flatnonzero(np.isfinite(C))
            least, last = known[np.argmin(C[known])], known[-1]
            depth = Estimate(
                float(C[last] - C[least]),
                float(np.hypot(error[last], error[least])) if last != least else 0.0,
            )
            place = result["minimum"][0, row, 0] / float(result.attributes["L"])
            own = result["minimum_error"][0, row, 0] / float(result.attributes["L"])
            what = f"Stokes, p = 1e-4, ω = 10^{power:g}: C at L/2 less C at its minimum"
            note = f"the minimum is at {Estimate(float(place), float(own))} L"
            if power < -5:
                part = f"ω = 10^{power:g}"
                yield Row(what, "no minimum: 0", depth, number(0.0, absolute=0.1), note, size, part=part)
            else:
                yield check(what, depth.value, depth.statistical, note, size, "a minimum: > 0")
