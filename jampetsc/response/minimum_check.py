"""Whether a packing is a minimum of its energy: the negative and zero modes of K, and how they were counted.

K is that of a `network.Network`, with or without pre-stress, on the displacements. For a proof that a packing's file
records see `packing.minimum_proof`, for unbalanced forces `packing.contacts`.
"""

from jampetsc.collective import on_root
from jampetsc.errors import ConvergenceError, InputError, named
from jampetsc.laws.damping import UNDAMPED
from jampetsc.network.contact_network import Network, find_pieces
from jampetsc.packing.contacts import BALANCED, imbalance, measure
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.inertia import Inertia, count_eigenvalues
from jampetsc.petsc.session import current
from jampetsc.petsc.shifted import ShiftedFactor
from jampetsc.progress import warn
from jampetsc.response.assembly import assemble

BY_CHOLESKY = "Cholesky's factorisation of K"
BY_INERTIA = "the inertia of K"


def examine_balance(packing, disks, comm) -> float:
    """max |F|/(p d) of disks, which are called `packing` in a warning where their forces are not balanced. Collective.

    A response of the contacts as they are is still defined, but the packing would not stay in that state.
    """
    found = on_root(comm, lambda: imbalance(disks, measure(disks)))
    if not found <= BALANCED and comm.rank == 0:
        warn(
            f"{packing}: forces are not balanced, max|F|/(p d) = {found:.1e}, so the packing is not a minimum of its "
            "energy: quench it (pack from it); the response is that of its contacts as they are"
        )
    return found


def count_modes(network: Network) -> Inertia:
    """Inertia of K, nothing pinned: two zeros for each piece are its translations. Collective; needs the real build.

    Raises as `count_eigenvalues`.
    """
    K = assemble(network, UNDAMPED, pinned=False).K
    return count_eigenvalues(K, f"K {'with' if network.prestress else 'without'} pre-stress")


def negative_modes(network: Network) -> tuple[int, str]:
    """(number of negative eigenvalues of K, how it is known). Collective; needs the real build.

    It is 0 if the Cholesky factorisation of K succeeds and proves it; otherwise they are counted by inertia. Raises as
    `count_modes`.
    """
    try:
        proved = ShiftedFactor(assemble(network, UNDAMPED).K, "K").prove()
    except NotPositiveDefinite:
        proved = False
    return (0, BY_CHOLESKY) if proved else (count_modes(network).negative, BY_INERTIA)


def require_minimum(network: Network) -> None:
    """Raise InputError, with their number, where K has negative modes. Collective."""
    _refuse_negative(negative_modes(network)[0])


def require_unique_response(network: Network) -> None:
    """Raise InputError, with their number, for negative modes and for zero modes besides translations. Collective."""
    inertia = count_modes(network)
    _refuse_negative(inertia.negative)
    if reason := _floppy_modes(network, inertia):
        raise InputError(reason)


def floppy_modes(network: Network) -> str:
    """The reason that floppy modes give where a response cannot be solved for; empty without them. Collective.

    Also empty where they cannot be counted: with complex scalars, or by factorisations that fail.
    """
    if current().scalar_type != "real":
        return ""
    try:
        return _floppy_modes(network, count_modes(network))
    except (ConvergenceError, InputError):
        return ""


def _floppy_modes(network, inertia):
    floppy = inertia.zero - find_pieces(network).translations
    if floppy <= 0:
        return ""
    return (
        f"K has {floppy} floppy mode{'s' * (floppy > 1)} besides its translations: the response to strain is not "
        "unique; raise the pressure or finish the quench"
    )


def _refuse_negative(count):
    if count:
        raise InputError(
            f"K has {count} negative mode{'s' * (count > 1)}: not a minimum of the energy; quench it "
            f"(pack with {named('from_')}) or leave the pre-stress out ({named('prestress')})"
        )
