"""G(t, γ) after step strains, beside the G(t) of linear response."""

import numpy as np

from jampetsc.errors import InputError
from jampetsc.plots.page import draw_band, draw_guide
from jampetsc.plots.picture import picture, stress_unit, units_of
from jampetsc.plots.style import COLUMN, DASHED, colours, entry, hidden, number

HEIGHT = 2.8  # inches
SLOPE = -0.5  # of G(t) where G* follows ω^½
TIMES_PER_DECADE = 20  # of linear curves


@picture("step-strain", "relax", "spectrum", "sweep", mixed=True)
def plot_step_strain(results, page):
    """G(t, γ) against t in units of k and τ₁, a colour for each strain, bands for errors; dashed the linear G(t).

    That is of spectra or sweeps beside the relaxations. A grey line of slope −½ where the smallest strain follows it.
    Raises InputError where no file has step strains, and for sweeps without a spectrum.
    """
    relaxations = [result for result in results if result.format == "jampetsc-relax"]
    if not relaxations:
        raise InputError(
            f"{results[0].path}: no step strains. Give the files of relax, and spectra beside them."
        )
    unit = stress_unit(results)
    ax = page.panels(1, 1, COLUMN, HEIGHT, x=r"$t/\tau_1$", y=rf"$G(t,\gamma){unit.over}$", log="xy")
    strains = sorted({float(strain) for result in relaxations for strain in result["strain"]})
    shades = dict(zip(strains, colours(len(strains)), strict=True))
    for result in relaxations:
        units = units_of(result)
        time = result["time"] / units.tau1
        rows = zip(result["strain"], result["G"] / units.k, result["error"] / units.k, strict=True)
        for strain, G, error in rows:
            name, look = f"{result.path.stem}, strain {strain:.3g}", {"color": shades[float(strain)]}
            ax.plot(time, _positive(G), label=hidden(name), **look)
            draw_band(ax, time, _positive(G - error), _positive(G + error), f"{name}, error", **look)
    handles = [entry(f"${number(strain)}$", shade) for strain, shade in shades.items()]
    times = np.concatenate([result["time"] / units_of(result).tau1 for result in relaxations])
    for result in results:
        if result not in relaxations:
            _draw_linear(ax, result, times.min(), times.max())
    if len(results) > len(relaxations):
        handles.append(entry("linear", "0.2", linestyle=DASHED, lw=0.8))
    first, units = relaxations[0], units_of(relaxations[0])
    falls = first["G"][0] > 0.0
    draw_guide(ax, first["time"][falls] / units.tau1, first["G"][0][falls] / units.k, SLOPE, "t", True)
    page.legend(ax, handles, r"$\gamma$", first="lower left", groups=len(shades))
    return f"G(t) after {len(strains)} step strain{'s' * (len(strains) > 1)}"


def _positive(values):
    """The values, nan where a log axis cannot show them."""
    return np.where(values > 0.0, values, np.nan)


def _draw_linear(ax, result, begin, end):
    """The G(t) of linear response between two times in units of τ₁."""
    units = units_of(result)
    time = np.geomspace(begin, end, 2 + round(TIMES_PER_DECADE * np.log10(end / begin)))
    G = result.spectrum.stress_relaxation(time * units.tau1) / units.k
    look = {"color": "0.2", "linestyle": DASHED, "lw": 0.8, "zorder": 3}
    ax.plot(time, _positive(G), label=hidden(f"{result.path.stem}, linear"), **look)
