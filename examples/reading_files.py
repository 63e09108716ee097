"""What the files hold, with numpy alone: a packing, its sweep and its slow response. Neither PETSc nor MPI is loaded.

jampetsc pack --n 256 --pressure 1e-3 --out packing.h5
jampetsc sweep packing.h5 --out sweep.h5
jampetsc quasistatic packing.h5 --out slow.h5
python examples/reading_files.py packing.h5 sweep.h5 slow.h5
"""

import sys

import numpy as np

import jampetsc

packing, sweep, slow = (jampetsc.load(path) for path in sys.argv[1:4])

print(f"{packing.n} disks, phi = {packing.phi:.4f}, Z = {packing.record['coordination']:.3f}")

# G* at any frequency, and where G' and G'' cross
omega = np.geomspace(1e-6, 1e2, 2000)
G = sweep.modulus(omega)
crossings = omega[1:][np.diff(np.sign(G.real - G.imag)) != 0]
print(f"{sweep.law}: G' = G'' at omega = {', '.join(f'{w:.3g}' for w in crossings) or 'none'}")

# contacts: how floppy slow shear is
normal, transverse = (np.abs(slow[f"contacts/{name}"]) for name in ("normal", "transverse"))
print(f"{len(normal)} contacts: median |Δu⊥|/|Δu∥| = {np.median(transverse) / np.median(normal):.3g}")
fastest = slow["particles"][np.argmax(np.linalg.norm(slow["nonaffine"], axis=1))]
print(f"disk {fastest} moves most beside the affine motion; it is at {packing.positions[fastest]}")
