"""Loads: displacement gradients E (D, D) that strain a packing, u_i = ũ_i + ε E x_i with the amplitude ε, or forces.

The modulus of a load is that of the energy along F = 1 + εE, M_E = V⁻¹ d²U/dε², and its viscous part. For E with the
symmetric part s, elastic constants C of symmetric loads and the stress σ (compression negative), exactly

    M_E = s:C:s + σ : (EᵀE − s²) ,      so for E = x̂ŷ      G = C_xyxy + (3σ_yy − σ_xx)/4 .

That holds for the elastic part, and for all of M_E where a rotation of the whole dissipates nothing; contacts whose
transverse motion is damped resist it. Coefficients of the Cauchy stress against strain (Barron & Klein, Proc. Phys.
Soc. 85, 523 (1965)) differ from C by terms of the order of σ.

    xy, yx, …       simple shear E = x̂ŷ, u_x = ε y
    pure-xy, …      pure shear along the axes, E = ½(x̂x̂ − ŷŷ)
    compression     E = 1/D, amplitude: change of the volume, relative
    xx, yy, …       one axis, E = x̂x̂
    D² numbers      the rows of E
    tensor          all symmetric loads xx, yy, (zz, yz, xz,) xy in this order, shears with E = ½(x̂ŷ + ŷx̂)
    wave:1,0:transverse, point:7, points:100, …     forces on particles, see `laws.probes`
"""

import itertools
import math
from dataclasses import dataclass

import numpy as np

from jampetsc.errors import InputError, named
from jampetsc.laws.probes import Forces, PointForces, Wave, Waves, read_probe

AXES = "xyz"
TENSOR = "tensor"
DEFAULT = "xy"
DIMENSIONS = (2, 3)
STRESS_MEASURE = "energy along F = 1 + eps E"  # of moduli, as files say it


@dataclass(frozen=True)
class Load:
    """A displacement gradient with a name.

    name    as `load` takes it
    rows    rows of E, D tuples of D numbers
    """

    name: str
    rows: tuple

    @property
    def gradient(self):
        """E (D, D)."""
        return np.array(self.rows, float)

    @property
    def dimension(self) -> int:
        """D."""
        return len(self.rows)

    @property
    def is_shear(self) -> bool:
        """Whether it leaves the volume as it is, to first order."""
        return float(np.trace(self.gradient)) == 0.0

    @property
    def deviator(self):
        """Traceless symmetric part of E, (D, D)."""
        symmetric = 0.5 * (self.gradient + self.gradient.T)
        return symmetric - np.trace(symmetric) / self.dimension * np.eye(self.dimension)

    @property
    def rotation(self):
        """Ω with Ω × x = ½ (E − Eᵀ) x, the rotation of the affine flow: (1,), in 3D (3,)."""
        turn = 0.5 * (self.gradient - self.gradient.T)
        return turn[[1], [0]] if self.dimension == 2 else turn[[2, 0, 1], [1, 2, 0]]

    def imposed(self, bonds):
        """E r of bonds r (M, D): how far a unit amplitude moves their ends apart, (M, D)."""
        return bonds @ self.gradient.T


@dataclass(frozen=True, eq=False)
class ForceLoad(Load):
    """Forces on particles, without any strain; rows are zero. Two are equal only where they are one.

    forces   (m, D) of this rank's particles that bear load; on each connected component they sum to zero
    sizes    (m, D) of their terms, ≥ |forces|, relative to which they round
    """

    forces: np.ndarray
    sizes: np.ndarray

    __eq__, __hash__ = object.__eq__, object.__hash__


def force_load(name: str, forces, sizes) -> ForceLoad:
    """Forces (m, D) with the sizes (m, D) of their terms as a load."""
    dimension = forces.shape[1]
    return ForceLoad(name, dimension * ((0.0,) * dimension,), forces, sizes)


def fluid_dissipation(load: Load, other: Load) -> float:
    """2 s′:s″ of the deviators of two loads: an incompressible fluid of viscosity 1 dissipates as much per volume."""
    return 2.0 * float(np.sum(load.deviator * other.deviator))


def _load(name, gradient) -> Load:
    return Load(name, tuple(map(tuple, np.asarray(gradient, float).tolist())))


def _dyad(first, second, dimension):
    gradient = np.zeros((dimension, dimension))
    gradient[AXES.index(first), AXES.index(second)] = 1.0
    return gradient


def simple_shear(dimension: int = 2, plane: str = "xy") -> Load:
    """u_x = ε y in the plane xy: E = x̂ŷ."""
    return _load(plane, _dyad(*plane, dimension))


def pure_shear(dimension: int = 2, plane: str = "xy") -> Load:
    """Shear along the axes of a plane: E = ½(x̂x̂ − ŷŷ)."""
    first, second = plane
    return _load(f"pure-{plane}", 0.5 * (_dyad(first, first, dimension) - _dyad(second, second, dimension)))


def compression(dimension: int = 2) -> Load:
    """The same change of length along all axes: E = 1/D, amplitude: relative change of the volume."""
    return _load("compression", np.eye(dimension) / dimension)


def uniaxial(dimension: int = 2, axis: str = "x") -> Load:
    """Change of length along one axis: E = x̂x̂."""
    return _load(2 * axis, _dyad(axis, axis, dimension))


def tensor_components(dimension: int = 2) -> tuple[str, ...]:
    """Pairs of axes in the order of the elastic tensor: xx, yy, (zz, yz, xz,) xy."""
    axes = AXES[:dimension]
    shears = [pair for pair in ("yz", "xz", "xy") if set(pair) <= set(axes)]
    return (*(2 * axis for axis in axes), *shears)


def symmetric_loads(dimension: int = 2) -> tuple[Load, ...]:
    """The D(D + 1)/2 loads of the elastic tensor: xx, yy, (zz, yz, xz,) xy, shears with E = ½(x̂ŷ + ŷx̂)."""
    loads = []
    for first, second in tensor_components(dimension):
        if first == second:
            loads.append(uniaxial(dimension, first))
        else:
            gradient = 0.5 * (_dyad(first, second, dimension) + _dyad(second, first, dimension))
            loads.append(_load(f"symmetric-{first}{second}", gradient))
    return tuple(loads)


def named_loads(dimension: int) -> dict[str, Load]:
    """{name: Load} of all single loads with a name."""
    axes = AXES[:dimension]
    loads = [simple_shear(dimension, a + b) for a, b in itertools.permutations(axes, 2)]
    loads += [pure_shear(dimension, a + b) for a, b in itertools.combinations(axes, 2)]
    loads += [uniaxial(dimension, axis) for axis in axes]
    return {load.name: load for load in (*loads, compression(dimension))}


class LoadChoice(str):
    """The load of a job, or the tensor, as the text in files and tables.

    value   a name of the list above, "tensor", or D² numbers with commas; or a `Load`, or an array (D, D) of a gradient
            or (N, D) of forces on N > D particles

    Raises InputError for a name that is not in the list, and for numbers that are no displacement gradient.

    probe   which forces it is, see `laws.probes`; None for a strain
    """

    __slots__ = ("probe",)

    def __new__(cls, value):
        probe = _probe(value)
        choice = super().__new__(cls, _text(value) if probe is None else str(probe))
        choice.probe = probe
        return choice

    def __getnewargs__(self):
        """What copies in other processes are made from: the array of forces has no name."""
        array = getattr(self.probe, "array", None)
        return (str(self) if array is None else array,)

    @property
    def is_tensor(self) -> bool:
        """Whether it is all symmetric loads."""
        return self == TENSOR

    @property
    def is_shear(self) -> bool:
        """Whether its modulus is a shear modulus; that of the tensor is, that of forces is not."""
        return self.is_tensor or (
            self.probe is None and all(load.is_shear for load in self.by_dimension().values())
        )

    def of(self, dimension: int) -> tuple[Load, ...]:
        """The strains in D dimensions: one, all of the tensor, none of forces.

        Raises InputError for a load of another dimension.
        """
        if self.is_tensor:
            return symmetric_loads(dimension)
        is_probe = self.probe is not None
        load = None if is_probe else self.by_dimension().get(dimension)
        if load is None and not (is_probe and self.probe.dimension in (None, dimension)):
            raise InputError(
                f"{named('load')} {self}: not a load in {dimension} dimensions. Give another one."
            )
        return () if is_probe else (load,)

    def field_and_tensor(self, dimension: int) -> tuple[Load, tuple[Load, ...]]:
        """The load whose fields are meant, and the loads of the tensor: simple shear and all of them, or one and none.

        Raises InputError as `of`.
        """
        loads = self.of(dimension)
        return (simple_shear(dimension), loads) if self.is_tensor else (loads[0], ())

    def by_dimension(self) -> dict[int, Load]:
        """{D: the strain in D dimensions}, of each in which it is one; of a single load."""
        by_name = {dimension: named_loads(dimension).get(self) for dimension in DIMENSIONS}
        if any(by_name.values()):
            return {dimension: load for dimension, load in by_name.items() if load is not None}
        numbers = np.array(self.split(","), float)
        dimension = math.isqrt(len(numbers))
        return {dimension: _load(str(self), numbers.reshape(dimension, dimension))}


def read_strain(value) -> LoadChoice:
    """The load of a job that takes no forces. Raises InputError for those, and as `LoadChoice`."""
    choice = LoadChoice(value)
    if choice.probe:
        raise InputError(
            f"{named('load')} {choice}: forces, which only sweep and quasistatic take. Give a displacement gradient."
        )
    return choice


def _probe(value):
    """The probe of a value that `LoadChoice` takes; None for a strain."""
    if isinstance(value, LoadChoice):
        return value.probe
    if isinstance(value, str):
        return read_probe(value)
    if isinstance(value, Wave):
        return Waves((value,))
    if isinstance(value, Waves | PointForces | Forces):
        return value
    if isinstance(value, Load):
        return None
    rows, *columns = np.shape(np.asarray(value, object)) or (0,)
    return Forces.of(value) if len(columns) == 1 and columns[0] in DIMENSIONS and rows > columns[0] else None


def _text(value) -> str:
    """The text of a `LoadChoice`."""
    if isinstance(value, Load):
        named_load = named_loads(value.dimension).get(value.name)
        return value.name if named_load == value else _numbers_text(np.ravel(value.rows))
    if isinstance(value, str):
        names = {TENSOR, *(name for dimension in DIMENSIONS for name in named_loads(dimension))}
        if value in names:
            return value
    words = value.split(",") if isinstance(value, str) else np.ravel(np.asarray(value, object)).tolist()
    try:
        numbers = [float(word) for word in words]
    except (TypeError, ValueError):
        raise InputError(
            f"{named('load')} {value}: no load of this name. Give {', '.join(named_loads(2))} (in 3D also xz, zz, …), "
            f"{TENSOR}, or the D² numbers of a displacement gradient, row by row."
        ) from None
    return _numbers_text(numbers)


def _numbers_text(numbers):
    numbers = np.asarray(numbers, float)
    if len(numbers) not in [dimension**2 for dimension in DIMENSIONS]:
        raise InputError(
            f"{named('load')}: {len(numbers)} numbers. Give D² of them, 4 in two dimensions, 9 in three, row by row."
        )
    if not np.isfinite(numbers).all() or not numbers.any():
        raise InputError(f"{named('load')}: numbers must be finite, and not all zero. Give another gradient.")
    return ",".join(repr(float(number)) for number in numbers)
