"""How a result came about: the attributes that every result file carries."""

import datetime
import re
import shlex
import sys
from pathlib import Path

from jampetsc.io.declaration import Table
from jampetsc.io.request import shortened
from jampetsc.laws.damping import OPTIONS, WEIGHTS
from jampetsc.version import VERSION

LAW_PARAMETERS = (
    *dict.fromkeys((*OPTIONS, *WEIGHTS)),
    "prestress",
    "tangential_stiffness",
    "tau1",
    "alpha",
    "stress",
    "mass",
    "mass_by",
)
PROVENANCE = Table(
    r"""
format, format_version | text | | which of the kinds here, and the version of its layout; readers refuse another major
  version
run_id | text | | unique to the run
argv, date | text? | | command line; when the run ended (ISO 8601)
wall_seconds | float? | s | duration
request | text? | | identity of the job (JSON): command, `format_version`, options with their defaults, hashes of its
  input files; without PETSc's options, `--threads`, `--parallel` and `--last`. The same job finds its unchanged result
  and ends; any other file is replaced by `--overwrite` alone
notes | text? | | warnings about the numbers, `KIND: details. Remedy`, separated by `; `
instruction_set | text? | | processors for which loops were compiled; seeds give the same packing only where it is the
  same ([installation](../install.md#processors))
git_commit | text? | | of the program, if it ran from a checkout
*_version | text | | versions of the program and of PETSc, SLEPc, MUMPS, MPI, numpy, h5py, python if they were used
scalar_type, petsc_options, ranks | text, text, int? | | if PETSc was used: real or complex; all options in force,
  given or set by the program; number of ranks
packing, packing_sha256 | text? | | name of the packing or network file it was made from, and hash of its disks:
  coordinates to the last bit, radii, cell, potential (`packing.fingerprint`), or of all of a network
sources, source_runs | text? | | of spectrum, correlation and collapse: names of the files and their `run_id`
law, normal, beta, rotations, eta_f, tau1 | text, float, float, bool, float, float > 0? | | damping law, and its
  parameters among these
transverse, sliding, drag, spin_drag | float? | | with `normal` and `eta_f` the weights of a law of one's own; of one
  made in python, `law` is its label and weights of 0 are left out
prestress | bool? | | whether K keeps the f/r term of its contacts (BT eq. 4)
tangential_stiffness | float? | | weight in K of the squared sliding of rims, over the stiffness of each contact;
  missing: 0
mass | float? | k time² | of every particle, or by the volume of particles of one of the mean diameter; missing: none
mass_by | text? | | with `mass`: number or volume
load | text? | | displacement gradient E: a name, its numbers, or `tensor`, the symmetric loads xx, yy, (zz, yz, xz,)
  xy, shears with E = ½(x̂ŷ + ŷx̂); missing: simple shear `xy`, as are the fields of `tensor`. Or forces:
  `wave:1,0:transverse`, `point:7`, `points:100`, `forces:` and a hash of their array
stress_measure | text? | | which modulus: energy along F = 1 + εE, V⁻¹ d²U/dε² and its viscous part
alpha, stress, stress_ratio | float? | | with `--alpha`: exponent of the viscous force, amplitude of the shear stress,
  and its ratio to k, of spheres to k/d, to k/d² in place of k where the stiffness is k/σ², d the mean diameter
stress_unit | text? | | unit of stress, pressure and moduli by that of `k`: k, k/length, …; numbers are absolute
dimension | int in 2 3? | | 3 for spheres and for networks in three dimensions; missing: 2
k, pressure, phi, particle_count, rattlers, coordination | float > 0, float, float, int > 0, int, float? | | of the
  packing: k, p, φ, N, disks without rigid contacts, Z without them
bond_count, keep | int, float? | | of a network: number of bonds; share of the bonds of the lattice or packing
force_threshold | float? | | contacts with a smaller force are left out
seed | int? | | of the packing, if it was made from a random start
""",
    has_shapes=False,
)


def recorded_dimension(attributes) -> int:
    """D of a result with these attributes; results in two dimensions do not record it."""
    return int(attributes.get("dimension", 2))


def provenance(*, versions, scalar_type, petsc_options, ranks, packing, law, wall_seconds) -> dict:
    """Attributes of a result, for `ResultWriter.attributes(**…)`.

    versions: {"petsc": "3.18.5", "slepc": …, "mumps": …}; petsc_options: the options as one string;
    packing: (name, hash) from `read_identified`; law: {"law": "contact", "beta": 1.0, …}, entries of None
    left out.
    """
    unknown = set(law) - {"law", *LAW_PARAMETERS}
    if unknown:
        raise ValueError(
            f"law parameters {sorted(unknown)} would be lost on reading: add them to LAW_PARAMETERS"
        )
    return {
        **_run(wall_seconds),
        **{f"{library}_version": version for library, version in versions.items()},
        "scalar_type": scalar_type,
        "petsc_options": petsc_options,
        "ranks": ranks,
        "packing": packing[0],
        "packing_sha256": packing[1],
        **{name: value for name, value in law.items() if value is not None},
    }


def derived_from(sweeps, wall_seconds) -> dict:
    """Attributes of a result that was computed from sweeps: what these have in common.

    `sources` and `source_runs` name the files and their run_id, separated by blanks.
    """
    shared = (
        "packing",
        "packing_sha256",
        "law",
        *LAW_PARAMETERS,
        "load",
        "dimension",
        "pressure",
        "phi",
        "k",
        "stress_unit",
        "particle_count",
    )
    attributes = [sweep.attributes for sweep in sweeps]
    return {
        **_run(wall_seconds),
        "sources": shortened(shlex.join(sweep.path.name for sweep in sweeps)),
        "source_runs": shortened(" ".join(str(entries.get("run_id", "?")) for entries in attributes)),
        **{
            name: attributes[0][name]
            for name in shared
            if len({str(a.get(name)) for a in attributes}) == 1 and name in attributes[0]
        },
    }


def _run(wall_seconds) -> dict:
    """Attributes that say which program made a result, when, and in how many seconds."""
    return {
        "jampetsc_version": VERSION,
        "git_commit": git_commit(),
        "python_version": sys.version.split()[0],
        "instruction_set": instruction_set(),
        "wall_seconds": float(wall_seconds),
        "date": datetime.datetime.now().astimezone().isoformat(timespec="seconds"),
    }


def instruction_set() -> str | None:
    """Processors for which loops were compiled, see `packing.compiled`; None in a process without compiled loops."""
    compiled = sys.modules.get("jampetsc.packing.compiled")
    return compiled and compiled.instruction_set()


def law_of(attributes) -> dict:
    """The law and its parameters out of the attributes of a result."""
    return {name: attributes[name] for name in ("law", *LAW_PARAMETERS) if name in attributes}


def git_commit(root=None) -> str | None:
    """Commit of the checkout that the package runs from, None outside of one.

    Read from git's files: a process of an MPI job should not fork.
    """
    git = Path(root or Path(__file__).resolve().parents[2]) / ".git"
    try:
        if git.is_file():  # a linked work tree
            git = (git.parent / git.read_text().removeprefix("gitdir:").strip()).resolve()
        common = git / (git / "commondir").read_text().strip() if (git / "commondir").is_file() else git
        head = (git / "HEAD").read_text().strip()
        if not head.startswith("ref:"):
            return head
        name = head.removeprefix("ref:").strip()
        if (common / name).is_file():
            return (common / name).read_text().strip()
        packed = (common / "packed-refs").read_text()
        match = re.search(rf"^([0-9a-f]{{40,64}}) {re.escape(name)}$", packed, re.MULTILINE)
        return match and match[1]
    except (OSError, UnicodeDecodeError):
        return None
