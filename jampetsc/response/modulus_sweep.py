"""A rational sweep G*(ω) or C*(ω) of a pencil, and what any sweep gives: steps that can be resumed, failures, fields.

A finished step is a record, numbers that all ranks have, and arrays, this rank's rows. `save(step, record, arrays)`
takes each; `resume` gives the steps of an earlier run, {step: (record, arrays or None)}, which are not repeated.

C*(ω) of several loads has the solution of each load in its own space, with factors in common. Between two loads the
stationary value of the bilinear form is off by r_EᵀA⁻¹r_E′ for any spaces (`certificate`), so the bound of each load
bounds all pairs: |ΔC_EE′| ≤ √(bound_E bound_E′), and no larger common space is needed.
"""

import itertools
from dataclasses import dataclass, fields

import numpy as np

from jampetsc.analysis.elasticity import ReducedTensor, dimension_of, shear_modulus, shear_weights
from jampetsc.analysis.reduced_inertia import ReducedInertia
from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.errors import ConvergenceError, InputError, named
from jampetsc.laws.loads import ForceLoad
from jampetsc.petsc.cholesky import NotPositiveDefinite
from jampetsc.petsc.session import current
from jampetsc.progress import Progress
from jampetsc.response import tall
from jampetsc.response.assembly import ROW, Pencil
from jampetsc.response.certificate import ROUNDING, Certified, pair_bounds
from jampetsc.response.galerkin import Galerkin
from jampetsc.response.minimum_check import floppy_modes, shared_zero_modes
from jampetsc.response.rational import VECTORS, RationalSweep

# estimated over allowed error of a load below which others do with a vector less at each shift: their error is some 13
# times as large
SPARE_ERROR_RATIO = 0.05


@dataclass(frozen=True, eq=False)
class _Solution:
    """What is kept of the sweep of a load."""

    certificate: Certified
    vectors: int
    galerkin: Galerkin | None  # of strains, whose fields make up what follows


class TensorProjection:
    """K and B between the solutions of several loads. Collective.

    galerkins   the `Galerkin` of each load, of pencils that differ in the load alone
    """

    def __init__(self, galerkins: list[Galerkin]):
        solutions = [_Columns(galerkin) for galerkin in galerkins]
        network = galerkins[0].network
        local = [_between(*pair) for pair in itertools.combinations(solutions, 2)]
        between = [[network.sum(matrix) for matrix in pair] for pair in local]
        sizes = [len(solution.rates) for solution in solutions]
        K, B = ([[None] * len(sizes) for _ in sizes] for _ in range(2))
        for number, solution in enumerate(solutions):
            K[number][number], B[number][number] = solution.own
        numbers = itertools.combinations(range(len(sizes)), 2)
        for (first, second), blocks in zip(numbers, between, strict=True):
            loads = (galerkins[number].pencil.load for number in (first, second))
            blocks[1][0, 0] += galerkins[0].pencil.compatibility.fluid_gg(*loads)
            for matrix, block in zip((K, B), blocks, strict=True):
                matrix[first][second], matrix[second][first] = block, block.T
        self.reduced = ReducedTensor(
            np.concatenate([solution.rates for solution in solutions]),
            np.concatenate([solution.forces for solution in solutions]),
            np.repeat(np.arange(len(sizes)), sizes),
            np.block(K) / network.volume,
            np.block(B) / network.volume,
        )
        # (2, c) in K and in B: roots of Σ w a² over V, and of the terms of the motions a
        self._noise = [
            np.concatenate([getattr(solution, name) for solution in solutions], axis=1)
            / np.sqrt(network.volume)
            for name in ("sizes", "reach")
        ]

    def certify(self, certificates: list[Certified]):
        """C (M, L, L), complex, and bounds on |ΔC|, |ΔC'| and |ΔC''|, (M, L, L, 3), where all loads are certified."""
        omega = certificates[0].omega
        C, weights = self.reduced.modulus(omega), self.reduced.weights(omega)
        weights = np.abs(np.stack((weights.real, weights.imag), axis=2))  # (M, L, 2, c)
        in_K, in_B = ([weights @ noise[part] for noise in self._noise] for part in (0, 1))
        errors = np.transpose([certificate.error for certificate in certificates])
        bounds = pair_bounds(errors, in_K, in_B, omega, 2.0 * ROUNDING)
        for number, certificate in enumerate(certificates):
            C[:, number, number] = certificate.G
            bounds[:, number, number] = certificate.bounds
        return C, bounds


class _Columns:
    """The fields of one load, the quasistatic one and its modes, with their motions. Collective."""

    def __init__(self, galerkin: Galerkin):
        c, network, spectrum = galerkin.pencil.compatibility, galerkin.network, galerkin.spectrum
        self.compatibility, h = c, galerkin.loads
        self.fields = np.vstack((galerkin.quasistatic, galerkin.modes.T)).T
        self.motions = np.empty((self.fields.shape[1], len(c.g))).T
        for motion, field in zip(self.motions.T, self.fields.T, strict=True):
            motion[:] = c.motions(field)
        self.motions[:, 0] += c.g
        self.rates, self.forces = np.append(np.inf, spectrum.rates), np.append(0.0, h)
        # Modes are orthonormal in B, their rates are K; the quasistatic field has no force in K on them, h in B.
        volume = network.volume
        K, B = np.diag(np.append(spectrum.G0 * volume, spectrum.rates)), np.eye(len(self.rates))
        B[0, 0] = spectrum.eta_inf * volume + h @ h
        B[0, 1:] = B[1:, 0] = h
        self.own = K, B
        sizes = network.sum(tall.squares(self.motions, np.array([c.size_K, c.w_B])))
        sizes[1] += network.sum(tall.squares(self.fields, c.drag[None])[0])
        sizes[1, 0] += c.drag_gg
        reach = ROW[network.dimension] * network.sum(
            tall.squares(self.fields, np.array([c.reach_K, c.reach_B]))
        )
        reach[:, 0] += c.affine_sizes
        self.sizes, self.reach = np.sqrt(sizes), np.sqrt(reach)


def _between(first, second):
    """This rank's part of K and of B between the columns of two loads, what the fluid adds left out."""
    c = first.compatibility
    K, B = (tall.gram(first.motions, w, second.motions) for w in (c.w_K, c.w_B))
    return K, B + tall.gram(first.fields, c.drag, second.fields) if c.drag.any() else B


@dataclass(frozen=True, eq=False)
class DisplacementField:
    """Motion at one frequency per unit strain. Arrays hold this rank's part."""

    omega: float
    displacement: np.ndarray  # (n_local, D) complex, non-affine, without the mean of each piece
    rotation: np.ndarray | None  # (n_local,), in 3D (n_local, 3), complex, where disks roll
    error_bound: float  # relative, in the energy norm


@dataclass(frozen=True, eq=False)
class TensorModuli:
    """Elastic constants C* of L loads at M frequencies."""

    C: np.ndarray  # (M, L, L) complex
    bounds: np.ndarray  # (M, L, L, 3) on |ΔC|, |ΔC'| and |ΔC''|
    reduced: ReducedTensor | None = None  # of the rational method: C at any frequency


@dataclass(frozen=True, eq=False)
class ModulusSweep:
    """G* of one pencil at M frequencies, the same on all ranks; of a tensor the shear modulus of all directions."""

    omega: np.ndarray  # (M,) those that were solved
    G: np.ndarray  # (M,) complex; of L loads that are forces (M, L), −χ/V of each
    bounds: np.ndarray  # (M, 3) on |ΔG*|, |ΔG'| and |ΔG''|; of forces (M, L, 3)
    fields: list  # of `DisplacementField`, at those field frequencies that were solved
    failures: dict  # {ω: ConvergenceError}, of the direct method
    factorisations: int
    vectors: int | None = None  # of the rational method: size of the reduced space
    spectrum: RelaxationSpectrum | None = None  # of the same, of one load
    tensor: TensorModuli | None = None  # of the loads of a tensor
    inertia: ReducedInertia | None = None  # with masses, if the space certified all frequencies
    direct: int = 0  # with masses: frequencies that the reduced space could not certify


def sweep_rationally(
    pencil: Pencil,
    omega,
    accuracy: float,
    loads=None,
    field_omega=(),
    parallel: str = "auto",
    resume: dict | None = None,
    save=None,
) -> ModulusSweep:
    """The whole spectrum from a few factorisations, see `rational`. Collective; needs the real build.

    omega         (M,) increasing, in 1/time
    accuracy      relative, allowed in G' and in G'' of each load
    loads         one strain or, for the tensor, all `symmetric_loads`, or any number of forces; default: the pencil's
    field_omega   the frequencies of omega at which fields are stored, of a single load
    parallel      what ranks share: "shifts", "matrix" or "auto"

    Raises InputError where a factorisation shows that K has negative modes, ConvergenceError where the accuracy cannot
    be certified.
    """
    loads, steps, first, solutions = list(loads or [pencil.load]), dict(resume or {}), None, []
    are_forces = isinstance(loads[0], ForceLoad)
    with FloppyModesExplained(pencil), Progress(None, "sweep", pencil.network.comm.rank) as progress:
        try:
            for number, load in enumerate(loads):
                factors = first.factors if first else None
                with current().stage("assembly"):
                    sweep = RationalSweep(pencil.under(load), omega, accuracy, parallel, factors)
                first = first or sweep
                _grow(sweep, number, first, steps, save, progress)
                solutions.append(
                    _Solution(sweep.certificate, sweep.basis.size, None if are_forces else sweep.galerkin)
                )
        except NotPositiveDefinite as error:
            raise InputError(f"{error.message(named)}. Use {named('method')} direct.") from None
    certificates, galerkins = (
        [getattr(solution, name) for solution in solutions] for name in ("certificate", "galerkin")
    )
    work = {
        "factorisations": first.factorisations,
        "vectors": sum(solution.vectors for solution in solutions),
    }
    if are_forces:
        G, bounds = (
            np.stack([getattr(certificate, name) for certificate in certificates], axis=1)
            for name in ("G", "bounds")
        )
        return ModulusSweep(first.omega, G, bounds, [], {}, **work)
    if len(loads) > 1:
        swept_omega = first.omega
        del first, sweep, solutions, factors
        with current().stage("projection"):
            projection = TensorProjection(galerkins)
            tensor = TensorModuli(*projection.certify(certificates), projection.reduced)
        return ModulusSweep(swept_omega, *mean_shear(tensor), [], {}, **work, tensor=tensor)
    galerkin, certificate = galerkins[0], certificates[0]
    fields = [
        DisplacementField(at, *pencil.split(galerkin.field(at)), galerkin.field_bound(at, first.error_at(at)))
        for at in field_omega
    ]
    return ModulusSweep(
        first.omega, certificate.G, certificate.bounds, fields, {}, **work, spectrum=galerkin.spectrum
    )


def mean_shear(tensor):
    """(G (M,), bounds (M, 3)) of the shear modulus averaged over all directions."""
    weights = np.abs(shear_weights(dimension_of(tensor.C)))
    return shear_modulus(tensor.C), np.einsum("ab,...abc->...c", weights, tensor.bounds)


def _grow(sweep, number, first, steps, save, progress):
    """Extend the basis of load `number` shift by shift until all is certified; `steps` are those finished, of all.

    first   the sweep of the first load, whose factors are used
    """
    own = {step: arrays for step, arrays in steps.items() if arrays[0]["load"] == number}
    if own:
        _restore(sweep, own)
        steps.update({step: (record, None) for step, (record, _) in own.items()})  # the basis has the arrays
    while shifts := sweep.next_shifts():
        fewer = 0
        if sweep is not first and sweep.basis is None:  # the first has needed all these shifts
            shifts, fewer = first.factors.shifts, int(first.worst() < SPARE_ERROR_RATIO)
        elif sweep is not first:  # a vector more halves the error at least
            fewer = VECTORS - min(
                VECTORS, 1 + int(np.ceil(np.log2(np.clip(sweep.worst(), 1.0, 2.0**VECTORS))))
            )
        previous = sweep.basis.size if sweep.basis else 0
        with current().stage("shift"):
            sweep.add_shifts(shifts, fewer)
        step = max(steps, default=-1) + 1
        record, arrays = _rational_step(sweep, previous)
        record |= {"load": number}
        steps[step] = record, None
        if save is not None:
            save(step, record, arrays)
        listed = ", ".join(f"{shift:.2e}" for shift in shifts)
        progress.step(
            f"shift {listed}  vectors {sweep.basis.size}  worst bound / allowed {sweep.worst():.1e}"
        )


def _rational_step(sweep, before):
    """(record, arrays) of what a step has added to a basis of `before` vectors."""
    basis = sweep.basis
    arrays = {"vectors": basis.vectors[before:]} | ({} if before else {"x0": basis.x0})
    arrays |= {} if sweep.certificate is None else vars(sweep.certificate)
    owner = list(sweep.factors.owner.items())
    return {"first": basis.first, "shifts": basis.shifts[before:], "owner": owner}, arrays


def _restore(sweep, steps):
    records, arrays = zip(*(steps[number] for number in sorted(steps)), strict=True)
    vectors = np.concatenate([array["vectors"] for array in arrays])
    shifts = np.concatenate([record["shifts"] for record in records])
    last = {field.name: arrays[-1].get(field.name) for field in fields(Certified)}
    certificate = None if last["G"] is None else Certified(**last)
    owner = dict(records[-1]["owner"])
    sweep.restore(records[0]["first"], arrays[0]["x0"], vectors, shifts, owner, certificate)


class FloppyModesExplained:
    """Context: errors raised inside name the zero modes that K and B share, or floppy modes, which can be their reason.

    It is a class for the same reason as `errors.about`.
    """

    def __init__(self, pencil):
        self.pencil = pencil

    def __enter__(self):
        return self

    def __exit__(self, kind, error, trace):
        if not isinstance(error, ConvergenceError | InputError):
            return
        if shared := shared_zero_modes(self.pencil):
            error.args = (shared,)
        elif reason := floppy_modes(self.pencil):
            error.args = (f"{error.args[0]}; {reason}",)
