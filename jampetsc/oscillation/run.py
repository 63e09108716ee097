"""Steady oscillations at several amplitudes and frequencies: progress, checkpoint, failures, result file."""

import contextlib
import time
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from jampetsc.errors import ConvergenceError, InputError, about, named
from jampetsc.io.outlet import Outlet
from jampetsc.io.packing_file import read_identified, source_name
from jampetsc.network.contact_network import Network, build_network
from jampetsc.oscillation.dashpots import LINEAR_BELOW
from jampetsc.oscillation.halfcycles import SteppedOscillation
from jampetsc.oscillation.powerlaw import relative_softening
from jampetsc.oscillation.repeated import START_STEPS, repeat_cycles
from jampetsc.oscillation.response import HARMONICS, Drive, Response
from jampetsc.oscillation.steady import LEAST_ALPHA, SteadyOscillation
from jampetsc.packing.disks import Disks
from jampetsc.petsc.session import current
from jampetsc.progress import Progress
from jampetsc.response.elastic import ElasticResponse
from jampetsc.response.minimum_check import examine_balance
from jampetsc.response.run_record import run_record

COUNTS = ("newton_steps", "linear_iterations", "factorisations", "steps_taken", "cycles", "half_cycles")


class _Solver(NamedTuple):
    """How the points (amplitude, frequency) of a job are solved."""

    solve: Callable[[Drive], Response]
    alone: bool  # whether each rank solves points of its own; else all ranks work on one point
    facts: dict  # attributes of the file


def _solver(job, disks: Disks, network: Network) -> _Solver:
    """The _Solver of a job for a packing. Collective."""
    law, moving, sticks = job.physics.law, job.contacts == "moving", job.alpha < LEAST_ALPHA
    alone, steps = moving or sticks, START_STEPS if moving else job.steps
    with current().alone() if alone else contextlib.nullcontext():
        if alone:
            network = build_network(disks, current().comm, job.prestress)
        kind = SteppedOscillation if sticks else SteadyOscillation
        oscillation = kind(network, law, 2.0 * float(disks.radii.mean()), steps)

    def with_moving_contacts(drive):
        return repeat_cycles(disks, law, oscillation.start(drive), job.steps, job.cycles)

    if alone:
        facts = {"solver": "steps", "regularisation": LINEAR_BELOW**job.alpha if job.alpha != 1.0 else 0.0}
    else:
        facts = {"solver": "cycle", "regularisation": relative_softening(job.alpha)}
    return _Solver(with_moving_contacts if moving else oscillation.solve, alone, facts)


def solve(job, to: Outlet) -> dict:
    """Solve every point of a `commands.oscillate.Oscillate` that no earlier run has finished, and write. Collective.

    Returns {dataset: array}, first axes (A, M), nan where a point failed. Raises InputError for a packing that is not
    a rigid minimum or, where a stress is imposed, has no positive shear modulus; ConvergenceError, after writing the
    others, if some points failed.
    """
    started = time.perf_counter()
    session = current()
    disks, identity = read_identified(job.packing, session.comm)
    to.made_from(disks)
    with session.stage("assembly"), about(source_name(job.packing)):
        examine_balance(source_name(job.packing), disks, session.comm)
        network = build_network(disks, session.comm, job.prestress)
        _require_stable(network, job.control)
    solver = _solver(job, disks, network)
    checkpoint = to.checkpoint(job.key(identity), session.comm)
    failures = _solve_all(job, solver, checkpoint)
    if not checkpoint.done:
        raise next(iter(failures.values()))
    arrays = _arrays(job, checkpoint.done)
    with session.stage("output"), to.writer(job.FORMAT, session.comm) as writer:
        writer.dataset("omega", job.omega)
        writer.dataset("amplitude", job.amplitude)
        for name, values in arrays.items():
            writer.dataset(name, values)
        writer.attributes(
            **run_record(disks, identity, job.parameters, network, started),
            control=job.control,
            contacts=job.contacts,
            steps=job.steps,
            **solver.facts,
        )
    if failures:
        first = failures[min(failures)]
        raise ConvergenceError(
            f"{len(failures)} of {len(job.amplitude) * len(job.omega)} points failed, {to.others}; the first: "
            f"{first.message(named)}"
        )
    checkpoint.remove()
    return arrays


def _require_stable(network: Network, control: str):
    """Raise InputError for a packing that is unstable under this control. Collective.

    An imposed strain fixes the shape of the cell. Under a stress the cell shears, so that a negative shear modulus is
    one more negative mode: the equations still have a periodic solution then, but an unstable one.
    """
    elastic = ElasticResponse(network)  # refuses packings with negative or floppy modes
    modulus = elastic.shear().value / network.area if control == "stress" else np.inf
    if not modulus > 0.0:
        raise InputError(
            f"its shear modulus is {modulus:.2g}: no stress can be imposed on such a packing; impose a "
            f"{named('strain')}, or relax the shear of its cell (pack {named('stabilise')} shear)"
        )


def _outcomes(solver, drives) -> list:
    """The record of each oscillation, or the ConvergenceError that it ended with. Collective."""

    def outcome(drive):
        try:
            return solver.solve(drive).record()
        except ConvergenceError as error:
            return error

    session = current()
    if not solver.alone:
        return [outcome(drive) for drive in drives]
    found, comm = None, session.comm
    if session.rank < len(drives):
        with session.alone():
            found = outcome(drives[comm.rank])
    return comm.allgather(found)[: len(drives)]


def _solve_all(job, solver, checkpoint):
    """Solve and save the points that are not done; {index: ConvergenceError} of those that failed."""
    session, failures = current(), {}
    drives = [
        Drive(float(omega), float(amplitude), job.control == "stress")
        for amplitude in job.amplitude
        for omega in job.omega
    ]
    left = [index for index in range(len(drives)) if index not in checkpoint.done]
    together = session.size if solver.alone else 1
    with Progress(len(drives), "oscillate", session.rank, done=len(checkpoint.done)) as progress:
        if checkpoint.done:
            progress.note(f"continuing {checkpoint.journal}: {len(checkpoint.done)} points are finished")
        while left:
            now, left = left[:together], left[together:]
            with session.stage("oscillation"):
                outcomes = _outcomes(solver, [drives[index] for index in now])
            for index, found in zip(now, outcomes, strict=True):
                name = f"omega {drives[index].omega:.3e}  {job.control} {drives[index].amplitude:.1e}"
                if isinstance(found, ConvergenceError):
                    failures[index] = ConvergenceError(f"{name}: {found.message(named)}")
                    progress.step(f"failed: {name}: {found}")
                    continue
                checkpoint.save(index, found)
                counts = ", ".join(
                    f"{count.removesuffix('_steps').removesuffix('_iterations').replace('_', ' ')} {found[count]}"
                    for count in COUNTS
                    if count in found
                )
                G = found["G"]
                progress.step(
                    f"{name}  G' {G.real:.6e}  G'' {G.imag:.6e}  error {found['error']:.1e}  {counts}"
                )
    return failures


def _arrays(job, done):
    """Datasets (A, M, …) from the records of finished points."""
    shape = (len(job.amplitude), len(job.omega))
    arrays = {}
    for name in next(iter(done.values())):
        more = (HARMONICS,) if name == "harmonics" else ()
        kind = complex if name in ("G", "harmonics") else int if name in COUNTS else float
        values = np.full((shape[0] * shape[1], *more), 0 if kind is int else np.nan, kind)
        for index, record in done.items():
            values[index] = record[name]
        arrays[name] = values.reshape(*shape, *more)
    return arrays
