"""What runs write: attributes of how they were made; of flow, shear and jam also rows over strain and checkpoints."""

from jampetsc.io.checkpoint import Checkpoint
from jampetsc.io.provenance import provenance
from jampetsc.packing.units import mean_diameter, name_stress_unit, units_line
from jampetsc.petsc import session

STATE = "state/"  # prefix of the arrays from which a run is continued


def run_provenance(seconds: float, running=None, ranks: int = 1, law=None, packing=(None, None)) -> dict:
    """Attributes of how a run was made.

    running   the session whose solvers it used, None if it used none
    law       its parameters, as `Law.parameters`
    packing   its source, as `read_identified` names it
    """
    return provenance(
        versions=session.package_versions(),
        scalar_type=running and running.scalar_type,
        petsc_options=running and running.options_text(),
        ranks=ranks,
        packing=packing,
        law=law or {},
        wall_seconds=seconds,
    )


def potential_facts(disks) -> dict:
    """Attributes of the potential of the disks."""
    return disks.potential.record | {"stress_unit": name_stress_unit(disks.potential, disks.dimension)}


def run_units(disks, tau1: float | None = None) -> str:
    """The line of a summary about the units of its numbers; tau1: of times, if there are any."""
    unit = name_stress_unit(disks.potential, disks.dimension)
    return units_line(unit, disks.potential.k, tau1, mean_diameter(disks))


def write_series(writer, arrays: dict, state: dict, facts: dict) -> None:
    """Write a finished result: arrays, the state at the end, and the attributes `facts`.

    Collective if the writer is. Raises the errors of ResultWriter.
    """
    with writer:
        for name, array in arrays.items():
            writer.dataset(name, array)
        for name, value in state.items():
            writer.dataset(f"{STATE}{name}", value)
        writer.attributes(**facts)


def save_rows(checkpoint: Checkpoint, arrays: dict, state: dict) -> None:
    """Put the rows so far on disk, complete or not at all; nothing where the checkpoint is in memory."""
    if checkpoint.journal is not None:
        checkpoint.save(0, {}, arrays | {f"{STATE}{name}": value for name, value in state.items()})


def saved_rows(checkpoint: Checkpoint):
    """(arrays, state) that `save_rows` has put on disk; None if there are none."""
    return split_state(checkpoint.fields(0)) if checkpoint.done else None


def split_state(arrays) -> tuple[dict, dict]:
    """(arrays, state) of a mapping that has both."""
    state = {name.removeprefix(STATE): arrays[name] for name in arrays if name.startswith(STATE)}
    return {name: arrays[name] for name in arrays if not name.startswith(STATE)}, state


def sample_sizes(shear_stress, pressure) -> str:
    """Effective sample sizes of two averages, in words."""
    return f"effective sample size {shear_stress.samples:.0f} (sigma), {pressure.samples:.0f} (p)"
