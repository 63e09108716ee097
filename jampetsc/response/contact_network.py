"""A network, or the contacts of a packing, spread over the ranks by ranges of disks along a space-filling curve.

Every rank knows the coordinates of all disks (a few MB at N = 1e5), but looks for and keeps only the contacts of the
disks in its own range. A contact between disks of two ranks is kept by both, each seeing it from its own end, so that
matrices assemble without communication. Nodes and bonds of a `Network` are disks and contacts here.
"""

from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components

from jampetsc.errors import InputError, named
from jampetsc.laws.damping import Law
from jampetsc.laws.forms import LinearForm, spins_of
from jampetsc.laws.masses import Masses
from jampetsc.packing.contacts import (
    BALANCED,
    IMBALANCE,
    LinearBonds,
    both_ends,
    find_contacts,
    find_rattlers,
    force_threshold,
    typical_force,
    virial_pressure,
)
from jampetsc.packing.neighbours import lengths, spatial_order
from jampetsc.packing.packing import Packing
from jampetsc.packing.spring_network import Network
from jampetsc.petsc.session import current

NETWORK_IMBALANCE = "max|F|/mean|T|"  # the imbalance of a `Network`
RIGID_REMEDY = "Raise the pressure, or finish the quench."  # of a `Packing`
UNBALANCED_REMEDY = (
    "Finish the quench, as forces are not balanced; a packing made with friction, which is not supported, has too few "
    "contacts without it."
)
FLOPPY_REMEDY = "Add bonds, or sweep under a law with drag, which resists every motion."  # of a `Network`


@dataclass(frozen=True, eq=False)
class DistributedNetwork:
    """Load-bearing contacts between n disks (rattlers left out), or bonds of a network, on this rank.

    Disks are renumbered 0 … n−1 along the curve; this rank owns first … last−1. `contacts` has an entry for
    each contact of an owned disk, seen from that disk (its i is owned), ordered by i.
    """

    comm: object  # mpi4py communicator
    n: int  # disks that bear load, on all ranks
    first: int
    last: int
    particles: np.ndarray  # (last − first,) numbers of the owned disks in the packing file
    contacts: LinearBonds  # `Contacts` of a packing
    radii: np.ndarray | None  # (n,) of all disks, in the new numbering; None: of nodes that cannot roll
    volume: float  # V
    k: float  # contact stiffness constant of the potential, or unit of stiffness of a network
    pressure: float  # p = Σ f r / (D V) over all overlaps
    rattlers: int  # number of disks left out
    threshold: float  # force above which a contact counts
    # max |F|/(p d^(D−1)) of the disks that bear load, d the mean diameter; infinite at p = 0
    imbalance: float
    pushes: bool  # whether any contact has f > 0
    prestress: bool = True  # K keeps the −f/r of its contacts (BT eq. 4); False: BT's 'without pre-stress'
    of_particles: bool = True  # whether its bonds are contacts of particles; else bonds of a `Network`
    tangential_stiffness: float = 0.0  # of elastic springs between rims, in units of the k of each contact
    diameter: float = 1.0  # d, mean of all disks; of nodes without radii without effect
    masses: Masses | None = None  # of its disks; None: overdamped

    @property
    def dimension(self) -> int:
        """D, 2 or 3."""
        return self.contacts.r.shape[1]

    @property
    def elastic_weights(self) -> dict:
        """Weights in K of the squares of forms of contacts, {name: (contacts,)}, see `forms.FORMS`."""
        c = self.contacts
        weights = {
            "stiffness": c.stiffness,
            "prestress": -c.force_per_length if self.prestress else np.zeros(len(c)),
        }
        if self.tangential_stiffness:
            weights["tangential_stiffness"] = self.tangential_stiffness * c.stiffness
        return weights

    @property
    def weight_rounding(self) -> dict:
        """What rounding of the input may do to `elastic_weights`, in units of ε, {name: (contacts,)}."""
        along, across = self.contacts.weight_rounding.T
        return {
            "stiffness": along,
            "prestress": across * self.prestress,
            "tangential_stiffness": self.tangential_stiffness * along,
        }

    def contact_forms(self, law: Law) -> tuple[LinearForm, ...]:
        """Forms of contacts that K or B of a law weighs.

        Raises InputError where nodes without radii roll, and where the fluid turns disks that no contact turns.
        """
        forms = law.contact_forms(tuple(self.elastic_weights))
        if not self.rolls(law):
            return forms
        if self.radii is None:
            raise InputError(
                "network without radii: its nodes roll under this damping law. Give radii, or take a law without "
                f"rotations ({named('rotations')})."
            )
        if not any(form.has_spins for form in forms):
            raise InputError(
                f"{named('spin_drag')} {law.spin_drag:g}: without effect, as no contact turns disks. Give "
                f"{named('sliding')} or {named('tangential_stiffness')}, or leave it out."
            )
        return forms

    @property
    def turns_elastically(self) -> bool:
        """Whether K acts on spins."""
        return self.tangential_stiffness > 0.0

    def rolls(self, law: Law) -> bool:
        """Whether spins are among the unknowns: where K or B of a law acts on them."""
        return self.turns_elastically or law.couples_rotations

    def dofs(self, law: Law) -> int:
        """Unknowns of each disk: D displacements and, where disks roll, D(D − 1)/2 spins."""
        return self.dimension + (spins_of(self.dimension) if self.rolls(law) else 0)

    def spins_follow_load(self, law: Law) -> bool:
        """Whether spins are relative to the rotation of the affine flow, as displacements are to that flow.

        They are where K, the fluid or inertia acts on them. Where contacts alone damp them no torque tells the
        difference.
        """
        has_reference = self.turns_elastically or law.holds_spins or self.masses is not None
        return has_reference and self.rolls(law)

    def unstressed(self) -> "DistributedNetwork":
        """The same contacts as springs at rest: K without pre-stress."""
        return replace(self, prestress=False)

    @property
    def imbalance_text(self) -> str:
        """`imbalance` with its measure."""
        measure = IMBALANCE[self.dimension] if self.of_particles else NETWORK_IMBALANCE
        return f"{measure} = {self.imbalance:.1e}"

    @property
    def sum_of_squares(self) -> str:
        """Why K has no negative modes whatever the forces, in words; empty where it may have some."""
        if not self.prestress:
            return "no pre-stress"
        return "" if self.pushes else "no bond pushes"

    def damping(self, law: Law) -> float:
        """kτ₁, the unit of a law's weights: one number for all contacts, whatever the stiffness convention."""
        return self.k * law.tau1

    def sum(self, value):
        """Sum over ranks of a number or an array, on one rank itself. Collective."""
        return self.comm.allreduce(value) if self.comm.size > 1 else value

    def max(self, values) -> float:
        """Largest of arrays of numbers ≥ 0 over ranks, or of a number, 0 where there are none. Collective."""
        return max(self.comm.allgather(float(np.max(values, initial=0.0))))

    @property
    def contact_count(self) -> int:
        """Number of contacts N_c on all ranks. Collective."""
        return self.sum(len(self.contacts)) // 2

    @property
    def coordination(self) -> float:
        """Z = 2 N_c / n, rattlers left out. Collective."""
        return 2.0 * self.contact_count / self.n if self.n else 0.0


def build_network(
    source: Packing | Network,
    comm,
    prestress: bool = True,
    tangential_stiffness: float = 0.0,
    masses: Masses | None = None,
) -> DistributedNetwork:
    """The contacts of a packing or the bonds of a network, linearised with pre-stress or without. Collective.

    source                 on every rank
    tangential_stiffness   weight of the squared sliding of rims in K, over the stiffness of each contact
    masses                 of its disks, None: overdamped

    Raises InputError for two disks at one place, and for a packing with too few contacts to be rigid: n disks in a
    periodic cell need at least D n − D (Maxwell's count), and each missing one leaves a floppy mode. With tangential
    springs a contact counts D times and a disk D(D + 1)/2 times. A network may be floppy.
    """
    model = {"prestress": prestress, "tangential_stiffness": tangential_stiffness, "masses": masses}
    if isinstance(source, Network):
        return _spread_network(source, comm, model)
    network = _spread_packing(source, comm, model)
    _require_rigid(network, source.n)
    return network


def _spread_packing(packing, comm, model):
    order = spatial_order(packing.positions, packing.cell)
    packing = packing.reordered(order)
    rows = _rows_of(packing.n, comm)
    every = find_contacts(packing, rows)
    _require_directions(every, order, comm)
    virial = virial_pressure(every.force, every.distance, packing.volume, packing.dimension)
    pressure = comm.allreduce(virial) / 2.0  # two ends each
    threshold = force_threshold(packing, pressure)
    loaded = every[every.force > threshold]
    rattlers = find_rattlers(
        packing.n,
        loaded.i,
        loaded.j,
        packing.dimension,
        lambda loose: np.concatenate(comm.allgather(loose[slice(*rows)])),
    )
    contacts = loaded[~(rattlers[loaded.i] | rattlers[loaded.j])]
    imbalance = _imbalance(packing, every, rows, rattlers, pressure, comm)
    return _without(
        rattlers,
        contacts,
        packing.radii,
        order,
        comm,
        volume=packing.volume,
        k=packing.potential.k,
        pressure=pressure,
        threshold=threshold,
        imbalance=imbalance,
        diameter=2.0 * float(np.mean(packing.radii)),
        **model,
    )


def _spread_network(source, comm, model):
    order = spatial_order(source.positions, source.cell)
    number, every = np.argsort(order), source.linear_bonds
    i, j = both_ends(number[every.i], number[every.j])
    first, last = _rows_of(source.n, comm)
    rows = np.flatnonzero((i >= first) & (i < last))
    rows = rows[np.lexsort((j[rows], i[rows]))]
    sign = np.where(rows < len(every), 1.0, -1.0)  # the second half sees bonds from their other end
    bonds = every[rows % len(every)]
    bonds = replace(bonds, i=i[rows], j=j[rows], r=sign[:, None] * bonds.r)
    radii = None if source.radii is None else source.radii[order]
    return _without(
        source.isolated[order],
        bonds,
        radii,
        order,
        comm,
        volume=source.volume,
        k=source.k,
        pressure=source.pressure,
        threshold=0.0,
        imbalance=source.imbalance if model["prestress"] else 0.0,
        of_particles=False,
        **({} if radii is None else {"diameter": 2.0 * float(np.mean(source.radii))}),
        **model,
    )


def _rows_of(n, comm):
    """First and one past the last of the disks of this rank, all n in the order of the curve."""
    return tuple((comm.rank + end) * n // comm.size for end in (0, 1))


def _without(left_out, contacts, radii, order, comm, **units):
    """The network without the disks of the mask `left_out`, which have no contacts."""
    first, last = _rows_of(len(order), comm)
    number = np.cumsum(~left_out) - 1
    owned = ~left_out[first:last]
    offset = int(np.count_nonzero(~left_out[:first]))
    return DistributedNetwork(
        comm=comm,
        n=int(number[-1]) + 1,
        first=offset,
        last=offset + int(np.count_nonzero(owned)),
        particles=order[first:last][owned],
        contacts=replace(contacts, i=number[contacts.i], j=number[contacts.j]),
        radii=None if radii is None else radii[~left_out],
        rattlers=int(np.count_nonzero(left_out)),
        pushes=any(comm.allgather(bool((contacts.force > 0.0).any()))),
        **units,
    )


def _require_directions(every, order, comm):
    coincident = np.flatnonzero(every.distance == 0.0)[:1]
    pairs = np.concatenate(comm.allgather(order[np.column_stack((every.i, every.j))[coincident]]))
    if len(pairs):
        i, j = sorted(pairs[0])
        raise InputError(f"particles {i} and {j} are in one place: a force has no direction there. Move one.")


def _imbalance(disks, every, rows, rattler, pressure, comm):
    """max |F|/(p d^(D−1)) of the disks without rattlers, from the contacts of this rank's `rows` of them."""
    pull, count = every.normal * every.force[:, None], rows[1] - rows[0]
    forces = [np.bincount(every.i - rows[0], axis, minlength=count) for axis in pull.T]
    size = lengths(np.array(forces).T)[~rattler[slice(*rows)]]
    largest = max(comm.allgather(float(size.max(initial=0.0))))
    unit = typical_force(disks, pressure)
    return largest / unit if unit > 0.0 else np.inf


def floppy_remedy(network: DistributedNetwork) -> str:
    """What to do about floppy modes of a network, in words."""
    if not network.of_particles:
        return FLOPPY_REMEDY
    return RIGID_REMEDY if network.imbalance <= BALANCED else UNBALANCED_REMEDY


def _require_rigid(network, total):
    contacts = network.contact_count
    if network.n == 0:
        raise InputError(
            f"no load-bearing contacts among {total} particles: below jamming, nothing resists shear. "
            "Raise the pressure."
        )
    D, springs = network.dimension, network.turns_elastically
    unknowns = D + (spins_of(D) if springs else 0)
    floppy = unknowns * network.n - D - contacts * (D if springs else 1)
    if floppy > 0:
        raise InputError(
            f"{contacts} contacts between {network.n} particles leave at least {floppy} floppy modes: below jamming. "
            f"{floppy_remedy(network)}"
        )


@dataclass(frozen=True, eq=False)
class Pieces:
    """Connected pieces of the contact graph; each moves freely as a whole."""

    label: np.ndarray  # (n,) lowest disk number of the piece of each disk
    bipartite: np.ndarray  # (n,) whether that piece is bipartite, so that its disks can turn like gears
    colour: np.ndarray  # (n,) +1 or −1, different for all neighbours in a bipartite piece
    dimension: int  # D

    @property
    def roots(self):
        """One disk of each piece, the lowest in number."""
        return np.unique(self.label)

    @property
    def translations(self) -> int:
        """How many moves cost no energy whatever the packing: D for each piece."""
        return self.dimension * len(self.roots)

    @cached_property
    def index(self):
        """(n,) number 0, 1, … of the piece of each disk."""
        return np.unique(self.label, return_inverse=True)[1]

    def gears(self, forms):
        """(n,) ±1 where the disks of a piece can turn by ρθ of this sign such that no form of contacts changes, else 0.

        forms   with spins; ρ_i θ_i = −ρ_j θ_j where both turn a form alike, which bipartite pieces alone allow
        """
        opposite = {form.turns[0] * form.turns[1] > 0.0 for form in forms if form.has_spins}
        if len(opposite) != 1:
            return np.zeros(len(self.label))
        return self.colour * self.bipartite if opposite == {True} else np.ones(len(self.label))

    def mean(self, network: DistributedNetwork, values):
        """Mean over its piece of what each owned disk has: values and result (last − first, c). Collective."""
        own_pieces = self.index[network.first : network.last]
        total = np.zeros((self.index.max() + 1, values.shape[1]), values.dtype)
        np.add.at(total, own_pieces, values)
        return (network.sum(total) / np.bincount(self.index)[:, None])[own_pieces]


def find_pieces(network: DistributedNetwork) -> Pieces:
    """Connected pieces and whether each is bipartite. Collective.

    Uses the double cover, two copies v⁺ and v⁻ of each disk with edges i⁺j⁻ and i⁻j⁺: a piece is bipartite
    exactly where v⁺ and v⁻ stay apart. Labels spread over ranks by taking minima until nothing changes.
    """
    n, i, j = network.n, network.contacts.i, network.contacts.j
    edges = coo_array((np.ones(2 * len(i), bool), (np.r_[i, i + n], np.r_[j + n, j])), shape=(2 * n, 2 * n))
    _, piece = connected_components(edges, directed=False)
    label, MPI = np.arange(2 * n), current().MPI
    while True:
        lowest = np.full(piece.max() + 1, 2 * n)
        np.minimum.at(lowest, piece, label)
        joined = lowest[piece]
        network.comm.Allreduce(MPI.IN_PLACE, joined, op=MPI.MIN)
        if np.array_equal(joined, label):
            break
        label = joined
    plus, minus = label[:n], label[n:]
    # the lowest disk of a piece is the lowest of its copies v⁺, with which disks of its colour are connected
    return Pieces(
        label=np.minimum(plus, minus),
        bipartite=plus != minus,
        colour=np.where(plus <= minus, 1.0, -1.0),
        dimension=network.dimension,
    )
