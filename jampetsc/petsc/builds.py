"""Selects the petsc4py to load: the user's own, else the distribution's build of the required scalar type.

Debian and Ubuntu install real and complex PETSc side by side under /usr/lib/petscdir, SLEPc under
/usr/lib/slepcdir, each with its own petsc4py or slepc4py that is not on sys.path. A process can load only one of
them. Nothing here imports petsc4py: `selected` only arranges what the next import finds.
"""

import importlib.util
import os
import re
import sys
from contextlib import contextmanager
from dataclasses import dataclass
from importlib.machinery import EXTENSION_SUFFIXES
from pathlib import Path

from jampetsc.errors import InputError

DISTRIBUTION = Path("/usr/lib")
PYTHON_FOLDERS = ("lib/python3/dist-packages", "lib")  # of a build: Debian's, and PETSc's own --with-petsc4py


@dataclass(frozen=True)
class Build:
    """One PETSc of the distribution with the SLEPc made for it."""

    petsc_dir: Path
    slepc_dir: Path
    scalar: str  # "real" or "complex"

    @property
    def variables(self):
        """The two environment variables that name this build."""
        return {"PETSC_DIR": str(self.petsc_dir), "SLEPC_DIR": str(self.slepc_dir)}


def distribution_builds():
    """The distribution's builds with a petsc4py for this python: newest first, debug and 64-bit-index ones last."""
    builds = {}
    for folder in DISTRIBUTION.glob("petscdir/*/*/"):
        scalar = re.search(r"real|complex", folder.name)
        if scalar and _module_folder(folder, "petsc4py"):
            slepc_dir = Path(str(folder).replace("petscdir/petsc", "slepcdir/slepc"))
            builds[folder.resolve()] = Build(folder, slepc_dir, scalar[0])
    return sorted(builds.values(), key=_preference, reverse=True)


@contextmanager
def selected(scalar):
    """While the context lasts, `import petsc4py` and `import slepc4py` find the build with `scalar` scalars.

    `scalar` is "real", "complex" or None (either, real preferred). A PETSC_DIR that is set, and a petsc4py
    that is importable and not the distribution's, come first and are not checked: their scalar type is known only
    after the import. The folders stay on sys.path; PETSC_DIR and SLEPC_DIR are restored, so that a child process
    chooses for itself.

    Raises InputError where this build is missing.
    """
    variables = {} if "petsc4py" in sys.modules else _choose(scalar)
    previous = {name: os.environ[name] for name in variables.keys() & os.environ.keys()}
    os.environ.update(variables)
    for name, package in (("SLEPC_DIR", "slepc4py"), ("PETSC_DIR", "petsc4py")):
        folder = _module_folder(Path(variables[name]), package) if name in variables else None
        if folder:
            sys.path.insert(0, str(folder))
    importlib.invalidate_caches()
    try:
        yield
    finally:
        for name in variables:
            del os.environ[name]
        os.environ.update(previous)


def can_choose(scalar) -> bool:
    """Whether `selected` may choose among the distribution's builds and one of them has these scalars."""
    if os.environ.get("PETSC_DIR") or "petsc4py" in sys.modules:
        return False
    builds = distribution_builds()
    return _has_no_own_petsc4py(builds) and any(build.scalar == scalar for build in builds)


def _has_no_own_petsc4py(builds):
    """Whether every importable petsc4py is of one of the distribution's builds."""
    spec = importlib.util.find_spec("petsc4py")
    if not (spec and spec.origin):  # a mere folder of that name
        return True
    return any(Path(spec.origin).resolve().is_relative_to(b.petsc_dir.resolve()) for b in builds)


def remedy(scalar):
    """What to do to get a build with `scalar` scalars when the user's own is of the other type."""
    for build in distribution_builds():
        if build.scalar == scalar:
            return f"Unset PETSC_DIR and SLEPC_DIR (and leave other environments) to use {build.petsc_dir}."
    return f"Use a petsc4py and slepc4py whose PETSc was configured --with-scalar-type={scalar}."


def _choose(scalar):
    """PETSC_DIR and SLEPC_DIR for `selected`; empty when the user's own petsc4py is importable without them."""
    own = os.environ.get("PETSC_DIR")
    if own:
        slepc = os.environ.get("SLEPC_DIR") or own.replace("petscdir/petsc", "slepcdir/slepc")
        if not (_module_folder(Path(own), "petsc4py") or importlib.util.find_spec("petsc4py")):
            raise InputError(
                f"PETSC_DIR={own}: no petsc4py for this python there. Install petsc4py against that PETSc. Or: "
                f"{remedy(scalar or 'real')}"
            )
        return {"PETSC_DIR": own, "SLEPC_DIR": slepc}
    builds = distribution_builds()
    if not _has_no_own_petsc4py(builds):
        return {}
    suitable = [b for b in builds if b.scalar == (scalar or b.scalar)]
    if not suitable:
        kind = scalar or "real"
        raise InputError(
            f"petsc4py: none with {kind} scalars for {sys.executable}. On Debian or Ubuntu run/setup installs it, "
            f"for /usr/bin/python3 (apt install python3-petsc4py-{kind} python3-slepc4py-{kind}); elsewhere "
            "install petsc4py and slepc4py against your own PETSc."
        )
    return max(suitable, key=lambda b: b.scalar == "real").variables


def _module_folder(build_dir, package):
    """The folder of `build_dir` to put on sys.path to import `package` in this python, or None."""
    arch = os.environ.get("PETSC_ARCH") or "."
    for folder in (build_dir / middle / tail for middle in (".", arch) for tail in PYTHON_FOLDERS):
        module = {"petsc4py": "PETSc", "slepc4py": "SLEPc"}[package]
        if any(list(folder.glob(f"{package}/lib/**/{module}{suffix}")) for suffix in EXTENSION_SUFFIXES):
            return folder
    return None


def _preference(build):
    """Sort key: ordinary builds before debug and 64-bit-index ones, then by version."""
    path = str(build.petsc_dir)
    version = tuple(int(n) for n in re.findall(r"\d+", build.petsc_dir.parent.name.replace("petsc64", "")))
    return ("debug" not in path and "petsc64" not in path, version)
