"""V 4.3.1: disks of one size crystallise under shear, more easily where L fits the lattice.

Primary estimator. Mean |⟨ψ₆⟩| over the strain, of cells that fit a triangular lattice less cells halfway between; the
error is of the means over seeds, and of N.
"""

import numpy as np

from jampetsc.analysis.statistics import mean_with_error
from papers.claims.shared import Row, check, claim
from papers.claims.verdicts import Estimate, between, difference
from papers.tables.crystals import BETWEEN, FITTING, means


@claim("crystals", on="fitting")
def fitting_cells(table):
    disks = table.where(dimension=2)
    strain, seeds = disks["strain"].max(), len(np.unique(disks["seed"]))
    size = f"N = {', '.join(map(str, sorted((*FITTING, *BETWEEN))))}, {seeds} seeds each, strain {strain:g}"
    fits, halfway = (Estimate(*mean_with_error(disks.where(n=list(n))["order"])) for n in (FITTING, BETWEEN))
    told = ", ".join(f"{Estimate(value, error)} at N = {n}" for n, _, value, error in means(table, 2))
    told += "; the latter hold rows that slide, farther apart than in the lattice: m (m + 1) less one disk"
    what = "RD0, φ = 0.80, one size: mean |⟨ψ₆⟩| in cells that fit less that in cells halfway between"
    yield Row(what, "more easily: > 0", difference(fits, halfway), between(low=0.0), told, size)
    for column, words in (("start", "at the start"), ("late", "in the second half of the strain")):
        for n, sizes, value, error in means(table, 3, column):
            strain = table.where(dimension=3)["strain"].max()
            what = f"3D, RD0, φ = 0.61, {sizes}: Q₆ {words}"
            yield check(what, value, error, "fcc has .575", f"N = {n}, strain {strain:g}", bears="order")
