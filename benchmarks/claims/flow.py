"""Steady flow: V figures 4.6 to 4.8, flow curves, walls and paper IV. Numbers that decide are in the rows."""

import numpy as np

from claims.shared import WITHIN, Row, claim, rates_of, size_of, slope_with_error
from jampetsc.analysis.order import six_fold_order
from jampetsc.analysis.profiles import heights, mean_profile
from jampetsc.analysis.scaling import local_exponents
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.plots.flowcurves import regimes

PHI_J = 0.8433  # V's, RD0
ROUNDED = 1.05 / 3.55, 1.15 / 3.45  # y/zν that V's digits, 1.1 and 3.5, may stand for
HARD = 2e-3  # γ̇ in units of 1/√(m/k_e) or k_e/k_d d_s², whichever is longer, below which disks collide as hard ones
NEWTONIAN = 1.0 - 1.1 / 3.5  # γ̇/p ~ γ̇^this at φ_J, with V's y/zν


EXTRAPOLATED = 4e-3  # γ̇ below which the limit γ̇ → 0 is extrapolated from
MIDDLE = 0.6  # of the height between walls: layers beside them may slip


def slower(rows, most):
    """The rows of flows at rates below `most`."""
    return rows.where(rate=[rate for rate in np.unique(rows["rate"]) if rate < most])


@claim("vagberg-fig4.6-4.7")
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
    decided = "yes" if least > most else "open"
    for sizes, says, told in (
        ("monodisperse", "order into rows and stay so", f"never below {least:.2f} there"),
        ("bidisperse", "stay disordered", f"never above {most:.2f} there"),
    ):
        mean, error, start, _, size = found[sizes]
        what = f"φ = 0.80, γ̇ = 1e-3: {sizes} disks {says}: |⟨ψ₆⟩| in the second half of the strain"
        yield Row(what, None, mean, error, f"RD0; {start:.2f} at the start, {told}", size, decided)


def _length(file):
    """(x, its error) of the minimum of g_y, None where it is not inside the cell."""
    at, error = (file.attributes[name] for name in ("minimum_at", "minimum_at_error"))
    return (at, error) if at < 0.8 * file["x"][-1] else None


@claim("vagberg-fig4.8")
def velocity_correlation(table):
    flows, growth = table.where(command="flow"), {}
    for model in ("RD0", "CD0"):
        for phi in (0.80, PHI_J):
            rows = table.where(command="correlate", model=model, phi=phi)
            files = sorted(rows.results(), key=lambda g: -g.attributes["rate"])
            lengths = [_length(g) for g in files]
            for g, found in zip(files, lengths, strict=True):
                if model == "CD0":
                    break
                rate = g.attributes["rate"]
                size = size_of(flows.where(model=model, phi=phi, rate=rate))
                what = f"RD0, φ = {phi:g}, γ̇ = {rate:g}: place of the minimum of g_y, in d_s"
                note = f"g_y = {g.attributes['minimum']:.3f}; bins of 1 d_s"
                yield Row(what, None, *(found or (np.nan, None)), note, size)
            size = size_of(flows.where(model=model, phi=phi))
            if model == "CD0":
                inside = sum(found is not None for found in lengths)
                what = f"CD0, φ = {phi:g}: minima of g_y inside the cell, at {len(files)} rates"
                yield Row(what, None, inside, None, "V: none", size, "no" if inside else "yes")
                curves = np.array([g["g_y"] for g in files])
                apart = np.nanmax(np.ptp(curves, axis=0))
                note = "V: nearly the same for all γ̇ (at φ = 0.80); values reach from 0.6 down to −0.2"
                what = f"CD0, φ = {phi:g}: largest difference of g_y between rates"
                yield Row(what, None, apart, None, note, size, "yes" if apart < 0.15 else "no")
            elif len(files) > 1 and lengths[-1] and lengths[-2]:
                rates = np.array([g.attributes["rate"] for g in files[-2:]])[::-1]
                x, error = np.array(lengths[-2:])[::-1].T
                _, (slope,), (spread,) = local_exponents(rates, x, error)
                growth[phi] = -slope, spread, rates, size
    yield from _divergence(growth)


def _divergence(growth):
    """Whether the length grows without end: {φ: (−d ln ℓ/d ln γ̇ of the lowest rates, error, rates, size)}."""
    for phi, (slope, error, rates, size) in growth.items():
        what = f"RD0, φ = {phi:g}: ℓ ~ γ̇^(−x) at γ̇ = {rates[0]:g} to {rates[1]:g}"
        if phi == PHI_J:
            decided = "yes" if slope > 3 * error else "open"
            note = "V sec. 4.5.3: the length diverges at point J; 1/x is z where x has settled"
            yield Row(what, None, slope, error, note, size, decided)
            note = "ℓ is a few d_s and near the cell's limit: corrections to scaling are not known; needs N ≫ 4096"
            yield Row("z = 1/x", None, 1 / slope, error / slope**2, note, size, "open")
        else:
            note = (
                "V's caption: ℓ diverges as γ̇ → 0. At φ < φ_J it cannot: the flow becomes Newtonian, a function of the"
                " strain alone, and with it g_y; ℓ saturates. V's words are right at φ_J"
            )
            settled = slope - 2 * error < 0.05 and rates[0] < 2e-5
            yield Row(what, None, slope, error, note, size, "no" if settled else "open")


@claim("vagberg-flow-curves")
def flow_curves(table):
    at = table.where(command="flow", model="RD0", phi=PHI_J)
    for n in np.unique(at["n"]):
        slow = slower(at.where(n=n), 2e-3)
        if len(np.unique(slow["rate"])) < 2:
            continue
        lowest = slow["rate"].min()
        rounded = f"V's y/zν = 1.1/3.5, {ROUNDED[0]:.3f} to {ROUNDED[1]:.3f} as two digits leave it"
        for name, symbol, theirs, note in (
            ("pressure", "p", round(1.1 / 3.5, 3), rounded),
            ("shear_stress", "σ", None, "V: larger corrections to scaling than p, so not y/zν yet"),
        ):
            rates, values, errors = rates_of(slow, name)
            _, local, spread = local_exponents(rates, values, errors)
            told = ", ".join(f"{x:.3f}({1e3 * e:.0f})" for x, e in zip(local, spread, strict=True))
            what = f"RD0 at φ_J = {PHI_J}, N = {n:g}: {symbol} ~ γ̇^x, γ̇ = {lowest:g} to 1e-3"
            slope, error = slope_with_error(rates, values, errors)
            off = max(ROUNDED[0] - slope, slope - ROUNDED[1], 0.0)
            decided = "" if theirs is None else "yes" if off <= WITHIN * error else "no"
            note = f"{note}; local exponents from low γ̇ up: {told}"
            yield Row(what, theirs, slope, error, note, size_of(slow), decided)
    yield from newtonian(table.where(command="flow", model="RD0", phi=0.80))
    collisions = table.where(command="flow", model="CDn")
    slow = slower(collisions, 2e-3)
    if len(np.unique(slow["rate"])) < 2:
        return
    for name, symbol in (("shear_stress", "σ"), ("pressure", "p")):
        slope = slope_with_error(*rates_of(slow, name))
        what = f"CDn, Q = 1, φ = 0.78: {symbol} ~ γ̇^x, γ̇ = 1e-4 to 1e-3 (Bagnoldian)"
        yield Row(
            what, 2.0, *slope, "above, collisions are not short beside the time between them", size_of(slow)
        )


def newtonian(rows):
    """The slope at the lowest rates, and 1/η_p extrapolated, which is positive where the flow is Newtonian."""
    if len(np.unique(slower(rows, EXTRAPOLATED)["rate"])) < 3:
        return
    rates, p, error = rates_of(rows, "pressure")
    _, local, spread = local_exponents(rates, p, error)
    fluidity = extrapolated_fluidity(rates, p, error)
    inverse, slope, own = fluidity[0], fluidity[1], fluidity[2]
    middle = np.array([rates[1], rates[0]])
    expected = 1 - np.log(np.divide(*(inverse + slope * middle**NEWTONIAN))) / np.log(rates[1] / rates[0])
    low = rates[0] < 2e-5
    note = (
        f"γ̇/p = 1/η_p + cγ̇^{NEWTONIAN:.3f} makes it {expected:.3f}, going to 1: from low γ̇ up "
        + ", ".join(f"{x:.2f}" for x in local)
    )
    agrees = abs(local[0] - expected) < 2 * spread[0] and inverse > 5 * own
    what = f"RD0 at φ = 0.80: p ~ γ̇^x, γ̇ = {rates[0]:g} to {rates[1]:g}"
    decided = "yes" if agrees and low else "open"
    yield Row(f"{what} (Newtonian)", 1.0, local[0], spread[0], note, size_of(rows), decided)
    what = "RD0 at φ = 0.80: γ̇/p extrapolated to γ̇ = 0, which is 0 where the flow is not Newtonian"
    yield Row(what, None, inverse, own, "", size_of(rows), "yes" if inverse > 5 * own else "open")


def extrapolated_fluidity(rates, p, error):
    """(1/η_p, c, error of 1/η_p) of γ̇/p = 1/η_p + c γ̇^(1 − y/zν), by weighted least squares, γ̇ ≤ 3e-3.

    The least form that has both limits: p = η_p γ̇ for γ̇ → 0 and p ~ γ̇^(y/zν) where γ̇ is large for the distance to φ_J.
    """
    used = rates < EXTRAPOLATED
    rates, p, error = rates[used], p[used], error[used]
    weights = p**2 / (rates * error)
    (slope, inverse), covariance = np.polyfit(rates**NEWTONIAN, rates / p, 1, w=weights, cov="unscaled")
    return inverse, slope, np.sqrt(covariance[1, 1])


def middle_share(profile) -> float:
    """Shear rate in the middle of the cell (MIDDLE of its height) in units of γ̇: 1 where v_x is linear."""
    y = heights(len(profile))
    inner = np.abs(y) < 0.5 * MIDDLE
    return float(np.polyfit(y[inner], profile[inner], 1)[0])


@claim("walls")
def walls(table):
    for model, says in (("CD", "a band at the walls at the start"), ("CD0", "no band, without momentum")):
        rows = table.where(command="flow", model=model)
        for rate in np.unique(rows["rate"])[::-1]:
            some = rows.where(rate=rate)
            runs, size = some.results(), size_of(some)
            start = [middle_share(mean_profile([run], 0, 0.1)[0]) for run in runs]
            steady = runs[0].attributes["discard"], runs[0]["strain"][-1]
            share, error = mean_with_error(start)
            banded = share + 2 * error < 0.5
            decided = "yes" if banded == (model == "CD") else "no"
            what = f"{model}, γ̇ = {rate:g}: {says}: shear rate in the middle over γ̇, strain up to 0.1"
            yield Row(what, None, share, error, "1 where v_x is linear", size, decided)
            shares = [middle_share(mean_profile([run], *steady)[0]) for run in runs]
            v, errors = mean_profile(runs, *steady)
            y = heights(len(v))
            inner = np.abs(y) < 0.4
            line = np.polynomial.Polynomial.fit(y[inner], v[inner], 1)
            off = np.sqrt(np.mean(((v - line(y))[inner]) ** 2))
            share, error = mean_with_error(shares)
            typical = np.sqrt(np.mean(errors[inner] ** 2))
            note = f"rms distance from a straight line {off:.4f} of γ̇H, errors {typical:.4f}; walls slip by the rest"
            what = f"{model}, γ̇ = {rate:g}: linear in the steady state: shear rate in the middle over γ̇"
            yield Row(what, None, share, error, note, size, "yes" if share > 0.8 and off < 0.01 else "no")


@claim("paper4")
def kinds_of_flow(table):
    rows = table.where(command="flow")
    maps = regimes(rows.results())
    size, states = size_of(rows), []
    for model, some in sorted(maps.items()):
        for phi, (qualities, exponents, errors, clusters, low, high) in some.items():
            for q, x, error, cluster, slow, fast in zip(
                qualities, exponents, errors, clusters, low, high, strict=True
            ):
                if fast * max(q, 1) < HARD:
                    states.append((model, phi, q, x, error, cluster))
                if phi != 0.78:
                    continue
                theirs = 2.0 if model == "CDn" and fast * max(q, 1) < HARD else None
                what = f"{model}, φ = 0.78, Q = {q:g}: σ ~ γ̇^x, γ̇ = {slow:g} to {fast:g}"
                yield Row(what, theirs, x, error, f"{100 * cluster:.0f} % of the disks in one cluster", size)
    x, error, cluster = np.array([state[3:] for state in states]).reshape(-1, 3).T
    found = {}
    for value, name in ((1, "Newtonian"), (2, "Bagnoldian")):
        near = (np.abs(x - value) < 0.15) & (error < 0.1)
        if near.any():
            found[name] = cluster[near]
            spread = f"{cluster[near].min():.2f} to {cluster[near].max():.2f} of {near.sum()} states of all φ and Q"
            what = f"largest cluster/N where |x − {value}| < 0.15 ({name}), mean"
            decided = ""
            if name == "Bagnoldian" and "Newtonian" in found:
                apart = np.median(found["Newtonian"]) > 3 * np.median(cluster[near])
                decided = "yes" if apart else "no"
            note = f"{spread}; V: Newtonian ⇔ large clusters"
            yield Row(what, None, cluster[near].mean(), None, note, size, decided)
    jumps = [
        (abs(x[1] - x[0]), model, phi, qualities[:2])
        for model, some in maps.items()
        for phi, (qualities, exponents, *_) in some.items()
        for qualities, x in zip(
            np.lib.stride_tricks.sliding_window_view(qualities, 2),
            np.lib.stride_tricks.sliding_window_view(exponents, 2),
            strict=True,
        )
        if np.isfinite(x).all()
    ]
    if jumps:
        jump, model, phi, (low, high) = max(jumps, key=lambda one: one[0])
        note = (
            f"{model}, φ = {phi:g}, Q = {low:g} to {high:g}. V: some transitions are sharp: a jump with hysteresis"
            " would need scans of Q or φ up and down at fixed γ̇, each from the state before"
        )
        yield Row("largest change of x between neighbouring Q", None, jump, None, note, size, "open")
