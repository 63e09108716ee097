"""Three dimensions: BT and V say that exponents are those of two, their upper critical dimension.

The estimators are those of disks. Flow: exponent of p in γ̇ at φ_c of random starts, between the two nearest φ.
"""

from dataclasses import replace

from claims.jamming import isostaticity, random_starts
from claims.moduli import balanced
from claims.motion import floppy
from claims.shared import Row, claim, power_law, rates_of, size_of, unjudged
from claims.verdicts import Estimate, number

SHIFT = 2e-3  # relative: as far as φ_J of RD0 lies above φ_c of random starts among disks
DISKS = 1.1, 3.5  # y and zν of V, Fig. 5.1


@claim("three-dimensions", "three-dimensions-flow")
def spheres(table, flows):
    of_two_sizes = table.where(command="pack", sizes="", state="done")
    equal = table.where(command="pack", sizes="monodisperse", state="done")
    starts = list(random_starts(of_two_sizes))
    parts = [("3D", balanced(table)), ("3D", floppy(table)), ("3D", isostaticity(of_two_sizes))]
    parts += [("3D, spheres of two sizes", map(unjudged, starts))]
    parts += [("3D, equal spheres", random_starts(equal))]
    parts += [("3D", exponent_of_flow(flows, starts[0].ours.value))] if starts else []
    for words, rows in parts:
        for row in rows:
            yield replace(row, claim=f"{words}, {row.claim}")


def exponent_of_flow(flows, phi_c):
    """The row about p ~ γ̇^q at φ_c; systematic: by the slope of q in φ, as φ_J of flow is not known."""
    groups = [(key["phi"], power_law(*rates_of(part, "pressure"))) for key, part in flows.groups(["phi"])]
    below = [group for group in groups if group[0] <= phi_c]
    above = [group for group in groups if group[0] > phi_c]
    if not below or not above:
        return
    (low, first), (high, second) = below[-1], above[0]
    share = (phi_c - low) / (high - low)
    near = first if share < 0.5 else second
    value = first.value + share * (second.value - first.value)
    systematic = abs(second.value - first.value) / (high - low) * SHIFT * phi_c
    ours = Estimate(value, near.statistical, systematic, near.chi2, near.dof)
    theirs = DISKS[0] / DISKS[1]
    told = ", ".join(f"{one.value:.3f} at φ = {phi:g}" for phi, one in groups)
    yield Row(
        "RD0 at φ_c: p ~ γ̇^q, q = y/zν", f"{theirs:.3g}", ours, number(theirs), f"q is {told}", size_of(flows)
    )
