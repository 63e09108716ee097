"""Do disks in steady shear diffuse? Mean square displacement across the flow, from unwrapped positions.

    python examples/diffusion.py [N] [STRAIN]

Overdamped disks with contact damping (CD0) at phi = 0.82: snapshots at equal strains after the start is forgotten.
"""

import sys

import numpy as np

import jampetsc

n = int(sys.argv[1]) if len(sys.argv) > 1 else 256
strain = float(sys.argv[2]) if len(sys.argv) > 2 else 20.0
flow = jampetsc.flow(n=n, phi=0.82, model="CD0", rate=1e-2, strain=strain, discard=0.2 * strain, snapshots=80)
moments = [flow.snapshot(i) for i in range(len(flow["snapshots/strain"]))]
y = np.array([moment.unwrapped[:, 1] for moment in moments])  # (snapshots, N), never folded back
at = np.array([moment.strain for moment in moments])
print("lag in strain   <dy^2>/d^2   <dy^2>/(2 d^2 lag)")
for lag in (1, 2, 5, 10, 20, 40):
    square = np.mean((y[lag:] - y[:-lag]) ** 2)
    print(f"{at[lag] - at[0]:13.3g}   {square:10.4g}   {square / (2 * (at[lag] - at[0])):10.4g}")
