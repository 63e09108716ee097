"""Six-fold order ψ₆ over the strain: disks of one size order into layers, disks of two do not (Vågberg, Fig. 4.6)."""

import numpy as np

from jampetsc.errors import InputError
from jampetsc.plots.shearing import kind_of, labels_of
from jampetsc.plots.style import MARKERS, PAGE, colours, figure, letter_panels, save

HEIGHT = 2.7  # inches
PARTS = (("local", r"$\langle|\psi_6|\rangle$"), ("global", r"$|\langle\psi_6\rangle|$"))


def plot_order(results, path) -> None:
    """⟨|ψ₆|⟩ and |⟨ψ₆⟩| of the disks against the strain, kind by kind: thin lines runs, thick ones their mean.

    Raises InputError for files without snapshots, and for runs of one kind with snapshots at other strains.
    """
    kinds = {}
    for result in results:
        if "snapshots/psi6_local" not in result:
            raise InputError(f"{result.path}: holds no six-fold order: run `jampetsc flow` with --snapshots")
        kinds.setdefault(kind_of(result), []).append(result)
    with figure(PAGE, HEIGHT, layout="constrained") as fig:
        axes = fig.subplots(1, 2)
        looks = zip(labels_of(list(kinds)), colours(len(kinds)), MARKERS * len(kinds), strict=False)
        for runs, (label, colour, marker) in zip(kinds.values(), looks, strict=True):
            strain = runs[0]["snapshots/strain"]
            for run in runs:
                if not np.array_equal(run["snapshots/strain"], strain):
                    raise InputError(
                        f"{run.path}: snapshots at other strains than {runs[0].path.name}: a mean needs the same"
                    )
            for ax, (part, _) in zip(axes, PARTS, strict=True):
                values = np.array([run[f"snapshots/psi6_{part}"] for run in runs])
                if len(runs) > 1:
                    ax.plot(strain, values.T, color=colour, lw=0.3, alpha=0.6)
                every = max(1, len(strain) // 10)
                ax.plot(strain, values.mean(0), color=colour, marker=marker, markevery=every, label=label)
        for ax, (_, text) in zip(axes, PARTS, strict=True):
            ax.set(xlabel=r"$\gamma$", ylabel=text, ylim=(0, 1))
            ax.margins(x=0.01)
        axes[1].legend(title=f"thin: {len(results)} runs" if len(results) > len(kinds) else None)
        letter_panels(axes)
        save(fig, path)
