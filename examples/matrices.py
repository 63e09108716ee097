"""G*(ω) from the matrices of a packing by scipy, beside a sweep; and a model of pyMOR of them, where it is installed.

python examples/matrices.py [N]
"""

import importlib.util
import sys

import numpy as np
from scipy.sparse.linalg import spsolve

import jampetsc

n = int(sys.argv[1]) if len(sys.argv) > 1 else 256
packing = jampetsc.pack(n=n, pressure=1e-3, seed=1, stabilise="shear")
law, omega = jampetsc.ContactDamping(beta=0.1), [1e-4, 1e-2, 1.0]
matrices = jampetsc.assemble(packing, law)
m = matrices.to_scipy()
kept = np.setdiff1d(np.arange(len(m.dofs)), m.pins)
sweep = jampetsc.sweep(packing, law, omega=omega, accuracy=1e-10)
model = matrices.to_pymor() if importlib.util.find_spec("pymor") else None
for w, G in zip(omega, sweep.G, strict=True):
    s = 1j * w
    c = (m.k_gamma + s * m.b_gamma)[kept]
    x = spsolve((m.K + s * m.B).tocsc()[kept][:, kept], c)
    modulus = (m.k_gg + s * m.b_gg - c @ x) / m.area
    print(
        f"omega = {w:.0e} / tau1: G* = {modulus:.9g} k, relative difference from the sweep {abs(modulus / G - 1):.0e}"
    )
    if model is not None:
        viscosity = model.transfer_function.eval_tf(s)[0, 0]
        print(f"    pyMOR: difference {abs(s * viscosity / G - 1):.0e}")
