"""Vibrational modes of a packing."""

from dataclasses import dataclass
from functools import partial
from typing import ClassVar

import numpy as np

from jampetsc.errors import InputError, about, named
from jampetsc.io.results import note_lines
from jampetsc.laws.damping import elastic_parameters
from jampetsc.laws.loads import STRESS_MEASURE, LoadChoice
from jampetsc.laws.masses import BY_NUMBER, BY_VOLUME, Masses
from jampetsc.options.job import NETWORKS, ONE_PACKING, Job, TaskInputs
from jampetsc.options.parameters import FILE, optional_parameter, parameter
from jampetsc.options.physics_options import PRESTRESS, load_parameter
from jampetsc.options.values import FREQUENCIES, PACKING_OR_NETWORK, POSITIVE, Numbers
from jampetsc.packing.packing import Packing
from jampetsc.petsc.session import current

COUNT = 50
PER_MODE = "eigenvalues residuals normal transverse participation_ratio floppiness shear_force".split()
MIN_EDGES = 2  # of intervals of frequency
ATTRIBUTES = "inertia_count inertia_shift complete method restarts".split()  # of the file


@dataclass(frozen=True, eq=False)
class Modes(Job):
    """Lowest vibrational modes of a packing, how floppy they are, and their share of the response to a load.

    Eigenvectors of the Hessian K without its translations. Disks have mass one, or masses by their volume: frequencies
    are the square roots of the eigenvalues. Each mode has its floppiness, participation ratio and share of the response
    to a load. That none was missed is proved by the inertia of K. The density of states follows from the inertia alone,
    without modes.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(ONE_PACKING, NETWORKS)
    EPILOG: ClassVar = """examples:
  jampetsc modes p.h5 --count 20 --out modes.h5
  jampetsc modes p.h5 --below 0.01 --out below.h5 -options_file jampetsc:modes_many       # hundreds of modes
  jampetsc modes p.h5 --all --no-eigenvectors --out all.h5                                # participation ratios
  jampetsc modes p.h5 --states 1e-3:3:60 --out states.h5                                  # density of states, any N
  jampetsc modes p.h5 --count 20 --mass-by volume --out by_volume.h5                      # of grains of one material

PETSc options: -modes_… for SLEPc's eigensolver, -inertia_… for the proof that no mode was missed. All modes, or most
of them, are found by LAPACK, which takes no options. Numbers of states take -inertia_…."""

    SOLVERS: ClassVar = ("modes_", "shift_", "inertia_")

    packing: Packing | str = parameter(help="packing or network", value_type=PACKING_OR_NETWORK, place=FILE)
    count: int | None = optional_parameter(
        f"number of modes (default {COUNT}); more where the last eigenvalues are equal", low=1, metavar="M"
    )
    below: float | None = optional_parameter(
        "all modes with eigenvalues below this",
        above=0.0,
        high=POSITIVE[1],
        unit="the unit of k",
        metavar="LAMBDA",
    )
    all: bool = parameter(False, "all modes, by LAPACK on one rank: up to 4096 disks or 2730 spheres")
    states: Numbers | None = optional_parameter(
        "no modes but their exact numbers between these frequencies, by one factorisation for each",
        value_type=FREQUENCIES,
        unit="√k, the mass, or that of the mean diameter, being one",
    )
    eigenvectors: bool = parameter(
        True,
        "eigenvectors in the file, 8 DN bytes for each mode",
        off="leave the eigenvectors out of the file: of each mode only its numbers",
    )
    mass_by: str | None = optional_parameter(
        "masses: all one (number), or by the volume of a particle, one being that of the mean diameter (default "
        "number)",
        choices=(BY_NUMBER, BY_VOLUME),
    )
    prestress: bool = PRESTRESS
    load: LoadChoice = load_parameter("simple shear xy, and the shares of the moduli of all symmetric loads")

    def check(self):
        """Refuse two ways to choose modes, and a single frequency."""
        values = {name: getattr(self, name) for name in ("count", "below", "all", "states")}
        selections = [name for name, value in values.items() if value is not None and value is not False]
        if len(selections) > 1:
            raise InputError(f"{named(selections[0])}, {named(selections[1])}: both given. Give one of them.")
        if self.states is not None and len(self.states) < MIN_EDGES:
            raise InputError(
                f"{named('states')} {self.states[0]:g}: one frequency. Give at least {MIN_EDGES}, as edges."
            )

    @property
    def implied(self):
        """See `Job`."""
        chosen = self.below is not None or self.all or self.states is not None
        return {} if chosen else {"count": COUNT}

    def work(self, to):
        from jampetsc.commands.packing_network import read_network

        masses = {"masses": Masses(1.0, self.mass_by)} if self.mass_by == BY_VOLUME else {}
        source = read_network(self.packing, elastic_parameters(self.prestress) | masses, to)
        with about(source.name), current().stage("modes"):
            write, summary, notes = self._count(source) if self.states is not None else self._find(source)
        with current().stage("output"), to.writer(self.FORMAT, current().comm) as writer:
            writer.distributed("particles", source.network.particles)
            write(writer)
            writer.attributes(
                **source.record(elastic_parameters(self.prestress), notes),
                load=self.load,
                stress_measure=STRESS_MEASURE,
                contacts=source.network.contact_count,
                mass_by=self.mass_by if masses else None,
            )
        return "\n".join([f"{to}: {summary}", source.units_line(), *note_lines([*source.notes, *notes])])

    def _find(self, source):
        """(what writes the modes of a `PackingNetwork`, summary, notes)."""
        from jampetsc.response.vibrations import lowest_modes

        count = self.implied.get("count") if self.count is None else self.count
        load, tensor = self.load.field_and_tensor(source.source.dimension)
        modes = lowest_modes(source.network, count, self.below, source.proved, load, tensor)
        return partial(_write, modes, self.eigenvectors), _summary(modes), _notes(modes)

    def _count(self, source):
        """Likewise of the numbers of states."""
        from jampetsc.response.mode_counts import count_between

        counts = count_between(source.network, self.states, source.proved)
        return partial(_write_counts, counts), _counts_summary(counts), []


def _write_counts(counts, writer):
    """Put `ModeCounts` into a result. Collective."""
    writer.dataset("states/edges", counts.edges)
    writer.dataset("states/counts", counts.counts)
    writer.attributes(states_below=counts.below, states_above=counts.above)


def _counts_summary(counts) -> str:
    """The summary of `ModeCounts`."""
    edges = counts.edges
    return (
        f"{counts.counts.sum()} modes in {len(edges) - 1} intervals of ω from {edges[0]:.4g} to {edges[-1]:.4g}, "
        f"{_stress(counts.network)}\n"
        f"  {counts.below} below, {counts.above} above; all counted by inertia"
    )


def _stress(network) -> str:
    """Whether K has pre-stress, in words."""
    return "pre-stress" if network.prestress else "no pre-stress"


def _write(modes, eigenvectors, writer):
    """Put `VibrationalModes` into a result, with or without their eigenvectors. Collective."""
    if eigenvectors:
        writer.distributed("modes", modes.vectors, axis=1)
    per_mode = {name: getattr(modes, name) for name in PER_MODE}
    contributions = modes.contributions
    if contributions is not None:
        per_mode |= {f"share/{name}": share for name, share in contributions.share.items()}
        per_mode |= {f"cumulative/{name}": np.cumsum(share) for name, share in contributions.share.items()}
        per_mode |= {"lowest/count": contributions.count}
        per_mode |= {f"lowest/{name}_median": median for name, median in contributions.median.items()}
        writer.attributes(**{f"{name}_median": median for name, median in contributions.whole.items()})
    if modes.tensor is not None:
        per_mode |= {"tensor/force": modes.tensor.force, "tensor/modulus": modes.tensor.modulus}
    for name, values in per_mode.items():
        writer.dataset(name, values)
    attributes = {name: getattr(modes, name) for name in ATTRIBUTES}
    writer.attributes(**attributes)


def _notes(modes) -> list[str]:
    """Notes on `VibrationalModes`, see `io.results`."""
    if modes.contributions is not None:
        return []
    return ["no shares of the response: it is affine, or not unique because of zero modes"]


def _summary(modes) -> str:
    """The summary."""
    m = len(modes.eigenvalues)
    proof = (
        "all of them"
        if modes.complete
        else f"inertia counts {modes.inertia_count} below {modes.inertia_shift:.4g}"
    )
    lines = [
        f"{m} modes, {_stress(modes.network)}; {proof}",
        f"  eigenvalues {modes.eigenvalues[0]:.6g} to {modes.eigenvalues[-1]:.6g}, residuals ≤ "
        f"{modes.residuals.max():.1e}",
        f"  floppiness (rms Δu⊥ / Δu∥) {modes.floppiness[0]:.3g} to {modes.floppiness[-1]:.3g}",
    ]
    if modes.contributions is not None:
        names = {"nonaffine": "|u_na|²", "transverse": "Δu⊥²", "normal": "Δu∥²", "modulus": "G_affine − G0"}
        parts = [
            f"{100 * modes.contributions.share[key].sum():.3g} % of {name}" for key, name in names.items()
        ]
        lines.append(f"  together {', '.join(parts)}")
    return "\n".join(lines)
