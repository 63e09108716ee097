"""Bands under Lees–Edwards conditions: the table and the picture of run/figure lees-edwards.

    .venv/bin/python -m papers.tables.layers figures/lees-edwards-quick --picture x.png

The cell is divided into layers of equal height. u_x(y) is the mean velocity beside γ̇y of the disks of a layer, φ(y) the
share of the layer that those fill whose centres are in it. Spreads are rms over layers, less what the errors of the
means make of it; a spread of u_x is in units of γ̇H, the difference of velocity across the cell.
"""

import numpy as np

from benchmarks.common import saved_page
from jampetsc.analysis.correlated_series import Average
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.io.reader import load
from jampetsc.packing.particles import UNIT_BALL
from jampetsc.plots import style
from papers.programs import folder_and_picture

STORED = tuple(f"layers/{name}" for name in ("velocity", "velocity_error", "density", "density_error"))
LAYERS = 10


def layers_of(positions, velocities, radii, cell):
    """((LAYERS,) mean u_x, (LAYERS,) φ) of a snapshot of N particles in D dimensions."""
    sides, dimension = np.diag(cell), len(cell)
    layer = np.floor(np.mod(positions[:, 1] / sides[1], 1.0) * LAYERS).astype(int) % LAYERS
    volumes = UNIT_BALL[dimension] * radii**dimension
    number = np.bincount(layer, minlength=LAYERS)
    return (
        np.bincount(layer, velocities[:, 0], LAYERS) / np.maximum(number, 1),
        np.bincount(layer, volumes, LAYERS) * LAYERS / np.prod(sides),
    )


def profiles(result):
    """(u_x/(γ̇H), its error, φ, its error), (LAYERS,) each: means over the snapshots of a loaded flow file."""
    if STORED[0] in result:
        return tuple(result[name] for name in STORED)
    scale = result.attributes["rate"] * result["snapshots/cell"][0][1, 1]
    arrays = (result[f"snapshots/{name}"] for name in ("positions", "velocities", "cell"))
    series = [layers_of(x, u, result["snapshots/radii"], cell) for x, u, cell in zip(*arrays, strict=True)]
    velocity, density = np.transpose(series, (1, 2, 0))
    found = [[Average.of(one) for one in rows] for rows in (velocity / scale, density)]
    return tuple(
        np.array([getattr(one, name) for one in rows]) for rows in found for name in ("mean", "error")
    )


def spread(means, errors):
    """rms deviation of the layers from their mean, less what their errors make; negative where these make more."""
    excess = np.var(means) - (1.0 - 1.0 / len(means)) * np.mean(errors**2)
    return float(np.sign(excess) * np.sqrt(abs(excess)))


def chi2(means, errors, expected):
    """χ² of the layers about a flat profile."""
    return float(np.sum(((means - expected) / errors) ** 2))


def bands(runs):
    """((spread of u_x, error), (spread of φ over φ, error), χ²/dof of u_x, of φ) over runs."""
    found = [profiles(run) for run in runs]
    velocity = mean_with_error([spread(u, e) for u, e, _, _ in found])
    density = mean_with_error([spread(phi, e) / phi.mean() for _, _, phi, e in found])
    of_velocity = np.mean([chi2(u, e, 0.0) for u, e, _, _ in found]) / LAYERS
    of_density = np.mean([chi2(phi, e, phi.mean()) for _, _, phi, e in found]) / (LAYERS - 1)
    return velocity, density, float(of_velocity), float(of_density)


def draw(table, path):
    """u_x(y) and φ(y) of the first run of each model."""
    flows = table.where(command="flow")
    y = (np.arange(LAYERS) + 0.5) / LAYERS
    models = [str(model) for model in np.unique(flows["model"])]
    with saved_page(path) as page:
        axes = page.panels(1, 2, style.PAGE, 2.8, x=[r"$u_x/\dot\gamma H$", r"$\phi(y)$"], y="$y/H$")
        for model, colour in zip(models, style.colours(len(models)), strict=True):
            u, u_error, phi, phi_error = profiles(flows.where(model=model).results()[0])
            for ax, value, error in zip(axes, (u, phi), (u_error, phi_error), strict=True):
                ax.errorbar(value, y, xerr=error, fmt="o-", ms=3, lw=0.6, color=colour, label=model)
        axes[0].axvline(0.0, lw=0.5, color=style.GREY)
        axes[0].set_xlim(-0.05, 0.05)
        page.legend(axes[1])


def main():
    args = folder_and_picture(__doc__, "draw the profiles")
    flows = load(args.folder).where(command="flow")
    print("| model | spread of u_x/γ̇H | χ²/dof | spread of φ(y)/φ | χ²/dof |\n|---|---|---|---|---|")
    for model in np.unique(flows["model"]):
        (u, u_error), (phi, phi_error), of_u, of_phi = bands(flows.where(model=model).results())
        print(
            f"| {model} | {u:.4f} ± {u_error:.4f} | {of_u:.2f} | {phi:.4f} ± {phi_error:.4f} | {of_phi:.2f} |"
        )
    if args.picture:
        draw(load(args.folder), args.picture)


if __name__ == "__main__":
    main()
