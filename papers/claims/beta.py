"""G* of linear response at other ratios β of the damping: BT figure 4. Estimators are as in `moduli`."""

import numpy as np

import jampetsc
from jampetsc.analysis.power_laws import collapse_spread, local_slope
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.plots.curves import curve_of
from papers.claims.moduli import exponent_rows
from papers.claims.shared import (
    Row,
    bearing,
    check,
    claim,
    size_of,
    unjudged,
)
from papers.claims.verdicts import Estimate, between, number

BOTH = (("no_prestress_", "without pre-stress"), ("", "with pre-stress"))
AROUND = 0.1  # of ½, where a slope counts as critical
SLOW = 1e-2  # ωτ₁ up to which κ is iωβτ₁
ROUNDING = 1e-6  # relative difference of what is the same, in the single precision of kept results
IDENTITIES = {
    "beta0": "B = τ₁K at β = 0",
    "eta0-beta0": "η₀ = G₀τ₁ at β = 0",
    "beta*": "β* is G₀ over η₀ per β, of the rows above",
    "omega*-beta": "η₀ = G₀τ₁ + βS",
}


@claim("bt-fig4", exact=IDENTITIES)
def sliding(table):
    """The rows of figure 4."""
    sweeps = table.where(command="sweep", state="done")
    off = [
        np.abs(s.G / (s.G.real[0] * (1 + 1j * s.omega)) - 1).max()
        for s in sweeps.where(beta=0.0, prestress=0).results()
    ]
    size = size_of(sweeps.where(beta=0.0))
    what = "β = 0, without pre-stress: G*/[G₀(1 + iωτ₁)] − 1, largest"
    yield Row(
        what,
        "0",
        Estimate(max(off)),
        between(0.0, ROUNDING),
        "limited by rounding of stored results",
        size,
        bears="beta0",
    )
    slow = table.where(command="quasistatic", state="done")
    cases = (
        ("eta0_normal", "η₀ at β = 0", 0.5, "eta0-beta0"),
        ("eta0_transverse", "η₀ − η₀(β = 0), per β", -0.5, "eta0-beta"),
        ("beta_star", "β* = G₀Vγ²/kΣ(Δu⊥ᶜ)²", 1.0, "beta*"),
    )
    columns = {name: slow[name] for name in slow}
    for prefix, _ in BOTH:
        columns[f"{prefix}beta_star"] = slow[f"{prefix}G0"] / slow[f"{prefix}eta0_transverse"]
    derived = type(slow)(slow.path, columns, jampetsc.load)
    for row in exponent_rows(derived, "contact damping", cases):
        # BT 22 and β* are derived without pre-stress
        yield row if "without" in row.claim else unjudged(row)
    yield from beta_scans(slow, size)
    yield from bearing("window", windows_of_beta(sweeps))


def beta_scans(slow, size):
    """η₀ and η_∞ of each packing against β."""
    off, slopes, rises = [], [], []
    for result in slow.results():
        beta, eta0 = result["beta_scan/beta"], result["beta_scan/no_prestress_eta0"]
        facts = result.attributes
        model = facts["no_prestress_G0"] + beta * facts["no_prestress_eta0_transverse"]
        off.append(np.abs(eta0 / model - 1).max())
        slopes.append(-np.diff(np.log(eta0[-3:])) / np.diff(np.log(beta[-3:])))
        middle = (beta > 0.9e-2) & (beta < 1.1e-1)  # p ≪ β ≪ 1
        rises.append(np.diff(np.log(result["beta_scan/eta_inf"][middle])).item() / np.log(10))
    what = "without pre-stress: η₀/τ₁ = G₀ + βkΣ(Δu⊥ᶜ)²/(Vγ²), largest relative difference"
    yield check(
        what, max(off), None, "rotations that are best for one β are for all", size, "0", predicted=True
    )
    (nearer, farther), (_, error) = mean_with_error(slopes)
    what = f"without pre-stress: ω* = G₀/η₀ ~ β^x, β = {beta[-2]:g} … {beta[-1]:g} ≫ β*"
    note = f"{nearer:.4f} between β = {beta[-3]:g} and {beta[-2]:g}"
    estimate = Estimate(farther, error, 0.5 * abs(farther - nearer))
    yield Row(what, "-1", estimate, number(-1.0), note, size, bears="omega*-beta")
    p = slow["pressure"]
    local = ", ".join(f"{np.mean(np.array(rises)[p == one]):.2f}" for one in np.unique(p)[::-1])
    yield check(
        "η_∞ ~ β^x, β = 1e-2 … 1e-1, lowest p",
        *mean_with_error(np.array(rises)[p == p.min()]),
        f"{local} from p = {p.max():g} down: p ≪ β ≪ 1 is a short range",
        size,
        "0.5",
        predicted=True,
    )


def windows_of_beta(sweeps):
    """The window in which G″ ~ ω^½ at several β and one pressure, and F(κ)."""
    for on, where in ((0, "without pre-stress"), (1, "with pre-stress")):
        some = sweeps.where(prestress=on, pressure=1e-4)
        groups = [(key["beta"], [curve_of(r) for r in part.results()]) for key, part in some.groups(["beta"])]
        widths = {beta: mean_with_error([critical_decades(c) for c in curves]) for beta, curves in groups}
        told = ", ".join(f"{width:.1f} at β = {beta:g}" for beta, (width, _) in list(widths.items())[::2])
        for chosen, words, target in (
            ([beta for beta in widths if beta < 1e-4 / 5], "none at β ≪ β*", between(high=0.5)),
            ([max(widths)], "opens as β grows", between(low=1.0)),
        ):
            if not chosen:
                continue
            estimate = Estimate(*widths[max(chosen)])
            what = (
                f"p = 1e-4, {where}: decades of ω with d ln G″/d ln ω = ½ ± {AROUND:g}, β = {max(chosen):g}"
            )
            if on:
                yield Row(what, words, estimate, target, told, size_of(some), part=f"β = {max(chosen):g}")
            else:
                yield check(what, estimate.value, estimate.statistical, told, size_of(some), words)
        if not on:
            spread = one_curve_spread([(beta, c) for beta, curves in groups if beta for c in curves[:1]])
            what = f"p = 1e-4, {where}: G*/(1 + iωτ₁) = F of βω for all β, ω < {SLOW:g}: spread (rms)"
            yield check(
                what,
                spread,
                None,
                "exact in κ = iωβτ₁/(1 + iωτ₁), which is nearly iωβτ₁",
                size_of(some),
                "0",
                predicted=True,
            )


def critical_decades(curve):
    """Decades of ω over which d ln G″/d ln ω is ½ ± AROUND."""
    near = np.abs(local_slope(curve.omega, curve.G.imag) - 0.5) < AROUND
    return np.sum(near[1:] * np.diff(np.log10(curve.omega)))


def one_curve_spread(curves):
    """How far G*/(1 + iωτ₁) is from one curve of βω, for [(β, curve)]."""
    scaled = [(c.omega, c.G / (1 + 1j * c.omega), 1 / beta) for beta, c in curves]
    return collapse_spread(scaled, 0.0, 1.0, end=SLOW)
