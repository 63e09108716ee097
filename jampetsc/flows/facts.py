"""Attributes that files of steady and quasistatic shear and of samples have in common."""

from jampetsc.io.provenance import provenance
from jampetsc.petsc import session


def run_provenance(seconds: float, running=None, ranks: int = 1, law=None) -> dict:
    """Attributes that say how a run came about; running: the session whose solvers it has used."""
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
    """Attributes of disks that do not change when these move."""
    potential = disks.potential
    return {"potential": potential.kind, "stiffness": potential.stiffness, "k": float(potential.k)}
