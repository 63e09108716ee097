"""Six-fold order ψ₆ over the strain: disks of one size order into layers, disks of two do not (Vågberg, Fig. 4.6)."""

import numpy as np

from jampetsc.analysis.order import six_fold_order
from jampetsc.errors import InputError
from jampetsc.plots.picture import count, grouped, picture
from jampetsc.plots.shearing import kind_of, labels_of
from jampetsc.plots.style import PAGE, hidden, looks

HEIGHT = 2.7  # inches
PARTS = (r"$\langle|\psi_6|\rangle$", r"$|\langle\psi_6\rangle|$")


@picture("order", "flow")
def plot_order(results, page):
    """⟨|ψ₆|⟩ and |⟨ψ₆⟩| of the disks against the strain, kind by kind: thin lines runs, thick ones their mean.

    Raises InputError for files without snapshots, and for runs of one kind with snapshots at other strains.
    """
    kinds = grouped([(result, six_fold_order(result)) for result in results], lambda pair: kind_of(pair[0]))
    for (first, _), *others in kinds.values():
        for result, _ in others:
            if not np.array_equal(result["snapshots/strain"], first["snapshots/strain"]):
                raise InputError(
                    f"{result.path}: snapshots at other strains than {first.path.name}: a mean needs the same"
                )
    axes = page.panels(1, 2, PAGE, HEIGHT)
    for part, (ax, text) in enumerate(zip(axes, PARTS, strict=True)):
        for runs, label, look in zip(kinds.values(), labels_of(list(kinds)), looks(len(kinds)), strict=True):
            strain = runs[0][0]["snapshots/strain"]
            for run, order in runs if len(runs) > 1 else ():
                ax.plot(
                    strain, order[part], color=look["color"], lw=0.3, alpha=0.6, label=hidden(run.path.name)
                )
            mean = np.mean([order[part] for _, order in runs], axis=0)
            ax.plot(strain, mean, markevery=max(1, len(strain) // 10), label=label, **look)
        ax.set(xlabel=r"$\gamma$", ylabel=text, ylim=(0, 1))
        ax.margins(x=0.01)
    page.legend(axes[1], title=f"thin: {len(results)} runs" if len(results) > len(kinds) else None)
    return f"six-fold order of {count(results, 'run', 'runs')} over the strain"
