"""jampetsc: linear rheology of jammed packings of soft disks, in parallel on PETSc and SLEPc.

    import jampetsc
    result = jampetsc.load("sweep.h5")      # numpy arrays; needs neither MPI nor PETSc
    G = result.modulus(omega)
    packing = jampetsc.pack(n=256, pressure=1e-3)       # the commands as functions, see `jampetsc.functions`
    packing = jampetsc.Packing(positions, radii, (Lx, Ly, xy))      # or of one's own arrays
    result = jampetsc.sweep(packing, beta=0.1)

Importing the package loads nothing else. `jampetsc.session.start` is the one door to PETSc and MPI.
"""

from jampetsc.version import VERSION as __version__

__all__ = [
    "Disks",
    "Packing",
    "__version__",
    "collapse",
    "correlate",
    "flow",
    "import_packing",
    "jam",
    "load",
    "modes",
    "oscillate",
    "pack",
    "quasistatic",
    "run",
    "shear",
    "spectrum",
    "study",
    "sweep",
]


def __getattr__(name):  # PEP 562: `jampetsc.load` and `jampetsc.Disks` import numpy and h5py when first used
    if name == "load":
        from jampetsc.storage.reader import load

        return load
    if name == "Disks":
        from jampetsc.contacts.disks import Disks

        return Disks
    if name == "Packing":
        from jampetsc.contacts.packing import Packing

        return Packing
    if name == "import_packing":
        from jampetsc.storage.importers import import_packing

        return import_packing
    if name in __all__:
        from jampetsc import functions

        return getattr(functions, name)
    raise AttributeError(f"module 'jampetsc' has no attribute {name!r}")
