"""Statements of V without a figure: limits of models, contacts, bands, minimisers, and coordinates in doubles.

Primary estimators. Overdamped limit: σ at the least Q over that without mass, or its exponent in Q. Contacts: half-life
of those of a state. Bands: rms over layers of mean profiles, less what their errors make. Minimiser and dynamics: ratio
of mean energies, from pairs. Coordinates: exponent of the rms net force in the distance from the origin.
"""

import numpy as np

from papers.claims.shared import Row, check, claim, mean_over_seeds, power_law, size_of
from papers.claims.verdicts import Estimate, between, number
from papers.tables.layers import bands
from papers.tables.lifetimes import lifetimes
from papers.tables.overdamped import LIMITS, limits
from papers.tables.precision import gradients
from papers.tables.relaxation import MINIMISERS, compared, unfinished

FLAT = 0.01  # of γ̇H or φ: a profile that varies by less has no bands
LONG, SHORT = 10.0, 2.0  # half-lives in durations of a collision
LIGHT = 0.35  # Q below which the exponent of σ in Q is taken


@claim("overdamped-limit", on="overdamped")
def overdamped_limits(table):
    flows, found = table.where(command="flow"), limits(table)
    for model, (q, ratio, error) in found.items():
        size = size_of(flows.where(model=[model, LIMITS[model]]))
        told = ", ".join(f"{r:.3g} at Q = {x:g}" for r, x in zip(ratio, q, strict=True))
        what = f"{model}, φ = 0.78: σ at Q = {q[-1]:g} over σ of {LIMITS[model]}"
        if model in ("RD", "CD"):
            ours = Estimate(ratio[-1], error[-1])
            words = f"has an overdamped limit, {LIMITS[model]}: 1"
            part = f"σ of {model} over σ of {LIMITS[model]}"
            yield Row(what, words, ours, number(1.0), told, size, part=part)
            continue
        yield check(what, ratio[-1], error[-1], told, size)
        light = q < LIGHT
        rows = flows.where(model=model)
        sigma, own = np.transpose([mean_over_seeds(rows.where(quality=x), "shear_stress") for x in q[light]])
        slope = power_law(q[light], sigma, own)
        what = f"{model}, φ = 0.78: σ ~ Q^x, Q = {q[-1]:g} to {q[light][0]:g}"
        if model == "CDn":
            words = "no overdamped limit, σ → 0 with the mass: > 1"
            note = f"σ over σ of CD0 {told}"
            yield Row(what, words, slope, between(low=1.0), note, size, part="x of σ ~ Q^x, CDn")
        else:
            yield check(what, slope.value, slope.inflated, "0 where there is an overdamped limit", size)


@claim("contact-lifetimes", on="clusters")
def contacts(table):
    flows = table.where(command="flow")
    for model, rates in lifetimes(table).items():
        slow = min(rates)
        life, error, duration = rates[slow]
        told = ", ".join(
            f"{one:.3g} of strain or {one / rate / duration:.2g} durations at γ̇ = {rate:g}"
            for rate, (one, *_) in rates.items()
        )
        size = size_of(flows.where(model=model))
        ours = Estimate(life / slow / duration, error / slow / duration)
        kind = "Bagnoldian" if model == "CDn" else "Newtonian"
        part = f"half-life of contacts over a collision, {model}"
        what = f"{model}, φ = 0.78, Q = 3, γ̇ = {slow:g}, {kind}: half-life of contacts over the duration of a collision"
        if model == "CDn":
            words = f"particles part after contact: < {SHORT:g}"
            yield Row(what, words, ours, between(high=SHORT), told, size, part=part)
        elif model == "CD":
            words = f"particles stay together: > {LONG:g}"
            yield Row(what, words, ours, between(low=LONG), told, size, part=part)
        else:
            yield check(what, ours.value, ours.statistical, told, size, f"> {LONG:g}")


@claim("lees-edwards", on="bands")
def no_bands(table):
    flows = table.where(command="flow")
    for model in np.unique(flows["model"]):
        rows = flows.where(model=model)
        velocity, density, of_velocity, of_density = bands(rows.results())
        for part, what, ours, words, chi2 in (
            ("u_x", "spread of u_x(y) over γ̇H", velocity, "u_x(y) = 0", of_velocity),
            ("φ", "spread of φ(y) over φ", density, "φ(y) is flat", of_density),
        ):
            what = f"Lees–Edwards, {model}, φ = 0.84, γ̇ = 0.01: {what}"
            note = f"χ²/dof of a flat profile {chi2:.1f}"
            if model == "CD":
                words = f"{words}: < {FLAT:g}"
                yield Row(what, words, Estimate(*ours), between(-FLAT, FLAT), note, size_of(rows), part=part)
            else:
                yield check(what, *ours, note, size_of(rows), f"< {FLAT:g}")


@claim("relaxation", on="minimiser")
def minimisers(table):
    size = f"N = {table['n'][0]:.0f}, {table.rows} starts"
    note = f"U still changes by {unfinished(table):.0e} at most in the second half of the dynamics"
    for name, words in MINIMISERS.items():
        ratio, share = (Estimate(*one) for one in compared(table, name))
        what = f"RD0 at rest over {words}, φ = 0.86, same starts: ⟨U⟩"
        differ = f"RD0 at rest and {words}: share of starts that end in different states"
        if name == "gradients":
            part = "ratio of ⟨U⟩"
            yield Row(what, "mean energies agree: 1", ratio, number(1.0), note, size, part=part)
            part = "share of different states"
            yield Row(differ, "single states differ: > 0", share, between(low=0.0), "", size, part=part)
        else:
            yield check(what, ratio.value, ratio.statistical, "", size, "1")
            yield check(differ, share.value, share.statistical, "", size)


@claim("split-coordinates", on="coordinates")
def force_gradients(table):
    found = gradients(table.path)
    p = found["pressure"].min()
    at = found["pressure"] == p
    r, disks, two, one = (found[name][at] for name in ("distance", "disks", "two_parts", "doubles"))
    relative = 0.5 / np.sqrt(disks)  # error of an rms of so many vectors
    excess = np.sqrt(one**2 - two**2)  # what rounding of coordinates adds
    size = f"N = {found['n'][0]:.0f}, p = {p:g}"
    for values, name, words, target in (
        (excess, "in one double", "grow away from the origin: > 0", between(low=0.0)),
        (two, "in two parts", "no gradient: 0", number(0.0, absolute=0.1)),
    ):
        slope = power_law(r, values, relative * values)
        told = " and ".join(f"{values[i]:.1e} at {r[i]:.1f} d" for i in (0, -1))
        what = f"coordinates {name}, p = {p:g}: rms residual force ~ r^x"
        note = f"{told} from the origin, in units of p d"
        yield Row(what, words, slope, target, note, size, part=name)
