"""Steady flow: V figures 4.6 to 4.8, flow curves, walls and paper IV.

Primary estimators. Order: |⟨ψ₆⟩| of snapshots in the second half of the strain. Exponents of flow curves: weighted
power laws between the lowest rates, and their weighted mean over states of one kind. Walls: shear rate in the middle
of the cell.
"""

import numpy as np

from jampetsc.analysis.correlated_series import layer_heights, mean_profile
from jampetsc.analysis.power_laws import local_exponents
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.io.disk_motion import six_fold_order, velocity_profiles
from jampetsc.plots.flow_plots import flow_regimes
from papers.claims.shared import Row, bearing, check, claim, line_fit, power_law, rates_of, size_of
from papers.claims.verdicts import Estimate, between, number

PHI_J = 0.8433  # V's, RD0
HARD = 2e-3  # γ̇ in units of 1/√(m/k_e) or k_e/k_d d_s², whichever is longer, below which disks collide as hard ones
NEWTONIAN = 1.0 - 1.1 / 3.5  # γ̇/p ~ γ̇^this at φ_J, with V's y/zν


SLOWEST = 9e-6  # γ̇ above which the exponent at φ_J is fitted: 1e-5 to 1e-3
EXTRAPOLATED = 4e-3  # γ̇ below which the limit γ̇ → 0 is extrapolated from
MIDDLE = 0.6  # of the height between walls: layers beside them may slip
KINDS = {"CDn": "bagnoldian"}  # claims on which slopes of a model bear, of others "newtonian"
NARROW, WIDE = 0.3, 0.8  # parts of the height whose shear rates are compared


def slower(rows, most):
    """The rows of flows at rates below `most`."""
    return rows.where(rate=[rate for rate in np.unique(rows["rate"]) if rate < most])


@claim("vagberg-fig4.6-4.7", on="order")
def order(table):
    found = {}
    for sizes in ("monodisperse", "bidisperse"):
        rows = table.where(command="flow", sizes=sizes)
        runs = [(run["snapshots/strain"], six_fold_order(run)[1]) for run in rows.results()]
        late = [psi[strain > 0.5 * strain[-1]] for strain, psi in runs]
        mean, error = mean_with_error([psi.mean() for psi in late])
        start = np.mean([psi[0] for _, psi in runs])
        found[sizes] = mean, error, start, late, size_of(rows)
    least = min(psi.min() for psi in found["monodisperse"][3])
    most = max(psi.max() for psi in found["bidisperse"][3])
    for sizes, says, target, told in (
        (
            "monodisperse",
            "ordered: above all of two sizes",
            between(low=most),
            f"never below {least:.2f} there",
        ),
        (
            "bidisperse",
            "disordered: below all of one size",
            between(high=least),
            f"never above {most:.2f} there",
        ),
    ):
        mean, error, start, _, size = found[sizes]
        what = f"RD0, φ = 0.80, γ̇ = 1e-3, {sizes}: |⟨ψ₆⟩| in the second half of the strain"
        yield Row(
            what, says, Estimate(mean, error), target, f"{start:.2f} at the start, {told}", size, part=sizes
        )


def _length(file):
    """(x, its error) of the minimum of g_y, None where it is not inside the cell."""
    at, error = (file.attributes[name] for name in ("minimum_at", "minimum_at_error"))
    return (at, error) if at < 0.8 * file["x"][-1] else None


@claim("vagberg-fig4.8", on="g_y")
def velocity_correlation(table):
    flows = table.where(command="flow")
    for phi in (0.80, PHI_J):
        rows = table.where(command="correlate", model="CD0", phi=phi)
        files = sorted(rows.results(), key=lambda g: -g.attributes["rate"])
        yield from _no_minimum(files, phi, size_of(flows.where(model="CD0", phi=phi)))
        rows = table.where(command="correlate", model="RD0", phi=phi)
        bins, lanes = np.unique(rows["bin"]), np.unique(rows["lane"])
        found = [minima(rows.where(bin=one, lane=lanes[-1])) for one in bins[::-1]]
        rates = found[0][0]
        if any(not np.array_equal(one, rates) for one, *_ in found) or len(rates) < 2:
            continue  # no minimum inside the cell
        for i, rate in enumerate(rates):
            what = f"RD0, φ = {phi:g}, γ̇ = {rate:g}: place of the minimum of g_y, in d_s"
            places, error = [x[i] for _, x, _, _ in found], found[0][2][i]
            told = ", ".join(
                f"{x:.2f} with {width:.2g} d_s" for x, (*_, width) in zip(places, found, strict=True)
            )
            size = size_of(flows.where(model="RD0", phi=phi, rate=rate))
            yield check(what, places[0], float(np.hypot(error, 0.5 * np.ptp(places))), f"bins: {told}", size)
        narrow = minima(rows.where(bin=bins[-1], lane=lanes[0]))
        yield from _growth(phi, found, narrow, size_of(flows.where(model="RD0", phi=phi)))


def minima(rows):
    """(γ̇ falling, place of the minimum of g_y in d_s, its error, width of a bin in d_s) for one bin and lane."""
    files = sorted(rows.results(), key=lambda g: -g.attributes["rate"])
    known = [(g.attributes["rate"], *_length(g)) for g in files if _length(g)]
    return *np.reshape(known, (-1, 3)).T, files[0].attributes["bin_width"]


def _no_minimum(files, phi, size):
    """CD0 has no minimum inside the cell, and one g_y at all rates."""
    inside = sum(_length(g) is not None for g in files)
    what = f"CD0, φ = {phi:g}: minima of g_y inside the cell, at {len(files)} rates"
    if phi == 0.80:
        yield Row(what, "none: 0", Estimate(inside), between(high=0.5), "", size, part="minima of CD0")
    else:
        yield check(what, inside, None, "", size, "0")
    apart = np.nanmax(np.ptp([g["g_y"] for g in files], axis=0))
    most, least = (max(np.nanmax(g["g_y"][1:]) for g in files), min(np.nanmin(g["g_y"]) for g in files))
    note = f"values reach from {most:.1f} to {least:.1f}"
    yield check(
        f"CD0, φ = {phi:g}: largest difference of g_y between rates",
        apart,
        None,
        note,
        size,
        "nearly the same",
    )


def _growth(phi, found, narrow, size):
    """ℓ at the lowest two rates: their mean over ℓ at the highest one at V's φ, where the caption sees ℓ grow and it
    saturates; x of ℓ ~ γ̇^(−x) between them at φ_J.

    found: `minima` of lanes of the same width, the widest bins first, of which statistical errors are; systematic: half
    of the range of all bins.
    """
    rates, x, errors, _ = found[0]
    told = ", ".join(f"{one:.2f} at {rate:g}" for rate, one in zip(rates, x, strict=True))
    narrower = ", ".join(f"{one:.2f} at {rate:g}" for rate, one in zip(*narrow[:2], strict=True))
    note = f"ℓ/d_s = {told}"
    what = f"RD0, φ = {phi:g}: place ℓ of the minimum of g_y, lanes of a quarter of the width, γ̇ = {narrow[0][-1]:g}"
    yield check(what, narrow[1][-1], narrow[2][-1], narrower, size)
    slow = [power_law(rates[-2:], one[-2:], own[-2:]) for _, one, own, _ in found]
    ours = Estimate(-slow[0].value, slow[0].statistical, 0.5 * float(np.ptp([one.value for one in slow])))
    what = f"RD0, φ = {phi:g}: place ℓ of the minimum of g_y ~ γ̇^(−x)"
    at_last = f"{what}, γ̇ = {rates[-1]:g} to {rates[-2]:g}"
    if phi == PHI_J:
        part = "x of ℓ ~ γ̇^(−x) at φ_J"
        yield Row(at_last, "diverges: > 0", ours, between(low=0.0), note, size, part=part)
        whole = power_law(rates, x, errors)
        yield check(f"{what}, all rates", -whole.value, whole.inflated, told, size)
        return
    last = [weighted_mean(one[-2:], own[-2:]) for _, one, own, _ in found]
    ratios = [mean.value / one[0] for mean, (_, one, _, _) in zip(last, found, strict=True)]
    own = ratios[0] * np.hypot(last[0].inflated / last[0].value, errors[0] / x[0])
    yield Row(
        f"RD0, φ = {phi:g}: ℓ at γ̇ = {rates[-1]:g} and {rates[-2]:g} over ℓ at {rates[0]:g}",
        "grows: > 1",
        Estimate(ratios[0], float(own), 0.5 * float(np.ptp(ratios))),
        between(low=1.0),
        note,
        size,
        part="growth of ℓ at φ = 0.80",
    )
    note = "in the Newtonian limit g_y depends on the strain alone, and ℓ saturates"
    yield check(at_last, ours.value, 0.5 * ours.half_width, note, size, "diverges: > 0")


@claim("vagberg-flow-curves", on="at-phi_J")
def flow_curves(table):
    at = table.where(command="flow", model="RD0", phi=PHI_J)
    sizes = np.unique(at["n"])
    for n in sizes:
        slow, both = slower(at.where(n=n), 2e-3), {}
        if len(np.unique(slow["rate"])) < 2:
            continue
        for name, symbol, theirs in (("pressure", "p", 1.1 / 3.5), ("shear_stress", "σ", None)):
            rates, values, errors = rates_of(slow, name)
            _, local, spread = local_exponents(rates, values, errors)
            note = f"local exponents from γ̇ = {rates[0]:g} up: " + ", ".join(
                f"{x:.3f}({1e3 * e:.0f})" for x, e in zip(local, spread, strict=True)
            )
            rates, values, errors = (part[rates > SLOWEST] for part in (rates, values, errors))
            found = power_law(rates, values, errors)
            near = power_law(rates[: len(rates) - 1], values[: len(rates) - 1], errors[: len(rates) - 1])
            ours = Estimate(
                found.value, found.statistical, 0.5 * abs(near.value - found.value), found.chi2, found.dof
            )
            both[symbol] = ours
            what = f"RD0 at φ_J = {PHI_J}, N = {n:g}: {symbol} ~ γ̇^x, γ̇ = {rates[0]:g} to {rates[-1]:g}"
            if theirs and n == sizes[-1]:
                yield Row(what, f"y/zν = {theirs:.3f}", ours, number(theirs), note, size_of(slow))
            else:
                yield check(
                    what, ours.value, ours.inflated, note, size_of(slow), f"{theirs:.3f}" if theirs else ""
                )
        if n == sizes[-1]:
            yield corrections(both, f"RD0 at φ_J = {PHI_J}, N = {n:g}", 1.1 / 3.5, size_of(slow))
    yield from bearing("newtonian", newtonian(table.where(command="flow", model="RD0", phi=0.80)))
    slow = slower(table.where(command="flow", model="CDn"), 2e-3)
    if len(np.unique(slow["rate"])) < 2:
        return
    for name, symbol in (("shear_stress", "σ"), ("pressure", "p")):
        rates, values, errors = rates_of(slow, name)
        found = power_law(rates, values, errors)
        local = np.diff(np.log(values)) / np.diff(np.log(rates))
        note = "from low γ̇ up: " + ", ".join(f"{x:.2f}" for x in local)
        what = f"CDn, Q = 1, φ = 0.78: {symbol} ~ γ̇^x, γ̇ = {rates[0]:g} to {rates[-1]:g}"
        yield check(what, found.value, found.inflated, note, size_of(slow), "2", bears="bagnoldian")


def corrections(exponents, what, asymptotic, size) -> Row:
    """How much farther the exponent of σ at φ_J is from its limit than that of p; exponents: {"p", "σ": estimate}."""
    p, sigma = (exponents[symbol] for symbol in ("p", "σ"))
    ours = Estimate(
        abs(sigma.value - asymptotic) - abs(p.value - asymptotic),
        float(np.hypot(p.inflated, sigma.inflated)),
        float(np.hypot(p.systematic, sigma.systematic)),
    )
    what = f"{what}: |x − y/zν| of σ less that of p, O ~ γ̇^x"
    return Row(
        what,
        "larger for σ: > 0",
        ours,
        between(low=0.0),
        f"x = {sigma} of σ, {p} of p",
        size,
        bears="corrections",
    )


def newtonian(rows):
    """The slope of RD0 below φ_J at the lowest rates, and 1/η_p extrapolated, positive where the flow is Newtonian."""
    if len(np.unique(slower(rows, EXTRAPOLATED)["rate"])) < 3:
        return
    rates, p, error = rates_of(rows, "pressure")
    _, local, spread = local_exponents(rates, p, error)
    limit, slope = extrapolated_fluidity(rates, p, error)
    middle = np.array([rates[1], rates[0]])
    expected = 1 - np.log(np.divide(*(limit.value + slope * middle**NEWTONIAN))) / np.log(rates[1] / rates[0])
    told = ", ".join(f"{x:.2f}" for x in local)
    note = f"γ̇/p = 1/η_p + cγ̇^{NEWTONIAN:.3f} makes it {expected:.3f}, going to 1: from low γ̇ up {told}"
    what = f"RD0 at φ = 0.80: p ~ γ̇^x, γ̇ = {rates[0]:g} to {rates[1]:g}"
    yield check(what, local[0], spread[0], note, size_of(rows), "1")
    what = "RD0 at φ = 0.80: γ̇/p extrapolated to γ̇ = 0, which is 0 where the flow is not Newtonian"
    yield check(
        what, limit.value, limit.inflated, f"χ² = {limit.chi2:.0f} for {limit.dof}", size_of(rows), "> 0"
    )


def extrapolated_fluidity(rates, p, error):
    """Estimate of 1/η_p and c of γ̇/p = 1/η_p + c γ̇^(1 − y/zν), by weighted least squares, γ̇ < EXTRAPOLATED.

    The least form that has both limits: p = η_p γ̇ for γ̇ → 0 and p ~ γ̇^(y/zν) where γ̇ is large for the distance to φ_J.
    """
    used = rates < EXTRAPOLATED
    rates, p, error = rates[used], p[used], error[used]
    powers, own = rates**NEWTONIAN, rates * error / p**2
    slope, *_ = line_fit((np.ones_like(rates), powers), rates / p, own)
    inverse, own_error, chi2, dof = line_fit((powers, np.ones_like(rates)), rates / p, own)
    return Estimate(inverse, own_error, 0.0, chi2, dof), slope


def middle_share(profile, part=MIDDLE) -> float:
    """Shear rate in the middle of the cell (this part of its height) in units of γ̇: 1 where v_x is linear."""
    y = layer_heights(len(profile))
    inner = np.abs(y) < 0.5 * part
    return float(np.polyfit(y[inner], profile[inner], 1)[0])


@claim("walls", on="walls")
def walls(table):
    for model in ("CD", "CD0"):
        rows = table.where(command="flow", model=model)
        for rate in np.unique(rows["rate"])[::-1]:
            some = rows.where(rate=rate)
            runs, size = some.results(), size_of(some)
            start = mean_with_error(
                [middle_share(mean_profile(velocity_profiles([run], 0, 0.1))[0]) for run in runs]
            )
            what = f"walls, {model}, γ̇ = {rate:g}: shear rate in the middle over γ̇, strain up to 0.1"
            claimed = model == "CD" and rate == rows["rate"].max()
            if claimed:
                part = "in the middle over γ̇, at the start"
                words, target = "a band at the walls: < 1/2", between(high=0.5)
                yield Row(what, words, Estimate(*start), target, "", size, part=part)
            else:
                yield check(what, *start, "", size)
            steady = runs[0].attributes["discard"], runs[0]["strain"][-1]
            share = mean_with_error(
                [middle_share(mean_profile(velocity_profiles([run], *steady))[0]) for run in runs]
            )
            v, errors = mean_profile(velocity_profiles(runs, *steady))
            y = layer_heights(len(v))
            inner = np.abs(y) < 0.4
            line = np.polynomial.Polynomial.fit(y[inner], v[inner], 1)
            off = np.sqrt(np.mean(((v - line(y))[inner]) ** 2))
            typical = np.sqrt(np.mean(errors[inner] ** 2))
            note = f"rms distance from a straight line {off:.4f} γ̇H, with errors of {typical:.4f} γ̇H"
            yield check(
                f"walls, {model}, γ̇ = {rate:g}: shear rate in the middle over γ̇, steady state",
                *share,
                note,
                size,
            )
            if claimed:
                profiles = [mean_profile(velocity_profiles([run], *steady))[0] for run in runs]
                even = [middle_share(one, NARROW) / middle_share(one, WIDE) for one in profiles]
                what = f"walls, {model}, γ̇ = {rate:g}: shear rate in the middle {NARROW:g} over {WIDE:g} of H, at last"
                yield Row(
                    what,
                    "the band is gone: 1 ± 0.05",
                    Estimate(*mean_with_error(even)),
                    between(0.95, 1.05),
                    note,
                    size,
                    part="in the middle over a wider part, at last",
                )


def weighted_mean(values, errors) -> Estimate:
    """Weighted mean of independent numbers, with the χ² of their being one."""
    weights = np.asarray(errors) ** -2.0
    mean = float(np.average(values, weights=weights))
    chi2 = float(np.sum(weights * (np.asarray(values) - mean) ** 2))
    return Estimate(mean, float(np.sum(weights) ** -0.5), 0.0, chi2, len(weights) - 1)


@claim("paper4")
def kinds_of_flow(table):
    rows = table.where(command="flow")
    maps, size, states = flow_regimes(rows.results()), size_of(rows), []
    for model, some in sorted(maps.items()):
        for phi, (qualities, exponents, errors, clusters, low, high) in some.items():
            for q, x, error, cluster, slow, fast in zip(
                qualities, exponents, errors, clusters, low, high, strict=True
            ):
                if fast * max(q, 1) < HARD:
                    states.append((model, phi, q, x, error, cluster))
                if phi == 0.78:
                    what = f"{model}, φ = 0.78, Q = {q:g}: σ ~ γ̇^x, γ̇ = {slow:g} to {fast:g}"
                    note = f"{100 * cluster:.0f} % of the disks in one cluster"
                    yield check(what, x, error, note, size, bears=KINDS.get(model, "newtonian"))
    yield from newtonian_or_bagnoldian(states, size)
    yield from bearing("clusters", clusters_of(states, size))
    yield from bearing("bagnoldian", largest_jump(maps, size))


def newtonian_or_bagnoldian(states, size):
    """Mean exponents: of overdamped flows of CD and CDt well below φ_J, and of CDn everywhere."""
    for models, chosen, theirs, words in (
        (("CD", "CDt"), lambda phi, q: 0.7 <= phi <= 0.78 and 1 <= q <= 3, 1.0, "Newtonian: 1"),
        (("CDn",), lambda phi, q: phi <= 0.80 and q >= 1, 2.0, "Bagnoldian: 2"),
    ):
        found = [(phi, q, x, e) for model, phi, q, x, e, _ in states if model in models and chosen(phi, q)]
        if len(found) < 2:
            continue
        phi, q, x, error = np.transpose(found)
        mean = weighted_mean(x, error)
        note = f"mean of {len(x)} states, φ = {phi.min():g} to {phi.max():g}, Q = {q.min():g} to {q.max():g}"
        note = f"{note}; from {x.min():.2f} to {x.max():.2f}"
        what = f"{', '.join(models)}, φ < φ_J: σ ~ γ̇^x between the lowest two γ̇"
        yield Row(what, words, mean, number(theirs), note, size, bears=KINDS.get(models[0], "newtonian"))


def clusters_of(states, size):
    """Largest clusters of Newtonian and of Bagnoldian states: that state of each kind decides which fits least."""
    x, error, cluster = np.array([state[3:] for state in states]).reshape(-1, 3).T
    for value, name in ((1, "Newtonian"), (2, "Bagnoldian")):
        near = (np.abs(x - value) < 0.15) & (error < 0.1)
        if near.any():
            note = f"{cluster[near].min():.2f} to {cluster[near].max():.2f} of {near.sum()} states of all φ and Q"
            what = f"largest cluster/N where |x − {value}| < 0.15 ({name}), mean"
            yield check(what, *mean_with_error(cluster[near]), note, size)
            chosen = [state for state, is_near in zip(states, near, strict=True) if is_near]
            worst = (min if value == 1 else max)(chosen, key=lambda state: state[5])
            words, target = (
                ("large clusters: > 1/2", between(low=0.5))
                if value == 1
                else ("no large cluster: < 1/2", between(high=0.5))
            )
            which = f"{worst[0]}, φ = {worst[1]:g}, Q = {worst[2]:g}, x = {worst[3]:.2f}"
            part = f"{'smallest' if value == 1 else 'largest'} of {name} states"
            what = f"largest cluster/N, {part}"
            yield Row(what, words, Estimate(worst[5]), target, f"{which}; {note}", size, part=part)


def largest_jump(maps, size):
    """The largest change of x between neighbouring Q: some transitions are said to be sharp."""
    jumps = [
        (abs(x[n + 1] - x[n]), model, phi, qualities[n : n + 2])
        for model, some in maps.items()
        for phi, (qualities, x, *_) in some.items()
        for n in range(len(x) - 1)
        if np.isfinite(x[n : n + 2]).all()
    ]
    if jumps:
        jump, model, phi, (low, high) = max(jumps, key=lambda one: one[0])
        note = f"{model}, φ = {phi:g}, Q = {low:g} to {high:g}: hysteresis would need scans of Q or φ up and down"
        yield check(
            "largest change of x between neighbouring Q", jump, None, note, size, "some transitions are sharp"
        )
