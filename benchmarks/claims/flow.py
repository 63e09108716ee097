"""Steady flow: V figures 4.8, flow curves, papers IV and V."""

import numpy as np

from claims.shared import Row, claim, mean_over_seeds, rates_of, slope_with_error
from jampetsc.plots.flowcurves import local_exponents


@claim("vagberg-flow-curves")
def flow_curves(table):
    at = table.where(command="flow", phi=0.8433)
    slow = at.where(rate=[rate for rate in np.unique(at["rate"]) if rate < 2e-3])
    yield Row(
        "RD0 at φ_J = 0.8433: p ~ γ̇^x, γ̇ ≤ 1e-3",
        round(1.1 / 3.5, 3),
        *slope_with_error(*rates_of(slow, "pressure")),
        "one seed, and its error from its own autocorrelation: runs differ by more (docs/flow.md)",
    )
    yield Row(
        "RD0 at φ_J = 0.8433: σ ~ γ̇^x, γ̇ ≤ 1e-3",
        round(1.1 / 3.5, 3),
        *slope_with_error(*rates_of(slow, "shear_stress")),
        "σ has larger corrections to scaling than p, as V says",
    )
    below = table.where(command="flow", phi=0.80)
    rates, p, error = rates_of(
        below.where(rate=[r for r in np.unique(below["rate"]) if r < 5e-4]), "pressure"
    )
    yield Row(
        "RD0 at φ = 0.80: p ~ γ̇^x, lowest rates (Newtonian)",
        1.0,
        *slope_with_error(rates, p, error),
        "approached from below as γ̇ falls (panel d of the picture)",
    )


@claim("vagberg-fig4.8")
def velocity_correlation(table):
    for model, says in (("RD0", "moves out as γ̇ falls"), ("CD0", "has none")):
        files = sorted(
            table.where(command="correlate", model=model).results(), key=lambda g: -g.attributes["rate"]
        )
        for g in files:
            x, depth = g.attributes["minimum_at"], g.attributes["minimum"]
            half = g["x"][-1]
            where = f"at x = {x:.1f}" if x < 0.8 * half else "at the edge of the cell: none inside"
            yield Row(
                f"{model}, γ̇ = {g.attributes['rate']:g}: minimum of g_y {says}", None, depth, None, where
            )


@claim("paper4")
def regimes(table):
    flows = table.where(command="flow", quality=1.0)
    cases = [("RD", 0.78, 1.0), ("CD", 0.78, 1.0), ("CDt", 0.78, 1.0), ("CDn", 0.78, 2.0), ("CD", 0.5, None)]
    for model, phi, theirs in cases:
        mine = flows.where(model=model, phi=phi)
        if mine.rows < 2:
            continue
        rates, stress, error = rates_of(mine, "shear_stress")
        slope = local_exponents(rates, stress)[1][0]
        spread = np.hypot(*(error[:2] / stress[:2])) / np.log(rates[1] / rates[0])
        (slowest,) = mine.where(rate=rates[0]).results()
        steady = slowest["strain"] > slowest.attributes["discard"]
        share = np.mean(slowest["largest_cluster"][steady]) / mine["n"][0]
        note = f"one seed, γ̇ = {rates[0]:g} to {rates[1]:g}; {100 * share:.0f} % of the disks in the largest cluster"
        if model in ("CD", "CDt") and phi > 0.7:
            note += "; still rising as γ̇ falls"
        yield Row(f"{model}, φ = {phi}, Q = 1: σ ~ γ̇^x at low rates", theirs, slope, spread, note)


@claim("paper5")
def stand_in(table):
    at = table.where(command="flow", phi=0.8433)
    for rate in (1e-2, 1e-3):
        means = {}
        for model in ("CD", "CD0", "RD0"):
            rows = at.where(model=model, rate=rate)
            means[model] = mean_over_seeds(rows, "shear_stress")
        for one, theirs, note in (("CD", 1.0, "Q = 1"), ("RD0", None, "")):
            a, b = means[one], means["CD0"]
            yield Row(
                f"σ of {one} over that of CD0, φ_J, γ̇ = {rate:g}",
                theirs,
                a[0] / b[0],
                a[0] / b[0] * np.hypot(a[1] / a[0], b[1] / b[0]),
                note,
            )
