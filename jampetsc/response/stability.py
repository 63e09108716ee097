"""Whether a packing is a minimum of its energy, and what becomes of a sweep when it is not.

The rational method and every error bound need K + ωB to be positive definite. Where K has negative modes G*
is still defined, and is solved for frequency by frequency.
"""

from dataclasses import replace

from jampetsc.contacts.laws import UNDAMPED
from jampetsc.mechanics.assembly import assemble
from jampetsc.mechanics.examine import elastic_inertia
from jampetsc.mechanics.network import Network
from jampetsc.progress import Progress
from jampetsc.response.job import Job
from jampetsc.session import current
from jampetsc.solvers.cholesky import NotPositiveDefinite
from jampetsc.solvers.shifted import ShiftedFactor


def negative_modes(network: Network) -> tuple[int, str]:
    """Number of negative eigenvalues of K, and how it is known. Collective; needs the real build.

    None when Cholesky's factorisation of K succeeds and proves it, otherwise counted by inertia. Raises
    ConvergenceError if that fails.
    """
    pencil = assemble(network, UNDAMPED)
    try:
        factor = ShiftedFactor(pencil.K.copy(), "K")
        proved = factor.prove()
        factor.destroy()
    except NotPositiveDefinite:
        proved = False
    finally:
        pencil.destroy()
    if proved:
        return 0, "Cholesky's factorisation of K"
    return elastic_inertia(network).negative, "the inertia of K"


def settle(job: Job) -> Job:
    """The job with the negative modes of its packing known, and by the direct method where there are some. Collective.

    Nothing is counted for a job that is direct anyway. Says so on stderr when the method changes.
    """
    if job.method == "direct":
        return job
    if job.negative_modes is None:
        network = job.network(current().comm)
        negative, how = negative_modes(network)
        job = replace(job, negative_modes=negative, counted_by=how)
    if not job.negative_modes:
        return job
    with Progress(None, "sweep", current().rank) as progress:
        progress.note(
            f"{job.packing}: K has {job.negative_modes} negative modes, so the packing is not a minimum of its energy: "
            "solving every frequency by --method direct; error_bound is an estimate then"
        )
    return replace(job, method="direct")
