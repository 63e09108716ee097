"""How long contacts last in flow: the table and the picture of run/figure contact-lifetimes.

    .venv/bin/python -m papers.tables.lifetimes figures/contact-lifetimes-quick --picture x.png

The share S(Δγ) of the contacts of a state that are contacts a strain Δγ later, whether or not they parted in between,
is a mean over all pairs of snapshots. A contact lasts for the strain where S = ½, in time divided by γ̇.
"""

import numpy as np

from benchmarks.common import saved_page
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.io.reader import load
from jampetsc.packing.neighbours import neighbour_pairs
from jampetsc.plots import style
from papers.programs import folder_and_picture

STORED = "snapshots/contact_survival", "snapshots/contact_strain"  # in files without positions: papers/kept
LAGS = 24  # of S, from one snapshot to the next to half of the whole


def contacts_of(positions, radii, cell):
    """Pairs of touching disks as sorted numbers i N + j, i < j."""
    i, j, *_ = neighbour_pairs(positions, radii, cell)
    return np.unique(np.minimum(i, j) * len(radii) + np.maximum(i, j))


def contact_survival(result):
    """((L,) S, (L,) Δγ) of a loaded flow file with snapshots, evenly spaced."""
    if STORED[0] in result:
        return tuple(result[name] for name in STORED)
    snapshots = zip(result["snapshots/positions"], result["snapshots/cell"], strict=True)
    sets = [contacts_of(x, result["snapshots/radii"], cell) for x, cell in snapshots]
    strain = result["snapshots/strain"]
    lags = np.unique(np.geomspace(1, max(len(sets) // 2, 1), LAGS).astype(int))
    shares = []
    for lag in lags:
        pairs = list(zip(sets[:-lag], sets[lag:], strict=True))
        left = sum(np.isin(before, after, assume_unique=True).sum() for before, after in pairs)
        shares.append(left / max(sum(len(before) for before, _ in pairs), 1))
    return np.array(shares), strain[lags] - strain[0]


def half_life(shares, strain):
    """Δγ where S falls below ½, by interpolation in ln Δγ from S(0) = 1; inf where it does not."""
    below = np.flatnonzero(shares < 0.5)
    if not len(below):
        return np.inf
    at = below[0]
    if at == 0:
        return float(strain[0] * 0.5 / (1.0 - shares[0]))
    x, y = np.log(strain[at - 1 : at + 1]), shares[at - 1 : at + 1]
    return float(np.exp(x[0] + (y[0] - 0.5) / (y[0] - y[1]) * (x[1] - x[0])))


def collision_time(mass, radii):
    """Duration of a collision of two free disks, π/√(2k/m − (c/m)²) with c = 1, k = 1/σ²; mean over σ of pairs."""
    sizes = 2.0 * np.unique(radii)
    sigma = 0.5 * np.add.outer(sizes, sizes).ravel()  # of sizes in equal numbers
    return float(np.mean(np.pi / np.sqrt(2.0 / (mass * sigma**2) - mass**-2.0)))


def lifetimes(table):
    """{model: {γ̇: (half-life in strain, its error over seeds, duration of a collision)}}."""
    flows, found = table.where(command="flow"), {}
    for model in np.unique(flows["model"]):
        for rate in np.unique(flows.where(model=model)["rate"]):
            runs = flows.where(model=model, rate=rate).results()
            lives = [half_life(*contact_survival(run)) for run in runs]
            duration = collision_time(runs[0].attributes["mass"], (0.5, 0.7))
            found.setdefault(str(model), {})[float(rate)] = *mean_with_error(lives), duration
    return found


def draw(table, path):
    """S against Δγ, a line for each model and rate."""
    flows = table.where(command="flow")
    with saved_page(path) as page:
        ax = page.panels(1, 1, 3.8, 3.0, x=r"$\Delta\gamma$", y=r"$S(\Delta\gamma)$", log="x")
        models = [str(model) for model in np.unique(flows["model"])]
        for model, colour in zip(models, style.colours(len(models)), strict=True):
            for rate, line in zip(np.unique(flows["rate"])[::-1], ("-", "--"), strict=False):
                runs = flows.where(model=model, rate=rate).results()
                found = [contact_survival(run) for run in runs]
                shares = np.mean([one for one, _ in found], axis=0)
                ax.plot(found[0][1], shares, line, color=colour, label=rf"{model}, $\dot\gamma = {rate:g}$")
        ax.axhline(0.5, lw=0.5, color=style.GREY)
        page.legend(ax)


def main():
    args = folder_and_picture(__doc__, "draw the share of contacts left")
    table = load(args.folder)
    print(
        "| model | γ̇ | half-life, strain | half-life, time | duration of a collision |\n|---|---|---|---|---|"
    )
    for model, rates in lifetimes(table).items():
        for rate, (life, error, duration) in rates.items():
            print(f"| {model} | {rate:g} | {life:.3g} ± {error:.1g} | {life / rate:.3g} | {duration:.3g} |")
    if args.picture:
        draw(table, args.picture)


if __name__ == "__main__":
    main()
