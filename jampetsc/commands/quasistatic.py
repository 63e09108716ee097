"""Response of a packing or a network to slow shear."""

from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from jampetsc.analysis.elasticity import anisotropy, least_modulus, poisson_ratio, shear_modulus
from jampetsc.commands.probe_files import SlowProbeResponse, write_probe
from jampetsc.errors import InputError, about, named
from jampetsc.io.results import note_lines, unstable_to_shear
from jampetsc.laws.damping import MAX_WEIGHT, having
from jampetsc.laws.loads import DEFAULT, STRESS_MEASURE, LoadChoice
from jampetsc.options.job import NETWORKS, ONE_PACKING, TaskInputs
from jampetsc.options.parameters import optional_parameter
from jampetsc.options.physics_options import NetworkJob, load_parameter
from jampetsc.options.values import Numbers, number_list
from jampetsc.petsc.session import current

# members of a `SlowResponse` that become attributes of the file
ATTRIBUTES = "G0 G_affine bulk_modulus eta0 omega_star identity_difference field_error".split()
SCAN = ("beta", "eta0", "no_prestress_eta0", "eta_inf")  # columns of `QuasistaticResult.scan`


@dataclass(frozen=True, eq=False)
class Quasistatic(NetworkJob):
    """Fields, moduli and viscosities of the limit of slow shear, or of another slow load.

    The motion of touching disks relative to each other, Δu∥ and Δu⊥, and the non-affine displacement of every disk, per
    unit strain, with medians, means, rms and histograms; G₀, bulk modulus, η₀ = lim G''/ω and η_∞ (BT eqs. 18–24).
    Moduli are second derivatives of the energy per volume along F = 1 + εE, E the displacement gradient of the load;
    the bulk modulus is −V dp/dV. With load tensor the fields are of simple shear xy, and the constants C₀, η₀ and η_∞
    between the symmetric loads xx, yy, (zz, yz, xz,) xy, whose shears are E = ½(x̂ŷ + ŷx̂), are added, with the shear
    modulus averaged over all directions and Poisson's ratio of both moduli.
    Forces have a susceptibility χ₀, with a bound, and its slope χ₁, χ → χ₀ − iωχ₁; waves also G₀ and η₀ at their k.
    Numbers whose names have no_prestress are without the pre-stress of K.
    """

    STUDY_INPUTS: ClassVar = TaskInputs(ONE_PACKING, NETWORKS)
    EPILOG: ClassVar = """examples:
  jampetsc quasistatic p.h5 --out slow.h5
  jampetsc quasistatic p.h5 --betas 1e-4,1e-2,1 --out betas.h5
  jampetsc quasistatic p.h5 --load tensor --out C.h5
  jampetsc quasistatic p.h5 --load wave:1,0:transverse --out wave.h5      # of forces, G0 at the wave vector

PETSc options: -shift_… for the factorisations."""

    SOLVERS: ClassVar = ("shift_", "inertia_")

    load: LoadChoice = load_parameter(
        "also the elastic constants and viscosities between all symmetric loads", takes_forces=True
    )
    betas: Numbers | None = optional_parameter(
        "also η₀ and η_∞ at these β, from the same fields (contact law)",
        value_type=number_list(0.0, MAX_WEIGHT, "b1,b2,…"),
    )

    def check(self):
        """Refuse a law without dissipation, and values of β for a law without β."""
        self.law.require_dissipation()
        owners = having("beta")
        if self.betas is not None and self.law.family not in owners:
            raise InputError(
                f"{named('betas')}: an option of {named('law')} {' or '.join(owners)}, not of "
                f"{self.law.family or self.law}. Leave it out."
            )
        if self.betas is not None and self.load.probe:
            raise InputError(
                f"{named('betas')}: not supported with {named('load')} {self.load}, which is forces. Leave it out."
            )
        for beta in [] if self.betas is None else self.betas:
            self.law.altered(beta=beta)  # where nothing dissipates

    def work(self, to):
        from jampetsc.commands.packing_network import read_network
        from jampetsc.response.slow_response import solve_quasistatic

        session = current()
        source = read_network(self.packing, self.elastic, to)
        if self.load.probe:
            return self._push(source, to)
        with about(source.name):
            betas = () if self.betas is None else self.betas.tolist()
            load, tensor = self.load.field_and_tensor(source.source.dimension)
            outcome = solve_quasistatic(source.network, self.law, betas, load, tensor)
        notes = [
            *(unstable_to_shear(outcome.responses[""].G0, "G0") if load.is_shear else []),
            *_stability_notes(outcome.tensors.get("")),
        ]
        with session.stage("output"), to.writer(self.FORMAT, session.comm) as writer:
            _write(writer, outcome)
            writer.attributes(
                **source.record(self.physics.parameters, notes), load=self.load, stress_measure=STRESS_MEASURE
            )
        units = source.units_line(self.law.tau1)
        return "\n".join(
            [_summary(to, self.physics, outcome, self.load), units, *note_lines([*source.notes, *notes])]
        )

    def _push(self, source, to):
        """The response of a `PackingNetwork` to forces, written; its summary. Collective."""
        from jampetsc.response.probe_loads import probe_loads
        from jampetsc.response.slow_probe import slow_susceptibilities

        probe, network = self.load.probe, source.network
        with about(source.name), current().stage("quasistatic"):
            self.load.of(network.dimension)
            loads = probe_loads(probe, source.source, network)
            slow = slow_susceptibilities(network, self.law, loads.loads)
        responses = {
            name: SlowProbeResponse.of(probe, loads, susceptibilities)
            for name, susceptibilities in slow.items()
        }
        with current().stage("output"), to.writer(self.FORMAT, current().comm) as writer:
            for name, response in responses.items():
                response.write(writer, name)
            write_probe(writer, probe, loads.particles)
            writer.attributes(**source.record(self.physics.parameters), load=self.load)
        lines = [f"{to}: {self.physics}, load {self.load}"]
        lines += [
            f"  {'no pre-stress' if name or not network.prestress else 'pre-stress'}: {response.text}"
            for name, response in responses.items()
        ]
        return "\n".join([*lines, source.units_line(self.law.tau1), *note_lines(source.notes)])


def _write(writer, outcome):
    """Put a `QuasistaticResult` into a result. Collective."""
    c = outcome.network.contacts
    once = c.i < c.j
    writer.distributed("particles", outcome.network.particles)
    numbers = np.concatenate(outcome.network.comm.allgather(outcome.network.particles))
    writer.distributed("contacts/pairs", numbers[np.column_stack((c.i, c.j))[once]])
    writer.distributed("contacts/bonds", c.r[once])
    for name, response in outcome.responses.items():
        group, prefix = (f"{name}/", f"{name}_") if name else ("", "")
        writer.distributed(f"{group}contacts/normal", response.normal)
        writer.distributed(f"{group}contacts/transverse", response.transverse)
        writer.distributed(f"{group}nonaffine", response.nonaffine)
        if response.flow.rotation is not None:
            writer.distributed(f"{group}contacts/sliding", response.flow.sliding)
            writer.distributed(f"{group}rotation", response.flow.rotation)
        values = {key: getattr(response, key) for key in ATTRIBUTES}
        values |= {f"eta0_{part}": value for part, value in response.flow.parts.items()}
        for quantity, distribution in outcome.distributions[name].items():
            writer.dataset(f"{group}histogram/{quantity}/edges", distribution.edges)
            writer.dataset(f"{group}histogram/{quantity}/counts", distribution.counts)
            values |= {
                f"{quantity}_{kind}": getattr(distribution, kind) for kind in ("median", "mean", "rms")
            }
        writer.attributes(**{f"{prefix}{key}": value for key, value in values.items()})
    writer.attributes(eta_inf=outcome.eta_inf)
    for name, tensor in outcome.tensors.items():
        group, prefix = (f"{name}/", f"{name}_") if name else ("", "")
        for key in ("C0", "eta0") if name else ("C0", "eta0", "eta_inf"):
            writer.dataset(f"{group}{key}", getattr(tensor, key))
        values = _isotropic_averages(outcome.responses[name], tensor)
        values["least_modulus"], _ = least_modulus(tensor.C0)
        writer.attributes(**{f"{prefix}{key}": value for key, value in values.items()})
    for name, column in zip(SCAN, outcome.scan.T, strict=True) if len(outcome.scan) else ():
        writer.dataset(f"beta_scan/{name}", column)


def _summary(to, physics, outcome, load=DEFAULT) -> str:
    """The summary."""
    of_load = "" if load == DEFAULT else f", load {load}"
    lines = [f"{to}: {physics}{of_load}, eta_inf = {outcome.eta_inf:.6g}"]
    for name, response in outcome.responses.items():
        distributions = outcome.distributions[name]
        stress = "pre-stress" if response.network.prestress else "no pre-stress"
        parts = ", ".join(f"{part} {value:.4g}" for part, value in response.flow.parts.items())
        lines += [
            f"  {stress}: G0 = {response.G0:.6g}, bulk modulus {response.bulk_modulus:.6g}, eta0 = "
            f"{response.flow.eta0:.6g} "
            f"({parts}), omega* = {response.omega_star:.4g}",
            "    medians per unit strain: "
            + ", ".join(
                f"{symbol} {distributions[key].median:.4g}"
                for symbol, key in (("|Δu∥|", "normal"), ("|Δu⊥|", "transverse"), ("|u_na|", "nonaffine"))
            )
            + f"; identity kept to {response.identity_difference:.0e}",
        ]
        if name in outcome.tensors:
            tensor = outcome.tensors[name]
            averages = _isotropic_averages(response, tensor)
            lines.append(
                f"    shear modulus averaged over all directions {averages['shear_modulus']:.6g}, Poisson ratio "
                f"{averages['poisson_ratio']:.4g}, anisotropy {averages['anisotropy']:.2g}"
            )
            least, _ = least_modulus(tensor.C0)
            lines.append(f"    the least modulus of all loads of unit gradient is {least:.6g}")
    return "\n".join(lines)


def _isotropic_averages(response, tensor) -> dict:
    """Attributes of a `QuasistaticTensor`, beside the bulk modulus of its `SlowResponse`."""
    shear = shear_modulus(tensor.C0)
    ratio = poisson_ratio(response.bulk_modulus, shear, response.network.dimension)
    return {"shear_modulus": shear, "poisson_ratio": ratio, "anisotropy": anisotropy(tensor.C0)}


def _stability_notes(tensor) -> list[str]:
    """The note, if any, that C₀ of a `QuasistaticTensor` is not positive definite."""
    least, gradient = (1.0, None) if tensor is None else least_modulus(tensor.C0)
    if least > 0.0:
        return []
    rows = ",".join(f"{value + 0.0:.3g}" for value in gradient.ravel())
    return [
        f"unstable to a load: modulus {least:.6g} under {rows}. For packings stable to all: pack --stabilise all"
    ]
