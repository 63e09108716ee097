"""Packings, networks, results and matrices as aligned text, for `jampetsc info` and commands that make a network."""

import itertools

import numpy as np

from jampetsc.analysis.elasticity import dimension_of, poisson_ratio
from jampetsc.analysis.error_bounds import relative_bound, relative_part_bounds
from jampetsc.columns import aligned
from jampetsc.io.ensemble import DISTINGUISHING_COLUMNS
from jampetsc.io.parts import parts_of
from jampetsc.io.provenance import recorded_dimension
from jampetsc.io.results import count_notes, notes_in
from jampetsc.laws.loads import AXES
from jampetsc.packing.contacts import BALANCED, imbalance, measure
from jampetsc.packing.packing import PARTICLES, PROOF_ATTRIBUTES, proved_minimum
from jampetsc.packing.spring_network import Network
from jampetsc.packing.units import name_stress_unit, units_text
from jampetsc.streams import visible

DIGITS = 10  # of numbers, enough to compare them with published ones
MAX_LISTED_VALUES = 6  # of a setting
RECORD_TOLERANCE = 1e-6  # largest relative difference from a recorded value without a note
LIBRARIES = ("jampetsc", "petsc", "slepc", "mumps", "mpi", "mpi4py", "numpy", "h5py", "python")
HEADER_ATTRIBUTES = (
    "format",
    "format_version",
    "run_id",
    "argv",
    "petsc_options",
    "packing",
    "packing_sha256",
    "date",
)
RUN_ATTRIBUTES = ("ranks", "scalar_type", "wall_seconds", "git_commit")


def aligned_text(rows) -> str:
    """Rows (name, value, …) in columns; a row of one word is a heading."""
    return "\n".join(
        row[0] if len(row) == 1 else "  " + "  ".join(row).rstrip()
        for row in aligned([[visible(word) for word in row] for row in rows], last=False)
    )


def number_text(value) -> str:
    """A number in DIGITS digits, several with commas; anything else as str."""
    if isinstance(value, float):
        return f"{value:.{DIGITS}g}"
    if isinstance(value, np.ndarray):
        return ", ".join(number_text(entry) for entry in value.tolist())
    return str(value)


def describe_study(path, ensemble) -> str:
    """How many tasks of each command are done, the values of every setting, and why tasks failed."""
    rows = [(f"{path}: study of {ensemble.rows} tasks",)]
    for command in dict.fromkeys(ensemble["command"].tolist()):
        tasks = ensemble.where(command=command)
        failed = tasks.failed.rows
        rows.append((command, f"{tasks.rows - failed} done" + (f", {failed} failed" if failed else "")))
    rows.append(("chosen",))
    for name in ("requested_n", "particle_count", "pressure", "phi", "seed", *DISTINGUISHING_COLUMNS[1:]):
        values = [
            value for value in np.unique(ensemble.get(name, [])).tolist() if value == value and value != ""
        ]
        if values:
            listed = values if len(values) <= MAX_LISTED_VALUES else [*values[:2], "…", values[-1]]
            text = ", ".join(value if isinstance(value, str) else f"{value:.6g}" for value in listed)
            rows.append(
                (name, text + (f"  ({len(values)} values)" if len(values) > MAX_LISTED_VALUES else ""))
            )
    failed = zip(*(ensemble.failed[column] for column in ("file", "state")), strict=True)
    reasons = [visible(f"  {name}: {why}") for name, why in failed]
    done = ensemble.where(state="done")
    noted = zip(*(done.get(name, [""] * done.rows) for name in ("command", "file", "notes")), strict=True)
    notes = count_notes(
        [{"command": command, "file": file, "notes": notes} for command, file, notes in noted]
    )
    return "\n".join([aligned_text(rows), *reasons, *notes])


def percent_text(share) -> str:
    """A share in per cent, of two digits, without an exponent: 100 %, 4.2 %, 0.031 %."""
    percent = 100.0 * share
    return f"{percent:.0f} %" if percent >= 9.95 else f"{percent:.2g} %"


def cell_text(cell) -> str:
    """Rows of a cell (D, D)."""
    rows = (", ".join(f"{side:.9g}" for side in row) for row in cell.tolist())
    return ", ".join(f"a{number} = ({row})" for number, row in enumerate(rows, 1))


def describe_packing(path, disks) -> str:
    """Geometry, state and record of a packing; published values stand beside the computed ones."""
    state, record = measure(disks), dict(disks.record)
    radii, potential, axes = disks.radii, disks.potential, AXES[: disks.dimension]
    diameter = 2.0 * float(radii.mean())
    letter = "d" if disks.dimension == 2 else "⟨d⟩"  # d is the unit of length in labels of spheres
    rattlers = int(np.count_nonzero(state.rattlers))
    computed = {
        "pressure": ("pressure p", state.pressure),
        "phi": ("packing fraction φ", disks.phi),
        "energy": ("energy U", state.energy),
    }
    for a, b in itertools.combinations_with_replacement(range(len(axes)), 2):
        name = f"{axes[a]}{axes[b]}"
        computed[f"stress_{name}"] = f"stress σ_{name}", float(state.stress[a, b])
    rows = [
        (f"{path}: packing of {disks.n} {PARTICLES[disks.dimension]}",),
        ("made by", str(record.pop("protocol", "unknown"))),
        ("potential", f"{potential}, stiffness {potential.stiffness}, k = {potential.k:g}"),
        ("radii", f"{radii.min():.6g} to {radii.max():.6g}, mean diameter {letter} = {diameter:.6g}"),
        ("units", units_text(name_stress_unit(potential, disks.dimension), potential.k)),
        ("cell", f"{cell_text(disks.cell)}, V = {disks.volume:.9g}"),
    ]
    notes = []
    for name, (label, value) in computed.items():
        published = record.pop(f"published_{name}", None)
        rows.append(
            (
                label,
                number_text(value),
                *([] if published is None else [f"published {number_text(published)}"]),
            )
        )
        recorded = record.pop(name, None)
        if isinstance(recorded, float) and abs(recorded - value) > RECORD_TOLERANCE * abs(value):
            notes.append(
                f"the file records {name} = {number_text(recorded)}: its positions have changed since"
            )
    for a, b in itertools.combinations(axes, 2):
        record.pop(f"published_stress_{b}{a}", None)
    rows += [
        ("contacts", f"{len(state.contacts)} that carry more than {state.threshold:.3g}"),
        ("rattlers", f"{rattlers} ({percent_text(rattlers / disks.n)})"),
        ("coordination Z", f"{number_text(state.coordination)} without rattlers"),
        ("max |F| / p", _residual(disks, state)),
    ]
    stated = record.get("negative_modes")
    if proved_minimum(disks):
        rows.append(("minimum", f"proved when it was made: {record['negative_modes_counted_by']}"))
    elif stated is not None:
        notes.append(f"the file records negative_modes = {stated}, but for other coordinates; ignored")
    notes += notes_in(record)
    for name in ("max_force", "coordination", "rattlers", "notes", *PROOF_ATTRIBUTES):  # measured above
        record.pop(name, None)
    if record:
        rows.append(("recorded in the file",))
        rows += [(name, number_text(value)) for name, value in sorted(record.items())]
    return "\n".join([aligned_text(rows), *(f"note: {note}" for note in notes)])


def _residual(disks, state):
    if not state.pressure > 0:
        return "no contacts: below jamming"
    remark = "" if imbalance(disks, state) <= BALANCED else ": forces are not balanced"
    return f"{state.max_force / state.pressure:.2e}{remark}"


def _origin(a):
    """The source of a result: a packing, other files, or random disks of its command."""
    if "packing" in a:
        return str(a["packing"])
    if "sources" in a:
        return str(a["sources"])
    return (
        f"{a['particle_count']} random {PARTICLES[recorded_dimension(a)]}"
        if "particle_count" in a
        else "an unknown packing"
    )


def describe_result(path, loaded) -> str:
    """Origin, law and contents of a result."""
    a = dict(loaded.attributes)
    scalar = a.get("scalar_type")
    kind = loaded.format.removeprefix("jampetsc-")
    rows = [
        (f"{path}: {kind} of {_origin(a)}",),
        *([("packing sha256", str(a.get("packing_sha256", "unknown")))] if "packing" in a else []),
        ("law", ", ".join(f"{name} = {number_text(value)}" for name, value in loaded.law.items()) or "none"),
        ("made", f"{a.get('date', 'unknown')} in {a.get('wall_seconds', float('nan')):.3g} s"),
        ("command", str(a.get("argv", "unknown"))),
        ("PETSc options", str(a.get("petsc_options", "")) or "none"),
        (
            "ranks",
            f"{a.get('ranks', 'unknown')}"
            + (f", PETSc with {scalar} scalars" if scalar else ", without PETSc"),
        ),
        (
            "versions",
            ", ".join(f"{name} {a[f'{name}_version']}" for name in LIBRARIES if f"{name}_version" in a),
        ),
        ("git commit", str(a.get("git_commit", "unknown"))),
        ("files", _files(len(parts_of(path).sizes)) if loaded.file else "none: in memory"),
    ]
    if "k" in a and "stress_unit" in a:
        rows.append(("units", units_text(a["stress_unit"], a["k"], a.get("tau1"))))
    if {"G", "omega"} <= set(loaded):
        rows += _moduli(loaded)
    elif "omega" in loaded and "susceptibility" in loaded:
        rows += _susceptibilities(loaded)
    listed = {
        "notes",
        "stress_unit",
        *HEADER_ATTRIBUTES,
        *RUN_ATTRIBUTES,
        *loaded.law,
        *(f"{name}_version" for name in LIBRARIES),
    }
    remaining = {name: value for name, value in a.items() if name not in listed}
    if remaining:
        rows.append(("attributes",))
        rows += [(name, number_text(value)) for name, value in sorted(remaining.items())]
    rows.append(("datasets",))
    rows += [
        (name, str(loaded.stored(name).shape), str(loaded.stored(name).dtype)) for name in sorted(loaded)
    ]
    return "\n".join([aligned_text(rows), *(f"note: {note}" for note in notes_in(a))])


def _files(parts):
    return f"joint file and {parts} parts, complete" if parts else "one, complete"


def _susceptibilities(sweep):
    omega, chi = sweep["omega"], sweep["susceptibility"].reshape(len(sweep["omega"]), -1)
    rows = [("frequencies", f"{len(omega)}, from {omega.min():.4g} to {omega.max():.4g}")]
    stored = [f"susceptibility_error_bound_{part}" for part in ("storage", "loss")]
    bounds = np.stack([sweep[name].reshape(chi.shape) for name in stored], axis=-1)
    for label, relative in zip(
        ("χ'", "χ''"), np.moveaxis(relative_part_bounds(chi, bounds), -1, 0), strict=True
    ):
        worst = int(np.argmax(relative.max(axis=1)))
        rows.append(
            (f"worst bound, {label}", f"{relative[worst].max():.1e} relative, at omega = {omega[worst]:.4g}")
        )
    return rows


def _moduli(sweep):
    omega, G = sweep["omega"], sweep["G"]
    if "susceptibility" in sweep and G.ndim > 1:
        return _susceptibilities(sweep)
    rows = [("frequencies", f"{len(omega)}, from {omega.min():.4g} to {omega.max():.4g}")]
    stored = ("error_bound_storage", "error_bound_loss")
    parts = [sweep[name] if name in sweep else np.full(len(G), np.inf) for name in stored]
    of_parts = relative_part_bounds(G, np.stack(parts, axis=-1)).T
    named = zip(stored, ("G'", "G''"), of_parts, strict=True)
    bounds = [(label, relative) for name, label, relative in named if name in sweep]
    if "error_bound" in sweep:
        bounds.append(("G*", relative_bound(sweep["error_bound"], G)))
    for name, relative in bounds:
        worst = int(np.argmax(relative))
        rows.append(
            (f"worst bound, {name}", f"{relative[worst]:.1e} relative, at omega = {omega[worst]:.4g}")
        )
    if "C" in sweep:
        text = poisson_text(omega, sweep["bulk_modulus"], G, dimension_of(sweep["C"]))
        rows.append(("Poisson ratio", text))
    return rows


def poisson_text(omega, bulk, shear, dimension) -> str:
    """Real part of Poisson's ratio of K* and G* (M,), averaged over all directions, at both ends of omega (M,)."""
    ends = sorted({int(np.argmin(omega)), int(np.argmax(omega))}, key=lambda row: omega[row])
    ratios = poisson_ratio(bulk, shear, dimension).real
    return ", ".join(f"{ratios[row]:.4g} at omega {omega[row]:.3g}" for row in ends)


def describe_matrices(network, is_packing, physics, facts, ranks) -> str:
    """Sizes, symmetry and inertia of K and B, and whether the packing, or the network, is a minimum."""
    from jampetsc.petsc.inertia import SHIFT
    from jampetsc.response.factor_memory import GIGABYTE

    contacts = facts.contacts
    D, particles = network.dimension, PARTICLES[network.dimension]
    springs = network.turns_elastically
    each, dofs = (D, D * (D + 1) // 2) if springs else (1, D)
    excess = each * contacts - (dofs * network.n - D)
    count = f"{each}·{contacts} contacts with springs" if springs else f"{contacts} contacts"
    moving = "displacements and spins" if springs else "displacements"
    rows = [
        (f"K and B for {physics}, on {ranks} rank{'s' * (ranks > 1)}",),
        (
            "unknowns",
            f"{facts.unknowns}, {facts.dofs} for each of {network.n} {particles if is_packing else 'nodes'}; "
            f"{network.rattlers} {'rattlers' if is_packing else 'nodes without bonds'} left out",
        ),
        ("nonzeros", f"{facts.nonzeros} in each of K and B, one pattern"),
        ("factor of K + sB", f"about {facts.factor_bytes / GIGABYTE:.2g} GB"),
        *(
            (
                ("contacts", f"{contacts}, Z = {number_text(2.0 * contacts / network.n)}"),
                ("Maxwell's count", f"{count} − ({dofs}·{network.n} − {D}) = {excess} in excess"),
            )
            if is_packing
            else [("bonds", str(contacts))]
        ),
        ("components", f"{facts.pieces} connected, {facts.gears} of them bipartite (gears)"),
        ("pinned unknowns", _pins(facts)),
        ("asymmetry", f"|K − Kᵀ|/|K| = {facts.asymmetry_K:.1e}, |B − Bᵀ|/|B| = {facts.asymmetry_B:.1e}"),
        ("eigenvalues", "negative", "zero", "positive", ""),
        _inertia("K, pre-stress", facts.with_prestress, f"{moving}, nothing pinned"),
        _inertia("K, no pre-stress", facts.without_prestress, f"{moving}, nothing pinned"),
        _inertia("B", facts.damping, "without the pinned unknowns"),
    ]
    head = len(rows) - 4
    return "\n".join(
        [
            aligned_text(rows[:head]),
            aligned_text(rows[head:]),
            f"  inertia of L D Lᵀ; zero: within {SHIFT:.0e} of it, the matrix scaled to a unit diagonal",
            *minimum_lines(facts, network.imbalance <= BALANCED),
        ]
    )


def _inertia(name, inertia, remark):
    return name, str(inertia.negative), str(inertia.zero), str(inertia.positive), remark


def _pins(facts):
    if not facts.pins:
        return "0: every move meets drag"
    gears = f" and {facts.pins - facts.translations} gear mode{'s' * (facts.pins - facts.translations > 1)}"
    return f"{facts.pins}: {facts.translations} translations" + gears * (facts.pins > facts.translations)


def minimum_lines(facts, at_rest) -> list[str]:
    """Lines on the meaning of the numbers of eigenvalues; at_rest: the forces are balanced."""
    K, free = facts.with_prestress, facts.without_prestress
    lines = []
    floppy = free.zero - facts.free_moves
    if K.negative:
        lines.append(
            f"not a minimum: K has {K.negative} negative eigenvalue{'s' * (K.negative > 1)}; error bounds of a sweep "
            "do not hold; `sweep --method direct` solves all the same, --no-prestress leaves out what makes them "
            "negative"
        )
    elif not at_rest:
        lines.append(
            "not a minimum: K has no negative eigenvalue, but the forces are not balanced; finish the quench, "
            "which also leaves out friction"
        )
    elif K.zero > facts.free_moves:
        lines.append(f"marginal: {K.zero - facts.free_moves} moves besides the translations cost no energy")
    else:
        lines.append("a minimum: K has no negative eigenvalue, and only the translations cost no energy")
    if floppy > 0:
        lines.append(f"floppy without pre-stress: {floppy} moves besides the translations stretch no contact")
    if facts.damping.zero:
        lines.append(f"B lets {facts.damping.zero} moves pass besides those pinned")
    return lines


def describe_network(name, network: Network) -> str:
    """Cell, bonds, forces and record of a network."""
    bonds = network.linear_bonds
    isolated = int(np.count_nonzero(network.isolated))
    record = {key: value for key, value in network.record.items() if key != "protocol"}
    return aligned_text(
        [
            (f"{name}: network of {network.n} nodes and {len(bonds)} bonds",),
            ("made by", str(network.record.get("protocol", "unknown"))),
            ("cell", f"{cell_text(network.cell)}, V = {network.volume:.9g}"),
            ("bonds", f"{2 * len(bonds) / network.n:.6g} for each node; {isolated} nodes have none"),
            ("lengths", _range(bonds.distance)),
            ("stiffness", f"{_range(bonds.stiffness)}, unit k = {network.k:g}"),
            ("units", units_text(name_stress_unit(None, network.dimension), network.k)),
            ("forces", _forces(network)),
            ("radii", "none: nodes do not roll" if network.radii is None else _range(network.radii)),
            *((key, number_text(value)) for key, value in sorted(record.items()) if value is not None),
        ]
    )


def _range(values):
    low, high = float(values.min()), float(values.max())
    return f"{low:.6g}" if high - low <= 1e-12 * abs(high) else f"{low:.6g} to {high:.6g}"


def _forces(network):
    if not network.tension.any():
        return "none: every bond is at rest"
    push, pull = (int(np.count_nonzero(sign * network.tension > 0)) for sign in (-1, 1))
    balance = network.imbalance
    state = "balanced" if balance <= BALANCED else f"not balanced, max |F| / mean |T| = {balance:.1e}"
    return f"{push} bonds push, {pull} pull; p = {network.pressure:.6g}; {state}"
