"""A damping law of one's own, a row of weights: G*(ω) of contact damping in a fluid that drags, beside each alone.

    python examples/own_law.py [N]

The dissipation over kτ₁ is Σ [normal (Δu̇∥)² + transverse (Δu̇⊥)² + sliding (Δu̇⊥ᶜ)²] of contacts + drag Σ |u̇ − u̇_aff|²
of disks. Every command knows a law by its row of FAMILIES; to keep one, put the row into jampetsc/contacts/laws.py.
"""

import sys

import jampetsc
from jampetsc.contacts.laws import FAMILIES, Family, Option

FAMILIES["immersed"] = Family(
    label="contact damping in a fluid",
    options={"beta": Option(1.0, "transverse to normal contact damping, ≥ 0")},
    weights=lambda beta: {"normal": 1.0, "transverse": beta, "drag": 1.0},
    leading="beta",
    simplest={"beta": 1.0},
)

n = int(sys.argv[1]) if len(sys.argv) > 1 else 256
packing = jampetsc.pack(n=n, pressure=1e-3, seed=1, stabilise="shear")
omega = [1e-6, 1e-4, 1e-2, 1.0]
both = jampetsc.sweep(packing, law="immersed", beta=0.5, omega=omega)
contacts = jampetsc.sweep(packing, beta=0.5, no_rotations=True, omega=omega)
drag = jampetsc.sweep(packing, law="stokes", eta_f=0.0, omega=omega)

print("omega tau1   G'' of both    of contacts    of drag")
for row, w in enumerate(omega):
    print(f"{w:10.0e}" + "".join(f"{sweep.G_loss[row]:15.4e}" for sweep in (both, contacts, drag)))
