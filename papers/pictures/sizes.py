"""BT's figure 8b; V's paper II: the four fits with corrections to scaling, ν and y as small N are left out."""

from pathlib import Path

import numpy as np

import jampetsc
from jampetsc.plots.page import draw_points
from jampetsc.plots.quasistatic_plots import draw_finite_size
from jampetsc.plots.scaling_plots import rescaled_values
from jampetsc.plots.style import GREY, OPEN, PAGE, entry, hidden, looks
from papers.pictures.shared import drawn, results

STOKES_POWER = 1.09  # of N, BT's under Stokes drag
ENSEMBLES = (("random", "RAND"), ("shear", "QS"))
OBSERVABLES = (("", "f"), ("-pressure", r"\langle p\rangle"))
RANGES = {"nu": (0.4, 1.6), "y": (0.6, 1.8)}  # of the axes; fits beyond have failed


@drawn("bt-fig8b")
def viscosity_under_drag(page, folder):
    """η₀/N^1.09 and (η₀ − η_F)/N^1.09 against pN², √p (η₀ − η_F) against N, under Stokes drag."""
    draw_finite_size(results(folder, command="quasistatic", law="stokes"), page, STOKES_POWER)


@drawn("paper2")
def finite_size(page, folder):
    """Collapses of f and ⟨p⟩ of RAND and QS without their corrections, and ν and y against the smallest N."""
    corrected = [r"$f-\mathrm{corr.}$", r"$(\langle p\rangle-\mathrm{corr.})\,L^{y/\nu}$"]
    y = [name for name in corrected for _ in ENSEMBLES] + [r"$\nu$", "$y$"]
    axes = page.panels(3, 2, PAGE, 7.2, x=[r"$(\phi-\phi_J)\,L^{1/\nu}$"] * 4 + ["smallest $N$"] * 2, y=y,
                       log=[""] * 4 + ["x"] * 2)  # fmt: skip
    cases = [(observable, ensemble) for observable in OBSERVABLES for ensemble in ENSEMBLES]
    for ax, ((ending, _), (ensemble, name)) in zip(axes, cases, strict=False):
        result = _fit(folder, f"{ensemble}{ending}-corrected")
        if result is None:
            continue
        a, (b, left, bars) = result.attributes, rescaled_values(result)
        ax.plot(result["curve/x"], result["curve/f0"], color=GREY, lw=0.9, zorder=1, label=hidden("f0"))
        if not ending:  # a share is from 0 to 1
            bars = np.array(
                [np.minimum(bars, np.maximum(left, 0)), np.minimum(bars, np.maximum(1 - left, 0))]
            )
        for scale, look in looks(np.unique(b)):
            here = b == scale
            draw_points(
                ax,
                result["x"][here],
                left[here],
                bars[..., here],
                ls="none",
                ms=3,
                label=f"${1 / scale**2:.0f}$",
                **look,
            )
        title = rf"{name}, $\chi^2/\mathrm{{dof}}={float(a['chi2']) / float(a['dof']):.2g}$"
        ax.set_title(title, loc="right", pad=3)
        page.legend(ax, title="$N$", first="upper left", fontsize=7.5, groups=0)
    for ax, parameter in zip(axes[4:], ("nu", "y"), strict=True):
        _drifts(ax, folder, parameter)
    kinds = [(f"{name}, {words}", look) for (name, words), look in looks(_kinds())]
    handles = [entry(label, ls="none", **look) for label, look in kinds]
    handles.append(entry("no corrections", "0.4", marker="o", ls=":", mfc="white"))
    page.legend(axes[4], handles, fontsize=7.5, first="upper right", ncol=2)


def _kinds():
    return [(name, f"${symbol}$") for _, name in ENSEMBLES for _, symbol in OBSERVABLES]


def _fit(folder, name):
    """A fit that `jampetsc collapse` made, None if it failed."""
    path = Path(folder) / f"{name}.h5"
    return jampetsc.load(path) if path.exists() else None


def _drifts(ax, folder, parameter):
    """A parameter against the smallest N, solid with corrections and dotted without, fits side by side."""
    cases = [(ensemble, ending) for ensemble, _ in ENSEMBLES for ending, _ in OBSERVABLES]
    for n, ((ensemble, ending), (_, look)) in enumerate(zip(cases, looks(_kinds()), strict=True)):
        for end, face in (("-corrected", {}), ("", OPEN | {"linestyle": ":"})):
            result = _fit(folder, f"{ensemble}{ending}{end}")
            names = [] if result is None else str(result.attributes["fitted"]).split(",")
            if parameter not in names:
                continue
            column = names.index(parameter)
            value, error = (result[f"drift/{part}"][:, column] for part in ("parameters", "errors"))
            seen = np.isfinite(error) & (value > RANGES[parameter][0]) & (value < RANGES[parameter][1])
            x = result["drift/cut"][seen] * 1.05 ** (2 * n + bool(face) - 3)
            name = hidden(f"{ensemble}{ending}{end}")
            draw_points(ax, x, value[seen], error[seen], lw=0.8, ms=3.5, label=name, **look | face)
    ax.set_ylim(*RANGES[parameter])
