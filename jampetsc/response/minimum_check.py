"""Whether a packing is a minimum of its energy: the negative and zero modes of K, and how they were counted.

K is that of a `contact_network.DistributedNetwork`, with or without pre-stress, on the displacements. For a proof that
a packing's file records see `packing.proved_minimum`. `examine` has other facts of K and B: size, asymmetry, inertia.
"""

from dataclasses import dataclass, replace

import numpy as np

from jampetsc.errors import ConvergenceError, InputError, named
from jampetsc.laws.damping import UNDAMPED, Law
from jampetsc.laws.forms import spins_of
from jampetsc.packing.contacts import BALANCED
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.inertia import Inertia, count_eigenvalues
from jampetsc.petsc.session import current
from jampetsc.petsc.shifted import PREFIX, ShiftedFactor
from jampetsc.response.assembly import Pencil, assemble
from jampetsc.response.contact_network import DistributedNetwork, find_pieces, floppy_remedy
from jampetsc.response.factor_memory import require_memory
from jampetsc.response.shift_factors import bytes_of_factor

BY_CHOLESKY = "Cholesky's factorisation of K"
BY_INERTIA = "the inertia of K"


@dataclass(frozen=True)
class MinimumCheck:
    """What is known of K's negative modes and of the balance of forces, so whether error bounds are certified."""

    construction: str  # why K is a sum of squares, if it is one: in words
    negative_modes: int | None  # None: not known
    counted_by: str  # how this run has counted them; empty if it has not
    imbalance: float  # of forces, see `DistributedNetwork`
    imbalance_text: str  # the same with its measure

    @property
    def certified(self) -> bool:
        """Whether K is known to have no negative modes and forces are balanced, so that error bounds are certified."""
        return self.negative_modes == 0 and self.imbalance <= BALANCED

    @property
    def description(self) -> str:
        """Whether K has no negative modes, and how that is known, as text for a file."""
        if self.construction:
            status = f"by construction ({self.construction})"
        elif self.negative_modes is None:
            status = "not shown: that of fields is a bound only if K has no negative modes"
        elif self.negative_modes:
            status = f"no: {self.negative_modes} negative modes; error_bound is an estimate for fields, a bound for G*"
        else:
            status = f"proved {f'by {self.counted_by}' if self.counted_by else 'when the packing was made'}"
        if self.imbalance <= BALANCED:
            return status
        return f"{status}; but forces are not balanced: {self.imbalance_text}"


def check_minimum(network: DistributedNetwork, proved: bool, count: bool = True) -> MinimumCheck:
    """Whether a packing is a minimum. Collective; needs the real build where modes are counted.

    proved   whether it was proved before that K with pre-stress has no negative modes
    count    whether to count them where that is not known

    Raises as `count_modes`.
    """
    construction = network.sum_of_squares
    negative, method = (0, "") if proved or construction else (None, "")
    if negative is None and count:
        negative, method = negative_modes(network)
    return MinimumCheck(construction, negative, method, network.imbalance, network.imbalance_text)


def count_modes(network: DistributedNetwork) -> Inertia:
    """Inertia of K, nothing pinned, with the zeros of `free_moves`. Collective; needs the real build.

    Raises as `count_eigenvalues`.
    """
    K = assemble(network, UNDAMPED, pinned=False).K
    return count_eigenvalues(K, f"K {'with' if network.prestress else 'without'} pre-stress")


def negative_modes(network: DistributedNetwork) -> tuple[int, str]:
    """(number of negative eigenvalues of K, how it is known). Collective; needs the real build.

    It is 0 if the Cholesky factorisation of K succeeds and proves it; otherwise they are counted by inertia. Raises as
    `count_modes`.
    """
    pencil = assemble(network, UNDAMPED)
    require_memory(network, pencil.unknowns, PREFIX)
    try:
        proved = ShiftedFactor(pencil.K, "K").prove()
    except NotPositiveDefinite:
        proved = False
    return (0, BY_CHOLESKY) if proved else (count_modes(network).negative, BY_INERTIA)


def require_minimum(network: DistributedNetwork) -> None:
    """Raise InputError, with their number, where K has negative modes. Collective."""
    _refuse_negative(negative_modes(network)[0])


def require_unique_response(network: DistributedNetwork) -> None:
    """Raise InputError, with their number, for negative modes and for zero modes besides translations. Collective."""
    inertia = count_modes(network)
    _refuse_negative(inertia.negative)
    if reason := _floppy_modes(network, inertia):
        raise InputError(reason)


def floppy_modes(pencil: Pencil) -> str:
    """The reason that floppy modes give where a response cannot be solved for; empty without them. Collective.

    Also empty where they cannot be counted: with complex scalars, or by factorisations that fail.
    """
    if current().scalar_type != "real":
        return ""
    network = pencil.network
    try:
        inertia = count_modes(network)
    except (ConvergenceError, InputError):
        return ""
    floppy = _floppy_count(network, inertia)
    if floppy <= 0 or not pencil.law.drag:
        return _floppy_modes(network, inertia)
    return (
        f"K has {floppy} floppy mode{'s' * (floppy > 1)} besides its translations, which drag alone resists: over many "
        f"decades of frequency rounding limits their response. Narrow the range of {named('omega')}, or raise "
        f"{named('accuracy')}."
    )


def shared_zero_modes(pencil: Pencil) -> str:
    """The reason that moves which K and B both let pass give where K + sB is singular; empty without them. Collective.

    Under drag they are spins alone: (ρ_i θ_i + ρ_j θ_j) × n = 0 in all contacts. In a plane these are the gears, which
    are pinned; in space also spheres that twist about n where all their bonds lie in one line. Empty where
    they cannot be counted, as for `floppy_modes`.
    """
    if current().scalar_type != "real":
        return ""
    of_K, of_B = pencil.largest
    both = pencil.K.copy()
    both.axpy(of_K / of_B, pencil.B)
    try:
        count = count_eigenvalues(both, "K + sB", pencil.pins).zero
    except (ConvergenceError, InputError):
        return ""
    if not count:
        return ""
    moves, cost = ("moves", "cost") if count > 1 else ("move", "costs")
    besides = "" if pencil.law.holds_translations else " besides translations"
    remedy = "Take a law with drag, which resists every motion."
    if pencil.dimension == 3 and pencil.rolls:
        remedy = f"Take a law without rotations ({named('rotations')}): spheres twist freely about bonds of one line."
    return (
        f"{count} {moves}{besides} {cost} neither energy nor dissipation under {pencil.law}. The response is not "
        f"unique. {remedy}"
    )


def free_moves(network: DistributedNetwork) -> int:
    """Moves that cost no energy whatever the packing: translations, and gears where K acts on spins. Collective."""
    pieces = find_pieces(network)
    gears = pieces.gears(network.contact_forms(UNDAMPED))[pieces.roots] if network.turns_elastically else []
    return pieces.translations + int(np.count_nonzero(gears)) * spins_of(network.dimension)


def _floppy_count(network, inertia):
    return inertia.zero - free_moves(network)


def _floppy_modes(network, inertia):
    floppy = _floppy_count(network, inertia)
    if floppy <= 0:
        return ""
    return (
        f"K has {floppy} floppy mode{'s' * (floppy > 1)} besides its translations: the response to strain is not "
        f"unique. {floppy_remedy(network)}"
    )


def _refuse_negative(count):
    if count:
        raise InputError(
            f"K has {count} negative mode{'s' * (count > 1)}: not a minimum of the energy. Quench it "
            f"(pack with {named('from_')}), or leave the pre-stress out ({named('prestress')})."
        )


@dataclass(frozen=True, eq=False)
class Examination:
    """Facts about the matrices of one law on one network."""

    contacts: int  # on all ranks
    unknowns: int  # rows of K and B
    dofs: int  # unknowns of each disk
    nonzeros: int  # entries stored in each of K and B
    factor_bytes: float  # of a factor of K + sB, about
    pieces: int  # connected pieces of the contact graph
    translations: int  # D for each piece
    free_moves: int  # that cost no energy in any packing: translations, and gears where K acts on spins
    gears: int  # bipartite pieces, whose disks can turn like gears
    pins: int  # pinned unknowns, see `assembly.Pencil`
    asymmetry_K: float  # ‖K − Kᵀ‖ / ‖K‖ (Frobenius)
    asymmetry_B: float
    with_prestress: Inertia  # of K on the displacements, nothing pinned: D zeros per piece are translations
    without_prestress: Inertia
    damping: Inertia  # of B, pinned unknowns left out


def asymmetry(matrix) -> float:
    """‖A − Aᵀ‖ / ‖A‖ in the Frobenius norm. Collective."""
    PETSc = current().PETSc
    difference = matrix.transpose(PETSc.Mat())
    difference.axpy(-1.0, matrix, structure=PETSc.Mat.Structure.DIFFERENT_NONZERO_PATTERN)
    norm = matrix.norm(PETSc.NormType.FROBENIUS)
    result = difference.norm(PETSc.NormType.FROBENIUS) / norm if norm else 0.0
    return float(result)


def examine(network: DistributedNetwork, law: Law) -> Examination:
    """Assemble K and B of `law` and examine them. Collective; needs the real build of PETSc.

    Raises ConvergenceError if a factorisation fails.
    """
    pencil = assemble(network, law)
    roots = pencil.pieces.roots
    return Examination(
        contacts=network.contact_count,
        unknowns=pencil.unknowns,
        dofs=pencil.dofs,
        nonzeros=int(pencil.K.getInfo(current().PETSc.Mat.InfoType.GLOBAL_SUM)["nz_used"]),
        factor_bytes=bytes_of_factor(pencil),
        pieces=len(roots),
        translations=pencil.pieces.translations,
        free_moves=free_moves(network),
        gears=int(np.count_nonzero(pencil.pieces.bipartite[roots])),
        pins=len(pencil.pins),
        asymmetry_K=asymmetry(pencil.K),
        asymmetry_B=asymmetry(pencil.B),
        with_prestress=count_modes(replace(network, prestress=True)),
        without_prestress=count_modes(network.unstressed()),
        damping=count_eigenvalues(pencil.B, "B", pencil.pins),
    )
