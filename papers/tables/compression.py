"""Compression beside shear: K*(ω) and G*(ω) of the same packings (docs/theory/linear_response.md).

    .venv/bin/python -m papers.tables.compression figures/compression-quick          # after run/figure compression

K is −V dp/dV, G the shear modulus averaged over all directions. The forces f of the contacts are the one state of self
stress of a packing that has just jammed; alone it would give

    K_f = k (Σ f r)²/(4V Σ f²) = p² V/(2U) ,

the second form for harmonic disks of one stiffness. It is the part of K that does not vanish at jamming. The other
states, whose number is that of the contacts beyond isostaticity, see a stretch r/2 without its projection on f, and
would give (K_A − K_f)/G_A times what they give to G*, A for affine motion. Terms of the order of iωτ₁ are left out.
"""

from collections import defaultdict
from dataclasses import dataclass

import numpy as np

import jampetsc
from benchmarks.common import saved_page
from jampetsc.analysis.power_laws import SLOPE_TOLERANCE, local_slope, low_frequency_limit, power_law_window
from jampetsc.analysis.statistics import draws_of, mean_with_error, small_sample_factor
from jampetsc.plots.page import draw_guide
from jampetsc.plots.style import DASHED, LOSS, PAGE, STORAGE, entry, hidden, looks, power_or_number
from papers.programs import folder_and_picture

CRITICAL = 0.5  # exponent of the window
NEAR = 1e-3  # highest p of the exponents
DRAWS = 2000
LAWS = {"contact": r"contact damping, $\beta=1$", "stokes": r"drag alone, $\eta_F=0$"}


@dataclass(frozen=True, eq=False)
class Point:
    """S packings of one pressure under one law: moduli (S, M) at M frequencies, K_f (S,), all in k."""

    omega: np.ndarray
    K: np.ndarray
    G: np.ndarray
    K_f: np.ndarray

    @property
    def limits(self):
        """{name: (S,)} of the numbers at ω → 0."""
        limits = {
            name: [low_frequency_limit(self.omega, one) for one in getattr(self, name)] for name in "KG"
        }
        numbers = {f"{name}0": np.array([one.modulus for one in found]) for name, found in limits.items()}
        numbers |= {
            f"eta_{name}": np.array([one.viscosity for one in found]) for name, found in limits.items()
        }
        return numbers | {"excess": numbers["K0"] - self.K_f}

    @property
    def excess(self):
        """K* − K_f, (S, M)."""
        return self.K - self.K_f[:, None]

    def row(self, omega):
        """Number of the frequency nearest to one."""
        return int(np.argmin(np.abs(np.log(self.omega / omega))))


def read(table):
    """({(law, prestress): {p: Point}}, {p: (K_A − K_f)/G_A}), p decreasing; the quotient (S,) of affine motion."""
    own = modulus_of_forces(table.where(command="pack"))
    found = defaultdict(lambda: defaultdict(list))
    for result in table.where(command="sweep").results():
        facts = result.attributes
        pressure, key = nominal(facts["pressure"]), (facts["law"], bool(facts["prestress"]))
        found[key][pressure].append((result, own[pressure, facts["seed"]]))
    points = {
        key: {
            p: Point(
                rows[0][0].omega,
                np.array([result["bulk_modulus"] for result, _ in rows]),
                np.array([result.G for result, _ in rows]),
                np.array([value for _, value in rows]),
            )
            for p, rows in by.items()
        }
        for key, by in found.items()
    }
    return points, affine_quotients(table, own)


def nominal(pressure) -> float:
    """The pressure that a packing was made for."""
    return float(f"{pressure:.3g}")


def modulus_of_forces(packs):
    """{(p, seed): K_f} of the packings of a table."""
    radii = np.array([0.5, 0.7]) / 1.2  # of equally many disks
    volume = packs["n"] * np.pi * np.mean(radii**2) / packs["phi"]
    values = packs["pressure"] ** 2 * volume / (2.0 * packs["energy"])
    return dict(zip(zip(map(nominal, packs["pressure"]), packs["seed"], strict=True), values, strict=True))


def affine_quotients(table, own):
    """{p: (K_A − K_f)/G_A} without pre-stress, whose affine moduli do not depend on the law."""
    rows = table.where(command="quasistatic", law="contact")
    affine = {
        load: {
            (nominal(p), seed): modulus
            for p, seed, modulus in zip(
                *(rows.where(load=load)[name] for name in ("pressure", "seed", "no_prestress_G_affine")),
                strict=True,
            )
        }
        for load in ("xy", "compression")
    }
    quotients = defaultdict(list)
    for (p, seed), K_A in affine["compression"].items():
        quotients[p].append((K_A - own[p, seed]) / affine["xy"][p, seed])
    return quotients


def text(values, digits=3):
    """Mean and standard error of independent values."""
    value, error = mean_with_error(values)
    return f"{value:.{digits}g} ± {error:.2g}" if np.isfinite(error) else f"{value:.{digits}g}"


def print_limits(points):
    """Moduli and viscosities at ω → 0 with their exponents in p."""
    print(
        "Limits ω → 0, medians over packings, k and kτ₁; exponents of p ≤ 1e-3, errors by bootstrap over packings.\n"
    )
    print("| law | pre-stress | p | packings | K₀ | K_f | K₀ − K_f | G₀ | η_K | η_G |")
    print("|---|---|---|---|---|---|---|---|---|---|")
    names = ("K0", "K_f", "excess", "G0", "eta_K", "eta_G")
    for (law, prestress), by in points.items():
        values = {p: point.limits | {"K_f": point.K_f} for p, point in by.items()}
        for p, limits in values.items():
            cells = " | ".join(f"{np.median(limits[name]):.3g}" for name in names)
            print(f"| {law} | {'with' if prestress else 'without'} | {p:g} | {len(by[p].K)} | {cells} |")
        near = [p for p in values if p <= NEAR]
        if len(near) > 1:
            cells = " | ".join(exponent_text(near, [values[p][name] for p in near]) for name in names)
            print(f"| {law} | {'with' if prestress else 'without'} | exponent | | {cells} |")


def exponent_text(pressures, samples):
    """Exponent in p of medians of samples, (P, S) of the same seeds, with the error of a bootstrap over seeds."""
    samples = np.array(samples)
    draws = draws_of(samples.shape[1], DRAWS)
    middles = np.vstack((np.median(samples, axis=1), np.median(samples[:, draws], axis=2).T))
    if not (middles > 0.0).all():
        return f"{fit(pressures, middles[:1])[0]:.2f}" if (middles[0] > 0.0).all() else ""
    found = fit(pressures, middles)
    return f"{found[0]:.3f} ± {small_sample_factor(samples.shape[1]) * found[1:].std():.2g}"


def fit(pressures, middles):
    """Exponents of rows of medians, (rows, P)."""
    return np.polyfit(np.log(pressures), np.log(middles).T, 1)[0]


def print_motion(table):
    """Motion of contacts per unit strain in both loads without pre-stress, rms over contacts, and its exponents."""
    print("\nRms motion of contacts without pre-stress, contact damping or not; exponents of p ≤ 1e-3.\n")
    print("| p | Δu∥, compression | Δu⊥ | Δu∥, shear | Δu⊥ |")
    print("|---|---|---|---|---|")
    rows = table.where(command="quasistatic", law="contact")
    pressures = sorted(set(map(nominal, rows["pressure"])), reverse=True)
    columns = [
        [rows.where(load=load, pressure=p)[f"no_prestress_{part}_rms"] for p in pressures]
        for load in ("compression", "xy")
        for part in ("normal", "transverse")
    ]
    for number, p in enumerate(pressures):
        print(f"| {p:g} | {' | '.join(text(column[number]) for column in columns)} |")
    near = [p for p in pressures if p <= NEAR]
    if len(near) > 1:
        cells = " | ".join(exponent_text(near, column[-len(near) :]) for column in columns)
        print(f"| exponent | {cells} |")


def print_windows(points, quotients):
    """Where K″ and G″ are powers near ½, their slopes at ω = √p, and K* without K_f over G* there."""
    print(
        f"\nWindow: slope of the median within {SLOPE_TOLERANCE} of ½. Slopes and quotients at ω = √p; A: affine "
        "motion.\n"
    )
    print(
        "| law | pre-stress | p | window of K″ | of G″ | slope of K″ | of G″ | (K′ − K_f)/G′ | K″/G″ "
        "| (K_A − K_f)/G_A |"
    )
    print("|---|---|---|---|---|---|---|---|---|---|")
    for (law, prestress), by in points.items():
        for p, point in by.items():
            at, both = point.row(np.sqrt(p)), (point.K, point.G)
            windows = " | ".join(window_text(point.omega, np.median(one.imag, axis=0)) for one in both)
            slopes = " | ".join(text([local_slope(point.omega, one.imag)[at] for one in M]) for M in both)
            excess, G = point.excess[:, at], point.G[:, at]
            cells = f"{text(excess.real / G.real)} | {text(excess.imag / G.imag)} | {text(quotients[p])}"
            print(
                f"| {law} | {'with' if prestress else 'without'} | {p:g} | {windows} | {slopes} | {cells} |"
            )


def window_text(omega, loss):
    """The range of ω of the window, or a dash."""
    window = power_law_window(omega, loss, CRITICAL, max_decades=np.inf)
    return "–" if window is None else f"{10 ** window[0]:.1e} to {10 ** window[1]:.1e}"


def draw(points, quotients, path):
    """K* and G* without pre-stress under each law; K* − K_f over √p with G* times the quotient of affine motion."""
    factor = float(np.mean(quotients[min(quotients)]))
    with saved_page(path) as page:
        axes = page.panels(
            2, 2, PAGE, 5.6, x=[r"$\omega\tau_1$", r"$\omega\tau_1\,k/p$"] * 2,
            y=["moduli  $[k]$", r"moduli  $[k\,(p/k)^{1/2}]$"] * 2, log=["xy"] * 4,
        )  # fmt: skip
        for row, law in enumerate(LAWS):
            by = points[law, False]
            plain, scaled = axes[2 * row : 2 * row + 2]
            for p, look in looks(sorted(by)):
                omega, K, G = by[p].omega, median(by[p].K), median(by[p].G)
                draw_moduli(plain, omega, K, G, f"p = {p:g}", look["color"])
                below = omega <= 1.0
                moduli = (median(by[p].excess)[below] / np.sqrt(p), factor * G[below] / np.sqrt(p))
                draw_moduli(scaled, omega[below] / p, *moduli, f"p = {p:g}", look["color"])
            plain.set_title(LAWS[law], loc="right", pad=3)
            scaled.set_title(rf"$K^*$ without $K_f$, and ${factor:.2f}\,G^*$", loc="right", pad=3)
            lowest = by[min(by)]
            draw_guide(plain, lowest.omega, median(lowest.K).imag, CRITICAL, r"\omega", True)
        shades = [entry(f"${power_or_number(p)}$", look["color"]) for p, look in looks(sorted(by))]
        page.legend(axes[0], shades, title="$p/k$")
        page.legend(axes[1], [entry("$K$\u2032, $K$\u2033"), entry(f"{STORAGE}, {LOSS}", ls=DASHED)])


def median(moduli):
    """Median of both parts over packings, (M,) complex."""
    return np.median(moduli.real, axis=0) + 1j * np.median(moduli.imag, axis=0)


def draw_moduli(ax, omega, K, G, name, colour):
    """Both parts of K (solid) and of G (dashed), losses thin."""
    for what, modulus, dash in (("K", K, "-"), ("G", G, DASHED)):
        for part, values, width in (("storage", modulus.real, 1.3), ("loss", modulus.imag, 0.8)):
            shown = np.where(values > 0.0, values, np.nan)
            ax.plot(omega, shown, color=colour, ls=dash, lw=width, label=hidden(f"{what} {part}, {name}"))


def main():
    args = folder_and_picture(__doc__, "draw K* and G*")
    table = jampetsc.load(args.folder).where(state="done")
    points, quotients = read(table)
    print_limits(points)
    print_motion(table)
    print_windows(points, quotients)
    if args.picture:
        draw(points, quotients, args.picture)


if __name__ == "__main__":
    main()
