"""jampetsc: linear and nonlinear rheology of jammed packings of soft disks, in parallel on PETSc and SLEPc.

    import jampetsc as jp
    packing = jp.pack(n=1024, pressure=1e-3, seed=1)               # in memory
    packing = jp.Packing(positions, radii, (Lx, Ly, xy))           # or of one's own arrays, a₂ = (xy, Ly)
    network = jp.Network(positions, bonds, (Lx, Ly))               # springs instead of disks
    sweep = jp.sweep(packing, jp.ContactDamping(beta=0.1))
    sweep.modulus(omega)
    sweep.save("sweep.h5")
    sweep = jp.load("sweep.h5")                                    # numpy arrays; needs neither MPI nor PETSc

Every job of `jampetsc.commands` is a function of this package. Importing it loads nothing else, and
`jampetsc.petsc.session.start` is the one door to PETSc and MPI.
"""

from importlib import import_module

from jampetsc.commands import JOBS, job_class
from jampetsc.version import VERSION as __version__

_HOMES = {  # name -> module, of the names that are not jobs
    "ContactDamping": "jampetsc.laws.damping",
    "Law": "jampetsc.laws.damping",
    "Network": "jampetsc.packing.spring_network",
    "Packing": "jampetsc.packing.packing",
    "StokesDrag": "jampetsc.laws.damping",
    "assemble": "jampetsc.commands.matrices",
    "minimise": "jampetsc.commands.minimising",
    "import_network": "jampetsc.io.network_importers",
    "import_packing": "jampetsc.io.importers",
    "load": "jampetsc.io.reader",
    "plot": "jampetsc.plots.draw",
}
_MODULES = {
    "loads": "jampetsc.laws.loads",  # loads.compression() and others, of sweep, quasistatic, modes and assemble
    "models": "jampetsc.laws.flow_models",  # models.CD0() and others, of flow
}
_FUNCTIONS = [name for name in JOBS if name != "import"]  # a keyword of python: import_packing instead

__all__ = ["__version__", *_HOMES, *_MODULES, *_FUNCTIONS]


def __getattr__(name):  # PEP 562: numpy, h5py and PETSc are imported when something that needs them is used
    if name in _HOMES:
        value = getattr(import_module(_HOMES[name]), name)
    elif name in _MODULES:
        value = import_module(_MODULES[name])
    elif name in _FUNCTIONS:
        from jampetsc.options.functions import make_function

        value = make_function(job_class(name))
    else:
        raise AttributeError(f"module 'jampetsc' has no attribute {name!r}")
    return globals().setdefault(name, value)


def __dir__():
    return sorted(__all__)
