"""`load`: any jampetsc file as an object with numpy arrays. Needs neither PETSc nor MPI."""

import difflib
import html
from collections.abc import Mapping
from pathlib import Path

import h5py
import numpy as np

from jampetsc.analysis.equivalent_damping import EquivalentDamping
from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.core.disks import PLACES, Disks
from jampetsc.core.potentials import Potential
from jampetsc.errors import InputError, named
from jampetsc.io import packing_file
from jampetsc.io.ensemble import TABLE, load_ensemble
from jampetsc.io.hdf5 import attributes, check_format, open_file, reading, undisturbed
from jampetsc.io.memory import MemoryWriter
from jampetsc.io.parts import GROUP, PartList
from jampetsc.io.provenance import law_of
from jampetsc.io.result_file import ResultWriter
from jampetsc.io.snapshots import Snapshot, snapshot

_SLOWEST = 1e-100  # rates beyond this and its inverse are no rates of relaxation
_SAME = 1e-12  # two frequencies that differ by less, relatively, are the same
_SHOWN = 6  # datasets that a line about a result names
_LONGEST = 60  # characters of an attribute in a table


class StoredArray:
    """A dataset that stays in its file: `array[…]` reads what is asked for, `numpy.asarray(array)` all of it.

    Raises InputError on reading if the file was replaced, or one of its parts went, since it was loaded.
    """

    axis = rows = None  # every rank reads all, as `memory.MemoryArray` has it
    grown = False

    def __init__(self, path, name, h5):
        self._path, self._name, self._run_id = Path(path).resolve(), name, h5.attrs.get("run_id", "")
        self.shape, self.dtype = h5[name].shape, h5[name].dtype

    def __getitem__(self, selection):
        return undisturbed(self._path, lambda path: self._read(path, selection))

    def _read(self, path, selection):
        with open_file(path) as h5:
            parts = PartList(h5, path)
            if parts.run_id != self._run_id:
                raise InputError(f"{path}: was replaced by another run since it was loaded: load it again")
            with reading(path):
                values = parts.read(h5[self._name], selection)
            parts.check_present()
        return values

    def __len__(self):
        return self.shape[0]

    def __array__(self, dtype=None, copy=None):
        return np.asarray(self[...], dtype=dtype)

    def __repr__(self):
        return f"<{self._name} {self.shape} {self.dtype} in {self._path.name}>"


class Attributes(dict):
    """Attributes of a result; asking for one that is missing is an InputError that names the file."""

    def __init__(self, path, values):
        super().__init__(values)
        self.path = path

    def __missing__(self, name):
        near = difflib.get_close_matches(name, self, n=1, cutoff=0.8)
        remedy = f"did you mean {near[0]}?" if near else "make the file again"
        raise InputError(f"{self.path}: attribute {name} is missing: {remedy}")


class Result(Mapping):
    """A result: `attributes` (how it came about), and a mapping of dataset names to numpy arrays.

    path      its file; of a result in memory words that stand for it in messages: "sweep in memory"
    packing   Disks that the result is of, where they were in memory with it; else None

    A file's array is read when it is asked for; `stored(name)` leaves it in the file, to read slices of it. In memory
    a distributed array is this rank's rows, and `stored(name).rows` says which.
    """

    def __init__(self, attributes: dict, arrays: dict, path, comm=None):
        self.attributes, self._arrays, self._comm = Attributes(path, attributes), arrays, comm
        self.path, self.packing = Path(path), None

    @classmethod
    def read(cls, h5, path) -> "Result":
        """The result in an open file; `path` is for messages and later reading."""
        arrays = {}

        def collect(name, item):
            if isinstance(item, h5py.Dataset) and not name.startswith(f"{GROUP}/"):
                arrays[name] = StoredArray(path, name, h5)

        with reading(path):
            h5.visititems(collect)
            return cls(attributes(h5), arrays, Path(path).resolve())

    @property
    def file(self) -> Path | None:
        """Its file; None in memory."""
        return self.path if self.path.is_absolute() else None

    @staticmethod
    def of(memory: MemoryWriter) -> "Result":
        """What was collected in memory, in the class that `load` gives for its file."""
        format = memory.found["format"]
        kind, name = RESULTS[format], format.removeprefix("jampetsc-")
        arrays = {name: memory.arrays[name] for name in sorted(memory.arrays, key=lambda n: n.split("/"))}
        return kind(memory.found, arrays, f"{name} in memory", memory.comm)

    def gathered(self) -> "Result":
        """The same with all rows of distributed arrays on every rank. Collective for a result in memory."""
        if all(array.axis is None for array in self._arrays.values()):
            return self
        arrays = {
            name: array if array.axis is None else array.gathered(self._comm)
            for name, array in self._arrays.items()
        }
        found = type(self)(self.attributes, arrays, self.path, self._comm)
        found.packing = self.packing
        return found

    def save(self, path) -> None:
        """Write it to a file, which `path` is from then on; an earlier result of its kind there is replaced.

        Collective for a result in memory: every rank writes its rows. Raises as ResultWriter.
        """
        with ResultWriter(path, self.format, self._comm) as writer:
            for name, array in self._arrays.items():
                if array.axis is None:
                    writer.dataset(name, array[...])
                elif array.grown:
                    for entry in range(len(array)):
                        writer.append(name, array[entry])
                else:
                    writer.distributed(name, array[...], array.axis)
            writer.attributes(**self.attributes | {"run_id": writer.run_id})
        self.path = self.attributes.path = Path(path).resolve()
        self.attributes["run_id"] = writer.run_id
        if any(
            isinstance(array, StoredArray) for array in self._arrays.values()
        ):  # what is in memory stays there
            self._arrays = load(path)._arrays

    def __repr__(self):
        held = ", ".join(f"{name} {self._arrays[name].shape}" for name in list(self)[:_SHOWN])
        more = f" and {len(self) - _SHOWN} more" if len(self) > _SHOWN else ""
        return f"<{type(self).__name__} {self.path.name}: {held}{more}>"

    def _repr_html_(self):
        """A table of shapes and attributes for notebooks."""
        rows = [(name, f"{array.shape} {array.dtype}") for name, array in self._arrays.items()]
        rows += [(name, _told(value)) for name, value in self.attributes.items()]
        cells = "".join(f"<tr><td>{html.escape(a)}</td><td>{html.escape(b)}</td></tr>" for a, b in rows)
        title = html.escape(f"{type(self).__name__} {self.path.name}")
        return f"<table><caption>{title}</caption>{cells}</table>"

    def __getitem__(self, name):
        return self.stored(name)[...]

    def stored(self, name) -> StoredArray:
        """A dataset without reading it. Raises InputError if there is none of this name."""
        if name not in self._arrays:
            near = difflib.get_close_matches(name, self._arrays, n=1)
            hint = f"did you mean {near[0]}?" if near else f"it holds {', '.join(self._arrays) or 'none'}"
            raise InputError(f"{self.path}: no dataset {name}: {hint}")
        return self._arrays[name]

    def get(self, name, default=None):
        """The array of a dataset, or `default` where there is none."""
        return self[name] if name in self else default

    def __iter__(self):
        return iter(self._arrays)

    def __len__(self):
        return len(self._arrays)

    def __contains__(self, name):
        return name in self._arrays

    @property
    def format(self) -> str:
        """What kind of file it is, such as "jampetsc-modes"."""
        return self.attributes["format"]

    @property
    def law(self) -> dict:
        """The damping law and its parameters: {"law": "contact", "beta": 1.0, …}."""
        return law_of(self.attributes)


def _told(value):
    text = " ".join(str(value).split())
    return text if len(text) <= _LONGEST else f"{text[:_LONGEST]} …"


class Fields:
    """Displacement fields of a sweep per unit strain, read on demand. F frequencies, n disks."""

    def __init__(self, result):
        self.omega = result["fields/omega"]  # (F,)
        self.displacement = result.stored("fields/displacement")  # (F, n, 2) complex, non-affine
        self.rotation = (
            result.stored("fields/rotation") if "fields/rotation" in result else None
        )  # (F, n) complex


class SweepResult(Result):
    """G*(ω) of a packing: `omega` (M,), `G` (M,) complex, `error_bound` (M,) on |ΔG*|, units k and 1/τ₁."""

    def __init__(self, *found):
        super().__init__(*found)
        self.omega, self.G, self.error_bound = (self[name] for name in ("omega", "G", "error_bound"))

    @property
    def G_storage(self):
        """G' = Re G*, (M,)."""
        return self.G.real

    @property
    def G_loss(self):
        """G'' = Im G*, (M,)."""
        return self.G.imag

    @property
    def fields(self) -> Fields:
        """The stored displacement fields. Raises InputError if the sweep was run without --fields."""
        if "fields/omega" not in self:
            raise InputError(f"{self.path}: holds no fields: ask the sweep for {named('fields')}")
        return Fields(self)

    def modulus(self, omega):
        """G*(ω), complex, in the shape of `omega`: the stored value where there is one.

        Elsewhere from the relaxation spectrum that a rational sweep stores in the group `reduced`, under
        power-law damping at the equivalent frequency; beyond the swept range without a certificate.
        Raises InputError for a frequency that is not stored if there is none.
        """
        wanted = np.atleast_1d(np.asarray(omega, float))
        nearest = np.abs(wanted[..., None] - self.omega).argmin(axis=-1)
        values = self.G[nearest]
        elsewhere = np.abs(self.omega[nearest] - wanted) > _SAME * np.abs(wanted)
        if elsewhere.any():
            if "reduced/rates" not in self:
                raise InputError(
                    f"{self.path}: omega = {wanted[elsewhere][0]:g} is not one of its {len(self.omega)} "
                    f"frequencies, {self.omega.min():g} to {self.omega.max():g}: {named('method')} rational gives any"
                )
            values[elsewhere] = self.spectrum.modulus(self._linear(wanted[elsewhere]))
        return values.reshape(np.shape(omega))[()]

    @property
    def damping(self) -> EquivalentDamping | None:
        """Power-law damping of the sweep, None where it is linear."""
        if "alpha" not in self.attributes:
            return None
        return EquivalentDamping(float(self.attributes["alpha"]), float(self.attributes["stress"]))

    def _linear(self, omega):
        """Frequencies at which the linear law has the moduli that this sweep has at omega."""
        if self.damping is None:
            return omega
        tau1 = float(self.attributes.get("tau1", 1.0))
        return self.damping.frequency(omega * tau1) / tau1

    @property
    def spectrum(self) -> RelaxationSpectrum:
        """Relaxation spectrum of a rational sweep, linear damping. Raises InputError if there is none."""
        if "reduced/rates" not in self:
            raise InputError(f"{self.path}: holds no spectrum: run the sweep with {named('method')} rational")
        return _sound_spectrum(
            self.path, *(self[f"reduced/{name}"] for name in ("G0", "eta_inf", "rates", "weights"))
        )

    @property
    def frequency_range(self) -> tuple[float, float]:
        """Lowest and highest frequency at which the linear law was solved and its spectrum certified."""
        solved = self["equivalent_omega"] if "equivalent_omega" in self else self.omega
        return float(solved.min()), float(solved.max())


class ShearedResult(Result):
    """Series along shear, steady or quasistatic, their means, and the state at the end."""

    @property
    def last(self) -> Disks:
        """The packing at the end."""
        arrays = {name: np.asarray(self[f"state/{name}"], float) for name in (*PLACES, "radii")}
        return Disks(
            **arrays,
            potential=Potential(*(self.attributes[name] for name in ("potential", "stiffness", "k"))),
        )


class FlowResult(ShearedResult):
    """Steady shear: with snapshots."""

    def snapshot(self, row=-1) -> Snapshot:
        """A snapshot, the last one if no other is asked for, as a packing with `velocities`, `spins` and `unwrapped`.

        Raises InputError where the file holds none, or not so many.
        """
        return snapshot(self, row)


class SpectrumResult(Result):
    """Relaxation and retardation spectrum of a packing, H(τ), G(t) and J(t)."""

    @property
    def spectrum(self) -> RelaxationSpectrum:
        """The relaxation spectrum, modes in the order of their times."""
        scalars = (self.attributes[name] for name in ("G0", "eta_inf"))
        return _sound_spectrum(self.path, *scalars, self["relaxation/rates"], self["relaxation/weights"])

    @property
    def frequency_range(self) -> tuple[float, float]:
        """Lowest and highest frequency of the sweep behind it."""
        return tuple(float(self.attributes[name]) for name in ("slowest_omega", "fastest_omega"))


def _sound_spectrum(path, G0, eta_inf, rates, weights):
    """The RelaxationSpectrum of these numbers. Raises InputError for what none can be."""
    spectrum = RelaxationSpectrum(float(G0), float(eta_inf), rates, weights)
    numbers = np.isfinite([spectrum.G0, spectrum.eta_inf]).all() and np.isfinite(weights).all()
    if not numbers or rates.shape != weights.shape or not ((rates > _SLOWEST) & (rates < 1 / _SLOWEST)).all():
        raise InputError(f"{path}: its spectrum holds values that no packing has: run the sweep again")
    return spectrum


RESULTS = {  # format -> class; a new format needs a line here
    "jampetsc-sweep": SweepResult,
    "jampetsc-quasistatic": Result,
    "jampetsc-modes": Result,
    "jampetsc-spectrum": SpectrumResult,
    "jampetsc-correlation": Result,
    "jampetsc-oscillate": Result,
    "jampetsc-flow": FlowResult,
    "jampetsc-shear": ShearedResult,
    "jampetsc-jam": Result,
    "jampetsc-velocity-correlation": Result,
    "jampetsc-collapse": Result,
}


def load(path):
    """Open a jampetsc file: Disks for a packing, SweepResult for a sweep, Result for the others.

    The folder of a study gives an `ensemble.Ensemble`, its table as arrays with averages over packings.

    Raises InputError naming the file, what is wrong with it and the remedy.
    """
    if (Path(path) / TABLE).exists():
        return load_ensemble(path, load)
    return undisturbed(path, _load)


def _load(path):
    with open_file(path) as h5:
        with reading(path):
            attrs = attributes(h5)
        name = check_format(path, attrs)
        if name == "jampetsc-part":
            raise InputError(f"{path}: is one rank's part: open the joint file beside its folder")
        if name == packing_file.FORMAT:
            return packing_file.packing_from(h5, path)
        if name not in RESULTS:
            known = ", ".join((packing_file.FORMAT, *RESULTS))
            raise InputError(f"{path}: format {name}: this jampetsc reads {known}; use a newer one")
        PartList(h5, path).check()
        return RESULTS[name].read(h5, path)
