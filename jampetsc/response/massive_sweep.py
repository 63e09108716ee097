"""A sweep G*(ω) or C*(ω) of a pencil with masses: steps that can be resumed, frequencies by `direct`, fields."""

from dataclasses import dataclass

import numpy as np

from jampetsc.analysis.reduced_inertia import ReducedInertia
from jampetsc.collective import on_root
from jampetsc.errors import InputError, named
from jampetsc.laws.loads import ForceLoad
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.session import current
from jampetsc.progress import Progress
from jampetsc.response.assembled_matrices import corners
from jampetsc.response.assembly import Pencil
from jampetsc.response.direct import FrequencySolver
from jampetsc.response.direct_sweep import DirectSteps
from jampetsc.response.modulus_sweep import (
    DisplacementField,
    FloppyModesExplained,
    ModulusSweep,
    TensorModuli,
    mean_shear,
)
from jampetsc.response.second_order_basis import Chain
from jampetsc.response.second_order_sweep import SecondOrderSweep

ZERO_STIFFNESS = 1e-13  # of the largest in the space: below it is rounding
DIRECT = "direct"  # key of a step that is a frequency


@dataclass
class _Steps:
    """Finished steps and what saves them. Each has grown the space of its `group`."""

    done: dict
    save: object

    def of(self, group):
        """(record, arrays) of the steps of a group, in their order."""
        return [self.done[number] for number in sorted(self.done) if self.done[number][0]["group"] == group]

    def add(self, group, record, arrays):
        number = max(self.done, default=-1) + 1
        self.done[number] = record | {"group": group}, arrays
        if self.save is not None:
            self.save(number, *self.done[number])


def sweep_with_inertia(
    pencil: Pencil, omega, accuracy: float, loads=None, field_omega=(), resume=None, save=None
) -> ModulusSweep:
    """The whole spectrum of a pencil with masses, see `second_order_sweep`. Collective; needs the real build.

    Arguments as for `modulus_sweep.sweep_rationally`. Strains share one reduced space, forces have one each.
    Frequencies that the space cannot certify are solved one by one, and are counted in `direct` of the result.

    Raises InputError where a factorisation shows that K has negative modes, ConvergenceError if all frequencies fail.
    """
    loads, steps = list(loads or [pencil.load]), _Steps(dict(resume or {}), save)
    are_forces = isinstance(loads[0], ForceLoad)
    groups, first, results = [[load] for load in loads] if are_forces else [loads], None, []
    with FloppyModesExplained(pencil), Progress(None, "sweep", pencil.network.comm.rank) as progress:
        for number, group in enumerate(groups):
            try:
                with current().stage("assembly"):
                    sweep = SecondOrderSweep(
                        [pencil.under(load) for load in group], omega, accuracy, field_omega, first
                    )
                first = first or sweep
                _grow(sweep, number, steps, progress)
            except NotPositiveDefinite as error:
                raise InputError(f"{error.message(named)}. Use {named('method')} direct.") from None
            alone = _solve_directly(sweep, number, field_omega, steps, progress)
            results.append(_collect(sweep, alone))
    return _joined(results) if are_forces else results[0]


def _grow(sweep, group, steps, progress):
    """Extend the space until all is certified or nothing helps, from the finished steps of its group."""
    _restore(sweep, [step for step in steps.of(group) if DIRECT not in step[0]])
    for shift, count in sweep.steps():
        before = sweep.basis.size
        with current().stage("shift"):
            sweep.extend(shift, count)
        steps.add(group, *_step(sweep, shift, before))
        progress.step(
            f"shift {shift:.2e}  vectors {sweep.basis.size}  worst bound / allowed {sweep.worst:.1e}"
        )


def _joined(results):
    """One `ModulusSweep` of several ones of forces, at the frequencies that all have."""
    failures = {at: error for result in results for at, error in result.failures.items()}
    omega = [at for at in results[0].omega if at not in failures]
    rows = [np.isin(result.omega, omega) for result in results]
    G, bounds = (
        np.stack([getattr(result, name)[kept] for result, kept in zip(results, rows, strict=True)], axis=1)
        for name in ("G", "bounds")
    )
    work = {
        "factorisations": results[0].factorisations,
        "vectors": sum(result.vectors for result in results),
        "direct": max(result.direct for result in results),
    }
    if not omega:
        raise next(iter(failures.values()))
    return ModulusSweep(np.array(omega), G, bounds, [], failures, **work)


def _step(sweep, shift, before):
    """(record, arrays) of a step that grew a space of `before` vectors at a shift."""
    chains = [
        (load, *(part.tolist() for part in (chain.x, chain.v, chain.constant)), chain.refused)
        for (load, s), chain in sweep.basis.chains.items()
        if s == shift
    ]
    record = {
        "shift": shift,
        "chains": chains,
        "ratios": list(sweep.ratios),
        "omega_c": sweep.definiteness.omega_c if sweep.is_tested else None,
    }
    return record, {"vectors": sweep.basis.vectors[before:].copy()}


def _restore(sweep, done):
    for record, arrays in done:
        sweep.basis.restore(arrays["vectors"])
        sweep.add_shift(record["shift"])
        for load, x, v, constant, refused in record["chains"]:
            chain = Chain(*(np.array(part, float) for part in (x, v, constant)), refused)
            sweep.basis.chains[load, record["shift"]] = chain
        sweep.resume(record["ratios"], record["omega_c"])


@dataclass(frozen=True, eq=False)
class _Alone:
    """Frequencies that were solved one by one."""

    solved: dict  # {ω: (record, arrays)}
    failures: dict  # {ω: ConvergenceError}
    factorisations: int


def _solve_directly(sweep, group, field_omega, steps, progress):
    """Solve those frequencies that the space does not certify."""
    solved = {record[DIRECT]: (record, arrays) for record, arrays in steps.of(group) if DIRECT in record}
    missing = [at for at in map(float, sweep.omega) if at not in solved and at not in sweep.solutions]
    failures, factorisations = {}, 0
    if missing:
        solver = FrequencySolver(sweep.pencil, loads=[pencil.load for pencil in sweep.pencils])
        direct = DirectSteps(solver, sweep.accuracy, field_omega, progress)
        for at in missing:
            step = direct.solve(at)
            if step is not None:
                record, arrays = step
                solved[at] = record | {DIRECT: at}, arrays
                steps.add(group, *solved[at])
        failures, factorisations = direct.failures, direct.factorisations
    factorisations += sum(record["factorisations"] for record, _ in solved.values())
    return _Alone(solved, failures, factorisations)


def _collect(sweep, alone):
    """The `ModulusSweep` of certified frequencies and of those that were solved alone."""
    own, many = alone.solved, len(sweep.pencils) > 1
    kept = [at for at in map(float, sweep.omega) if at in own or at in sweep.solutions]
    if not kept:
        raise next(iter(alone.failures.values()))
    G, bounds, C, C_bounds, fields = [], [], [], [], []
    for at in kept:
        if at in own:
            record, arrays = own[at]
            G.append(np.ravel(record["G"])[0])
            bounds.append(np.reshape(record["bounds"], (-1, 3))[0])
            tensor = record.get("C"), record.get("C_bounds")
            if arrays is not None:
                values = arrays["displacement"], arrays.get("rotation"), record["field_bound"]
                fields.append(DisplacementField(at, *values))
        else:
            solution = sweep.solutions[at]
            G.append(solution.certificates[0].G)
            bounds.append(solution.certificates[0].bounds)
            tensor = solution.C, solution.C_bounds
            if solution.x is not None:
                fields.append(DisplacementField(at, *sweep.pencil.split(solution.x), solution.field_bound))
        C.append(tensor[0])
        C_bounds.append(tensor[1])
    work = {
        "factorisations": sweep.factorisations + alone.factorisations,
        "vectors": sweep.basis.size,
        "direct": len(own),
    }
    is_whole = not own and not alone.failures  # else it is not certified between frequencies
    reduced = reduced_inertia(sweep) if is_whole and not sweep.pencil.exerts_forces else None
    omega = np.array(kept)
    if many:
        tensor = TensorModuli(np.array(C), np.array(C_bounds))
        return ModulusSweep(
            omega, *mean_shear(tensor), [], alone.failures, **work, tensor=tensor, inertia=reduced
        )
    return ModulusSweep(omega, np.array(G), np.array(bounds), fields, alone.failures, **work, inertia=reduced)


def reduced_inertia(sweep: SecondOrderSweep) -> ReducedInertia:
    """The reduced pencil of a sweep, in the eigenvectors of its K. Collective."""
    basis, volume = sweep.basis, sweep.network.volume
    stiffness, rotation = on_root(sweep.network.comm, lambda: np.linalg.eigh(basis.K))
    # of spins that K does not turn: rounding would exceed their damping at low frequency
    stiffness[np.abs(stiffness) < ZERO_STIFFNESS * stiffness.max(initial=0.0)] = 0.0
    k_gg, b_gg = corners(sweep.pencils)
    return ReducedInertia(
        stiffness,
        rotation.T @ basis.B @ rotation,
        basis.k @ rotation / np.sqrt(volume),
        basis.b @ rotation / np.sqrt(volume),
        k_gg / volume,
        b_gg / volume,
    )
