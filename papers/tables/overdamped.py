"""Which models have an overdamped limit: the table and the picture of run/figure overdamped-limit.

    .venv/bin/python -m papers.tables.overdamped figures/overdamped-limit-quick --picture x.png

σ at falling Q = √(m k_e)/(k_d d_s), one φ and one γ̇, beside σ of the same damping without mass, RD0 or CD0.
"""

import numpy as np

from benchmarks.common import saved_page
from jampetsc.io.reader import load
from jampetsc.plots import style
from jampetsc.plots.page import draw_points
from papers.claims.shared import mean_over_seeds
from papers.programs import folder_and_picture

# model with a mass: one without that it might tend to
LIMITS = {"RD": "RD0", "CD": "CD0", "CDt": "CD0", "CDn": "CD0"}
CLOSE = ("RD", "CD")  # models that σ shows to have a limit


def limits(table, name="shear_stress"):
    """{model: ((Q,) falling, (Q,) ratios of σ to that of `LIMITS`, their errors)}."""
    flows, found = table.where(command="flow"), {}
    for model, other in LIMITS.items():
        base, base_error = mean_over_seeds(flows.where(model=other), name)
        rows = flows.where(model=model)
        qualities = np.unique(rows["quality"])[::-1]
        values, errors = np.transpose([mean_over_seeds(rows.where(quality=q), name) for q in qualities])
        ratio = values / base
        found[model] = qualities, ratio, ratio * np.hypot(errors / values, base_error / base)
    return found


def draw(found, path):
    """σ over that of the overdamped model against Q: (a) of models with a limit, (b) of all, logarithmic."""
    with saved_page(path) as page:
        name = r"$\sigma/\sigma_{Q=0}$"
        near, whole = page.panels(1, 2, style.PAGE, 2.9, x="$Q$", y=[name, name], log=["x", "xy"])
        for (model, (q, ratio, error)), (_, look) in zip(found.items(), style.looks(found), strict=True):
            label = f"{model}/{LIMITS[model]}"
            draw_points(whole, q, ratio, error, ms=3.5, lw=0.8, label=label, **look)
            if model in CLOSE:
                draw_points(near, q, ratio, error, ms=3.5, lw=0.8, label=style.hidden(label), **look)
        for ax in (near, whole):
            ax.axhline(1.0, lw=0.6, color=style.GREY, zorder=0)
        near.axhspan(0.95, 1.05, color=style.GREY, alpha=0.15, lw=0, zorder=0)
        near.set_title(r"shaded: $\pm5\,\%$", loc="right", pad=3)
        page.legend(whole, first="lower right")


def main():
    args = folder_and_picture(__doc__, "draw the ratios of σ against Q")
    found = limits(load(args.folder))
    print("| model | σ over that of | at Q |\n|---|---|---|")
    for model, (q, ratio, error) in found.items():
        told = ", ".join(f"{r:.4f}({1e4 * e:.0f}) at {x:g}" for x, r, e in zip(q, ratio, error, strict=True))
        print(f"| {model} | {LIMITS[model]} | {told} |")
    if args.picture:
        draw(found, args.picture)


if __name__ == "__main__":
    main()
