"""Steady oscillations at several amplitudes and frequencies: progress, checkpoint, failures, result file."""

import time

import numpy as np

from jampetsc.core.disks import Disks
from jampetsc.errors import ConvergenceError, InputError, named
from jampetsc.io.outlet import Outlet
from jampetsc.io.packing_file import read_identified, source_told
from jampetsc.linear.elastic import ElasticResponse
from jampetsc.linear.record import run_record
from jampetsc.mechanics.assembly import assemble
from jampetsc.mechanics.compatibility import build_compatibility
from jampetsc.mechanics.network import Network, build_network
from jampetsc.oscillation.dashpots import REST
from jampetsc.oscillation.halfcycles import SteppedOscillation
from jampetsc.oscillation.harmonics import HARMONICS
from jampetsc.oscillation.powerlaw import relative_softening
from jampetsc.oscillation.repeated import START_STEPS, Start, shake
from jampetsc.oscillation.steady import LEAST_ALPHA, Point, SteadyOscillation
from jampetsc.petsc.session import current
from jampetsc.progress import Progress

COUNTS = ("newton_steps", "linear_iterations", "factorisations", "steps_taken", "cycles", "half_cycles")


class _Fixed:
    """Oscillations with the contacts of the packing, a cycle at once, one after the other, on all ranks together."""

    together = 1  # points solved at the same time

    def __init__(self, job, disks: Disks, network: Network):
        self._items = [assemble(network, job.physics.law)]
        self._items.append(build_compatibility(self._items[0]))
        self._oscillation = SteadyOscillation(self._items[1], 2.0 * float(disks.radii.mean()), job.steps)
        self.facts = {"solver": "cycle", "regularisation": relative_softening(job.physics.law.exponent)}

    def solve(self, points) -> list:
        """The record of each point, or the ConvergenceError that it ended with. Collective."""
        return [_outcome(self._oscillation.solve, point) for point in points]

    def destroy(self):
        """Free PETSc's objects."""
        for item in (self._oscillation, *reversed(self._items)):
            item.destroy()


class _InTime:
    """Oscillations by steps in time, one on each rank at a time."""

    def __init__(self, job, disks: Disks, network: Network):
        alpha = job.physics.law.exponent
        self.facts = {"solver": "steps", "regularisation": 0.0 if alpha == 1.0 else REST**alpha}
        self._job, self._disks, self._comm = job, disks, network.comm
        self.together = self._comm.size
        with current().alone():
            self._prepare(build_network(disks, current().comm, job.physics.prestress))

    def solve(self, points) -> list:
        """The record of each point, or the ConvergenceError that it ended with. Collective."""
        found = None
        if self._comm.rank < len(points):
            with current().alone():
                found = _outcome(self._one, points[self._comm.rank])
        return self._comm.allgather(found)[: len(points)]

    def _stepped(self, network, steps):
        return SteppedOscillation(
            network, self._job.physics.law, 2.0 * float(self._disks.radii.mean()), steps
        )


class _Sticking(_InTime):
    """With the contacts of the packing and so small an exponent that they stick."""

    def _prepare(self, network):
        self._one = self._stepped(network, self._job.steps).solve

    def destroy(self):
        """Nothing outlives a point."""


class _Moving(_InTime):
    """Of contacts that open and close."""

    def _prepare(self, network):
        job, self._items = self._job, []
        if _sticks(job):
            self._start, self._oscillation = Start.of_steps, self._stepped(network, START_STEPS)
            return
        self._items.append(assemble(network, job.physics.law))
        self._items.append(build_compatibility(self._items[0]))
        diameter = 2.0 * float(self._disks.radii.mean())
        self._items.append(SteadyOscillation(self._items[1], diameter, START_STEPS))
        self._start, self._oscillation = Start.of, self._items[-1]

    def _one(self, point):
        start = self._start(self._oscillation, self._disks.n, point)
        return shake(self._disks, self._job.physics.law, start, self._job.steps, self._job.cycles)

    def destroy(self):
        """Free PETSc's objects."""
        for item in reversed(self._items):
            item.destroy()


def _outcome(solve, point):
    try:
        return solve(point).record()
    except ConvergenceError as error:
        return error


def _sticks(job) -> bool:
    """Whether the exponent is too small for a cycle to be solved at once."""
    return job.alpha < LEAST_ALPHA


def solve(job, to: Outlet) -> dict:
    """Solve every point of a `jobs.oscillate.Oscillate` that no earlier run has finished, and write. Collective.

    Returns arrays of what the records hold, first axes (A, M), nan where a point failed. Raises InputError for a
    packing that is not a rigid minimum, ConvergenceError, after writing the others, if some points failed.
    """
    started = time.perf_counter()
    session = current()
    disks, identity = read_identified(job.packing, session.comm)
    to.made_from(disks)
    with session.stage("assembly"):
        try:
            network = build_network(disks, session.comm, job.physics.prestress)
            ElasticResponse(network).destroy()  # refuses what has negative or floppy modes
        except InputError as error:
            raise InputError(f"{source_told(job.packing)}: {error.told(named)}") from None
        kind = _Moving if job.contacts == "moving" else _Sticking if _sticks(job) else _Fixed
        solver = kind(job, disks, network)
    checkpoint = to.checkpoint(job.key(identity), session.comm)
    failures = _solve_all(job, solver, checkpoint)
    facts = solver.facts
    solver.destroy()
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
            **facts,
        )
    if failures:
        first = failures[min(failures)]
        raise ConvergenceError(
            f"{len(failures)} of {len(job.amplitude) * len(job.omega)} points failed, the others are in {to}; "
            f"the first: {first.told(named)}"
        )
    checkpoint.remove()
    return arrays


def _solve_all(job, solver, checkpoint):
    """Solve and save what is not done; {index: ConvergenceError} of what failed."""
    session, failures = current(), {}
    total = len(job.amplitude) * len(job.omega)
    points = [
        Point(float(omega), float(amplitude), job.control == "stress")
        for amplitude in job.amplitude
        for omega in job.omega
    ]
    left = [index for index in range(total) if index not in checkpoint.done]
    with Progress(total, "oscillate", session.rank, done=len(checkpoint.done)) as progress:
        if checkpoint.done:
            progress.note(f"continuing {checkpoint.journal}: {len(checkpoint.done)} points are finished")
        while left:
            now, left = left[: solver.together], left[solver.together :]
            with session.stage("oscillation"):
                outcomes = solver.solve([points[index] for index in now])
            for index, found in zip(now, outcomes, strict=True):
                name = f"omega {points[index].omega:.3e}  {job.control} {points[index].amplitude:.1e}"
                if isinstance(found, ConvergenceError):
                    failures[index] = ConvergenceError(f"{name}: {found.told(named)}")
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
    """Datasets (A, M, …) out of the records of finished points."""
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
