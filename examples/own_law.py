"""A damping law of one's own, its weights: G*(ω) of contact damping in a fluid that drags, beside each alone.

    python examples/own_law.py [N]

The dissipation over kτ₁ is Σ [normal (Δu̇∥)² + transverse (Δu̇⊥)² + sliding (Δu̇⊥ᶜ)²] of contacts + drag Σ |u̇ − u̇_aff|²
of disks. On the command line: --law custom --normal 1 --transverse 0.5 --drag 1
"""

import sys

import jampetsc

n = int(sys.argv[1]) if len(sys.argv) > 1 else 256
packing = jampetsc.pack(n=n, pressure=1e-3, seed=1, stabilise="shear")
omega = [1e-6, 1e-4, 1e-2, 1.0]
law = jampetsc.Law("contact damping in a fluid", normal=1.0, transverse=0.5, drag=1.0)
both = jampetsc.sweep(packing, law, omega=omega)
contacts = jampetsc.sweep(packing, jampetsc.ContactDamping(beta=0.5, rotations=False), omega=omega)
drag = jampetsc.sweep(packing, jampetsc.StokesDrag(eta_f=0.0), omega=omega)

print("omega tau1   G'' of both    of contacts    of drag")
for row, w in enumerate(omega):
    print(f"{w:10.0e}" + "".join(f"{sweep.G_loss[row]:15.4e}" for sweep in (both, contacts, drag)))
