"""Three dimensions: BT and V say that exponents are those of two, their upper critical dimension.

The estimators are those of disks. Flow: exponents of p and σ in γ̇ at φ_c of random starts, between the two nearest φ;
systematic: half of the change without the largest rate, and the slope in φ times a shift of φ_J.
"""

from dataclasses import replace

import numpy as np

import jampetsc
from jampetsc.analysis.power_laws import local_exponents
from papers.claims.finite_size import OHERN, drift_of, finite_size
from papers.claims.flow import slower
from papers.claims.jamming import PHI_MARGIN, isostaticity, random_starts
from papers.claims.moduli import balanced
from papers.claims.motion import floppy_rows
from papers.claims.shared import (
    SYMBOLS,
    Row,
    bearing,
    beta_of,
    check,
    claim,
    fitted,
    power_law,
    rates_of,
    size_of,
    unjudged,
)
from papers.claims.verdicts import Estimate, difference, number

SHIFT = 2e-3  # relative: as far as φ_J of RD0 lies above φ_c of random starts among disks
DISKS = 1.1, 3.5  # y and zν of V, Fig. 5.1
SLOW = 2e-3  # γ̇ below which exponents are fitted, as among disks
IN_SPACE = {  # {claim of disks: (claim of spheres, whether its numbers decide)}
    "G0": ("3D-G0", True),
    "eta0": ("3D-eta0", True),
    "omega*": ("3D-omega*", True),
    "Delta": ("3D-Delta", True),
    "median-normal": ("3D-floppy", True),
    "median-transverse": ("3D-floppy", True),
    "median-nonaffine": ("3D-floppy", True),
    "squares": ("3D-floppy", False),
    "mean-normal": ("3D-floppy", False),
    "G0-prestress": ("3D-G0", False),
    "shallow": ("3D-eta0", False),
    "border": ("3D-Delta", False),
    "collapse": ("3D-Delta", False),
    "rotations": ("3D-Delta", False),
}
OHERN_PHI = 0.648  # φ_c of O'Hern et al. (2003), of harmonic spheres of radii 1 : 1.4


@claim("three-dimensions", "three-dimensions-flow")
def spheres(table, flows):
    of_two_sizes = table.where(command="pack", sizes="", state="done")
    equal = table.where(command="pack", sizes="monodisperse", state="done")
    starts = list(random_starts(of_two_sizes))
    parts = [("3D", in_space(balanced(table))), ("3D", in_space(floppy_rows(table, "rms")))]
    parts += [("3D", bearing("3D-isostatic", isostaticity(of_two_sizes)))]
    parts += [("3D, spheres of two sizes", bearing("3D-phi_c", map(unjudged, starts)))]
    parts += [("3D, equal spheres", bearing("3D-phi_c", random_starts(equal)))]
    parts += [("3D", bearing("3D-flow", flow_at(flows, starts[0].ours.value)))] if starts else []
    for words, rows in parts:
        for row in rows:
            yield replace(row, claim=f"{words}, {row.claim}")


def in_space(rows):
    """The numbers with the claims of three dimensions on which they bear; those of other claims decide none."""
    for row in rows:
        bears, decides = IN_SPACE[row.bears]
        yield replace(row, bears=bears, part=row.part if decides else None)


def flow_at(flows, phi_c):
    """The rows about p, σ ~ γ̇^q at φ_c."""
    found = {
        symbol: exponent_of_flow(flows, phi_c, name)
        for name, symbol in (("pressure", "p"), ("shear_stress", "σ"))
    }
    if None in found.values():
        return
    theirs = DISKS[0] / DISKS[1]
    (ours, note), (of_stress, its) = found.values()
    size = size_of(slower(flows, SLOW))
    yield Row("RD0 at φ_c: p ~ γ̇^q, q = y/zν", f"{theirs:.3g}", ours, number(theirs), note, size)
    yield check("RD0 at φ_c: σ ~ γ̇^q", of_stress.value, 0.5 * of_stress.half_width, its, size)
    change = Estimate(of_stress.value - ours.value, float(np.hypot(of_stress.inflated, ours.inflated)))
    note = "with one y/zν it tends to 0 as γ̇ falls: corrections to scaling are larger for σ, as among disks"
    yield check("RD0 at φ_c: q of σ less q of p", change.value, change.statistical, note, size)
    yield from collapsed_flow(flows)


def collapsed_flow(flows):
    """The rows about φ_J, y and zν of collapses of p and σ, of p beside V's of disks."""
    for name, symbol in (("pressure", "p"), ("shear-stress", "σ")):
        found = fitted(flows, name)
        if not found:
            continue
        result = jampetsc.load(flows.path / f"{name}.h5")
        rates, phi = np.unique(result["rate"]), np.unique(result["phi"])
        size = f"N = {result['N'][0]:g}, γ̇ = {rates[0]:g} to {rates[-1]:g}, φ = {phi[0]:g} to {phi[-1]:g}"
        told = ", ".join(f"{SYMBOLS[parameter]} = {one}" for parameter, one in found.items())
        for parameter, ours in found.items():
            what = f"RD0, collapse of {symbol}: {SYMBOLS[parameter]}"
            theirs = dict(zip(("y", "znu"), DISKS, strict=True)).get(parameter)
            if symbol == "p" and theirs:
                words, target, part = f"of disks: {theirs:g}", number(theirs), SYMBOLS[parameter]
                yield Row(what, words, ours, target, told, size, bears="3D-fit", part=part)
            else:
                yield check(what, ours.value, 0.5 * ours.half_width, told, size, bears="3D-fit")
        beta, note = beta_of(result, found["znu"], found["y"])
        what = f"RD0, collapse of {symbol}: β = zν − y"
        yield check(what, beta.value, beta.statistical, note, size, "of disks: 2.4", bears="3D-fit")


def exponent_of_flow(flows, phi_c, name):
    """(exponent of p or σ at φ_c, what it is at each φ) from γ̇ < SLOW; None with too few φ or rates.

    Systematic: by the slope of q in φ, as φ_J of flow is not known, and by half of the change without the largest rate.
    """
    groups = []
    for key, part in flows.groups(["phi"]):
        rates, values, errors = rates_of(slower(part, SLOW), name)
        if len(rates) > 2:
            points = rates, values, errors
            groups.append((key["phi"], power_law(*points), power_law(*(one[:-1] for one in points)), points))
    below = [group for group in groups if group[0] <= phi_c]
    above = [group for group in groups if group[0] > phi_c]
    if not below or not above:
        return None
    (low, *first), (high, *second) = below[-1], above[0]
    share = (phi_c - low) / (high - low)

    def between(one, other):
        return one.value + share * (other.value - one.value)

    value = between(first[0], second[0])
    by_density = abs(second[0].value - first[0].value) / (high - low) * SHIFT * phi_c
    by_rate = 0.5 * abs(between(first[1], second[1]) - value)
    own = float(np.hypot((1 - share) * first[0].statistical, share * second[0].statistical))
    chi2, dof = first[0].chi2 + second[0].chi2, first[0].dof + second[0].dof
    ours = Estimate(value, own, float(np.hypot(by_density, by_rate)), chi2, dof)
    told = ", ".join(f"{one.value:.3f} at φ = {phi:g}" for phi, one, *_ in groups)
    rates, local, _ = local_exponents(*(first if share < 0.5 else second)[2])
    nearest = low if share < 0.5 else high
    told += f"; between neighbouring γ̇ at φ = {nearest:g}, from the lowest: "
    return ours, told + ", ".join(f"{one:.3f}" for one in local)


@claim("three-dimensions", "three-dimensions-jamming", on="3D-nu")
def random_spheres(packings, samples):
    """f(φ, N) of random starts: φ_J and ν, with L = N^(1/3)."""
    for row in finite_size(samples):
        yield replace(
            unjudged(row), claim=f"3D, {row.claim}", bears="3D-phi_J" if row.bears == "phi_J" else ""
        )
    found = fitted(samples, "random")
    if not found:
        return
    result = jampetsc.load(samples.path / "random.h5")
    n, size = result["N"], samples.where(command="jam")["samples"]
    size = f"N = {n.min():g} … {n.max():g}, {size.min():g} to {size.max():g} samples at each φ"
    nu, phi_J = found["nu"], found["phi_J"]
    width = Estimate(*(3.0 * one for one in (nu.value, nu.inflated, nu.systematic)))
    note = f"Dν = {width}, 2 where N^(−½) scales the width in any D; {drift_of(result, 'nu', 2)}"
    words = f"{OHERN[0]:g}({100 * OHERN[1]:.0f})"
    target = number(OHERN[0], absolute=2 * OHERN[1])
    yield Row("3D, RAND: ν of f(φ, N)", f"O'Hern et al.: {words}", nu, target, note, size)
    note, target = drift_of(result, "phi_J", 4), number(OHERN_PHI, absolute=PHI_MARGIN)
    what, words = "3D, RAND: φ_J of f(φ, N)", f"O'Hern et al.: {OHERN_PHI:g}"
    yield Row(what, words, phi_J, target, note, size, bears="3D-phi_J")
    for row in random_starts(packings.where(command="pack", sizes="", state="done")):
        change = difference(phi_J, row.ours)
        what = "3D, RAND: φ_J of f(φ, N) less φ_c of packings at p → 0"
        note = f"φ_J = {phi_J}, φ_c = {row.ours}"
        target = number(0.0, absolute=PHI_MARGIN)
        yield Row(what, "one number: 0", change, target, note, size, bears="3D-one-phi_J")
