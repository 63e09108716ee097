"""The packing of a run with its contact network: read, searched for contacts and examined once."""

import time
from dataclasses import dataclass

from jampetsc.errors import about
from jampetsc.io.packing_file import read_identified, source_name
from jampetsc.io.provenance import provenance
from jampetsc.network.contact_network import Network, build_network
from jampetsc.packing.contacts import BALANCED
from jampetsc.packing.minimum_proof import proved_minimum
from jampetsc.packing.packing import Packing
from jampetsc.petsc import session
from jampetsc.progress import warn


@dataclass(frozen=True, eq=False)
class PackingNetwork:
    """A packing and its contact network."""

    name: str  # in messages
    disks: Packing
    identity: tuple  # name of the file and sha256 of the packing
    network: Network
    started: float  # time.perf_counter() at the start of the run

    @property
    def proved(self) -> bool:
        """Whether K of the network is known to have no negative modes."""
        return not self.network.prestress or proved_minimum(self.disks)

    def record(self, law: dict) -> dict:
        """Attributes of every result of a packing, for `ResultWriter.attributes(**…)`. Collective.

        law   its parameters, as `Law.parameters`
        """
        running, network = session.current(), self.network
        return {
            **provenance(
                versions=session.versions(),
                scalar_type=running.scalar_type,
                petsc_options=running.options_told(),
                ranks=network.comm.size,
                packing=self.identity,
                law=law,
                wall_seconds=time.perf_counter() - self.started,
            ),
            "pressure": network.pressure,
            "phi": self.disks.phi,
            "k": network.k,
            "particle_count": self.disks.n,
            "rattlers": network.rattlers,
            "coordination": network.coordination,
            "force_threshold": network.threshold,
            "seed": self.disks.record.get("seed"),
        }


def read_network(packing, prestress: bool, to, started: float) -> PackingNetwork:
    """The network of a packing, in memory or a file, from which the result in the outlet `to` is made. Collective.

    Warns where forces are not balanced. Raises InputError, naming the packing, where it is not rigid.
    """
    comm, name = session.current().comm, source_name(packing)
    disks, identity = read_identified(packing, comm)
    to.made_from(disks)
    with session.current().stage("assembly"), about(name):
        network = build_network(disks, comm, prestress)
    # The response of the contacts as they are is still defined, but the packing would not stay in that state.
    if not network.imbalance <= BALANCED and comm.rank == 0:
        warn(
            f"{name}: forces are not balanced, max|F|/(p d) = {network.imbalance:.1e}, so the packing is not a minimum "
            "of its energy: quench it (pack from it); the response is that of its contacts as they are"
        )
    return PackingNetwork(name, disks, identity, network, started)
