"""Attributes common to files of steady shear, of quasistatic shear and of samples that jam."""

from jampetsc.io.provenance import provenance
from jampetsc.petsc import session


def run_provenance(seconds: float, running=None, ranks: int = 1, law=None) -> dict:
    """Attributes of how a run was made; running: the session whose solvers it used, None if it used none."""
    return provenance(
        versions=session.versions(),
        scalar_type=running and running.scalar_type,
        petsc_options=running and running.options_told(),
        ranks=ranks,
        packing=(None, None),
        law=law or {},
        wall_seconds=seconds,
    )


def facts_of_disks(disks) -> dict:
    """Attributes of the potential of the disks."""
    potential = disks.potential
    return {"potential": potential.kind, "stiffness": potential.stiffness, "k": float(potential.k)}
