"""Forces between the disks of a packing: their distribution, their balance on every disk, and the stress they make.

    python examples/contact_forces.py [N] [FILE]

FILE may be a packing of jampetsc; any file of another program is read by jampetsc.import_packing instead.
"""

import sys

import numpy as np

import jampetsc

if len(sys.argv) > 2:
    packing = jampetsc.load(sys.argv[2])
else:
    packing = jampetsc.pack(n=int(sys.argv[1]) if len(sys.argv) > 1 else 256, pressure=1e-3, seed=1)
c = packing.contacts()  # i, j, r = r_j - r_i, overlap, force of every contact
print(f"{len(c)} contacts, Z = {packing.coordination:.3f}, {packing.rattlers.sum()} rattlers")

pull = c.force[:, None] * c.r / np.linalg.norm(c.r, axis=1)[:, None]  # on disk j
net = np.zeros((packing.n, 2))
np.add.at(net, c.j, pull)
np.add.at(net, c.i, -pull)
print(
    f"largest net force on a disk {np.abs(net).max():.1e} k d, mean force of a contact {c.force.mean():.3g} k d"
)

area = np.linalg.det(packing.cell)
stress = -np.einsum("ca,cb->ab", pull, c.r) / area  # compression negative
print(f"pressure from the contacts {-np.trace(stress) / 2:.9g} k, of the packing {packing.pressure:.9g} k")

edges = np.arange(0.0, 4.0, 0.5)
share = np.histogram(c.force / c.force.mean(), edges, density=True)[0]
for low, high, P in zip(edges[:-1], edges[1:], share, strict=True):
    print(f"P(f/<f>) = {P:.3f} from {low:.1f} to {high:.1f}")
