"""Attributes of every result of a packing: provenance, and the state of the packing."""

import time

from jampetsc.io.provenance import provenance
from jampetsc.network.contact_network import Network
from jampetsc.packing.packing import Packing
from jampetsc.petsc import session


def run_record(disks: Packing, identity, law: dict, network: Network, started: float) -> dict:
    """Attributes for `ResultWriter.attributes(**…)`. Collective.

    identity   name and sha256 of the packing file; law: its parameters, as `Law.parameters`
    started    time.perf_counter() at the start of the run
    """
    running = session.current()
    return {
        **provenance(
            versions=session.versions(),
            scalar_type=running.scalar_type,
            petsc_options=running.options_told(),
            ranks=network.comm.size,
            packing=identity,
            law=law,
            wall_seconds=time.perf_counter() - started,
        ),
        "pressure": network.pressure,
        "phi": disks.phi,
        "k": network.k,
        "particle_count": disks.n,
        "rattlers": network.rattlers,
        "coordination": network.coordination,
        "force_threshold": network.threshold,
        "seed": disks.record.get("seed"),
    }
