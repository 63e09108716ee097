"""Exponents of flow near jamming: V figure 5.1 and paper V.

Primary estimators. φ_J, y and zν: the collapse without corrections to scaling of γ̇ ≤ SLOWEST_FIT and the largest N
alone, as higher rates move φ_J; systematic: half of the change to the next larger cut. β and y beside φ_J: power laws
of values extrapolated to γ̇ → 0, with the χ² of the extrapolations.
"""

from dataclasses import replace

import numpy as np

import jampetsc
from jampetsc.analysis.collapse_fit import estimate
from jampetsc.analysis.scaling_collapse import form_named
from jampetsc.commands.collapse_points import read_points
from papers.claims.finite_size import drift_of
from papers.claims.flow import PHI_J, extrapolated_fluidity, slower, weighted_mean
from papers.claims.shared import (
    SYMBOLS,
    Row,
    bearing,
    beta_of,
    check,
    claim,
    fitted,
    line_fit,
    power_law,
    rates_of,
    size_of,
)
from papers.claims.verdicts import Estimate, difference, number

SLOWEST_FIT = 3e-4  # γ̇ of the primary collapses
PHI_MARGIN = 1e-3  # of φ_J
FAR_BELOW = 0.78  # φ up to which the lowest γ̇ are Newtonian within a few per cent
FAR = 0.5  # share of the value at the lowest rate below which a limit γ̇ → 0 is too far to extrapolate to
HALF = 0.5  # p^m = p₀^m + c γ̇^½ above φ_J, m = ½ zν/y: the least form with p ~ γ̇^(y/zν) at large γ̇
THEIRS = {"phi_J": (PHI_J, PHI_MARGIN), "y": (1.1, None), "znu": (3.5, None)}  # V Fig. 5.1: value, margin


def target_of(parameter):
    """V's number for a parameter of the collapse."""
    value, margin = THEIRS[parameter]
    return number(value) if margin is None else number(value, absolute=margin)


def at_cut(fit, cut) -> dict[str, Estimate]:
    """{parameter: estimate} of the fit up to the rate nearest to `cut`; systematic: half the change to the next cut,
    the larger one if there is one."""
    cuts, values, errors = (fit[f"drift/{name}"] for name in ("cut", "parameters", "errors"))
    i = int(np.argmin(np.abs(np.log(cuts / cut))))
    names, dof = str(fit.attributes["fitted"]).split(","), fit.attributes["dof"]
    whole = fit.attributes["chi2"], int(dof)  # of the fit of all rates: the narrower ones do not say theirs
    change = 0.5 * np.abs(values[i] - values[i - 1 if i else min(1, len(cuts) - 1)])
    return {
        name: Estimate(values[i, n], errors[i, n], change[n], *(whole if i == 0 else (0.0, 0)))
        for n, name in enumerate(names)
    }


@claim("vagberg-fig5.1")
def scaling(table):
    """The collapse of the figure's own rates, all of them and γ̇ ≤ SLOWEST_FIT: both without a verdict."""
    size = size_of(table.where(command="flow"))
    for fit, symbol, theirs in collapses(table):
        yield from whole_rows(fit, symbol, theirs, size)
        for parameter, found in at_cut(fit, SLOWEST_FIT).items():
            on = f"fit-{parameter}"
            what = f"collapse of {symbol}, RD0, γ̇ ≤ {SLOWEST_FIT:g}: {SYMBOLS[parameter]}"
            note = f"systematic error {found.systematic:.2g}"
            words = f"{theirs[parameter]:g}" if theirs else ""
            yield check(what, found.value, found.statistical, note, size, words, bears=on)


@claim("vagberg-fig5.1-slow")
def slow_scaling(table):
    """The collapse at the lowest rates and the largest N, which decides."""
    flows = table.where(command="flow")
    size = size_of(flows)
    for fit, symbol, theirs in collapses(table):
        rates = fit["drift/cut"]
        primary = at_cut(fit, min(SLOWEST_FIT, rates[0]))
        held = held_at_phi_J(fit, flows) if theirs else {}
        for parameter, found in primary.items():
            on = f"fit-{parameter}"
            what = f"collapse of {symbol}, RD0, γ̇ ≤ {min(SLOWEST_FIT, rates[0]):g}: {SYMBOLS[parameter]}"
            if theirs:
                note = f"{lower_cuts(fit, parameter)}; {held[parameter]}"
                yield Row(what, f"{theirs[parameter]:g}", found, target_of(parameter), note, size, bears=on)
            else:
                yield check(what, found.value, found.statistical, "", size, bears=on)
        if theirs:
            beta, note = beta_of(fit, primary["znu"], primary["y"], SLOWEST_FIT)
            what = "β = zν − y from the collapse of p, RD0"
            yield check(what, beta.value, beta.statistical, note, size, "2.4", bears="beta")
            yield from powers_beside_phi_J(flows, size, f"zν − y of the collapse is {beta}")


def lower_cuts(fit, parameter, whole=False) -> str:
    """What the fits of lower rates alone give for a parameter, in words; whole: and that of all rates."""
    column = str(fit.attributes["fitted"]).split(",").index(parameter)
    cuts, values, errors = (fit[f"drift/{name}"] for name in ("cut", "parameters", "errors"))
    first = 0 if whole else 1
    rows = zip(cuts[first:], values[first:, column], errors[first:, column], strict=True)
    return ", ".join(f"{Estimate(value, error)} for γ̇ ≤ {cut:g}" for cut, value, error in rows)


def collapses(table):
    """(fit, symbol, V's numbers or None) of the collapses of p and σ that have converged."""
    for name, symbol, theirs in (
        ("pressure", "p", {parameter: value for parameter, (value, _) in THEIRS.items()}),
        ("shear-stress", "σ", None),
    ):
        path = table.path / f"{name}.h5"
        if path.exists():
            yield jampetsc.load(path), symbol, theirs


def whole_rows(fit, symbol, theirs, size):
    """Numbers of the fit of all rates."""
    chi2 = fit.attributes["chi2"] / fit.attributes["dof"]
    for parameter in str(fit.attributes["fitted"]).split(","):
        what = f"collapse of {symbol}, RD0, γ̇ ≤ {fit['drift/cut'][0]:g}: {SYMBOLS[parameter]}"
        value, error = fit.attributes[parameter], fit.attributes[f"{parameter}_error"]
        words = f"{theirs[parameter]:g}" if theirs else ""
        yield check(what, value, error, f"χ²/dof {chi2:.2f}", size, words, bears=f"fit-{parameter}")


def held_at_phi_J(fit, flows) -> dict[str, str]:
    """What the primary collapse gives with V's φ_J held, in words for each parameter."""
    points = read_points(flows.results(), "pressure", False)
    low, high = fit.attributes.get("phi_low", 0.0), fit.attributes.get("phi_high", np.inf)
    phi = fit["phi"] if "phi" in fit else points.phi
    points = points[points.within(max(low, phi.min()), min(high, phi.max()), SLOWEST_FIT)]
    free, _ = estimate(points, form_named("phi_J,y,znu"))
    held, found = estimate(points, form_named(f"phi_J={PHI_J},y,znu"))
    y, znu = (Estimate(found[name].value, found[name].error) for name in ("y", "kappa"))
    return {
        "phi_J": f"χ² grows by {held.chi2 - free.chi2:.0f} at {PHI_J}",
        "y": f"{y} at φ_J = {PHI_J}",
        "znu": f"{znu} at φ_J = {PHI_J}",
    }


def powers_beside_phi_J(flows, size, of_collapse):
    """β of p/γ̇ extrapolated to γ̇ → 0 at each φ, against the distance to V's φ_J."""
    if len(np.unique(slower(flows, 2e-3)["rate"])) < 3:
        return
    points = []
    for phi in (phi for phi in np.unique(flows["phi"]) if phi < PHI_J):
        rates, p, error = rates_of(flows.where(phi=phi), "pressure")
        limit, _ = extrapolated_fluidity(rates, p, error)
        if limit.value > max(FAR * rates[0] / p[0], 5 * limit.statistical):
            error = limit.statistical / limit.value**2
            points.append((PHI_J - phi, replace(limit, value=1 / limit.value, statistical=error)))
    if len(points) < 3:
        return
    distances, limits = (list(part) for part in zip(*points[::-1], strict=True))  # the nearest φ first
    found = power_of_limits(distances, limits)
    near, far = (
        -power_of_limits(distances[some], limits[some]).value for some in (slice(3), slice(-3, None))
    )
    ours = replace(found, value=-found.value, systematic=0.5 * abs(near - far))
    note = f"{of_collapse}; {near:.2f} of the nearest three φ, {far:.2f} of the farthest"
    what = "φ < φ_J: p/γ̇ ~ (φ_J − φ)^(−β): β, extrapolated to γ̇ → 0"
    yield Row(what, "2.4", ours, number(2.4), note, size, bears="beta")


def power_of_limits(distances, limits) -> Estimate:
    """Exponent of limits γ̇ → 0 in a distance, with the χ² of the extrapolations, too."""
    found = power_law(distances, [one.value for one in limits], np.array([one.statistical for one in limits]))
    chi2, dof = (sum(getattr(one, name) for one in limits) for name in ("chi2", "dof"))
    return replace(found, chi2=found.chi2 + chi2, dof=found.dof + dof)


def yield_pressure(rates, p, error) -> Estimate:
    """p₀ of p^m = p₀^m + c γ̇^½, m = ½ zν/y, by weighted least squares over γ̇ ≤ 1e-3; nan where it is not positive."""
    used = rates < 2e-3
    rates, p, error = rates[used], p[used], error[used]
    m = HALF * 3.5 / 1.1
    power, own, chi2, dof = line_fit((rates**HALF, np.ones_like(rates)), p**m, m * p ** (m - 1) * error)
    if power <= 0:
        return Estimate(np.nan, np.nan)
    p0 = power ** (1 / m)
    return Estimate(p0, own * p0 / (m * power), 0.0, chi2, dof)


@claim("paper5", on="universality")
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
        found = power_law(rates[slow], ratio[slow], (relative * ratio)[slow])
        told = ", ".join(f"{r:.3f} at {g:g}" for g, r in zip(rates[slow], ratio[slow], strict=True))
        what = f"RD0/CD0 of {symbol} at φ_J ~ γ̇^x, γ̇ = {rates[0]:g} to {rates[slow][-1]:g}"
        if symbol == "p":  # of which V says that it has the smaller corrections
            target = number(0.0, absolute=0.1 * 1.1 / 3.5)
            yield Row(
                what,
                "the same exponents: x = 0",
                found,
                target,
                f"ratio {told}",
                size_of(at),
                part="ratio of p",
            )
        else:
            yield check(what, found.value, found.inflated, f"ratio {told}", size_of(at), "0")
    yield from bearing("stand-in", stand_in(table, flows))


def same_exponents(table, flows):
    """Differences of φ_J, y and zν of CD0 and RD0, from collapses of the same cut."""
    found = {}
    for model in ("RD0", "CD0"):
        path = table.path / f"pressure-{model}.h5"
        if path.exists():
            fit = jampetsc.load(path)
            found[model] = at_cut(fit, SLOWEST_FIT)
            for parameter, ours in found[model].items():
                what = f"collapse of p, {model}, γ̇ ≤ {SLOWEST_FIT:g}: {SYMBOLS[parameter]}"
                told = ", ".join(
                    f"{value:.4f} at γ̇ ≤ {cut:g}"
                    for value, cut in zip(
                        fit["drift/parameters"][:, list(found[model]).index(parameter)],
                        fit["drift/cut"],
                        strict=True,
                    )
                )
                size, on = size_of(flows.where(model=model)), "phi_J" if parameter == "phi_J" else ""
                yield check(what, ours.value, ours.statistical, told, size, bears=on)
    if len(found) < 2:
        return
    for parameter, (value, margin) in THEIRS.items():
        one, other = found["RD0"][parameter], found["CD0"][parameter]
        ours = Estimate(
            other.value - one.value,
            float(np.hypot(one.statistical, other.statistical)),
            float(np.hypot(one.systematic, other.systematic)),
        )
        symbol = SYMBOLS[parameter]
        what = f"{symbol} of CD0 less {symbol} of RD0"
        target = number(0.0, absolute=margin or 0.1 * value)
        note = f"RD0 {one}, CD0 {other}; CD0 {lower_cuts(jampetsc.load(path), parameter, whole=True)}"
        on, part = ("phi_J", "CD0 less RD0") if parameter == "phi_J" else ("", symbol)
        yield Row(what, "the same: 0", ours, target, note, size_of(flows), bears=on, part=part)


def stand_in(table, flows):
    """CD over CD0 as Q falls: σ, p and g_y."""
    g = table.where(command="correlate")
    ratios = []
    least = min(np.unique(flows.where(model="CD")["quality"]), default=0.0)
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
                if q == least:
                    ratios.append((ratio, error))
                what = f"CD over CD0: σ, φ = {phi:g}, γ̇ = {rate:g}, Q = {q:g}"
                yield check(what, ratio, error, note, size_of(rows), "1")
    if len(ratios) > 1:
        ratio, error = np.transpose(ratios)
        what = f"σ of CD at Q = {least:g} over σ of CD0, {len(ratio)} states"
        note = f"from {ratio.min():.3f} to {ratio.max():.3f}, φ = 0.80 and {PHI_J}"
        ours = weighted_mean(ratio, error)
        yield Row(what, "CD stands in for CD0: 1", ours, number(1.0), note, size_of(flows))


@claim("paper2", "paper5", "vagberg-fig5.1-slow", on="phi_J")
def density_of_jamming(samples, models, drag):
    """φ_J of random starts, of quasistatic shear and of flow, γ̇ → 0: that of shear is one number, path independent."""
    found = {}
    for name, ensemble in (("RAND", "random"), ("QS", "shear")):
        estimates = fitted(samples, f"{ensemble}-corrected")
        if estimates:
            found[name] = estimates["phi_J"]
    for name, table, file in (
        ("RD0", drag, "pressure"),
        ("CD0", models, "pressure-CD0"),
    ):
        if (table.path / f"{file}.h5").exists():
            found[name] = at_cut(jampetsc.load(table.path / f"{file}.h5"), SLOWEST_FIT)["phi_J"]
    jams = samples.where(command="jam")
    size = f"{size_of(drag.where(command='flow'))}; N = {jams['n'].min():.0f} to {jams['n'].max():.0f} of samples"
    how = {"RAND": "f(φ, N) with corrections to scaling", "QS": "f(φ, N) with corrections to scaling"}
    for name, ours in found.items():
        what = f"φ_J of {name}, from {how.get(name, 'the collapse of p at low γ̇')}"
        yield check(what, ours.value, 0.5 * ours.half_width, "", size)
    told = ", ".join(f"{name} {one}" for name, one in found.items())
    if "QS" in found:
        drift = drift_of(jampetsc.load(samples.path / "shear-corrected.h5"), "phi_J", 4)
        told += f"; QS with {drift.rpartition(', ')[2]}"
    for name in ("RD0", "CD0"):
        if name not in found or "QS" not in found:
            continue
        one, other = found["QS"], found[name]
        ours = difference(one, other)
        what = f"φ_J of quasistatic shear less φ_J of {name}, γ̇ → 0"
        if name == "RD0":
            words = "one well-defined number, path independent: 0"
            yield Row(what, words, ours, number(0.0, absolute=PHI_MARGIN), told, size, part="QS less RD0")
        else:
            yield check(what, ours.value, 0.5 * ours.half_width, "", size, "0")


@claim("vagberg-fig5.1", "paper5", on="overdamped-newtonian")
def overdamped_below_phi_J(drag, models):
    """Slope of σ between the lowest two γ̇: of RD0 far below φ_J, of CD0 at the lowest φ of the figure."""
    wide = drag.path / "wide"
    cases = (
        ("RD0", jampetsc.load(wide) if wide.exists() else drag, FAR_BELOW),
        ("CD0", models, 0.80),
    )
    for model, table, highest in cases:
        rows, slopes = table.where(command="flow", model=model), []
        for phi in (phi for phi in np.unique(rows["phi"]) if phi <= highest + 1e-9):
            rates, stress, error = rates_of(rows.where(phi=phi), "shear_stress")
            if len(rates) > 1:
                slopes.append(power_law(rates[:2], stress[:2], error[:2]))
        if not slopes:
            continue
        mean = weighted_mean([one.value for one in slopes], [one.statistical for one in slopes])
        what = f"{model}, φ ≤ {highest:g}: σ ~ γ̇^x between the lowest two γ̇"
        note = f"{len(slopes)} φ, from γ̇ = {rows['rate'].min():g} up"
        yield Row(what, "Newtonian: 1", mean, number(1.0), note, size_of(rows), part=model)


@claim("paper5", "vagberg-fig5.1-slow", on="above")
def yield_pressures(models, drag):
    """y of the limits γ̇ → 0 of RD0 above φ_J, with φ_J of the collapse of p."""
    path, rows = drag.path / "pressure.h5", models.where(command="flow", model="RD0")
    if not path.exists():
        return
    phi_J = at_cut(jampetsc.load(path), SLOWEST_FIT)["phi_J"]
    limits = []
    for phi in (phi for phi in np.unique(rows["phi"]) if phi > PHI_J + 1e-9):
        limit = yield_pressure(*rates_of(rows.where(phi=phi), "pressure"))
        if limit.value > 0:
            limits.append((phi, limit))
    if len(limits) < 3:
        return
    phi, values = np.array([at for at, _ in limits]), [limit for _, limit in limits]
    found = power_of_limits(phi - phi_J.value, values)
    shifts = [phi_J.value + sign * 0.5 * phi_J.half_width for sign in (-1, 1)]
    ends = [power_of_limits(phi - shift, values).value for shift in shifts]
    ours = replace(found, systematic=0.5 * abs(ends[1] - ends[0]))
    told = ", ".join(f"{one} at φ = {at:g}, χ² = {one.chi2:.0f} for {one.dof}" for at, one in limits)
    what = "RD0, φ > φ_J: p ~ (φ − φ_J)^y, extrapolated to γ̇ → 0: y"
    yield Row(what, "1.1", ours, number(1.1), f"p = {told}", size_of(rows), part=None)
