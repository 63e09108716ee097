"""The start of a flow or a shear: a packing, or random disks of a given number, packing fraction and sizes."""

from dataclasses import dataclass
from functools import partial
from pathlib import Path

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.io.packing_file import read_identified, write_packing
from jampetsc.io.reader import load
from jampetsc.minimisation.size_laws import DEFAULT_SIZES, SIZES_HELP
from jampetsc.minimisation.sizes import (
    MAX_DISKS,
    MIN_DISKS,
    Radii,
    in_small_diameters,
    radii_asked,
    sizes_text,
)
from jampetsc.options.job import Job
from jampetsc.options.parameters import FILE, optional_parameter, parameter, parameters
from jampetsc.options.potential_options import EXPONENT, potential_identity
from jampetsc.options.values import MAX_SEED, MAX_THREADS, PACKING, RADII, SIZES, input_name
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import DEFAULT_POTENTIAL, EXPONENTS, Potential

PHI_RANGE = (0.1, 1.0)
RELAXED_START_FORCE = 1e-6  # max |F| in k_e/d of the smallest particles, to which a random start is relaxed
UNITS = "k_e = k_d = 1, diameter of the small disks 1"  # Vågberg, thesis sec. 4.1
OWN_UNITS = "k_e = k_d = 1, length as of the radii given"
STIFFNESS = "inverse-square-diameter"  # of contacts of random particles; `pack` has another default
GROUP = "random particles instead of START; smallest diameter 1, contact stiffness k_e/σ², k_e = k_d = 1"
random_disks_parameter = partial(optional_parameter, group=GROUP)
run_parameter = partial(optional_parameter, group="run")
minimum_tolerance_parameter = partial(
    parameter,
    1e-6,
    "largest max|F|/(p d), in three dimensions max|F|/(p d²), of a minimum",
    low=1e-13,
    high=1e-2,
    metavar="T",
)


@dataclass(frozen=True, eq=False)
class ShearJob(Job):
    """Base of jobs that shear a packing, or random particles that they make."""

    start: Packing | None = optional_parameter(
        "packing to start from", value_type=PACKING, place=FILE, metavar="START"
    )
    n: int | None = random_disks_parameter("number of particles", low=MIN_DISKS, high=MAX_DISKS, metavar="N")
    dimension: int | None = random_disks_parameter(
        "2: disks (default), 3: spheres", low=2, high=3, metavar="D"
    )
    phi: float | None = random_disks_parameter(
        "packing fraction (disks jam near 0.84, spheres near 0.64)",
        low=PHI_RANGE[0],
        high=PHI_RANGE[1],
        metavar="PHI",
    )
    seed: int | None = random_disks_parameter(
        "seed of the random start (default 1)", low=0, high=MAX_SEED, metavar="S"
    )
    sizes: str | None = random_disks_parameter(f"{SIZES_HELP} (default {DEFAULT_SIZES})", value_type=SIZES)
    radii: Radii | None = random_disks_parameter(
        "text file of radii, line i that of particle i, or an array, instead of n and sizes", value_type=RADII
    )
    potential: str | None = random_disks_parameter(
        f"energy of an overlap (default {DEFAULT_POTENTIAL})", choices=EXPONENTS
    )
    exponent: float | None = random_disks_parameter(**EXPONENT)

    discard: float | None = run_parameter(
        "strain left out of the means (default 1, or half of the strain if less)", low=0.0, metavar="S"
    )
    last: Path | None = run_parameter(
        "packing file of the last state to write", metavar="FILE", in_identity=False
    )
    threads: int | None = run_parameter(
        "maximal number of threads (default: one per core)",
        low=1,
        high=MAX_THREADS,
        metavar="T",
        in_identity=False,
    )

    def check(self):
        """Refuse parameters of random disks beside a packing, and missing ones without a packing."""
        self.check_discard()
        if self.start is not None:
            for name, declaration in parameters(type(self)).items():
                if declaration.group == GROUP and getattr(self, name) not in (None, False):
                    raise InputError(f"{named(name)}: fixed by {input_name(self.start)}. Leave it out.")
            return
        for name in ("phi", "n"):
            if getattr(self, name) is None and not (name == "n" and self.radii is not None):
                raise InputError(
                    f"{named(name)}: missing. Give {named('n')} and {named('phi')}, or a packing to start from."
                )
        radii_asked(self.n, self.sizes, self.radii)
        _ = self.made_potential  # raises InputError

    def check_discard(self):
        """Refuse a strain left out of the means that is as long as the run."""
        if self.discard is not None and self.discard >= abs(self.strain):
            raise InputError(
                f"{named('discard')} {self.discard:g}: not below {named('strain')} {self.strain:g}. Give a smaller one."
            )

    @property
    def implied(self):
        """See `Job`."""
        from jampetsc.analysis.strain_series import discarded_strain

        discard = {"discard": discarded_strain(abs(self.strain), self.discard)}
        if self.start is not None:
            return discard
        sizes = {} if self.radii is not None else {"sizes": DEFAULT_SIZES}
        return {"dimension": 2, "seed": 1} | sizes | discard

    def identity(self):
        """See `Job`."""
        return super().identity() | (
            {} if self.start is not None else potential_identity(self.made_potential)
        )

    def check_outputs(self, to):
        """Also check the file of the last state."""
        super().check_outputs(to)
        self.check_last(to)

    def check_last(self, to) -> bool:
        """Raise InputError unless a packing may be written to `last`; whether it is there already, or not wanted."""
        if self.last is None:
            return True
        return to.check("jampetsc-packing", self.paths, self.last, [to.path] if to.path else [])

    def complete(self, to):
        """See `Job`; also writes the last state."""
        super().complete(to)
        if not self.check_last(to):
            result = load(to.path)
            self.write_last(result.last, result.attributes, to)

    def write_last(self, disks, attributes, to):
        """Write the last state as a packing, where that is wanted; attributes: of the result."""
        if self.last is not None:
            write_packing(self.last, disks.with_record(protocol=self.protocol(attributes)), to.request)

    def protocol(self, attributes) -> str:
        """How the last state came about."""
        raise NotImplementedError

    @property
    def team(self):
        """The threads that it may use, a `packing.threads.Team`."""
        from jampetsc.packing.threads import Team, cores

        return Team(self.threads or cores())

    def disks(self) -> tuple[Packing, dict]:
        """(disks, attributes that say where they come from).

        Without a packing: disks at random places, relaxed from deep overlaps, in Vågberg's units, in which the smallest
        diameter is 1, or with the radii that are given.
        """
        if self.start is not None:
            disks, (name, digest) = read_identified(self.start)
            return disks, {"packing": name, "packing_sha256": digest, "units": "those of the packing"}

        radii, units, seed = radii_asked(self.n, self.sizes, self.radii), OWN_UNITS, self.seed
        if self.radii is None:
            radii, units = in_small_diameters(radii), UNITS
        seed = 1 if seed is None else seed
        disks, more = self.random(radii, seed)
        return disks, {"seed": seed, "sizes": sizes_text(self.sizes, self.radii), "units": units} | more

    def random(self, radii, seed) -> tuple[Packing, dict]:
        """(disks of these radii (N,) at random places of a seed, more attributes)."""
        from jampetsc.minimisation.minimise import settle
        from jampetsc.minimisation.protocols import random_places
        from jampetsc.packing.neighbours import spatial_order

        start = random_places(radii, self.phi, seed, self.made_potential, dimension=self.dimension or 2)
        order = spatial_order(start.positions, start.cell)
        force = RELAXED_START_FORCE * start.potential.k / (2.0 * start.radii.min())
        disks = settle(start.reordered(order), force)
        return disks if self.radii is None else disks.reordered(np.argsort(order)), {}

    @property
    def made_potential(self) -> Potential:
        """The potential of random disks. Raises InputError."""
        return Potential(self.potential or DEFAULT_POTENTIAL, STIFFNESS, exponent=self.exponent)


def random_particles_lines(facts) -> list[str]:
    """A line of a summary on the particles that a run has made, none where they are of a packing; facts: attributes."""
    if "sizes" not in facts:
        return []
    return [
        f"  made of random particles: {facts['sizes']}, contact stiffness k_e/σ² ({STIFFNESS}), {facts['units']}"
    ]
