"""The logarithm of Stokes drag: G* beside BT's figure 6a, and η₀ against N."""

import numpy as np

import jampetsc
from jampetsc.plots.page import draw_points
from jampetsc.plots.style import GREY, PAGE, entry, hidden, looks, power_or_number
from papers.claims.drag import mean_fit
from papers.claims.moduli import LIMIT, curves_of
from papers.claims.sizes import growths
from papers.pictures.shared import beside, drawn

SHOWN = 3.0, 0.05  # ω from so many p to so many 1/τ₁
PARTS = ((np.real, "Re", {}), (np.imag, "Im", {"markerfacecolor": "white"}))


@drawn("bt-fig6-logarithm")
def logarithm(page, folder):
    """(G*² − G₀²)/(iω) without iωη_F against |G*|/ω, with A + B ln(G*/iω); √p (η₀ − η_F) against N; no pre-stress."""
    axes = page.panels(
        1, 2, PAGE, 2.9, log="x", x=["$|G^*|\\,/\\,k\\omega\\tau_1$", "$N$"],
        y=[r"$(G^{*2}-G_0^2)\,/\,\mathrm{i}\omega\,k\tau_1$", r"$(p/k)^{1/2}\,(\eta_0-\eta_F)\,/\,k\tau_1$"],
    )  # fmt: skip
    sweeps = jampetsc.load(folder).where(command="sweep", state="done", eta_f=1.0, prestress=0)
    groups = [(p, curves) for p, curves in curves_of(sweeps) if SHOWN[0] * p * 10 < SHOWN[1]]
    for p, look in looks([p for p, _ in groups]):
        curves, label = dict(groups)[p], f"${power_or_number(p)}$"
        omega = curves[0].omega
        G = np.mean([curve.G - 1j * omega for curve in curves], axis=0)
        inside = (omega >= SHOWN[0] * p) & (omega <= SHOWN[1])
        x = np.abs(G / omega)[inside]
        y = ((G**2 - G[0].real ** 2) / (1j * omega))[inside]
        for part, name, style in PARTS:
            axes[0].plot(x, part(y), ls="none", ms=3.5, label=hidden(f"{name} {label}"), **{**look, **style})
        if LIMIT[0] * p * 3 < LIMIT[1] and len(curves) > 2:
            constant, slope, *_ = mean_fit(curves, p, LIMIT)
            fit = constant + slope * np.log((G / (1j * omega))[inside])
            for part, name, _ in PARTS:
                axes[0].plot(x, part(fit), color=look["color"], lw=0.9, label=hidden(f"fit {name} {label}"))
    handles = [
        entry(f"${power_or_number(p)}$", ls="none", **look) for p, look in looks([p for p, _ in groups])
    ]
    handles += [entry(name, GREY, ls="none", marker="o", **style) for _, name, style in PARTS]
    page.legend(axes[0], [*handles, entry("fit", GREY)], "$p/k$", "upper left")
    sizes = beside(folder, "bt-fig8")
    found = (
        []
        if sizes is None
        else growths(jampetsc.load(sizes).where(command="quasistatic", state="done", law="stokes"))
    )
    for (p, n, values, errors, constant, slope, _), (_, look) in zip(
        found, looks([one[0] for one in found]), strict=True
    ):
        label = rf"$p/k={power_or_number(p)}$, $B'={slope:.3f}$"
        draw_points(axes[1], n, values, errors, ls="none", ms=3.5, label=label, **look)
        axes[1].plot(
            n, constant + slope * np.log(n), color=look["color"], lw=0.9, label=hidden(f"{label}, line")
        )
    page.legend(axes[1], first="upper left")
