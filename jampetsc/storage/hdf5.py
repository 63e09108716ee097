"""Reading HDF5 so that every defect of a file becomes one line: what file, what is wrong, what to do."""

import os
from contextlib import contextmanager

import h5py
import numpy as np

from jampetsc.errors import InputError
from jampetsc.storage.regular import open_regular


def open_file(path) -> h5py.File:
    """Open for reading. Raises InputError as `opening` does."""
    with opening(path):
        open_regular(path).close()
        # HDF5 would look for the parts of a symbolic link beside the link and in the working directory first
        return h5py.File(os.path.realpath(path), "r")


@contextmanager
def opening(path):
    """Turn what the system and HDF5 say of a file into InputError: missing, no permission, not HDF5, truncated."""
    try:
        yield
    except FileNotFoundError:
        raise InputError(f"{path}: no such file") from None
    except PermissionError:
        raise InputError(f"{path}: no permission to read it") from None
    except OSError as error:
        raise InputError(f"{path}: {_explain(error)}") from None


def _explain(error) -> str:
    if "truncated file" in str(error):
        return "truncated: it was not written or copied completely; copy or make it again"
    if "signature not found" in str(error):
        return "not an HDF5 file: jampetsc reads its own files; `jampetsc import` reads published packings"
    return f"cannot be read as HDF5 ({' '.join(str(error).split())}): copy or make it again"


@contextmanager
def reading(path):
    """Turn what h5py and numpy raise on damaged contents into InputError naming `path`."""
    try:
        yield
    except InputError:
        raise
    except (OSError, RuntimeError, KeyError, ValueError, TypeError) as error:
        text = " ".join(str(error).strip("'\"").split())
        raise InputError(f"{path}: damaged ({text}): copy or make it again") from None


def undisturbed(path, action):
    """action(path), once more if it failed while a run was putting another file at `path`."""
    while True:
        before = _identity(path)
        try:
            return action(path)
        except InputError:
            if _identity(path) == before:
                raise


def _identity(path):
    try:
        status = os.stat(path)
    except OSError:
        return None
    return status.st_ino, status.st_mtime_ns


def set_attributes(h5, values: dict) -> None:
    """Store attributes, None left out. Bytes of a file name that are no text are stored as escapes: \\udcff."""
    for name, value in values.items():
        if isinstance(value, str):
            value = value.encode(errors="backslashreplace").decode()
        if value is not None:
            h5.attrs[name] = value


def attributes(h5) -> dict:
    """Attributes as Python strings, numbers, booleans or (for lists) numpy arrays."""
    return {name: _plain(value) for name, value in h5.attrs.items()}


def _plain(value):
    if isinstance(value, bytes):
        return value.decode(errors="replace")
    if isinstance(value, np.generic):
        return _plain(value.item()) if not isinstance(value, np.void) else value
    if isinstance(value, np.ndarray) and value.shape == (1,):  # how many other writers store a scalar
        return _plain(value[0])
    return value


def check_format(path, attrs: dict, expected: str | None = None, major: int = 1) -> str:
    """The file's `format`.

    Raises InputError if it is not one of ours, not the `expected` one, or of a newer major version.
    """
    name = attrs.get("format")
    if not isinstance(name, str) or not name.startswith("jampetsc-"):
        raise InputError(
            f"{path}: attribute format = {name!r}: not a jampetsc file; other packings: `jampetsc import`"
        )
    if expected is not None and name != expected:
        raise InputError(f"{path}: is a {name} file: a {expected} file is needed here")
    version = str(attrs.get("format_version", major))
    if not version.split(".")[0].isdigit():
        raise InputError(
            f"{path}: attribute format_version = {version!r}: must be a number such as {major}.0"
        )
    if int(version.split(".")[0]) > major:
        writer = attrs.get("jampetsc_version")
        remedy = f"use jampetsc {writer} or newer" if writer else "use a newer jampetsc"
        raise InputError(
            f"{path}: format_version {version}, but this jampetsc reads up to {major}.x: {remedy}"
        )
    return name
