"""A figure of one's own: a packing and its moduli, drawn by jampetsc on axes that one makes and adds to.

python examples/own_figure.py [N] [FILE.pdf]
"""

import sys

from matplotlib.figure import Figure

import jampetsc

n = int(sys.argv[1]) if len(sys.argv) > 1 else 256
out = sys.argv[2] if len(sys.argv) > 2 else "figure.pdf"
packing = jampetsc.pack(n=n, pressure=1e-3, seed=1, stabilise="shear")
sweep = jampetsc.sweep(packing)
G0 = jampetsc.quasistatic(packing).attributes["G0"]

figure = Figure(figsize=(7, 3), layout="constrained")
left, right = figure.subplots(1, 2)
jampetsc.plot(packing, ax=left)
jampetsc.plot(sweep, ax=right, xlim=(1e-6, 1e2), ylim=(1e-6, 1e2), csv=out.rpartition(".")[0] + ".csv")
right.axhline(G0, color="gray", linestyle=":")
left.xaxis.label.set_size(7)
left.set_title(f"p = {packing.pressure:.0e} k", fontsize=9)
figure.savefig(out)
print(f"{out}: G0 = {G0:.4g} k")
