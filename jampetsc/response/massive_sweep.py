"""A sweep G*(ω) or C*(ω) of a pencil with masses: steps that can be resumed, frequencies by `direct`, fields."""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.reduced_inertia import ReducedInertia
from jampetsc.collective import on_root
from jampetsc.errors import ConvergenceError, InputError, named
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.session import current
from jampetsc.progress import Progress
from jampetsc.response.assembled_matrices import corners
from jampetsc.response.assembly import Pencil
from jampetsc.response.direct import FrequencySolver
from jampetsc.response.modulus_sweep import (
    DisplacementField,
    FloppyModesExplained,
    ModulusSweep,
    TensorModuli,
    direct_step,
    mean_shear,
)
from jampetsc.response.second_order_basis import Chain
from jampetsc.response.second_order_sweep import SecondOrderSweep

ZERO_STIFFNESS = 1e-13  # of the largest in the space: below it is rounding
DIRECT = "direct"  # key of a step that is a frequency


@dataclass
class _Steps:
    """Finished steps and what saves them."""

    done: dict
    save: object

    def add(self, record, arrays):
        number = max(self.done, default=-1) + 1
        self.done[number] = record, arrays
        if self.save is not None:
            self.save(number, record, arrays)


def sweep_with_inertia(
    pencil: Pencil, omega, accuracy: float, loads=None, field_omega=(), resume=None, save=None
) -> ModulusSweep:
    """The whole spectrum of a pencil with masses, see `second_order_sweep`. Collective; needs the real build.

    Arguments as for `modulus_sweep.sweep_rationally`. Frequencies that the reduced space cannot certify are solved one
    by one, and are counted in `direct` of the result.

    Raises InputError where a factorisation shows that K has negative modes, ConvergenceError if all frequencies fail.
    """
    steps = _Steps(dict(resume or {}), save)
    with FloppyModesExplained(pencil), Progress(None, "sweep", pencil.network.comm.rank) as progress:
        try:
            with current().stage("assembly"):
                loads = list(loads or [pencil.load])
                sweep = SecondOrderSweep([pencil.under(load) for load in loads], omega, accuracy)
            _restore(sweep, steps.done)
            for shift, count in sweep.steps():
                before = sweep.basis.size
                with current().stage("shift"):
                    sweep.extend(shift, count)
                steps.add(*_step(sweep, shift, before))
                progress.step(
                    f"shift {shift:.2e}  vectors {sweep.basis.size}  worst bound / allowed {sweep.worst:.1e}"
                )
        except NotPositiveDefinite as error:
            raise InputError(f"{error.message(named)}. Use {named('method')} direct.") from None
        solved = sweep.evaluate(sweep.omega)
        failing = sweep.omega[solved.ratio > 1.0]
        own, failures, factorisations = _solve_directly(
            pencil, loads, failing, accuracy, field_omega, steps, progress
        )
    return _collect(sweep, solved, own, failures, factorisations, field_omega)


def _step(sweep, shift, before):
    """(record, arrays) of a step that grew a space of `before` vectors at a shift."""
    chains = [
        (load, [part.tolist() for part in chain.x], [part.tolist() for part in chain.v], list(chain.constant),
         chain.refused)
        for (load, s), chain in sweep.basis.chains.items()
        if s == shift
    ]  # fmt: skip
    record = {
        "shift": shift,
        "chains": chains,
        "ratios": list(sweep.ratios),
        "omega_c": sweep.known.omega_c if sweep.is_tested else None,
    }
    return record, {"vectors": sweep.basis.vectors[before:].copy()}


def _restore(sweep, done):
    for number in sorted(done):
        record, arrays = done[number]
        if DIRECT in record:
            continue
        sweep.basis.restore(arrays["vectors"])
        sweep.add_shift(record["shift"])
        for load, x, v, constant, refused in record["chains"]:
            chain = Chain(
                [np.array(part) for part in x], [np.array(part) for part in v], list(constant), refused
            )
            sweep.basis.chains[load, record["shift"]] = chain
        sweep.resume(record["ratios"], record["omega_c"])


def _solve_directly(pencil, loads, failing, accuracy, field_omega, steps, progress):
    """({ω: (record, arrays)}, {ω: ConvergenceError}, factorisations) of the frequencies `failing`."""
    own = {record[DIRECT]: (record, arrays) for record, arrays in steps.done.values() if DIRECT in record}
    failures, solver, factorisations = {}, None, 0
    for at in map(float, failing):
        if at in own:
            continue
        solver = solver or FrequencySolver(pencil, loads=loads)
        previous = solver.factorisations
        try:
            with current().stage("frequency"):
                results = solver.solve_loads(at, accuracy)
        except ConvergenceError as error:
            failures[at] = error
            factorisations += solver.factorisations - previous
            progress.step(f"failed: {error}")
            continue
        record, arrays = direct_step(solver, results, solver.factorisations - previous, at in field_omega)
        own[at] = record | {DIRECT: at}, arrays
        steps.add(*own[at])
        progress.step(f"omega {at:.3e} alone  bound {results[0].bounds[0]:.1e}")
    factorisations += sum(record["factorisations"] for record, _ in own.values())
    return own, failures, factorisations


def _collect(sweep, solved, own, failures, factorisations, field_omega):
    """The `ModulusSweep` of certified frequencies and of those that were solved alone."""
    many = len(sweep.pencils) > 1
    kept = [number for number, at in enumerate(sweep.omega) if at in own or not solved.ratio[number] > 1.0]
    if not kept:
        raise next(iter(failures.values()))
    G, bounds, C, C_bounds, fields = [], [], [], [], []
    for number in kept:
        at, results = float(sweep.omega[number]), solved.certificates[number]
        record, arrays = own.get(at, (None, None))
        G.append(record["G"] if record else results[0].G)
        bounds.append(record["bounds"] if record else results[0].bounds)
        if many:
            values = (record["C"], record["C_bounds"]) if record else sweep.tensor(results)
            C.append(values[0])
            C_bounds.append(values[1])
        elif at in field_omega and record:
            fields.append(
                DisplacementField(at, arrays["displacement"], arrays.get("rotation"), record["field_bound"])
            )
        elif at in field_omega:
            x, bound = sweep.field(results[0])
            fields.append(DisplacementField(at, *sweep.pencil.split(x), bound))
    work = {
        "factorisations": sweep.factorisations + factorisations,
        "vectors": sweep.basis.size,
        "direct": len(own),
    }
    reduced = (
        None if own or failures else reduced_inertia(sweep)
    )  # else it is not certified between frequencies
    omega = sweep.omega[kept]
    if many:
        tensor = TensorModuli(np.array(C), np.array(C_bounds))
        return ModulusSweep(omega, *mean_shear(tensor), [], failures, **work, tensor=tensor, inertia=reduced)
    return ModulusSweep(omega, np.array(G), np.array(bounds), fields, failures, **work, inertia=reduced)


def reduced_inertia(sweep: SecondOrderSweep) -> ReducedInertia:
    """The reduced pencil of a sweep, in the eigenvectors of its K. Collective."""
    basis, volume = sweep.basis, sweep.network.volume
    stiffness, rotation = on_root(sweep.network.comm, lambda: np.linalg.eigh(basis.K))
    # of spins that K does not turn: rounding would exceed their damping at low frequency
    stiffness[np.abs(stiffness) < ZERO_STIFFNESS * stiffness[-1]] = 0.0
    k_gg, b_gg = corners(sweep.pencils)
    return ReducedInertia(
        stiffness,
        rotation.T @ basis.B @ rotation,
        basis.k @ rotation / np.sqrt(volume),
        basis.b @ rotation / np.sqrt(volume),
        k_gg / volume,
        b_gg / volume,
    )
