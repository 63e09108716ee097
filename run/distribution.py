"""Keeps .venv on the distribution's compiled packages, since PETSc's modules are compiled for their numpy.

Packages that pip put in their place are removed, all are imported, and a constraint makes every pip of .venv leave them
as they are. Status 1 and one line if an import fails. `run/setup` runs this.
"""

import ast
import importlib
import importlib.metadata
import importlib.util
import re
import subprocess
import sys
from pathlib import Path

PACKAGES = ("numpy", "scipy.sparse", "h5py", "numba", "matplotlib", "mpi4py")
PIP = (sys.executable, "-m", "pip", "--disable-pip-version-check")


def say(text):
    print(f"setup: {text}", file=sys.stderr)


def origin(package) -> Path:
    """Where a package would be imported from. Raises ModuleNotFoundError."""
    spec = importlib.util.find_spec(package.partition(".")[0])
    if spec is None:
        raise ModuleNotFoundError(f"No module named {package!r}")
    return Path(spec.origin or ".")


def remove_replacements():
    """Uninstall the packages in .venv that stand before the distribution's."""
    names = [package.partition(".")[0] for package in PACKAGES if origin(package).is_relative_to(sys.prefix)]
    if not names:
        return
    versions = ", ".join(f"{name} {importlib.metadata.version(name)}" for name in names)
    say(
        f".venv: {versions} in place of the distribution's, for which PETSc's modules are compiled. Removing it."
    )
    say(
        "If a package of yours needed it, run: .venv/bin/python -m pip install PACKAGE, which takes one that fits."
    )
    subprocess.run([*PIP, "uninstall", "--quiet", "--yes", *names], check=True)
    importlib.invalidate_caches()


def import_all():
    """Import all packages. Raises ImportError, with the place of the package, for the first that fails."""
    for package in PACKAGES:
        try:
            importlib.import_module(package)
        except Exception as error:  # numpy's are ValueError and RuntimeError as well
            reason = " ".join(str(error).split())
            raise ImportError(f"{package} of {origin(package).parent}: {reason}") from error


def visible_version(name) -> str:
    """The version of an imported package that pip sees; an entry in .venv for one that pip does not see.

    Debian's h5py has metadata of another name. Without a RECORD in the entry pip can neither replace nor remove it.
    """
    try:
        return importlib.metadata.version(name)
    except importlib.metadata.PackageNotFoundError:
        version = sys.modules[name].__version__
        (site,) = Path(sys.prefix).glob("lib/python3*/site-packages")
        entry = site / f"{name}-{version}.dist-info"
        entry.mkdir(exist_ok=True)
        (entry / "METADATA").write_text(f"Metadata-Version: 2.1\nName: {name}\nVersion: {version}\n")
        return version


def constrain():
    """Write the constraint for pip, and a pip.conf that names it beside those that the machine has already."""
    names = (package.partition(".")[0] for package in PACKAGES)
    lines = "".join(f"{name}=={visible_version(name)}\n" for name in names)
    constraints, settings = Path(sys.prefix, "constraints.txt"), Path(sys.prefix, "pip.conf")
    if settings.exists() and constraints.exists() and constraints.read_text() == lines:
        return
    constraints.write_text(lines)
    settings.unlink(missing_ok=True)
    listing = subprocess.run([*PIP, "config", "list"], capture_output=True, text=True, check=True).stdout
    other_constraints = [
        ast.literal_eval(value) for value in re.findall(r"(?m)^global\.constraint=(.*)$", listing)
    ]
    places = " ".join(
        [constraints.as_uri(), *" ".join(other_constraints).split()]
    )  # as a URL, since pip splits at spaces
    settings.write_text(f"[global]\nconstraint = {places}\n")


if __name__ == "__main__":
    try:
        remove_replacements()
        import_all()
        constrain()
    except (ImportError, OSError, subprocess.CalledProcessError) as error:
        say(error)
        sys.exit(1)
