"""How disks move: BT figures 1, 5 and 7, and the lowest modes."""

import numpy as np

from claims.medium import dragged, first_root, solid
from claims.shared import WITHIN, Row, claim
from jampetsc.analysis.correlation_lengths import (
    LONGEST,
    SHORTEST,
    length_spread,
    medium_collapse,
    stokes_collapse,
)
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.errors import InputError
from jampetsc.plots.correlation import correlation_curve

LARGE = 1e3  # pN² above which a packing is large (BT Fig. 8)
SHARP = 0.2  # an exponent is decided if its error is below this part of what is claimed
QUANTITIES = {"normal": ("|Δu∥|", 0.25), "transverse": ("|Δu⊥|", -0.25), "nonaffine": ("|u_na|", -0.25)}


def stokes(part, angle=0.0, phase="stress", length=1.0):
    """Factor a(k) at finite ω: `part` numpy.real or numpy.imag; angle φ of G*; length ℓ in units of L."""

    def factor(k):
        q = k * length
        turn = 1.0 if phase == "stress" else np.exp(1j * angle)
        return part(turn * q / (np.exp(1j * angle) * q**2 + 1j))

    return factor


def agrees(value, error, claimed) -> str:
    """yes or no by two standard errors, open where they are too large to tell."""
    if not np.isfinite(error) or error > SHARP * abs(claimed):
        return "open"
    return "yes" if abs(value - claimed) <= WITHIN * error else "no"


def paired(rows, column):
    """(p (P,), values (S, P)) of the seeds that have a packing at every pressure where pN² is large, p increasing.

    Where it is at fewer than two, as in runs of tiny packings, at every pressure: nothing is decided then.
    """
    p = np.unique(rows["pressure"][rows["pressure"] * rows["n"] ** 2.0 >= LARGE])
    p = p if len(p) > 1 else np.unique(rows["pressure"])
    parts = [rows.where(pressure=one, state="done") for one in p]
    seeds = sorted(set.intersection(*(set(part["seed"].tolist()) for part in parts))) if parts else []
    values = [[part[column][part["seed"] == seed][0] for part in parts] for seed in seeds]
    return p, np.array(values).reshape(len(seeds), len(p))


def fitted(p, values, corrected):
    """(exponent, standard error) of ln y = ln A + x ln p [+ B p^½], fitted to each packing, mean over packings."""
    columns = [np.ones_like(p), np.log(p)] + [np.sqrt(p)] * corrected
    solution = np.linalg.lstsq(np.column_stack(columns), np.log(values).T, rcond=None)[0]
    return mean_with_error(solution[1])


def exponents(rows, column, claim, claimed, note="", printed=True):
    """Rows for an exponent in p: a power law, and one with a relative correction ~ p^½ where there are points."""
    p, values = paired(rows, column)
    if len(p) < 2 or not len(values):
        return
    values = np.abs(values)
    local = np.diff(np.log(values).mean(axis=0)) / np.diff(np.log(p))
    told = "between neighbouring pressures, low first: " + ", ".join(f"{x:.2f}" for x in local)
    size = f"N = {rows['n'].max()}, {len(values)} packings at each p = {p[0]:.0e} … {p[-1]:.0e}"
    for corrected in (False, True)[: 2 if len(p) > 3 else 1]:
        value, error = fitted(p, values, corrected)
        more = ", corrections ~ p^½" if corrected else ""
        words = note if corrected else "; ".join(filter(None, (note, told)))
        theirs = claimed if printed else None
        decided = agrees(value, error, claimed)
        if p[0] * rows["n"].max() ** 2.0 < LARGE:
            decided, words = "open", f"pN² < {LARGE:g}: finite size; {words}"
        if decided == "no" and not corrected and len(p) > 3:
            words += "; a power law alone: see the row with corrections"
        yield Row(f"{claim}{more}", theirs, value, error, words, size, decided)


@claim("bt-fig1")
def instants(table):
    """Needs of each sweep: omega, G and the fields (of one packing at least)."""
    found = {}
    for sweep in table.where(command="sweep").results():
        if "fields/displacement" not in sweep:
            continue
        for row, omega in enumerate(sweep["fields/omega"]):
            field, G = sweep["fields/displacement"][row], sweep.modulus(omega)
            turned = field * np.conj(G) / abs(G)
            size = [np.sqrt(np.mean(np.abs(part) ** 2)) for part in (field, turned.imag, turned.real)]
            found.setdefault(float(omega), []).append((size[0], size[1] / size[2]))
    note = "rms |ũ| per unit strain over all disks"
    for omega, values in sorted(found.items()):
        sizes, ratios = np.transpose(values)
        size = f"N = {table.where(command='sweep')['n'].max()}, {len(values)} packings"
        yield Row(
            f"ω = {omega:.0e}: non-affine motion per strain, in d", None, *mean_with_error(sizes), note, size
        )
        yield Row(
            f"ω = {omega:.0e}: ũ at zero over ũ at peak stress", None, *mean_with_error(ratios), "", size
        )


@claim("bt-fig5")
def floppy(table):
    """Needs of each quasistatic file: attributes only."""
    slow = table.where(command="quasistatic")
    for prefix, where in (("no_prestress_", "without pre-stress"), ("", "with pre-stress")):
        below = int(np.sum(slow["G0"] < 0)) if not prefix else 0
        note = f"G₀ < 0 in {below} packings, which count like the others" if below else ""
        for column, (name, claimed) in QUANTITIES.items():
            what = f"median {name} ~ p^x, {where}"
            yield from exponents(slow, f"{prefix}{column}_median", what, claimed, note)
    yield from _mean_normal(slow)
    p, normal = paired(slow, "no_prestress_normal_rms")
    _, transverse = paired(slow, "no_prestress_transverse_rms")
    if len(p) > 1 and len(normal):
        size = f"N = {slow['n'].max()}, {len(normal)} packings at each p = {p[0]:.0e} … {p[-1]:.0e}"
        value, error = fitted(p, (transverse / normal) ** 2, False)
        decided = agrees(value, error, -1.0)
        yield Row("Σ(Δu⊥)²/Σ(Δu∥)² ~ p^x (BT 20)", -1.0, value, error, "", size, decided)


def _mean_normal(slow):
    """The mean of |Δu∥| beside the rms, which √G₀ gives exactly."""
    p, mean = paired(slow, "no_prestress_normal_mean")
    _, rms = paired(slow, "no_prestress_normal_rms")
    if len(p) < 2 or not len(mean):
        return
    size = f"N = {slow['n'].max()}, {len(mean)} packings"
    local = np.diff(np.log(mean), axis=1) / np.diff(np.log(p))
    defect = float(np.nanmax(np.abs(slow["no_prestress_identity_difference"])))
    what = f"mean |Δu∥| ~ p^x at the lowest pressures, p = {p[0]:.0e} … {p[1]:.0e} (BT: levels off)"
    note = (
        "no plateau: k Σ(Δu∥)² = G₀Vγ² exactly, here to "
        f"{defect:.0e}, so the mean ≤ rms ~ p^¼ cannot level off while G₀ falls"
    )
    yield Row(what, None, *mean_with_error(local[:, 0]), note, size, "no")
    ratio = (mean / rms).mean(axis=0)
    told = "from low to high p: " + ", ".join(f"{one:.2f}" for one in ratio)
    yield Row(
        "mean |Δu∥| over its rms at the lowest p", None, *mean_with_error((mean / rms)[:, 0]), told, size
    )


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
    yield from _plateaus(large, size)
    yield from _contact(found, large, size)
    yield from _lanes(large, size)
    yield from _collapses(large, size)
    yield from _phases(large, size)
    yield from _minima(large)


def _over_size(pairs, part, chosen=lambda omega: omega == omega.min()):
    """(mean, error) of l/L over files and the frequencies chosen; the error of one file's lengths, or their scatter."""
    values, errors = [], []
    for _, curve in pairs:
        at = chosen(curve.omega)
        values.append(np.nanmean(part(curve.G[at])) / curve.size)
        errors.append(np.nanmean(curve.bounds[int(part is np.imag), at]) / curve.size)
    own = np.sqrt(np.nanmean(np.square(errors)) / len(values))
    return float(np.mean(values)), float(np.fmax(own, mean_with_error(values)[1]))


def _plateaus(large, size):
    for phase in ("stress", "strain"):
        for part, name in ((np.real, "Re"), (np.imag, "Im")):
            pairs = large["stokes", phase]
            value, error = _over_size(pairs, part)
            expected = np.mean([first_root(_slow(curve, part, phase)) for _, curve in pairs])
            note = f"random stresses in an isotropic medium give {expected:.3f} (docs/physics.md)"
            theirs = 0.25 if (phase, name) == ("stress", "Re") else None
            if theirs:
                note += (
                    "; ¼ is what a single longest wave has, and nearly what Im in the phase of the strain has"
                )
            what = f"Stokes: l/L as ω → 0, {name} u_y, phase of the {phase}"
            yield Row(what, theirs, value, error, note, size, agrees(value, error, theirs or expected))


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
    pairs = large["contact", "stress"]
    both = [_over_size(pairs, part, lambda omega: omega < 0.1) for part in (np.real, np.imag)]
    for (value, error), name in zip(both, ("Re", "Im"), strict=True):
        note = "from random stresses .169 L for both parts, as B ~ k² like K"
        decided = agrees(value, error, first_root(solid))
        what = f"contact: l/L at ω < 0.1, {name} u_y, phase of the stress"
        yield Row(what, None, value, error, note, size, decided)
    sizes = sorted({curve.attributes["particle_count"] for _, curve in found["contact", "stress"]})
    if len(sizes) > 1:
        part = [
            _over_size(
                [pair for pair in found["contact", "stress"] if pair[1].attributes["particle_count"] == n],
                np.real,
                lambda omega: omega < 0.1,
            )
            for n in (sizes[0], sizes[-1])
        ]
        ratio = part[0][0] / part[1][0]
        error = ratio * np.hypot(*(e / v for v, e in part))
        what = f"contact: l/L at N = {sizes[0]} over that at N = {sizes[-1]} (no length but L)"
        note = "BT print no number: the collapse in δ/L is 1"
        decided = agrees(ratio, error, 1.0)
        yield Row(what, None, ratio, error, note, f"N = {sizes[0]} and {sizes[-1]}", decided)


def _lanes(large, size):
    lanes = np.concatenate([result["length"] for result, _ in large["stokes", "stress"]], axis=1)
    widths = large["stokes", "stress"][0][1].lanes
    errors = np.concatenate([result["length_error"] for result, _ in large["stokes", "stress"]], axis=1)
    own = float(np.nanmedian(errors[0] / lanes[0]))
    for wide, narrow in zip(range(len(widths) - 1), range(1, len(widths)), strict=True):
        change = float(np.nanmedian(np.abs(lanes[narrow] / lanes[wide] - 1)))
        what = f"Stokes: change of l from lanes of {widths[wide]:.2g} d to {widths[narrow]:.2g} d"
        note = f"median over ω, p, Re and Im; l has an error of {own:.1%}"
        decided = "yes" if change <= own else "open"
        yield Row(what, None, change, None, note, size, decided)


def _collapses(large, size):
    for phase in ("stress", "strain"):
        curves = [curve for _, curve in large["stokes", phase]]
        for take, name in ((lambda c: c.G.real + 0j, "Re"), (lambda c: 1j * c.G.imag, "Im")):
            spreads = {}
            try:
                for exponent in (0.65, 0.0, -0.65):
                    given = [(c.omega, take(c), c.size, c.pressure, exponent) for c in curves]
                    spreads[f"l (−ln p)^{exponent:g} at equal ω/p^½"] = length_spread(given, stokes_collapse)
                given = [(c.omega, take(c), c.size, c.modulus) for c in curves]
                spreads["l at equal |G*|/ω"] = length_spread(given, medium_collapse)
            except InputError:  # cells so small that no length is free of their size
                continue
            best = min(spreads, key=spreads.get)
            for what, value in spreads.items():
                note = "as printed" if "^0.65" in what else ""
                note += "; least of the four" if what == best else ""
                decided = {"as printed": "no"}.get(note, "")
                what = f"Stokes: spread of {what}, {name} u_y, phase of the {phase}"
                note = note.removeprefix("; ")
                yield Row(what, None, value, None, note, size, decided)


def _phases(large, size):
    """Coefficient of l = c √(|G*|/nω) in both phases where p ≪ ω ≪ 1, beside that of the medium."""
    for part, name in ((np.real, "Re"), (np.imag, "Im")):
        for phase in ("strain", "stress"):
            values, angles = [], []
            for _, curve in large["stokes", phase]:
                density = curve.attributes["particle_count"] / curve.size**2
                x, y = medium_collapse(curve.omega, part(curve.G), curve.modulus)
                free = (y > 2 * SHORTEST) & (y < LONGEST * curve.size)
                free &= np.angle(curve.modulus) > np.pi / 6
                values += list(y[free] / x[free] * np.sqrt(density))
                angles += list(np.angle(curve.modulus[free]))
            if len(values) < 2:
                continue
            expected = first_root(stokes(part, np.mean(angles), phase, 0.04)) / 0.04
            note = f"medium without disks: {expected:.2f} at the mean arg G* = {np.mean(angles):.2f}"
            what = f"Stokes, arg G* > π/6: l/√(|G*|/nω), {name} u_y, phase of the {phase}"
            yield Row(what, None, *mean_with_error(np.array(values)), note, size)


def _minima(large):
    """Where C of Re u_y is least: inside the cell where a length shows, at L/2 where the cell cuts it off (Fig. 7b)."""
    for result, curve in large["stokes", "stress"]:
        if abs(np.log10(curve.pressure) + 4) > 0.1:
            continue
        places = result["minimum"][0, :, 0] / float(result.attributes["L"])
        for exponent in (-6.5, -5.5, -4.5, -3.5):
            row = int(np.abs(np.log10(curve.omega) - exponent).argmin())
            if abs(np.log10(curve.omega[row]) - exponent) < 0.05:
                error = float(result["minimum_error"][0, row, 0]) / float(result.attributes["L"])
                lost = "yes" if places[row] + WITHIN * error >= 0.45 else "no"
                yield Row(
                    f"Stokes, p = 1e-4: place of the minimum of C over L, ω = 10^{exponent:g}",
                    None,
                    places[row],
                    error,
                    "BT: lost at 10^−6.5 and 10^−5.5, where C falls on to L/2",
                    f"N = {curve.attributes['particle_count']}, {curve.attributes['packings']} packings",
                    lost if exponent < -5 else "",
                )


@claim("bt-modes")
def lowest(table):
    """Needs of each modes file: attributes, eigenvalues and shear_force; the rest is in the table."""
    rows = table.where(command="modes")
    rows = rows.where(n=int(rows["n"].max()))
    counts = [count for count in (10, 50, 200) if f"floppiness_{count}" in rows]
    if counts:
        what = f"rms Δu⊥ over rms Δu∥ of the lowest {counts[0]} modes ~ p^x"
        note = (
            f"expected −½: modes at the edge of the plateau have λ ~ p, and k Σ(Δu∥)² = λ; {_methods(rows)}"
        )
        yield from exponents(rows, f"floppiness_{counts[0]}", what, -0.5, note, printed=False)
    for name, symbol in (("nonaffine", "|u_na|²"), ("transverse", "Δu⊥²"), ("normal", "Δu∥²")):
        for count in counts:
            p, share = paired(rows, f"share_{name}_{count}")
            if len(share):
                told = "from low to high p: " + ", ".join(f"{one:.3f}" for one in share.mean(axis=0))
                size = f"N = {rows['n'].max()}, {len(share)} packings"
                what = f"share of {symbol} that the lowest {count} modes carry, p = {p[0]:.0e}"
                yield Row(what, None, *mean_with_error(share[:, 0]), told, size)
    for name, (symbol, _) in QUANTITIES.items() if counts else ():
        p, alone = paired(rows, f"{name}_median_{counts[-1]}")
        _, whole = paired(rows, f"{name}_median")
        if len(alone):
            ratio = alone / whole
            told = "from low to high p: " + ", ".join(f"{one:.2f}" for one in ratio.mean(axis=0))
            what = f"median {symbol} by the lowest {counts[-1]} modes alone over that of the whole, p = {p[0]:.0e}"
            size = f"N = {rows['n'].max()}, {len(alone)} packings"
            yield Row(what, None, *mean_with_error(ratio[:, 0]), told, size)
    yield from _floppy_band(rows)


def _methods(rows):
    return "found by " + ", ".join(sorted(set(rows["method"].tolist())))


def _floppy_band(rows):
    """What the modes with λ < X p alone do, X the largest that all files reach: their number is ~ N p^½."""
    files = [
        (seed, one)
        for seed, one in zip(rows["seed"][rows["state"] == "done"], rows.results(), strict=True)
        if one.attributes["pressure"] * one.attributes["particle_count"] ** 2.0 >= LARGE
    ]
    if not files:
        return
    reach = min(one["eigenvalues"][-1] / one.attributes["pressure"] for _, one in files)
    p = np.array(sorted({float(f"{one.attributes['pressure']:.3g}") for _, one in files}))
    found = {}
    for seed, one in files:
        values, force = one["eigenvalues"], one["shear_force"]
        low = values < reach * one.attributes["pressure"]
        parts = np.sum(force[low] ** 2 / values[low]), np.sum((force[low] / values[low]) ** 2)
        place = int(np.abs(np.log(p / one.attributes["pressure"])).argmin())
        found.setdefault(int(seed), {})[place] = np.sqrt(parts)
    whole = [[found[seed][n] for n in range(len(p))] for seed in sorted(found) if len(found[seed]) == len(p)]
    values = np.array(whole).reshape(-1, len(p), 2)
    if len(p) < 2 or not len(values) or not (values > 0).all():
        return
    size = f"N = {rows['n'].max()}, {len(values)} packings at each p = {p[0]:.0e} … {p[-1]:.0e}"
    for column, (symbol, claimed) in enumerate((("Δu∥", 0.25), ("u_na", -0.25))):
        value, error = fitted(p, values[:, :, column], False)
        note = f"expected {claimed:+g}, as for the whole; from Σ F²/λ and Σ (F/λ)²; {_methods(rows)}"
        what = f"rms {symbol} by the modes with λ < {reach:.2g} p alone ~ p^x"
        yield Row(what, None, value, error, note, size, agrees(value, error, claimed))
