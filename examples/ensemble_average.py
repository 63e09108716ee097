"""G₀ and η₀ of slow shear, and G*(ω), against the pressure: means over packings, with errors.

    python examples/ensemble_average.py [N] [packings] [FOLDER]

The study in FOLDER continues when the program is started again; `mpirun -n 8 python …` shares its tasks.
"""

import sys

import jampetsc
from jampetsc.analysis.power_laws import fit_power_law

n = int(sys.argv[1]) if len(sys.argv) > 1 else 256
packings = int(sys.argv[2]) if len(sys.argv) > 2 else 8
folder = sys.argv[3] if len(sys.argv) > 3 else f"ensemble-n{n}"
settings = {
    "pack": {"n": n, "pressure": [1e-2, 1e-3, 1e-4], "seeds": f"1:{packings}", "stabilise": "shear"},
    "quasistatic": {},
    "sweep": {"omega": "1e-8:1e2:51"},
}
table = jampetsc.study(settings, out=folder)
slow = table.where(command="quasistatic").mean(by="pressure")
for row, p in enumerate(slow["pressure"]):
    G0, eta0 = (f"{slow[name][row]:.3g} ± {slow.error[name][row]:.1g}" for name in ("G0", "eta0"))
    print(f"p = {p:.0e}: G0 = {G0} k, eta0 = {eta0} k tau1")
G0, eta0 = (fit_power_law(slow["pressure"], slow[name]).exponent for name in ("G0", "eta0"))
print(f"G0 ~ p^{G0:.2f}, eta0 ~ p^{eta0:.2f}")

for curve in table.mean_curve("G", by="pressure"):
    middle = len(curve.omega) // 2
    print(
        f"p = {curve.key['pressure']:.0e}: G'({curve.omega[middle]:.0e}) = {curve.value[middle].real:.3g} "
        f"± {curve.error[middle].real:.1g} k, mean of {curve.count}"
    )
jampetsc.plot(table, kind="collapse", out=f"{folder}/collapse.png")
