"""The packing or network of a run, spread over the ranks: read, searched for contacts and examined once."""

import time
from dataclasses import dataclass

from jampetsc.commands.run_files import run_provenance
from jampetsc.errors import about
from jampetsc.io.packing_file import read_identified, read_source, source_name
from jampetsc.io.results import noted
from jampetsc.packing.contacts import BALANCED
from jampetsc.packing.packing import Packing, proved_minimum
from jampetsc.packing.spring_network import Network
from jampetsc.packing.units import name_stress_unit, stress_unit_of, units_line
from jampetsc.petsc import session
from jampetsc.progress import warn
from jampetsc.response.contact_network import DistributedNetwork, build_network

UNBALANCED = {
    Packing: "so the packing is not a minimum of its energy and the response is that of its contacts as they are. "
    "Quench it (pack from it), also where it was made with friction, which is not supported",
    Network: "so the network is not at rest and the response is that of its bonds as they are. Leave out its forces "
    "(no prestress)",
}


@dataclass(frozen=True, eq=False)
class PackingNetwork:
    """A packing or a network, and its bonds over the ranks."""

    name: str  # in messages
    source: Packing | Network
    identity: tuple  # name of its file and sha256
    network: DistributedNetwork
    start_time: float  # time.perf_counter() before it was read

    @property
    def proved(self) -> bool:
        """Whether K of the network is known to have no negative modes."""
        return not self.network.prestress or (
            isinstance(self.source, Packing) and proved_minimum(self.source)
        )

    @property
    def notes(self) -> list[str]:
        """The note, if any, that forces are not balanced, see `io.results`.

        The response of the contacts as they are is still defined, but the packing would not stay in that state.
        """
        if self.network.imbalance <= BALANCED:
            return []
        return [f"forces are not balanced: {self.network.imbalance_text}, {UNBALANCED[type(self.source)]}"]

    @property
    def stress_scale(self) -> float:
        """Stress of order one: `stress_unit_of` a packing, the unit of stiffness of a network."""
        source = self.source
        if isinstance(source, Network):
            return self.network.k
        return stress_unit_of(source.radii, source.potential, source.dimension)

    def units_line(self, tau1: float | None = None) -> str:
        """The line of a summary about the units of its numbers; tau1: of times, if there are any."""
        return units_line(self.stress_unit, self.network.k, tau1)

    @property
    def stress_unit(self) -> str:
        """Unit of stress and moduli by that of k, in words."""
        return name_stress_unit(getattr(self.source, "potential", None), self.network.dimension)

    def record(self, law: dict, notes=()) -> dict:
        """Attributes of every result of a packing, for `ResultWriter.attributes(**…)`. Collective.

        law     its parameters, as `Law.parameters`
        notes   on its numbers, besides those on the packing
        """
        network = self.network
        return {
            **run_provenance(
                time.perf_counter() - self.start_time,
                session.current(),
                network.comm.size,
                law,
                self.identity,
            ),
            "pressure": network.pressure,
            "k": network.k,
            "stress_unit": self.stress_unit,
            "notes": noted([*self.notes, *notes]),
            "dimension": None if network.dimension == 2 else network.dimension,
            "particle_count": self.source.n,
            "seed": self.source.record.get("seed"),
            **self._counts(),
        }

    def _counts(self):
        network = self.network
        if isinstance(self.source, Network):
            return {"bond_count": network.contact_count, "keep": self.source.record.get("keep")}
        return {
            "phi": self.source.phi,
            "rattlers": network.rattlers,
            "coordination": network.coordination,
            "force_threshold": network.threshold,
        }


def read_network(packing, elastic: dict, to, read=read_source) -> PackingNetwork:
    """The bonds of a packing or a network, in memory or a file, from which the result in `to` is made. Collective.

    elastic   what K has beside the stiffness of contacts, as `build_network` takes it
    read      `packing_file.read_packing` for a command that takes packings alone

    Warns where forces are not balanced. Raises InputError, naming a packing, where it is not rigid.
    """
    start_time, comm, name = time.perf_counter(), session.current().comm, source_name(packing)
    source, identity = read_identified(packing, comm, read)
    to.set_source(source)
    with session.current().stage("assembly"), about(name):
        network = build_network(source, comm, **elastic)
    result = PackingNetwork(name, source, identity, network, start_time)
    for line in result.notes if comm.rank == 0 else ():
        warn(f"{name}: {line}")
    return result
