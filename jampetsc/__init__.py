"""jampetsc: linear rheology of jammed packings of soft disks, in parallel on PETSc and SLEPc.

    import jampetsc
    result = jampetsc.load("sweep.h5")      # numpy arrays; needs neither MPI nor PETSc
    G = result.modulus(omega)
    packing = jampetsc.pack(n=256, pressure=1e-3)       # the commands as functions, see `jampetsc.functions`
    packing = jampetsc.Packing(positions, radii, (Lx, Ly, xy))      # or of one's own arrays
    result = jampetsc.sweep(packing, beta=0.1)

Importing the package loads nothing else. `jampetsc.session.start` is the one door to PETSc and MPI.
"""

from importlib import import_module

from jampetsc.version import VERSION as __version__

__all__ = [
    "Disks",
    "Packing",
    "__version__",
    "assemble",
    "collapse",
    "correlate",
    "flow",
    "import_packing",
    "jam",
    "load",
    "modes",
    "oscillate",
    "pack",
    "plot",
    "quasistatic",
    "run",
    "shear",
    "spectrum",
    "study",
    "sweep",
]


_HOMES = {  # of what is no function of `jampetsc.functions`
    "Disks": "jampetsc.contacts.disks",
    "Packing": "jampetsc.contacts.packing",
    "import_packing": "jampetsc.storage.importers",
    "load": "jampetsc.storage.reader",
    "plot": "jampetsc.plots.draw",
}


def __getattr__(name):  # PEP 562: numpy and h5py are imported when something of it is first used
    if name not in __all__:
        raise AttributeError(f"module 'jampetsc' has no attribute {name!r}")
    return getattr(import_module(_HOMES.get(name, "jampetsc.functions")), name)
