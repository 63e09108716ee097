"""The packings of a `pack.Pack`, made one after another by one rank, and their lines in the summary."""

import math
import time
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jampetsc.commands.run_files import run_units
from jampetsc.errors import ConvergenceError, JampetscError, named
from jampetsc.io.outputs import is_finished
from jampetsc.io.packing_file import read_identified, write_packing
from jampetsc.io.request import Request
from jampetsc.io.results import note_lines, noted
from jampetsc.minimisation.descent import Effort
from jampetsc.minimisation.protocols import Target, changed, make_packing, random_places, start_phi
from jampetsc.minimisation.size_laws import DEFAULT_SIZES
from jampetsc.packing.contacts import IMBALANCE, typical_force
from jampetsc.packing.neighbour_list import is_scattered
from jampetsc.packing.neighbours import spatial_order
from jampetsc.packing.packing import with_proof
from jampetsc.packing.potentials import Potential
from jampetsc.packing.units import stress_unit_of
from jampetsc.petsc.hessian_solver import HessianSolver
from jampetsc.progress import Progress

ROUNDING = 1e-12  # largest relative difference of a unit from 1 that is rounding


@dataclass(frozen=True)
class PackingTask:
    """One packing to make."""

    path: Path | None  # its file, None in memory
    seed: int | None  # of its random start, None if it starts from another packing
    target: Target
    rung: int = 0  # of a ladder: it starts from the packing of the task before it, unless this is 0
    job: object = None  # the `pack.Pack` that makes this packing alone, None in memory

    @property
    def name(self) -> str:
        """Its name in messages."""
        return str(self.path or f"the packing at p = {self.target.pressure:g}")

    @property
    def request(self) -> Request:
        """What its file records as requested; the files that it reads must be there."""
        request = Request(self.job)
        request.read(self.job.paths)
        return request

    def is_finished(self) -> bool:
        """Whether its file is there already. Raises InputError as `outputs.is_finished`."""
        return self.path is not None and is_finished(self.path, self.request)

    @property
    def requested(self) -> dict:
        """Entries of its record for its own settings: the target, and the seed."""
        name = "phi" if self.target.phi else "pressure"
        seed = {} if self.seed is None else {"seed": self.seed}
        return {f"requested_{name}": getattr(self.target, name)} | seed


@dataclass(frozen=True)
class PackingStart:
    """What packings start from."""

    record: dict  # entries of the record of each packing
    disks_of: Callable  # task -> the disks from which it starts
    keeps_order: bool = True  # whether particle i of the packing is particle i of these


def start_at_random(
    radii, potential: Potential, record: dict, dimension: int, keeps_order: bool
) -> PackingStart:
    """Disks, or spheres, of radii (N,) at random places; record: entries of the record."""

    unit = stress_unit_of(radii, potential, dimension)
    if math.isclose(
        unit, 1.0, rel_tol=ROUNDING
    ):  # seeds of packings of unit diameter keep them to the last bit
        unit = 1.0

    def disks_of(task):
        phi = task.target.phi or start_phi(task.target.pressure / unit, dimension)
        return random_places(radii, phi, task.seed, potential, dimension=dimension)

    kind = {"requested_potential": potential.kind, "requested_stiffness": potential.stiffness}
    return PackingStart(record | kind, disks_of, keeps_order=keeps_order)


def start_from_packing(source, record: dict, comm=None) -> PackingStart:
    """Another packing, a file or a Packing; record: entries of the record. Collective over comm."""
    disks, identity = read_identified(source, comm)
    record = record | dict(zip(("source", "source_sha256"), identity, strict=True))
    return PackingStart(record, lambda task: changed(disks, task.target))


def make_packings(tasks, team, rank) -> dict:
    """Make the packings of tasks [(number, task, start)]: {number: (disks, line of the summary) or JampetscError}.

    start   `PackingStart`; disks are None where they were written to a file; a line of their units is last
    """
    solver, outcomes = HessianSolver(), {}
    with Progress(len(tasks), "packings", rank) as progress:
        for number, task, start in tasks:
            start_time = time.perf_counter()
            effort = Effort(report=lambda e: progress.show(f"{e.stage}, max|F|/p = {e.residual:.0e}"))
            try:
                disks, fresh = start.disks_of(task), task.seed is not None
                settings = {"fresh": fresh, "team": team, "effort": effort}
                if fresh or is_scattered(disks):
                    order = spatial_order(disks.positions, disks.cell)
                    disks = make_packing(disks.reordered(order), task.target, solver, **settings)
                    if start.keeps_order:
                        disks = with_proof(disks.reordered(np.argsort(order)))
                else:
                    disks = make_packing(disks, task.target, solver, **settings)
                disks = disks.with_record(**start.record, **task.requested)
                if notes := rounding_notes(disks):
                    disks = disks.with_record(notes=noted(notes))
                if task.path is not None:
                    write_packing(task.path, disks, task.request)
            except ConvergenceError as error:
                remedy = f"use another {named('seed')}, or a larger {named('tolerance')}"
                outcomes[number] = ConvergenceError(f"{error.args[0]}: {remedy}")
                continue
            except JampetscError as error:
                outcomes[number] = error
                continue
            line = _line(task.path or "in memory", disks, time.perf_counter() - start_time)
            outcomes[number] = (disks if task.path is None else None), line, run_units(disks)
            if len(tasks) > 1:
                progress.step(line)
    return outcomes


def raise_failures(failures, tasks) -> None:
    """Raise the error of one packing, or say which of several failed and why."""
    if len(tasks) == 1:
        raise failures[0]
    reasons = [f"{tasks[i].path or f'packing {i + 1}'}: {error.args[0]}" for i, error in failures.items()]
    written = ", the others are on disk" if tasks[0].path else ""
    raise ConvergenceError(f"{len(failures)} of {len(tasks)} packings failed{written}: {'; '.join(reasons)}")


def summarise_packings(tasks, task_lines, ranks, units=()) -> str:
    """The summary: a line of each packing that was made, how many existed already, how many ranks had no work.

    task_lines  {number of a task: its line}
    units       lines of the units of these packings
    """
    lines = []
    if len(task_lines) < len(tasks):
        lines.append(f"{len(tasks) - len(task_lines)} of {len(tasks)} packings are there already")
    if 0 < len(task_lines) < ranks:
        idle = ranks - len(task_lines)
        lines.append(f"one rank makes a packing: {idle} of {ranks} ranks had nothing to do")
    return "\n".join([*lines, *task_lines.values(), *dict.fromkeys(units)])


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


def _line(name, disks, seconds) -> str:
    """A line about a packing, with its notes below."""
    record = disks.record
    line = (
        f"{name}: N = {disks.n}{_sizes_text(record)}, p = {record['pressure']:.6g}, phi = {record['phi']:.6f}, "
        f"Z = {record['coordination']:.4f}, "
        f"{record['rattlers']} rattlers, max|F|/p = {record['max_force'] / record['pressure']:.1e}, "
        f"{record['evaluations']} force evaluations, {seconds:.2f} s"
    )
    return "\n".join([line, *note_lines(rounding_notes(disks))])
