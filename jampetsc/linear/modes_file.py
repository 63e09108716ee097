"""The modes of a packing as a run: read, solve, write the result file."""

import time

import numpy as np

from jampetsc.core.minimum import proved_minimum
from jampetsc.errors import InputError, named
from jampetsc.io.outlet import Outlet
from jampetsc.io.packing_file import read_identified, source_told
from jampetsc.linear.modes import Modes, lowest_modes
from jampetsc.linear.record import run_record
from jampetsc.mechanics.network import build_network
from jampetsc.petsc.session import current

FORMAT = "jampetsc-modes"


def run(packing, to: Outlet, prestress: bool, count=None, below=None) -> Modes:
    """Find modes as `lowest_modes` does and write them.

    Collective. Raises as that does, naming the packing.
    """
    started = time.perf_counter()
    session = current()
    disks, identity = read_identified(packing, session.comm)
    to.made_from(disks)
    try:
        network = build_network(disks, session.comm, prestress)
        with session.stage("modes"):
            modes = lowest_modes(network, count, below, proved=not prestress or proved_minimum(disks))
    except InputError as error:
        raise InputError(f"{source_told(packing)}: {error.told(named)}") from None
    with session.stage("output"), to.writer(FORMAT, session.comm) as writer:
        _write(writer, modes)
        writer.attributes(**run_record(disks, identity, {"prestress": prestress}, network, started))
    return modes


def _write(writer, modes):
    writer.distributed("particles", modes.network.particles)
    writer.distributed("modes", modes.vectors, axis=1)
    per_mode = {
        "eigenvalues": modes.eigenvalues,
        "residuals": modes.residuals,
        "normal": modes.normal,
        "transverse": modes.transverse,
        "participation_ratio": modes.participation,
        "floppiness": modes.floppiness,
        "shear_force": modes.shear_force,
    }
    carried = modes.carried
    if carried is not None:
        per_mode |= {f"share/{name}": share for name, share in carried.share.items()}
        per_mode |= {f"cumulative/{name}": np.cumsum(share) for name, share in carried.share.items()}
        per_mode |= {"lowest/count": carried.count}
        per_mode |= {f"lowest/{name}_median": found for name, found in carried.median.items()}
        writer.attributes(**{f"{name}_median": found for name, found in carried.whole.items()})
    for name, values in per_mode.items():
        writer.dataset(name, values)
    writer.attributes(
        inertia_count=modes.inertia_count,
        inertia_shift=modes.inertia_shift,
        complete=modes.complete,
        method=modes.method,
        restarts=modes.iterations,
        contacts=modes.network.contact_count,
    )
