"""What a sweep writes and says: its datasets, notes on its numbers, its summary."""

import numpy as np

from jampetsc.analysis.elasticity import anisotropy, bulk_modulus
from jampetsc.analysis.error_bounds import relative_part_bounds, zero_parts
from jampetsc.commands.describe import poisson_text
from jampetsc.commands.probe_files import MODULUS_BOUNDS
from jampetsc.io.results import unstable_to_shear
from jampetsc.laws.loads import DEFAULT


def write_moduli(writer, frequencies, sweep, source, is_power_law) -> None:
    """Put the arrays of a `ModulusSweep` of a `PackingNetwork` into a result. Collective."""
    if is_power_law:
        writer.dataset("equivalent_omega", sweep.omega)
    writer.dataset("G", sweep.G)
    for name, bound in zip(MODULUS_BOUNDS, sweep.bounds.T, strict=True):
        writer.dataset(name, bound)
    if sweep.spectrum is not None:
        for name in ("G0", "eta_inf", "rates", "weights"):
            writer.dataset(f"spectrum/{name}", getattr(sweep.spectrum, name))
    if sweep.tensor is not None:
        _write_tensor(writer, sweep.tensor, source.network)
    if sweep.inertia is not None:
        for name, values in vars(sweep.inertia).items():
            writer.dataset(f"reduced_inertia/{name}", values)
    if not sweep.fields:
        return
    writer.dataset("fields/omega", frequencies.of_experiment([field.omega for field in sweep.fields]))
    writer.distributed("particles", source.network.particles)
    for field in sweep.fields:
        writer.append("fields/displacement", field.displacement)
        if field.rotation is not None:
            writer.append("fields/rotation", field.rotation)
    writer.dataset("fields/error_bound", np.array([field.error_bound for field in sweep.fields]))


def _write_tensor(writer, tensor, network) -> None:
    """Put `TensorModuli` of a network into a result. Collective."""
    writer.dataset("C", tensor.C)
    for number, name in enumerate(("C_error_bound", "C_error_bound_storage", "C_error_bound_loss")):
        writer.dataset(name, tensor.bounds[..., number])
    writer.dataset("bulk_modulus", _bulk_modulus(tensor, network))
    writer.dataset("anisotropy", anisotropy(tensor.C))
    if tensor.reduced is not None:
        for name, values in vars(tensor.reduced).items():
            writer.dataset(f"reduced_tensor/{name}", values)


def _bulk_modulus(tensor, network):
    """K* (M,) of `TensorModuli` of a network."""
    return bulk_modulus(tensor.C, network.pressure if network.prestress else 0.0)


def minimum_notes(minimum) -> list[str]:
    """The note, if any, that K has negative modes, see `io.results`."""
    if not minimum.negative_modes:
        return []
    return [
        f"not a minimum: K has {minimum.negative_modes} negative modes, so method direct solves every frequency and "
        "bounds on fields are estimates. Quench it (pack from it)"
    ]


def notes_of(job, source, omega, sweep, damping) -> list[str]:
    """Notes on a `ModulusSweep` at frequencies omega (M,) of the experiment, see `io.results`.

    source    `PackingNetwork`
    damping   `EquivalentDamping`, None where it is linear
    """
    notes, G, highest = [], sweep.G, sweep.G.real + sweep.bounds[:, 1]
    if sweep.direct:
        notes.append(
            f"many resonances: {sweep.direct} of {len(omega)} frequencies were solved one by one, so G* is known at "
            "these frequencies alone"
        )
    for name, is_zero, bounds in zip(
        ("G'", "G''"), zero_parts(G, sweep.bounds[:, 1:]).T, sweep.bounds[:, 1:].T, strict=True
    ):
        is_zero &= bounds > 0.0  # others are exact
        if is_zero.any():
            notes.append(
                f"{name}: zero to rounding at {np.count_nonzero(is_zero)} of {len(omega)} frequencies, at most "
                f"{bounds[is_zero].max():.1e}"
            )
    if highest.min() < 0.0 and job.load.is_shear and job.mass is None:  # by more than its bound
        worst = int(np.argmin(highest))
        notes += unstable_to_shear(G.real[worst], f"G' at omega {omega[worst]:.3g}")
    if damping is not None:
        strain = job.stress / abs(G).min()
        pressure = source.network.pressure / source.stress_scale
        if strain > pressure:
            notes.append(
                f"contacts would change, which is left out: strain amplitude up to {strain:.1e}, more than p/k = "
                f"{pressure:.1e}. `oscillate --contacts moving` has it"
            )
        if G.real.min() < 0.0:
            notes.append(
                "G* is formal: G' < 0, so no stress can be imposed on the packing. Impose a strain (oscillate)"
            )
    return notes


def summary_of(job, to, network, frequencies, sweep, certified, response=None) -> str:
    """The summary of a `ModulusSweep` of a network; response: the `ProbeResponse` of forces."""
    G, bounds, omega = sweep.G, sweep.bounds, frequencies.of_experiment(sweep.omega)
    worst = response.worst_bounds if response else relative_part_bounds(G, bounds[:, 1:]).max(axis=0)
    symbol = "susceptibility" if response else "G"
    lines = [
        f"{to}: {job.physics}{'' if job.load == DEFAULT else f', load {job.load}'}, {len(omega)} frequencies, "
        f"{'certified' if certified else 'estimated'} to {worst[0]:.1e} in {symbol}' and {worst[1]:.1e} in {symbol}''"
    ]
    if response:
        return "\n".join([*lines, *response.lines(omega)])
    lines += [
        f"  omega {omega[end]:.3g}: G' = {G[end].real:.6g}, G'' = {G[end].imag:.6g}"
        for end in ((0, -1) if len(omega) > 1 else (0,))
    ]
    if sweep.tensor is not None:
        C = np.array2string(sweep.tensor.C[0].real, precision=6).replace("\n", "\n    ")
        poisson = poisson_text(omega, _bulk_modulus(sweep.tensor, network), G, network.dimension)
        lines += [
            f"  G: shear modulus averaged over all directions; Poisson ratio {poisson}",
            f"  C' at omega {omega[0]:.3g}:\n    {C}",
        ]
    if job.alpha is not None:
        lines.append(
            f"  alpha {job.alpha:g}, stress {job.stress:g}: equivalent linear frequencies "
            f"{frequencies.solved[0]:.3g} to {frequencies.solved[-1]:.3g}; the stored spectrum is that of the linear "
            "law"
        )
    return "\n".join(lines)
