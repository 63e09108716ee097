"""A packing to OVITO, ASE, HOOMD and ParaView and back: it keeps its pressure.

    python examples/other_programs.py [N]

Writes packing.xyz, .dump, .data, .vtp and, with the package gsd, .gsd into this folder. Where ASE is installed, it
opens packing.xyz, counts the rattlers in it, and writes the packing as ase.xyz.
"""

import importlib.util
import sys

import numpy as np

import jampetsc

n = int(sys.argv[1]) if len(sys.argv) > 1 else 64
packing = jampetsc.pack(n=n, pressure=1e-2, seed=1)
endings = ["xyz", "dump", "data", "vtp", *(["gsd"] if importlib.util.find_spec("gsd") else [])]
for ending in endings:
    jampetsc.export(packing, out=f"packing.{ending}")
names = [f"packing.{ending}" for ending in endings if ending != "vtp"]  # jampetsc does not read VTK
if importlib.util.find_spec("ase"):
    import ase.io

    atoms = ase.io.read("packing.xyz")
    print(f"ASE: {len(atoms)} disks, {np.sum(atoms.arrays['rattler'])} rattlers")
    ase.io.write("ase.xyz", atoms, format="extxyz")
    names.append("ase.xyz")
for name in names:
    print(f"{name:14s} p = {jampetsc.import_packing(name).pressure:.7f} k")
