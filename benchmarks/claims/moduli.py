"""G* of linear response: BT figures 1, 3, 4, 6 and 8."""

import numpy as np

from claims.shared import CRITICAL, Row, claim, exponent
from jampetsc.analysis.statistics import mean_with_error


@claim("bt-fig3")
def moduli(table):
    sweeps = table.where(command="sweep")
    near = sweeps.where(pressure=CRITICAL)
    for column, name, theirs in (("G0", "G₀", 0.5), ("eta0", "η₀", -0.5), ("omega_star", "ω* = G₀/η₀", 1.0)):
        yield Row(
            f"β = 1: {name} ~ p^x, p = 1e-5 … 1e-3",
            theirs,
            *exponent(near, column),
            (
                "with pre-stress, whose effect falls with p (rows of bt-fig8): without it see the rows of bt-fig5"
            ),
        )
    lowest = sweeps.where(pressure=1e-5)
    for part, name in (("storage", "G′"), ("loss", "G″")):
        value, error = mean_with_error(lowest[f"exponent_{part}"])
        yield Row(
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
    yield Row("β = 0 without pre-stress: G*/[G₀(1 + iωτ₁)] − 1, largest", 0.0, max(off), None, "exact")
    betas = [(result["beta_scan/beta"], result["beta_scan/eta0"], result.attributes["G0"])
             for result in table.where(command="quasistatic").results()]  # fmt: skip
    slope = [np.log(eta[-1] / eta[-3]) / np.log(beta[-1] / beta[-3]) for beta, eta, _ in betas]
    yield Row("η₀ ~ β^x for strong sliding, β = 1 … 100", 1.0, np.mean(slope), None, "Σ (Δu⊥ᶜ)² alone")
    plateau = [eta[0] / G0 for _, eta, G0 in betas]
    yield Row("η₀/(G₀τ₁) as β → 0 (β = 1e-8)", 1.0, np.mean(plateau), None, "")


@claim("bt-fig6")
def drag(table):
    sweeps = table.where(command="sweep")
    near = sweeps.where(pressure=CRITICAL)
    yield Row("Stokes: η₀ ~ p^x (η_F = 0), p = 1e-5 … 1e-3", -0.5, *exponent(near, "eta0"), "")
    lowest = sweeps.where(pressure=sweeps["pressure"].min())
    for part, name in (("storage", "G′"), ("loss", "G″")):
        yield Row(
            f"Stokes: {name} ~ ω^Δ between p and 1, p = 1e-5",
            0.5,
            *mean_with_error(lowest[f"exponent_{part}"]),
            (
                "G′ has G₀ added to its power law"
                if part == "storage"
                else "G″ turns over at ω ~ 1: see the picture"
            ),
        )


@claim("bt-fig8")
def prestress(table):
    for p in (1e-2, 1e-4):
        rows = table.where(command="sweep", law="contact", pressure=p)
        both = [rows.where(prestress=on)["G0"] for on in (1, 0)]
        yield Row(
            f"G₀ with over without pre-stress, p = {p:g}", None, *mean_with_error(both[0] / both[1]), ""
        )
