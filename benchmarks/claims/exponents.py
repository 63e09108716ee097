"""Exponents of flow near jamming: V figure 5.1 and paper V."""

import numpy as np

import jampetsc
from claims.flow import PHI_J, extrapolated_fluidity, slower
from claims.shared import Row, claim, fitted, rates_of, size_of, slope_with_error

POOR = 0.01  # probability of χ² below which a form is taken to miss the data
LOOSE = 0.1  # relative error beyond which to agree says little
FAR = 0.5  # share of the value at the lowest rate below which a limit γ̇ → 0 is too far to extrapolate to
HALF = 0.5  # p^m = p₀^m + c γ̇^½ above φ_J, m = ½ zν/y: the least form with p ~ γ̇^(y/zν) at large γ̇


@claim("vagberg-fig5.1")
def scaling(table):
    flows = table.where(command="flow")
    size = size_of(flows)
    wanted = [("phi_J", 0.8433, ""), ("y", 1.1, ""), ("znu", 3.5, "without corrections to scaling, as V's")]
    yield from fits(table, "pressure", wanted, "collapse of p, RD0", size)
    wanted = [
        ("phi_J", None, "V's numbers are of p"),
        ("y", None, "V: σ has larger corrections than p"),
        ("znu", None, ""),
    ]
    yield from fits(table, "shear-stress", wanted, "collapse of σ, RD0", size)
    yield from beta_of_fit(table.path / "pressure.h5", size)
    yield from powers_beside_phi_J(flows, size)


def poor(path):
    """Whether a fit's form misses the data by more than their errors: its parameters then decide nothing."""
    return jampetsc.load(path).attributes["probability"] < POOR


def fits(table, name, wanted, of, size):
    """Rows of a collapse with their size; open where the form misses the data."""
    for row in fitted(table, name, wanted, of):
        row.size = size
        if row.theirs and row.error and row.error > LOOSE * row.theirs:
            row.decided = "open"
        if poor(table.path / f"{name}.h5"):
            row.decided = "open"
            row.note += (
                f"{'; ' if row.note else ''}the form misses the data: corrections to scaling, or lower γ̇"
            )
        yield row


def beta_of_fit(path, size):
    """β = zν − y with errors added as of independent ones: not too small, as y/zν is known better than both."""
    if not path.exists():
        return
    found = jampetsc.load(path).attributes
    error = np.hypot(found["y_error"], found["znu_error"])
    decided = "" if error < LOOSE * 2.4 and not poor(path) else "open"
    what = "β = zν − y from the collapse of p, RD0"
    note = "V: 3.5 − 1.1"
    yield Row(what, 2.4, found["znu"] - found["y"], error, note, size, decided)


def powers_beside_phi_J(flows, size):
    """β of p/γ̇ and y of p, both extrapolated to γ̇ → 0 at each φ, against the distance to V's φ_J."""
    below, above = [], []
    if len(np.unique(slower(flows, 2e-3)["rate"])) < 3:
        return
    for phi in np.unique(flows["phi"]):
        rates, p, error = rates_of(flows.where(phi=phi), "pressure")
        if phi < PHI_J:
            inverse, _, own = extrapolated_fluidity(rates, p, error)
            if inverse > FAR * rates[0] / p[0]:
                below.append((PHI_J - phi, 1 / inverse, own / inverse**2))
        elif phi > PHI_J:
            limit, own = yield_pressure(rates, p, error)
            if limit > FAR * p[0]:
                above.append((phi - PHI_J, limit, own))
    for points, name, theirs, sign in ((below, "φ < φ_J: p/γ̇ ~ (φ_J − φ)^(−β): β", 2.4, -1),
                                       (above, "φ > φ_J: p ~ (φ − φ_J)^y: y", 1.1, 1)):  # fmt: skip
        known = [point for point in points if 0 < 5 * point[2] < point[1]]
        if len(known) < 3:
            continue
        distance, value, error = np.array(sorted(known)).T
        slope, own = slope_with_error(distance, value, error)
        near, _ = slope_with_error(distance[:3], value[:3], error[:3])
        far, _ = slope_with_error(distance[-3:], value[-3:], error[-3:])
        drift = 0.5 * abs(near - far)
        what = f"{name}, extrapolated to γ̇ → 0"
        note = (
            f"φ_J = {PHI_J} held, {len(known)} φ at distances {distance[0]:.4f} to {distance[-1]:.4f}; nearest three"
            f" {sign * near:.2f}, farthest {sign * far:.2f}; the error has half of their difference"
        )
        decided = "open" if np.hypot(own, drift) > LOOSE * theirs else ""
        yield Row(what, theirs, sign * slope, np.hypot(own, drift), note, size, decided)


def yield_pressure(rates, p, error):
    """(p₀, its error) of p^m = p₀^m + c γ̇^½, m = ½ zν/y, by weighted least squares over γ̇ ≤ 1e-3."""
    used = rates < 2e-3
    rates, p, error = rates[used], p[used], error[used]
    m = HALF * 3.5 / 1.1
    weights = 1 / (m * p ** (m - 1) * error)
    (_, power), covariance = np.polyfit(rates**HALF, p**m, 1, w=weights, cov="unscaled")
    if power <= 0:
        return np.nan, np.nan
    p0 = power ** (1 / m)
    return p0, np.sqrt(covariance[1, 1]) * p0 / (m * power)


@claim("paper5")
def universality(table):
    flows = table.where(command="flow")
    yield from same_exponents(table, flows)
    at = flows.where(phi=PHI_J)
    for name, symbol in (("pressure", "p"), ("shear_stress", "σ")):
        both = {model: rates_of(at.where(model=model), name) for model in ("RD0", "CD0")}
        rates = np.intersect1d(both["RD0"][0], both["CD0"][0])
        values, errors = [], []
        for found in both.values():
            rows = np.isin(found[0], rates)
            values.append(found[1][rows])
            errors.append(found[2][rows] / found[1][rows])
        ratio, relative = values[0] / values[1], np.hypot(*errors)
        slow = rates < 11 * rates[0]  # the lowest decade
        slope, own = slope_with_error(rates[slow], ratio[slow], (relative * ratio)[slow])
        told = ", ".join(f"{r:.3f} at {g:g}" for g, r in zip(rates, ratio, strict=True))
        what = f"RD0/CD0 of {symbol} at φ_J ~ γ̇^x, γ̇ = {rates[0]:g} to {rates[slow][-1]:g}: x, 0 where it is constant"
        note = f"{told}; still rising where x < 0: the limit needs lower γ̇"
        decided = "yes" if abs(slope) < 2 * own and own < 0.02 else "open"
        yield Row(what, None, slope, own, note, size_of(at), decided)
    yield from stand_in(table, flows)


def same_exponents(table, flows):
    """φ_J, y and zν of RD0 and CD0 from a fit to each, and their differences."""
    found = {}
    for model in ("RD0", "CD0"):
        size = size_of(flows.where(model=model))
        wanted = [(name, None, "V's numbers are those of Fig. 5.1") for name in ("phi_J", "y", "znu")]
        yield from fits(table, f"pressure-{model}", wanted, f"collapse of p, {model}", size)
        path = table.path / f"pressure-{model}.h5"
        if path.exists():
            found[model] = jampetsc.load(path)
    if len(found) < 2:
        return
    cut = min(settled(one) for one in found.values())
    told = not any(poor(table.path / f"pressure-{model}.h5") for model in found)
    (one, one_error), (other, other_error) = (at_cut(found[model], cut) for model in ("RD0", "CD0"))
    for i, (symbol, small) in enumerate((("φ_J", 2e-3), ("y", 0.15), ("zν", 0.4))):
        difference, error = other[i] - one[i], np.hypot(one_error[i], other_error[i])
        decided = ("yes" if abs(difference) < 2 * error else "no") if told and error <= small else "open"
        note = f"V: the same; from fits to γ̇ ≤ {cut:g}, which lower rates do not move, without corrections to scaling"
        yield Row(f"{symbol} of CD0 − {symbol} of RD0", None, difference, error, note, size, decided)


def settled(fit) -> float:
    """The largest rate of the widest fit of a collapse whose parameters the next narrower one does not move.

    To two errors of the change, √(e_narrow² − e_wide²), as the narrower fit has part of the points of the wider one.
    """
    values, errors, cuts = (fit[f"drift/{name}"] for name in ("parameters", "errors", "cut"))
    for i in range(len(cuts) - 1):
        change = np.sqrt(np.maximum(errors[i + 1] ** 2 - errors[i] ** 2, 0.0))
        if not (np.abs(values[i + 1] - values[i]) > 2.0 * change).any():
            return cuts[i]
    return cuts[-1]


def at_cut(fit, cut):
    """(parameters, errors) of the fit whose largest rate is nearest to a cut."""
    i = np.argmin(np.abs(np.log(fit["drift/cut"] / cut)))
    return fit["drift/parameters"][i], fit["drift/errors"][i]


def stand_in(table, flows):
    """CD over CD0 as Q falls: σ, p and g_y."""
    g = table.where(command="correlate")
    for phi in (0.80, PHI_J):
        for rate in np.unique(flows.where(model="CD", phi=phi)["rate"])[::-1]:
            exact = flows.where(model="CD0", phi=phi, rate=rate)
            if not exact.rows:
                continue
            for q in np.unique(flows.where(model="CD")["quality"])[::-1]:
                rows = flows.where(model="CD", phi=phi, rate=rate, quality=q)
                (_, a, ea), (_, b, eb) = (rates_of(some, "shear_stress") for some in (rows, exact))
                ratio, error = a[0] / b[0], a[0] / b[0] * np.hypot(ea[0] / a[0], eb[0] / b[0])
                (_, pa, _), (_, pb, _) = (rates_of(some, "pressure") for some in (rows, exact))
                note = f"p {pa[0] / pb[0]:.3f}"
                files = [g.where(model=m, phi=phi, rate=rate) for m in ("CD", "CD0")]
                files[0] = files[0].where(quality=q)
                if all(part.rows == 1 for part in files):
                    (one,), (other,) = (part.results() for part in files)
                    apart = np.sqrt(np.nanmean((one["g_y"] - other["g_y"]) ** 2))
                    own = np.sqrt(np.nanmean(one["g_y_error"] ** 2 + other["g_y_error"] ** 2))
                    note += f"; g_y differs by {apart:.3f} (rms), with errors of {own:.3f}"
                what = f"CD over CD0: σ, φ = {phi:g}, γ̇ = {rate:g}, Q = {q:g}"
                decided = "open" if error > 0.05 else "" if q <= 0.1 else None
                size = size_of(rows)
                if decided is None:  # Q is not small yet: a number without a verdict
                    yield Row(what, None, ratio, error, note, size)
                else:
                    yes = "yes" if abs(ratio - 1) < max(2 * error, 0.02) else "no"
                    yield Row(what, None, ratio, error, note, size, decided or yes)
