"""Networks of springs: lattices, and the contacts of a packing or a network with a share of its bonds left out."""

from dataclasses import dataclass
from typing import ClassVar

from jampetsc.commands.describe import describe_network
from jampetsc.errors import InputError, named
from jampetsc.io.packing_file import NETWORK_FORMAT, read_identified, read_source
from jampetsc.options.job import NO_FILE, Job, TaskInputs
from jampetsc.options.parameters import FILE, ValueType, optional_parameter, parameter
from jampetsc.options.values import MAX_SEED, PACKING_OR_NETWORK, split_list
from jampetsc.packing.lattices import LATTICES, build_lattice
from jampetsc.packing.packing import Packing
from jampetsc.packing.spring_network import Network


def _size(value):
    """Numbers of unit cells along the axes; one number is that of all."""
    try:
        sides = tuple(int(word) for word in split_list(value))
    except (TypeError, ValueError):
        raise ValueError("must be a whole number, or one for each axis such as 64,32") from None
    if len(sides) > 3:
        raise ValueError("must be a whole number, or one for each axis such as 64,32")
    return sides


DEFAULT_SIZES = {2: 32, 3: 10}  # unit cells along each axis, by dimension
SIZE = ValueType(
    _size, lambda size: ",".join(map(str, size)), metavar="N|NX,NY[,NZ]", python="integer or (NX, NY)"
)


@dataclass(frozen=True, eq=False)
class Springs(Job):
    """Make a network of springs: a lattice, or the contacts of a packing, with a share of its bonds.

    Springs of a lattice have k = 1, length 1 and no force. Bonds of a packing have the stiffness and force of its
    contacts. Bonds that are left out are chosen at random; of one seed, a lower share keeps bonds of a higher one.
    """

    FORMAT: ClassVar = NETWORK_FORMAT
    scalar: ClassVar = None
    OUT_HELP: ClassVar = "network file to write"
    EPILOG: ClassVar = """examples:
  jampetsc springs --lattice triangular --size 32 --keep 0.7 --seed 1 --out net.h5
  jampetsc springs --lattice fcc --size 8 --keep 0.5 --seed 1 --out net3d.h5       # 2048 nodes in three dimensions
  jampetsc springs p.h5 --keep 0.95 --seed 1 --out cut.h5     # contacts of a packing without 5 % of them"""
    STUDY_INPUTS: ClassVar = TaskInputs(NO_FILE)

    source: Packing | None = optional_parameter(
        "packing or network, instead of a lattice", value_type=PACKING_OR_NETWORK, place=FILE, metavar="FILE"
    )
    lattice: str | None = optional_parameter("kind of lattice", choices=tuple(LATTICES))
    size: tuple | None = optional_parameter(
        "unit cells along all axes, or along each (default 32, in three dimensions 10); triangular, square and cubic "
        "have one node each, kagome three, fcc four",
        value_type=SIZE,
    )
    keep: float = parameter(
        1.0, "share of the bonds that stay, chosen at random", above=0.0, high=1.0, metavar="P"
    )
    seed: int = parameter(1, "seed of the choice of bonds", low=0, high=MAX_SEED, metavar="S")

    def check(self):
        """Refuse a lattice beside a file, and neither of them."""
        if (self.source is None) == (self.lattice is None):
            raise InputError(
                f"{named('lattice')}: missing, or given with a file. Give a kind of lattice, or a packing or network."
            )
        if self.source is not None and self.size is not None:
            raise InputError(f"{named('size')}: an option of {named('lattice')}. Leave it out.")

    @property
    def implied(self):
        """See `Job`."""
        return {} if self.lattice is None else {"size": (DEFAULT_SIZES[self._dimension],)}

    @property
    def _dimension(self):
        """Dimension of the lattice."""
        return len(LATTICES[self.lattice].vectors)

    def work(self, to):
        network = self._of_lattice() if self.lattice else self._of_source()
        if self.keep < 1.0:
            network = network.diluted(self.keep, self.seed).with_record(keep=self.keep, seed=self.seed)
        to.put_network(network)
        return describe_network(to, network)

    def _of_lattice(self):
        size = self.size or (DEFAULT_SIZES[self._dimension],)
        return build_lattice(self.lattice, size * self._dimension if len(size) == 1 else size)

    def _of_source(self):
        source, (name, digest) = read_identified(self.source, read=read_source)
        network = source if isinstance(source, Network) else Network.of_packing(source)
        return network.with_record(source=name, source_sha256=digest)
