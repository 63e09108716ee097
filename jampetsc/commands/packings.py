"""The packing of a `pack.Pack`: its start, its way to rest, and its line in the summary."""

import math
from dataclasses import dataclass

import numpy as np

from jampetsc.errors import ConvergenceError, named
from jampetsc.io.packing_file import read_identified
from jampetsc.io.results import note_lines, noted
from jampetsc.minimisation.descent import Effort
from jampetsc.minimisation.protocols import Target, changed, make_packing, random_places, start_phi
from jampetsc.minimisation.size_laws import DEFAULT_SIZES
from jampetsc.packing.contacts import IMBALANCE, typical_force
from jampetsc.packing.neighbour_list import is_scattered
from jampetsc.packing.neighbours import spatial_order
from jampetsc.packing.packing import Packing, with_proof
from jampetsc.packing.potentials import Potential
from jampetsc.packing.units import UNIT_ROUNDING, stress_unit_of
from jampetsc.petsc.hessian_solver import HessianSolver
from jampetsc.progress import Progress


@dataclass(frozen=True)
class PackingStart:
    """What a packing starts from."""

    disks: Packing
    record: dict  # entries of the record of the packing
    is_random: bool
    keeps_order: bool = True  # whether particle i of the packing is particle i of these


def start_at_random(
    radii, potential: Potential, target: Target, seed: int, record: dict, dimension: int, keeps_order: bool
) -> PackingStart:
    """Disks, or spheres, of radii (N,) at random places of a seed; record: entries of the record."""

    unit = stress_unit_of(radii, potential, dimension)
    if math.isclose(
        unit, 1.0, rel_tol=UNIT_ROUNDING
    ):  # seeds of packings of unit diameter keep them to the last bit
        unit = 1.0
    phi = target.phi or start_phi(target.pressure / unit, dimension)
    kind = {f"requested_{name}": value for name, value in potential.record.items() if name != "k"}
    disks = random_places(radii, phi, seed, potential, dimension=dimension)
    return PackingStart(disks, record | kind | _requested(target) | {"seed": seed}, True, keeps_order)


def start_from_packing(source, target: Target, record: dict) -> PackingStart:
    """Another packing, a file or a Packing, brought near the target; record: entries of the record."""
    disks, identity = read_identified(source)
    record = record | dict(zip(("source", "source_sha256"), identity, strict=True))
    return PackingStart(changed(disks, target), record | _requested(target), is_random=False)


def _requested(target) -> dict:
    """The entry of the record for the pressure or packing fraction of the target."""
    name = "phi" if target.phi else "pressure"
    return {f"requested_{name}": getattr(target, name)}


def make_from(start: PackingStart, target: Target, team) -> Packing:
    """The packing that is made from a start, with its record. Raises ConvergenceError."""
    solver, disks, is_random = HessianSolver(), start.disks, start.is_random
    with Progress(1, "pack") as progress:
        effort = Effort(report=lambda e: progress.show(f"{e.stage}, max|F|/p = {e.residual:.0e}"))
        settings = {"fresh": is_random, "team": team, "effort": effort}
        try:
            if is_random or is_scattered(disks):
                order = spatial_order(disks.positions, disks.cell)
                disks = make_packing(disks.reordered(order), target, solver, **settings)
                if start.keeps_order:
                    disks = with_proof(disks.reordered(np.argsort(order)))
            else:
                disks = make_packing(disks, target, solver, **settings)
        except ConvergenceError as error:
            remedy = f"use another {named('seed')}, or a larger {named('tolerance')}"
            raise ConvergenceError(f"{error.args[0]}: {remedy}") from None
    disks = disks.with_record(**start.record)
    notes = rounding_notes(disks)
    return disks.with_record(notes=noted(notes)) if notes else disks


def rounding_notes(disks) -> list[str]:
    """The note, if any, that rounding leaves forces of a packing above its tolerance, see `io.results`."""
    record = disks.record
    residual = record["max_force"] / typical_force(disks, record["pressure"])
    if not residual > record["tolerance"]:
        return []
    return [
        f"limited by rounding: {IMBALANCE[disks.dimension]} = {residual:.1e}, above the tolerance "
        f"{record['tolerance']:g}"
    ]


def _sizes_text(record) -> str:
    """Sizes of the particles in a line of the summary, where they are not those by default."""
    sizes = record.get("sizes", DEFAULT_SIZES)
    return "" if sizes == DEFAULT_SIZES else f", {sizes}"


def packing_line(name, disks, seconds) -> str:
    """The line of a summary about a packing, with its notes below."""
    record = disks.record
    line = (
        f"{name}: N = {disks.n}{_sizes_text(record)}, p = {record['pressure']:.6g}, phi = {record['phi']:.6f}, "
        f"Z = {record['coordination']:.4f}, "
        f"{record['rattlers']} rattlers, max|F|/p = {record['max_force'] / record['pressure']:.1e}, "
        f"{record['evaluations']} force evaluations, {seconds:.2f} s"
    )
    return "\n".join([line, *note_lines(rounding_notes(disks))])
