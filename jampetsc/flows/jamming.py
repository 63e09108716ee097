"""Which packings jam: samples at a packing fraction, by three protocols, each at a minimum of the energy.

random    uniformly random disks: Vågberg's RAND ensemble (thesis sec. 4.7, after O'Hern et al., PRE 68, 011306
          (2003))
shear     the minima along quasistatic shear of such a start (thesis sec. 4.7)
compress  a thermal liquid, cooled slowly, quenched, and brought to the φ_J of that sample by changes of its cell
          (Vågberg et al., PRE 83, 031307 (2011), who find that φ_J depends on how it was cooled; their rates and
          schedule are not published); a shear between quench and search shows how much of that dependence survives it
"""

import math
from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.jammed_samples import assortativity
from jampetsc.errors import ConvergenceError, InputError, named
from jampetsc.flows.quasistatic_shear import SlowShear, minimum_of
from jampetsc.minimise.descent import Goal
from jampetsc.minimise.minimise import minimise, settle
from jampetsc.minimise.protocols import random_start
from jampetsc.minimise.thermal import annealed
from jampetsc.packing.neighbours import neighbour_pairs
from jampetsc.packing.packing import Packing, deformed
from jampetsc.packing.potentials import Potential

RELAXED_FORCE = 1e-4  # max |F| in k_e/d to which a random start is relaxed before it is minimised
STEP = 2e-3  # of φ, in the search for φ_J before it is bracketed
EXACT = 1e-5  # largest final width of the bracket of φ_J
MAX_SEARCH_PHI = 1.0  # largest φ of the search for φ_J
MAX_NEIGHBOUR_GAP = 0.2  # largest gap between neighbours, in mean diameters
PROTOCOLS = {  # options of each, and their defaults
    "random": {},
    "shear": {"step": 1e-3, "strain": 2.0, "discard": 1.0, "every": 0.02},
    "compress": {"temperature": 1e-3, "cooling_rate": 1e-2, "sweeps": 200, "step": None, "strain": None},
}
SAME_PHI = 1e-12  # packing fractions are alike, and have the same samples, but for so much rounding
_THERMAL = 1  # appended to the seeds of the random start, seeds the generator of its thermal moves


@dataclass(frozen=True)
class Protocol:
    """How samples are made; options of other protocols are None."""

    name: str = "random"
    step: float | None = None  # shear, compress: Δγ
    strain: float | None = None  # in all; compress: between quench and search
    discard: float | None = None  # shear: strain before the first sample
    every: float | None = None  # strain from one sample to the next
    temperature: float | None = None  # compress: T of the liquid in k_e
    cooling_rate: float | None = None  # decrease of ln T per sweep
    sweeps: int | None = None  # sweeps at T before it cools
    separated: bool = False  # whether large disks start on one side of the cell, see `random_start`

    @classmethod
    def of(cls, name: str, *, separated=False, **options) -> "Protocol":
        """The protocol of PROTOCOLS with these options; an option that is None has its default.

        Raises InputError for options of another protocol and for those that do not go together.
        """
        given = {option: value for option, value in options.items() if value is not None}
        for option, value in given.items():
            if option not in PROTOCOLS[name]:
                owners = " or ".join(other for other, known in PROTOCOLS.items() if option in known)
                raise InputError(
                    f"{named(option)} {value:g}: belongs to {named('protocol')} {owners}, not {name}; leave it out"
                )
        values = PROTOCOLS[name] | given
        if name == "compress" and given.keys() & {"step", "strain"}:
            values["step"] = values["step"] or PROTOCOLS["shear"]["step"]
            if not values["strain"] or values["strain"] < values["step"]:
                raise InputError(
                    f"{named('step')} {values['step']:g}: give a {named('strain')} of that or more, too"
                )
        protocol = cls(name, **values, separated=separated)
        if name == "shear" and not protocol.step <= protocol.every * (1 + 1e-9):
            raise InputError(
                f"{named('every')} {protocol.every:g}: must be a {named('step')} of {protocol.step:g} or more"
            )
        if protocol.rows < 1:
            raise InputError(
                f"{named('strain')} {protocol.strain:g}: no sample before it: {named('discard')} "
                f"{protocol.discard:g}, then {named('every')} {protocol.every:g}"
            )
        return protocol

    @property
    def rows(self) -> int:
        """Samples of one seed."""
        if self.name != "shear":
            return 1
        return int(np.floor((self.strain - self.discard) / self.every + 1e-9))

    @property
    def facts(self) -> dict:
        """Its options that are set, by name."""
        known = {
            name: value for name, value in vars(self).items() if value is not None and value is not False
        }
        return {name: value for name, value in known.items() if name != "name"}

    @property
    def columns(self) -> tuple:
        """Names of the columns of its samples."""
        more = {"shear": ("strain",), "compress": ("phi_J", "segregation")}
        return "phi", "seed", "energy", "pressure", "jammed", "coordination", *more.get(self.name, ())


def samples(
    protocol: Protocol, radii, phi: float, seed: int, potential: Potential, solver, tolerance
) -> list[dict]:
    """The samples of one seed at φ, of disks of these radii (N,): `protocol.rows` rows, nan where no minimum is found.

    The seed and φ determine the random start and the thermal moves: from the same places, samples at neighbouring φ
    would jam together, and fits to several φ take them as independent.
    """
    seeds = [seed, round(phi / SAME_PHI)]
    start = settle(random_start(radii, phi, seeds, potential, protocol.separated), RELAXED_FORCE)
    found = []
    try:
        if protocol.name == "shear":
            found.extend(_sheared(protocol, start, solver, tolerance))
        elif protocol.name == "compress":
            found.append(_annealed(protocol, start, seeds, solver, tolerance))
        else:
            found.append(_quenched(start, solver, tolerance)[0])
    except ConvergenceError:
        pass
    known = dict.fromkeys(protocol.columns, np.nan) | {"phi": phi, "seed": seed}
    return [known | one for one in found + [{}] * (protocol.rows - len(found))]


def _quenched(start: Packing, solver, tolerance):
    """(columns of the minimum found from `start`, its disks, whether they jam)."""
    disks = minimise(start, Goal(), solver, tolerance=tolerance).disks
    found = minimum_of(disks)
    return _columns_of(found, disks.n), disks, found.jammed


def _columns_of(found, n):
    """Columns of a `Minimum`, its energy per disk."""
    known = {"energy": found.energy / n, "jammed": float(found.jammed)}
    return known | {name: getattr(found, name) for name in ("pressure", "coordination")}


def _sheared(protocol, start, solver, tolerance):
    """Generates the rows of samples along quasistatic shear."""
    slow = SlowShear(start, protocol.step, solver, tolerance)
    steps = round(protocol.discard / protocol.step)
    for _ in range(protocol.rows):
        steps += max(1, round(protocol.every / protocol.step))
        while slow.steps < steps:
            slow.advance()
        yield {"strain": slow.strain, **_columns_of(minimum_of(slow.disks), slow.disks.n)}


def _annealed(protocol, start, seeds, solver, tolerance):
    """Row of the minimum that a cooled liquid is quenched to, with φ_J and segregation."""
    generator = np.random.Generator(np.random.PCG64(np.random.SeedSequence([*seeds, _THERMAL])))
    heat = protocol.temperature * start.potential.k
    cold = annealed(start, heat, protocol.cooling_rate, protocol.sweeps, generator)
    known, disks, jammed = _quenched(cold, solver, tolerance)
    if protocol.strain:
        slow = SlowShear(disks, protocol.step, solver, tolerance)
        for _ in range(round(protocol.strain / protocol.step)):
            slow.advance()
        known, disks, jammed = _columns_of(slow.found, start.n), slow.disks, slow.found.jammed
    try:
        phi_J = jamming_density(disks, jammed, solver, tolerance)[0]
    except ConvergenceError:
        phi_J = np.nan
    return known | {"phi_J": phi_J, "segregation": segregation(disks)}


def jamming_density(disks: Packing, jammed: bool, solver, tolerance: float) -> tuple:
    """(φ_J, disks of the loosest jammed state found): φ_J is where the energy of a minimum vanishes as the cell grows.

    disks: the minimum; if not jammed, it is compressed first. φ_J is bracketed to EXACT; every looser state is made
    from the loosest jammed one. Raises ConvergenceError where a minimum is not found, or none jams up to DENSEST.
    """
    while not jammed:
        if disks.phi + STEP > MAX_SEARCH_PHI:
            raise ConvergenceError(f"no jammed state up to phi = {disks.phi:.6g}")
        _, disks, jammed = _quenched(_scaled(disks, disks.phi + STEP), solver, tolerance)
    loose = disks.phi
    while jammed:
        loose -= STEP
        _, found, jammed = _quenched(_scaled(disks, loose), solver, tolerance)
        disks = found if jammed else disks
    while disks.phi - loose > EXACT:
        middle = 0.5 * (disks.phi + loose)
        _, found, jammed = _quenched(_scaled(disks, middle), solver, tolerance)
        disks, loose = (found, loose) if jammed else (disks, middle)
    return 0.5 * (disks.phi + loose), disks


def _scaled(disks, phi):
    """The disks in a cell of another packing fraction, all lengths but radii scaled."""
    return deformed(disks, np.zeros((disks.n, 2)), 0.5 * math.log(disks.phi / phi), 0.0)


def segregation(disks: Packing) -> float:
    """Separation of sizes: assortativity of neighbours as large or small, 0 if mixed at random; nan for one size.

    Neighbours are disks with a gap of less than MAX_NEIGHBOUR_GAP mean diameters.
    """
    large = disks.radii > disks.radii.mean()
    i, j, _ = neighbour_pairs(
        disks.positions, disks.radii, disks.cell, skin=2 * MAX_NEIGHBOUR_GAP * float(disks.radii.mean())
    )
    return assortativity(large, i, j)
