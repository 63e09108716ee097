"""`load`: any jampetsc file as an object with numpy arrays. Needs neither PETSc nor MPI."""

from dataclasses import fields
from pathlib import Path

import numpy as np

from jampetsc.analysis.elasticity import ReducedTensor
from jampetsc.analysis.reduced_inertia import ReducedInertia
from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.errors import InputError, about, named
from jampetsc.io import packing_file
from jampetsc.io.disk_motion import snapshot
from jampetsc.io.ensemble import load_ensemble
from jampetsc.io.hdf5 import attributes, check_format, open_file, retry_if_replaced
from jampetsc.io.parts import PartList
from jampetsc.io.result_file import ResultWriter
from jampetsc.io.results import Result
from jampetsc.laws.equivalent_damping import EquivalentDamping
from jampetsc.laws.loads import DEFAULT, LoadChoice
from jampetsc.packing.packing import PLACES, Packing, deformed
from jampetsc.packing.potentials import Potential
from jampetsc.packing.strain import simple_shear

_MIN_RATE = 1e-100  # rates beyond this and its inverse are no rates of relaxation
_FREQUENCY_TOLERANCE = 1e-12  # two frequencies that differ by less, relatively, are the same


class Fields:
    """Displacement fields of a sweep per unit strain, read on demand. F frequencies, n disks."""

    def __init__(self, result):
        self.omega = result["fields/omega"]  # (F,)
        self.displacement = result.stored("fields/displacement")  # (F, n, 2) complex, non-affine
        rolls = "fields/rotation" in result
        self.rotation = result.stored("fields/rotation") if rolls else None  # (F, n) complex


class SweepResult(Result):
    """G*(ω) of a packing: `omega` (M,), `G` (M,) complex, `error_bound` (M,) on |ΔG*|, units k and 1/τ₁."""

    def __init__(self, *parts):
        super().__init__(*parts)
        self.omega = self["omega"]
        self._modulus = None
        if "G" in self or "susceptibility" not in self:
            self._modulus = self["G"], self["error_bound"]

    @property
    def G(self):
        """G* (M,), complex; of a wave of forces G(k, ω). Raises InputError for other forces, which have none."""
        self._require_modulus()
        return self._modulus[0]

    @property
    def error_bound(self):
        """Bound on |ΔG*|, (M,). Raises InputError as `G`."""
        self._require_modulus()
        return self._modulus[1]

    def _require_modulus(self):
        if self._modulus is None:
            raise InputError(
                f"{self.path}: {named('load')} {self.load}, forces without a modulus. See its susceptibility."
            )

    @property
    def G_storage(self):
        """G' = Re G*, (M,)."""
        return self.G.real

    @property
    def G_loss(self):
        """G'' = Im G*, (M,)."""
        return self.G.imag

    @property
    def shear_modulus(self):
        """Shear modulus (M,), complex; of a tensor averaged over all directions. Raises InputError for other loads."""
        if not ("C" in self or self.load.is_shear):
            raise InputError(
                f"{self.path}: load {self.load}, not a shear. Give a sweep of load xy or tensor."
            )
        return self.G

    @property
    def load(self) -> LoadChoice:
        """The load as text, see `jampetsc.loads`."""
        return LoadChoice(self.attributes.get("load", DEFAULT))

    @property
    def fields(self) -> Fields:
        """The stored displacement fields. Raises InputError if the sweep was run without --fields."""
        if "fields/omega" not in self:
            raise InputError(f"{self.path}: no fields. Run the sweep with {named('fields')}.")
        return Fields(self)

    def modulus(self, omega):
        """G*(ω), complex, in the shape of `omega`: the stored value where there is one; of a tensor C*(ω), (…, L, L).

        Elsewhere from the relaxation spectrum that a rational sweep stores in the group `spectrum`, under
        power-law damping at the equivalent frequency; beyond the swept range without a certificate.
        Raises InputError for a frequency that is not stored without a spectrum, and for one that is not finite.
        """
        frequencies = np.atleast_1d(np.asarray(omega, float))
        if not np.isfinite(frequencies).all():
            raise InputError(f"omega = {frequencies[~np.isfinite(frequencies)][0]:g}: must be finite")
        nearest = np.abs(frequencies[..., None] - self.omega).argmin(axis=-1)
        values = self["C"][nearest] if "C" in self else self.G[nearest]
        elsewhere = np.abs(self.omega[nearest] - frequencies) > _FREQUENCY_TOLERANCE * np.abs(frequencies)
        if elsewhere.any():
            if not {"spectrum/rates", "reduced_tensor/rates", "reduced_inertia/stiffness"} & set(self):
                remedy = f", or run the sweep with {named('method')} rational" * (self.load.probe is None)
                raise InputError(
                    f"{self.path}: omega = {frequencies[elsewhere][0]:g} is not one of its {len(self.omega)} "
                    f"frequencies, {self.omega.min():g} to {self.omega.max():g}. Choose one of them{remedy}."
                )
            linear = self._linear(frequencies[elsewhere])
            if not np.isfinite(linear).all():
                far = frequencies[elsewhere][~np.isfinite(linear)][0]
                raise InputError(
                    f"omega = {far:g}: its equivalent frequency overflows. Choose another frequency."
                )
            values[elsewhere] = self._reduced_modulus(linear)
        return values.reshape((*np.shape(omega), *values.shape[frequencies.ndim :]))[()]

    def stress_relaxation(self, time):
        """G(t) in the shape of `time` > 0 after a step of the strain, of a tensor C(t), (…, L, L), of a rational sweep.

        Without the Dirac part η_∞ δ(t). With masses it oscillates. Raises InputError as `spectrum`.
        """
        if self.has_inertia:
            values = self.reduced_inertia.stress_relaxation(time)
            return values if "C" in self else values[..., 0, 0]
        return self.spectrum.stress_relaxation(np.asarray(time, float))

    def _reduced_modulus(self, omega):
        """G*, or C* of a tensor, at frequencies of the linear law, by the reduced pencil that the file has."""
        if self.has_inertia:
            modulus = self.reduced_inertia.modulus(omega)
            return modulus if "C" in self else modulus[..., 0, 0]
        return (self._reduced("reduced_tensor", ReducedTensor) if "C" in self else self.spectrum).modulus(
            omega
        )

    @property
    def has_inertia(self) -> bool:
        """Whether it has a reduced pencil with masses."""
        return "reduced_inertia/stiffness" in self

    @property
    def reduced_inertia(self) -> ReducedInertia:
        """The reduced K, B and M of a sweep with masses."""
        return self._reduced("reduced_inertia", ReducedInertia)

    def _reduced(self, group, kind):
        return kind(*(self[f"{group}/{field.name}"] for field in fields(kind)))

    @property
    def damping(self) -> EquivalentDamping | None:
        """Power-law damping of the sweep, None where it is linear."""
        if "alpha" not in self.attributes:
            return None
        a = self.attributes
        ratio = a.get("stress_ratio", a["stress"])  # older files have the ratio alone
        return EquivalentDamping(float(a["alpha"]), float(ratio))

    def _linear(self, omega):
        """Frequencies at which the linear law has the moduli that this sweep has at omega."""
        if self.damping is None:
            return omega
        tau1 = float(self.attributes.get("tau1", 1.0))
        return self.damping.frequency(omega * tau1) / tau1

    @property
    def spectrum(self) -> RelaxationSpectrum:
        """Relaxation spectrum of a rational sweep, linear damping. Raises InputError for a sweep without one."""
        if "C" in self:
            raise InputError(
                f"{self.path}: elastic constants, which have no single spectrum. Give a sweep of one {named('load')}."
            )
        if self.load.probe:
            raise InputError(
                f"{self.path}: {named('load')} {self.load}, forces, of which no spectrum is stored. Give a sweep of a "
                "strain."
            )
        if "mass" in self.attributes:
            raise InputError(
                f"{self.path}: a sweep with mass, whose response oscillates and has no relaxation spectrum. "
                f"{self._way_to_transient}."
            )
        if "spectrum/rates" not in self:
            raise InputError(f"{self.path}: no spectrum. Run the sweep with {named('method')} rational.")
        return _sound_spectrum(
            self.path, *(self[f"spectrum/{name}"] for name in ("G0", "eta_inf", "rates", "weights"))
        )

    @property
    def _way_to_transient(self) -> str:
        """How to get G(t) and J(t) of a sweep with masses, in words."""
        if self.has_inertia:
            return "Run spectrum for a result, which has its G(t) and J(t)"
        if self.attributes["method"] == "rational":
            return "G(t) needs a sweep without single frequencies. Sweep fewer high frequencies"
        return f"For G(t) run the sweep with {named('method')} rational"

    @property
    def frequency_range(self) -> tuple[float, float]:
        """Lowest and highest frequency at which the linear law was solved and its spectrum certified."""
        solved = self["equivalent_omega"] if "equivalent_omega" in self else self.omega
        return float(solved.min()), float(solved.max())


class ShearedResult(Result):
    """Series along shear, steady or quasistatic, their means, and the state at the end."""

    @property
    def last(self) -> Packing:
        """The packing at the end."""
        return self.listed

    @property
    def listed(self) -> Packing:
        """The disks of the stored state."""
        arrays = {name: np.asarray(self[f"state/{name}"], float) for name in (*PLACES, "radii")}
        with about(self.path):
            potential = Potential.of_record(self.attributes)
            radii, positions = arrays["radii"], arrays["base"] + arrays["offset"]
            cell = arrays["cell_base"] + arrays["cell_offset"]
            return Packing.from_positions(positions, radii, cell, potential).replace(**arrays)


class FlowResult(ShearedResult):
    """Steady shear: with snapshots. Its state has the disks of the last neighbour list, and how they moved since."""

    snapshot = snapshot

    @property
    def last(self) -> Packing:
        """The packing at the end."""
        shear = int(self["state/list_age"]) * self.attributes["rate"] * self.attributes["step"]
        return deformed(self.listed, self["state/offsets"], simple_shear(shear)).folded()


class SpectrumResult(Result):
    """Relaxation and retardation spectrum of a packing, H(τ), G(t) and J(t)."""

    @property
    def spectrum(self) -> RelaxationSpectrum:
        """The relaxation spectrum, modes in the order of their times. Raises InputError for G(t) with masses."""
        if "relaxation/rates" not in self:
            raise InputError(
                f"{self.path}: G(t) and J(t) with masses, which have no relaxation spectrum. Draw them by "
                f"{named('kind')} transient."
            )
        scalars = (self.attributes[name] for name in ("G0", "eta_inf"))
        return _sound_spectrum(self.path, *scalars, self["relaxation/rates"], self["relaxation/weights"])

    @property
    def frequency_range(self) -> tuple[float, float]:
        """Lowest and highest frequency of the sweep behind it."""
        return tuple(float(self.attributes[name]) for name in ("slowest_omega", "fastest_omega"))


def _sound_spectrum(path, G0, eta_inf, rates, weights):
    """The RelaxationSpectrum of these numbers. Raises InputError where they cannot be one."""
    spectrum = RelaxationSpectrum(float(G0), float(eta_inf), rates, weights)
    numbers = np.isfinite([spectrum.G0, spectrum.eta_inf]).all() and np.isfinite(weights).all()
    if (
        not numbers
        or rates.shape != weights.shape
        or not ((rates > _MIN_RATE) & (rates < 1 / _MIN_RATE)).all()
    ):
        raise InputError(
            f"{path}: impossible values in its spectrum (rates must be finite and positive). Run the sweep again."
        )
    return spectrum


RESULTS = {  # format -> class; a new format needs a line here
    "jampetsc-sweep": SweepResult,
    "jampetsc-quasistatic": Result,
    "jampetsc-modes": Result,
    "jampetsc-spectrum": SpectrumResult,
    "jampetsc-correlation": Result,
    "jampetsc-oscillate": Result,
    "jampetsc-relax": Result,
    "jampetsc-flow": FlowResult,
    "jampetsc-shear": ShearedResult,
    "jampetsc-jam": Result,
    "jampetsc-velocity-correlation": Result,
    "jampetsc-collapse": Result,
    "jampetsc-scaling": Result,
}


def collected(writer: ResultWriter) -> Result:
    """The result that a writer has collected, in the class that `load` gives for its file."""
    format = writer.found["format"]
    arrays = dict(sorted(writer.arrays.items(), key=lambda item: item[0].split("/")))
    words = f"{format.removeprefix('jampetsc-')} in memory"
    return RESULTS[format](writer.found, arrays, words, writer.comm)


@retry_if_replaced
def load(path):
    """Open a jampetsc file.

    path   of a file, or of the folder of a study

    Returns a Packing for a packing, a Network for a network, SweepResult for a sweep, FlowResult for a flow, Result for
    other files, and an `ensemble.Ensemble`, its table as arrays with averages over packings, for a study. Not
    collective.

    Raises InputError with the file, what is wrong with it and the remedy.
    """
    if Path(path).is_dir():
        return load_ensemble(path, load)
    with open_file(path) as h5:
        name = check_format(path, attributes(h5))
        if name == "jampetsc-part":
            raise InputError(f"{path}: the part of one rank. Open the joint file beside its folder.")
        if name == packing_file.FORMAT:
            return packing_file.packing_from(h5, path)
        if name == packing_file.NETWORK_FORMAT:
            return packing_file.network_from(h5, path)
        if name not in RESULTS:
            formats = ", ".join((packing_file.FORMAT, packing_file.NETWORK_FORMAT, *RESULTS))
            raise InputError(f"{path}: format {name}: not one of {formats}. Use a newer jampetsc.")
        result = RESULTS[name].read(h5, path)
        PartList(h5, path).check()
        return result
