"""G₀ and η₀ of slow shear against the pressure: means over packings, with standard errors.

    python examples/ensemble_average.py [N] [packings]

For more than a look make it a study (`jampetsc study`): it uses all ranks, and goes on after a stop.
"""

import sys

import numpy as np

import jampetsc
from jampetsc.analysis.scaling import fit_power_law
from jampetsc.analysis.statistics import mean_with_error

n = int(sys.argv[1]) if len(sys.argv) > 1 else 256
packings = int(sys.argv[2]) if len(sys.argv) > 2 else 8
pressures = np.array([1e-2, 1e-3, 1e-4])
means = []
for pressure in pressures:
    moduli, viscosities = [], []
    for seed in range(1, packings + 1):
        packing = jampetsc.pack(n=n, pressure=pressure, seed=seed, stabilise="shear")
        slow = jampetsc.quasistatic(packing)
        moduli.append(slow.attributes["G0"])
        viscosities.append(slow.attributes["eta0"])
    (G0, G0_error), (eta0, eta0_error) = mean_with_error(moduli), mean_with_error(viscosities)
    means.append((G0, eta0))
    print(
        f"p = {pressure:.0e}: G0 = {G0:.3g} ± {G0_error:.1g} k, eta0 = {eta0:.3g} ± {eta0_error:.1g} k tau1"
    )

G0, eta0 = np.transpose(means)
print(
    f"G0 ~ p^{fit_power_law(pressures, G0).exponent:.2f}, eta0 ~ p^{fit_power_law(pressures, eta0).exponent:.2f}"
)
