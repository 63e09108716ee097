"""The claims of the two works beside what the figures' quick runs give: prints the table of docs/reproduction.md.

    for figure in run/figures/*; do $figure; done
    .venv/bin/python benchmarks/reproduction.py [figures]

A row is the claim, its number, ours with one standard error (bootstrap over packings or seeds, or the file's own from
the autocorrelation), whether they are within two of these, and the command. What has not been run is left out.
"""

import sys
from pathlib import Path

import numpy as np

import jampetsc
from jampetsc.analysis.correlations import length_spread
from jampetsc.analysis.jamming import memory
from jampetsc.analysis.scaling import fit_power_law
from jampetsc.analysis.statistics import bootstrap
from jampetsc.plots.correlation import correlation_curve
from jampetsc.plots.flowcurves import local_exponents

RESAMPLES = 500
WITHIN = 2.0  # standard errors
ROWS = []


def claim(figure):
    """Decorator: the function yields (claim, theirs, ours, error or None, note) from the table of a quick run."""

    def enter(function):
        ROWS.append((figure, function))
        return function

    return enter


def exponent(rows, column, by="pressure"):
    """(exponent of the mean of a column in `by`, its standard error from resampling the packings)."""
    groups = [(key[by], part[column]) for key, part in rows.groups([by])]
    x = np.array([key for key, _ in groups])
    draw = np.random.default_rng(0)
    means = [[np.mean(draw.choice(y, len(y))) for _, y in groups] for _ in range(RESAMPLES)]
    found = [fit_power_law(x, mean).exponent for mean in means if min(mean) > 0]
    return fit_power_law(x, np.array([np.mean(y) for _, y in groups])).exponent, np.std(found)


CORRECTIONS = "two decades at N = 4096 do not tell an exponent from its corrections to scaling"
CRITICAL = [1e-3, 1e-4, 1e-5]  # pressures near jamming at which N = 4096 is large: N²p > 100


@claim("bt-fig3")
def moduli(table):
    sweeps = table.where(command="sweep")
    near = sweeps.where(pressure=CRITICAL)
    for column, name, theirs in (("G0", "G₀", 0.5), ("eta0", "η₀", -0.5), ("omega_star", "ω* = G₀/η₀", 1.0)):
        yield (
            f"β = 1: {name} ~ p^x, p = 1e-5 … 1e-3",
            theirs,
            *exponent(near, column),
            (
                "with pre-stress, whose effect falls with p (rows of bt-fig8): without it see the rows of bt-fig5"
            ),
        )
    lowest = sweeps.where(pressure=1e-5)
    for part, name in (("storage", "G′"), ("loss", "G″")):
        value, error = bootstrap(lowest[f"exponent_{part}"])
        yield (
            f"β = 1: {name} ~ ω^Δ between p and 1, p = 1e-5",
            0.5,
            value,
            error,
            "G′ has G₀ added to its power law" if part == "storage" else "",
        )


@claim("bt-fig4")
def weak_sliding(table):
    sweeps = table.where(command="sweep", beta=0.0).results()
    off = [np.abs(s.G / (s.G.real[0] * (1 + 1j * s.omega)) - 1).max() for s in sweeps]
    yield "β = 0 without pre-stress: G*/[G₀(1 + iωτ₁)] − 1, largest", 0.0, max(off), None, "exact"
    betas = [(result["beta_scan/beta"], result["beta_scan/eta0"], result.attributes["G0"])
             for result in table.where(command="quasistatic").results()]  # fmt: skip
    slope = [np.log(eta[-1] / eta[-3]) / np.log(beta[-1] / beta[-3]) for beta, eta, _ in betas]
    yield "η₀ ~ β^x for strong sliding, β = 1 … 100", 1.0, np.mean(slope), None, "Σ (Δu⊥ᶜ)² alone"
    plateau = [eta[0] / G0 for _, eta, G0 in betas]
    yield "η₀/(G₀τ₁) as β → 0 (β = 1e-8)", 1.0, np.mean(plateau), None, ""


@claim("bt-fig5")
def floppy(table):
    slow = table.where(command="quasistatic", pressure=CRITICAL)
    for prefix, where in (("no_prestress_", "without pre-stress"), ("", "with pre-stress")):
        for column, name, theirs in (
            ("normal", "|Δu∥|", 0.25), ("transverse", "|Δu⊥|", -0.25), ("nonaffine", "|u_na|", -0.25)
        ):  # fmt: skip
            found = exponent(slow, f"{prefix}{column}_median")
            yield f"median {name} ~ p^x, {where}, p = 1e-5 … 1e-3", theirs, *found, ""
    lowest = table.where(command="quasistatic", pressure=[1e-4, 1e-5, 1e-6])
    yield (
        "mean |Δu∥| ~ p^x at p ≤ 1e-4 (a plateau is reported)",
        0.0,
        *exponent(lowest, "no_prestress_normal_mean"),
        "k Σ (Δu∥)² = G₀Vγ² exactly, so rms |Δu∥| follows √G₀ ~ p^¼ and no plateau is possible",
    )
    for column, name, theirs in (("G0", "G₀", 0.5), ("eta0", "η₀", -0.5), ("omega_star", "ω*", 1.0)):
        yield (
            f"β = 1 without pre-stress: {name} ~ p^x, p = 1e-5 … 1e-3",
            theirs,
            *exponent(slow, f"no_prestress_{column}"),
            "",
        )


@claim("bt-fig6")
def drag(table):
    sweeps = table.where(command="sweep")
    near = sweeps.where(pressure=CRITICAL)
    yield "Stokes: η₀ ~ p^x (η_F = 0), p = 1e-5 … 1e-3", -0.5, *exponent(near, "eta0"), ""
    lowest = sweeps.where(pressure=sweeps["pressure"].min())
    for part, name in (("storage", "G′"), ("loss", "G″")):
        yield (
            f"Stokes: {name} ~ ω^Δ between p and 1, p = 1e-5",
            0.5,
            *bootstrap(lowest[f"exponent_{part}"]),
            (
                "G′ has G₀ added to its power law"
                if part == "storage"
                else "G″ turns over at ω ~ 1: see the picture"
            ),
        )


@claim("bt-fig7")
def lengths(table):
    def curves(law):
        rows = table.where(command="correlate", law=law)
        return [correlation_curve(result) for result in rows.results()]

    slowest = [c.G.real[0] / c.size for c in curves("stokes")]
    yield (
        "Stokes: l/L as ω → 0 (Re u_y)",
        0.25,
        *bootstrap(slowest),
        "mean over three pressures of four packings each; Im u_y gives more, see the picture",
    )
    contact = [c.G.real[c.omega < 1e-1] / c.size for c in curves("contact")]
    spread = np.std(np.concatenate(contact)) / np.mean(np.concatenate(contact))
    yield "contact: l/L does not depend on ω: spread of l over ω < 0.1 and p", 0.0, spread, None, ""
    collapsed = [(c.omega, c.G, c.pressure, c.size) for c in curves("stokes")]
    for sign, note in ((0.65, "as printed"), (-0.65, "the other sign collapses better"), (0.0, "no factor")):
        yield (
            f"Stokes: l (−ln p)^{sign:g} against ω/p^½: spread",
            0.0,
            length_spread(collapsed, sign),
            None,
            note,
        )


@claim("bt-fig8")
def prestress(table):
    for p in (1e-2, 1e-4):
        rows = table.where(command="sweep", law="contact", pressure=p)
        both = [rows.where(prestress=on)["G0"] for on in (1, 0)]
        yield f"G₀ with over without pre-stress, p = {p:g}", None, *bootstrap(both[0] / both[1]), ""


def rates_of(rows, name):
    """(rates, means, errors) of σ or p of flows, over seeds."""
    groups = rows.groups(["rate"])
    rates = np.array([key["rate"] for key, _ in groups])
    values = np.array([part[f"{name}_mean"].mean() for _, part in groups])
    own = [np.sqrt(np.mean(part[f"{name}_error"] ** 2) / part.rows) for _, part in groups]
    scatter = [bootstrap(part[f"{name}_mean"])[1] if part.rows > 1 else 0.0 for _, part in groups]
    return rates, values, np.maximum(own, scatter)


def slope_with_error(rates, values, errors):
    """Exponent through all points, weighted, and its error from theirs."""
    (slope, _), covariance = np.polyfit(np.log(rates), np.log(values), 1, w=values / errors, cov="unscaled")
    return slope, np.sqrt(covariance[0, 0])


@claim("vagberg-flow-curves")
def flow_curves(table):
    at = table.where(command="flow", phi=0.8433)
    slow = at.where(rate=[rate for rate in np.unique(at["rate"]) if rate < 2e-3])
    yield (
        "RD0 at φ_J = 0.8433: p ~ γ̇^x, γ̇ ≤ 1e-3",
        round(1.1 / 3.5, 3),
        *slope_with_error(*rates_of(slow, "pressure")),
        "one seed, and its error from its own autocorrelation: runs differ by more (docs/flow.md)",
    )
    yield (
        "RD0 at φ_J = 0.8433: σ ~ γ̇^x, γ̇ ≤ 1e-3",
        round(1.1 / 3.5, 3),
        *slope_with_error(*rates_of(slow, "shear_stress")),
        "σ has larger corrections to scaling than p, as V says",
    )
    below = table.where(command="flow", phi=0.80)
    rates, p, error = rates_of(
        below.where(rate=[r for r in np.unique(below["rate"]) if r < 5e-4]), "pressure"
    )
    yield (
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
            yield f"{model}, γ̇ = {g.attributes['rate']:g}: minimum of g_y {says}", None, depth, None, where


def fitted(table, name, wanted, of):
    """Claims about the parameters that `jampetsc collapse` has put into a file of the study's folder."""
    path = table.path / f"{name}.h5"
    if not path.exists():  # a fit that did not converge, or that is under way
        return
    result = jampetsc.load(path).attributes
    for parameter, theirs, note in wanted:
        symbol = {"phi_J": "φ_J", "znu": "zν", "nu": "ν"}.get(parameter, parameter)
        what = f"{of}: {symbol} (χ²/dof {result['chi2'] / result['dof']:.2f})"
        yield what, theirs, result[parameter], result[f"{parameter}_error"], note


@claim("vagberg-fig5.1")
def exponents(table):
    wanted = [
        ("phi_J", 0.8433, ""),
        ("y", 1.1, ""),
        ("znu", 3.5, "N = 1024 and γ̇ from 1e-4 on: corrections to scaling"),
    ]
    yield from fitted(table, "pressure", wanted, "collapse of p, RD0")
    wanted = [
        ("phi_J", 0.8433, ""),
        ("y", 1.1, "V: σ has larger corrections than p; not the exponent of small γ̇"),
    ]
    yield from fitted(table, "shear-stress", wanted, "collapse of σ, RD0")


@claim("paper2")
def finite_size(table):
    wanted = [("nu", 1.0, "random starts"), ("phi_J", None, "")]
    yield from fitted(table, "finite-size", wanted, "f(φ, N), RAND")
    wanted = [
        (
            "y",
            1.0,
            "N ≤ 256: drifts with the smallest N, see the picture; one packing that is compressed has 1",
        ),
        ("phi_J", None, ""),
    ]
    yield from fitted(table, "pressure", wanted, "⟨p⟩(φ, N), RAND")


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
        yield f"{model}, φ = {phi}, Q = 1: σ ~ γ̇^x at low rates", theirs, slope, spread, note


@claim("paper5")
def stand_in(table):
    at = table.where(command="flow", phi=0.8433)
    for rate in (1e-2, 1e-3):
        means = {}
        for model in ("CD", "CD0", "RD0"):
            rows = at.where(model=model, rate=rate)
            means[model] = (
                bootstrap(rows["shear_stress_mean"])[0],
                np.max(
                    [
                        bootstrap(rows["shear_stress_mean"])[1],
                        np.sqrt(np.mean(rows["shear_stress_error"] ** 2) / rows.rows),
                    ]
                ),
            )
        for one, theirs, note in (("CD", 1.0, "Q = 1"), ("RD0", None, "")):
            a, b = means[one], means["CD0"]
            yield (
                f"σ of {one} over that of CD0, φ_J, γ̇ = {rate:g}",
                theirs,
                a[0] / b[0],
                a[0] / b[0] * np.hypot(a[1] / a[0], b[1] / b[0]),
                note,
            )


@claim("paper1")
def jamming(table):
    jam = table.where(command="jam")
    random = jam.where(cooling_rate=np.nan) if "cooling_rate" in jam else jam
    for rows, column, name in (
        (random, "jammed_fraction", "RAND"), (table.where(command="shear"), "jammed_mean", "QS")
    ):  # fmt: skip
        for n in np.unique(rows["n"]):
            mine = rows.where(n=n)
            order = np.argsort(mine["phi"])
            phi, f = mine["phi"][order], mine[column][order]
            note = "depends on the protocol; f sharpens with N"
            if f[0] < 0.5 < f[-1]:
                yield f"{name}, N = {n:g}: φ where f = ½", None, np.interp(0.5, f, phi), None, note
    if "cooling_rate" in jam:
        for key, rows in jam.where(cooling_rate=[1e-1, 1e-2, 1e-3]).groups(["cooling_rate"]):
            what = f"liquid cooled at {key['cooling_rate']:g} per sweep, N = 64: φ_J"
            yield what, None, rows["phi_J"][0], rows["phi_J_error"][0], "rises as cooling slows"


@claim("paper3")
def soft_states(table):
    cases = (
        ("jam", "RAND", "V: y ≤ 1, so that P does not diverge"),
        ("shear", "QS", "V: y > 1, so that P diverges"),
    )
    for command, name, theirs in cases:
        for key, rows in table.where(command=command).groups(["n"]):
            runs = []
            for result in rows.results():
                steady = np.ones(len(result["pressure"]), bool)
                if command == "shear":
                    steady = result["strain"] > result.attributes["discard"]
                runs.append(result["pressure"][steady & (result["jammed"] == 1)])
            p = np.concatenate(runs)
            edge = p.mean() / 4
            soft = p[p < edge]
            independent = len(soft) / (memory(runs) if command == "shear" else 1.0)
            y = np.mean(np.log(edge / soft))  # Hill's estimator
            what = f"{name}, N = {key['n']:g}, φ = 0.84: y of P(p) ~ p^(1/y − 1) at p < ⟨p⟩/4"
            note = f"{theirs}; {len(soft)} states below, that tell as much as {independent:.0f}"
            yield what, None, y, y / np.sqrt(independent), note


def text(value, error):
    if error is None or not np.isfinite(error):
        return f"{value:.4g}"
    digits = max(0, 1 - int(np.floor(np.log10(error)))) if error > 0 else 3
    return f"{value:.{min(digits, 8)}f} ± {error:.{min(digits, 8)}f}"


def main():
    folder = Path(sys.argv[1] if len(sys.argv) > 1 else "figures")
    print("| claim | theirs | ours | within two errors | command | |\n|---|---|---|---|---|---|")
    for figure, rows in ROWS:
        if not (folder / f"{figure}-quick" / "table.csv").exists():
            continue
        for what, theirs, value, error, note in rows(jampetsc.load(folder / f"{figure}-quick")):
            agrees = (
                ""
                if theirs is None or error is None
                else "yes"
                if abs(value - theirs) <= WITHIN * error
                else "no"
            )
            said = "" if theirs is None else f"{theirs:.4g}"
            note = note or (CORRECTIONS if agrees == "no" else "")
            what, note = (words.replace("|", r"\|") for words in (what, note))
            print(f"| {what} | {said} | {text(value, error)} | {agrees} | `{figure}` | {note} |")


if __name__ == "__main__":
    main()
