"""Newtonian and Bagnoldian flow over φ and Q = √(m k_e)/(k_d d_s), with the clusters of disks that touch.

Vågberg, thesis sec. 6.4: σ ~ γ̇ where disks stay together in large clusters, σ ~ γ̇² where they part after a collision.
"""

import numpy as np

from jampetsc.analysis.scaling import local_exponents
from jampetsc.errors import InputError
from jampetsc.plots.flowcurves import flow_curves
from jampetsc.plots.picture import count, picture
from jampetsc.plots.shearing import kind_of
from jampetsc.plots.style import GREY, PAGE, entry, hidden, looks

HEIGHT = 2.1  # inches of one row of panels


def regimes(results) -> dict:
    """{model: {φ: (Q (M,), exponent (M,), error (M,), cluster (M,), low, high)}} of massive flows at two rates or more.

    exponent   d ln σ/d ln γ̇ between the two lowest rates, low and high, in 1/τ₁; nan where σ is not positive
    cluster    share of the disks in the largest cluster, at the lowest rate

    Raises InputError where there is no massive flow at two rates.
    """
    found, clusters = {}, {}
    for result in results:
        a = result.attributes
        clusters.setdefault((kind_of(result), float(a["rate"])), []).append(float(a["largest_cluster_mean"]))
    quality = {kind_of(result): result.attributes.get("quality") for result in results}
    for kind, curve in flow_curves(results).items():
        rates, stress, error = curve["shear_stress"]
        if quality[kind] is None or len(rates) < 2:
            continue
        exponent, spread = np.nan, np.nan
        if (stress[:2] > 0).all():
            _, (exponent,), (spread,) = local_exponents(rates[:2], stress[:2], error[:2])
        slowest = min(rate for one, rate in clusters if one == kind)
        share = np.mean(clusters[kind, slowest]) / kind[2]
        row = (float(quality[kind]), exponent, spread, share, rates[0], rates[1])
        found.setdefault(kind[0], {}).setdefault(kind[1], []).append(row)
    if not found:
        raise InputError(f"{results[0].path}: regimes are of massive disks at several rates of one φ and Q")
    return {
        model: {phi: np.array(sorted(rows)).T for phi, rows in sorted(some.items())}
        for model, some in found.items()
    }


@picture("regimes", "flow")
def plot_regimes(results, page):
    """Exponents of σ at the lowest rates, and the share of the largest cluster, against Q; a line for each φ.

    Raises InputError as `regimes`.
    """
    maps = regimes(results)
    phis = sorted({phi for some in maps.values() for phi in some})
    styles = dict(zip(phis, looks(len(phis)), strict=True))
    axes = page.panels(2, len(maps), PAGE, 2 * HEIGHT, sharex=True, sharey="row").reshape(2, -1)
    for (slope, share), (model, some) in zip(axes.T, sorted(maps.items()), strict=True):
        for value in (1, 2):
            slope.axhline(value, color=GREY, lw=0.6, ls=":")
        for phi, (quality, exponent, error, cluster, *_) in some.items():
            look = styles[phi] | {"label": hidden(rf"${phi:g}$")}
            slope.errorbar(quality, exponent, error, elinewidth=0.6, **look)
            share.plot(quality, cluster, **look)
        slope.set_title(model, loc="right", pad=3)
        share.set(xlabel="$Q$", xscale="log", ylim=(0, 1.05))
    axes[0, 0].set_ylabel(r"$d\ln\sigma/d\ln\dot\gamma$")
    axes[1, 0].set_ylabel("largest cluster$/N$")
    page.legend(
        axes[1, 0], [entry(rf"${phi:g}$", **look) for phi, look in styles.items()], r"$\phi$", "lower left"
    )
    return f"exponents and clusters of {count(results, 'run', 'runs')} against Q"
