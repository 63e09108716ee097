"""Motion of disks in results: fields of sweeps, vectors of modes, snapshots of flows, with their packing."""

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from jampetsc.analysis.order import mean_order
from jampetsc.analysis.velocity_correlation import LaneCorrelation, correlate_velocities
from jampetsc.errors import InputError, about, named
from jampetsc.io.packing_file import read_source
from jampetsc.io.provenance import recorded_dimension
from jampetsc.packing.packing import Packing
from jampetsc.packing.potentials import Potential
from jampetsc.packing.spring_network import Network

# phase of the real part of a field, the default first; files hold fields per strain
PHASES = ("stress", "strain")
# attributes that flows share whose correlations are averaged
FLOW_KIND = ("model", "rate", "particle_count", "mass")
PHI_TOLERANCE = 1e-6  # φ of such flows may differ by this
# in files without positions, such as in papers/kept
STORED_ORDER = "snapshots/psi6_local", "snapshots/psi6_global"
_MAX_DISPLACEMENT = 1e100  # displacements per unit strain that no packing has
_FREQUENCY_TOLERANCE = 0.01  # relative distance from a stored frequency: 0.0316 means 10^-1.5


def packing_of(result, packing=None) -> Packing:
    """As `source_of`, of a result of a packing. Raises InputError for a result of a network as well."""
    source = source_of(result, packing)
    if not isinstance(source, Packing):
        raise InputError(f"{result.path}: of a network. Give a result of a packing.")
    return source


def radii_of(source: Packing | Network):
    """Radii of the disks, (N,); of nodes without any half the mean length of a bond."""
    if source.radii is not None:
        return source.radii
    return np.full(source.n, 0.5 * float(source.linear_bonds.distance.mean()))


def source_of(result, packing=None) -> Packing | Network:
    """The packing or network that a result was made from: `packing` (in memory or a file), else the one in memory with
    the result, else the file beside it.

    Raises InputError for a missing packing, and for another one: a file or a Network has to have the recorded
    fingerprint, a Packing that or the same number of disks and φ.
    """
    name, recorded = (result.attributes.get(key) for key in ("packing", "packing_sha256"))
    if packing is None and result.packing is not None:
        return result.packing
    if isinstance(packing, Packing | Network):
        facts = [result.attributes.get(key) for key in ("particle_count", "phi")]
        if packing.fingerprint != recorded and facts != [packing.n, getattr(packing, "phi", np.nan)]:
            raise InputError(
                f"{named('packing')}: not the packing that {result.path.name} was made from. Give that packing."
            )
        return packing
    path = Path(packing) if packing else result.path.parent / str(name)
    if not packing and (name is None or not path.is_file()):
        what = f"packing {name} is not beside it" if name else "packing was in memory"
        raise InputError(f"{result.path}: its {what}. Give it with {named('packing')}.")
    disks = read_source(path)
    if recorded not in (None, disks.fingerprint):
        raise InputError(
            f"{path}: not the packing that {result.path.name} was made from (sha256 {disks.fingerprint[:12]}… "
            f"instead of {recorded[:12]}…). Give that packing with {named('packing')}."
        )
    return disks


def field_at(result, row):
    """(displacement (n, D), rotation (n,), of spheres (n, 3), or None), complex, of a sweep's field number `row`.

    Raises InputError for a field with nan or absurdly large values.
    """
    fields = result.fields
    arrays = [None if part is None else part[int(row)] for part in (fields.displacement, fields.rotation)]
    for array in arrays:
        if array is not None and not (np.abs(array) < _MAX_DISPLACEMENT).all():  # nan too
            raise InputError(
                f"{result.path}: its field at omega = {fields.omega[int(row)]:g} holds NaN, Inf or "
                "absurdly large values. Run the sweep again."
            )
    return tuple(arrays)


def mode_vectors(result, number: int):
    """Eigenvectors (n, D) of mode `number` of a modes file, from 1.

    Raises InputError for a file that was made without them, and for a mode that it does not have.
    """
    if "modes" not in result:
        raise InputError(f"{result.path}: modes without eigenvectors. Run modes again with them.")
    stored = result.stored("modes")
    if not 1 <= number <= stored.shape[0]:
        raise InputError(
            f"{named('mode')} {number}: not in {result.path.name}. Give one from 1 to {stored.shape[0]}."
        )
    return stored[number - 1]


def phase_factor(result, omega, phase):
    """e^{−i arg G*(ω)}, which turns a sweep's fields, stored per strain, into the phase of the stress; 1 for "strain".

    u*/δσ = (u*/γ*)/G* (BT impose the stress, eq. 13): Re u* then is the motion when the stress is at its peak, −Im u*
    a quarter of a period later, when it is zero. Raises InputError where the sweep has no modulus at ω.
    """
    if phase == "strain":
        return 1.0
    try:
        G = result.modulus(omega)
    except InputError as error:
        raise InputError(
            f"{error.message(named)} Or use {named('phase')} strain, which does not need G*."
        ) from None
    if not abs(G) > 0:  # nan too
        raise InputError(
            f"{result.path}: no modulus at omega = {omega:g}, hence no phase of the stress. Use {named('phase')} "
            "strain."
        )
    return np.conj(G) / abs(G)


def disk_rows(result, disks):
    """Rows (n,) of the packing that the disks of a result are. Raises InputError where it has no such rows."""
    rows = result["particles"] if "particles" in result else np.arange(disks.n)
    if not ((0 <= rows) & (rows < disks.n)).all():
        raise InputError(
            f"{result.path}: dataset particles: not rows of the {disks.n} particles of the packing. "
            "Make the file again."
        )
    return rows


def particle_rows(result, disks):
    """Rows (n,) of the packing that the fields of a sweep belong to. Raises InputError if the numbers do not fit."""
    count, rows = result.fields.displacement.shape[1], disk_rows(result, disks)
    if not count:
        raise InputError(
            f"{result.path}: fields without particles, as all are rattlers. Sweep a jammed packing."
        )
    if len(rows) != count:
        raise InputError(
            f"{result.path}: fields of {count} particles do not fit the {disks.n} particles of the packing. "
            "Run the sweep again."
        )
    return rows


def chosen_frequencies(result, frequencies=None):
    """Rows of the stored fields at frequencies (in the file's units), or at up to four of them.

    Raises InputError naming the nearest stored ones where a frequency is not there.
    """
    stored = result.fields.omega
    if not len(stored):
        raise InputError(f"{result.path}: no fields. Run the sweep with {named('fields')}.")
    if frequencies is None:
        order = np.argsort(stored)
        return order[np.unique(np.linspace(0, len(order) - 1, min(len(order), 4)).round().astype(int))]
    rows = []
    for omega in frequencies:
        distance = np.abs(np.log(stored / omega))
        nearest = int(distance.argmin())
        if not distance[nearest] <= _FREQUENCY_TOLERANCE:
            nearest_stored = ", ".join(f"{w:g}" for w in sorted(stored[np.argsort(distance)[:3]]))
            raise InputError(
                f"{result.path}: no fields at omega = {omega:g} (nearest {nearest_stored}). Choose one of these, or "
                f"run the sweep with {named('fields')}."
            )
        rows.append(nearest)
    return np.array(rows)


@dataclass(frozen=True, eq=False, init=False)
class Snapshot(Packing):
    """Disks of a flow at one moment, for everything that takes a packing."""

    strain: float = 0.0  # γ since the start
    rate: float = 0.0  # γ̇
    velocities: np.ndarray | None = None  # (N, D) without the affine flow, γ̇ y along x
    spins: np.ndarray | None = (
        None  # (N,) or (N, 3) angular velocities, if disks roll; −γ̇/2 about z in affine flow
    )


def snapshot(result, row=-1) -> Snapshot:
    """A snapshot of a flow, by default the last, as a packing with `velocities`, `spins` and
    `unwrapped`; its record has `units`, and the number of disks of `walls`, if there are any.

    Raises InputError where the file has no such snapshot.
    """
    if "snapshots/positions" not in result:
        raise InputError(f"{result.path}: no snapshots. Run the flow with {named('snapshots')}.")
    count = len(result.stored("snapshots/positions"))
    if not -count <= row < count:
        raise InputError(f"{result.path}: no snapshot {row} ({count}, numbered from 0). Choose another.")
    a = result.attributes
    potential = Potential.of_record(a)
    names = ("positions", "cell", "velocities", "strain", "images", "spins")
    kept = {name: result.stored(f"snapshots/{name}")[row] for name in names if f"snapshots/{name}" in result}
    record = {name: convert(a[name]) for name, convert in (("walls", int), ("units", str)) if name in a}
    disks = Snapshot.from_positions(
        kept.pop("positions"), result["snapshots/radii"], kept.pop("cell"), potential, record=record
    )
    return disks.replace(rate=float(a["rate"]), **kept)


def check_snapshots(result) -> None:
    """Raise InputError where a flow has no snapshots, or these have positions or cells that no disks have."""
    if "snapshots/positions" not in result:
        raise InputError(f"{result.path}: no snapshots. Run the flow with {named('snapshots')}.")
    radii = result["snapshots/radii"]
    for positions, cell in zip(result["snapshots/positions"], result["snapshots/cell"], strict=True):
        with about(result.path):
            Packing.from_positions(positions, radii, cell)


def six_fold_order(result):
    """`analysis.order.mean_order` of each snapshot of a flow, as stored in a file without positions: (S,) each.

    Raises InputError for a file without snapshots, and for spheres.
    """
    if recorded_dimension(result.attributes) != 2:
        raise InputError(
            f"{result.path}: spheres, and six-fold order is of disks in a plane. Give flows of disks, "
            "or look at the spheres in OVITO: jampetsc export FILE --out FILE.xyz."
        )
    if STORED_ORDER[0] in result:
        return tuple(result[name] for name in STORED_ORDER)
    check_snapshots(result)
    walls = int(result.attributes.get("walls", 0))
    return mean_order(result["snapshots/positions"], result["snapshots/cell"], walls)


def velocity_profiles(results, low: float, high: float) -> list:
    """Velocity profiles (rows, B) of flow files, for each its rows with low < strain ≤ high.

    Raises InputError for files without profiles, and where one has no row there.
    """
    profiles = []
    for result in results:
        if recorded_dimension(result.attributes) != 2:
            raise InputError(
                f"{result.path}: spheres, and walls, between which profiles are measured, are of disks. Give flows of "
                "disks, or look at the spheres in OVITO: jampetsc export FILE --out FILE.xyz."
            )
        if "velocity_profile" not in result:
            raise InputError(f"{result.path}: no velocity profiles. Run the flow with {named('walls')}.")
        strain = result["strain"]
        rows = result["velocity_profile"][(strain > low * (1 + 1e-9)) & (strain <= high * (1 + 1e-9))]
        if not len(rows):
            raise InputError(
                f"{result.path}: no row between strain {low:g} and {high:g}. Choose other strains."
            )
        profiles.append(rows)
    return profiles


def correlate_lanes(results, lane: float, width: float) -> LaneCorrelation:
    """`correlate_velocities` of the snapshots of flow files of one kind.

    Raises InputError as that does, and for files without snapshots or of different kinds.
    """
    first = results[0]
    for result in results:
        _require_one_kind(result, first)
        check_snapshots(result)

    def snapshots():
        for result in results:
            arrays = (result[f"snapshots/{name}"] for name in ("positions", "velocities", "cell"))
            for positions, velocities, cell in zip(*arrays, strict=True):
                yield positions, velocities[:, 1], cell

    diameter, rate = 2.0 * float(np.mean(first["state/radii"])), float(first.attributes["rate"])
    with about(first.path):
        return correlate_velocities(snapshots(), diameter, rate, lane, width)


def _require_one_kind(result, first) -> None:
    """Raise InputError unless a flow can be averaged with the first."""
    if "snapshots/velocities" not in result:
        raise InputError(f"{result.path}: no snapshots. Run the flow with {named('snapshots')}.")
    if "walls" in result.attributes:
        raise InputError(
            f"{result.path}: a flow between walls, which is not homogeneous. Give flows without walls."
        )
    for name in FLOW_KIND:
        value, other = result.attributes.get(name), first.attributes.get(name)
        if value != other:
            raise InputError(
                f"{result.path}: {name} {value}, but {first.path.name} has {other}. Average flows of one kind."
            )
    if abs(result.attributes["phi"] - first.attributes["phi"]) > PHI_TOLERANCE:
        raise InputError(f"{result.path}: another phi than {first.path.name}. Average flows of one phi.")
