"""Whether an output file may be written, checked in one place for all jobs.

A result replaces an earlier result of its own kind and nothing else: no input, no file of another kind, no pipe
and no device, and a finished result only on demand.
"""

import os
import re
from pathlib import Path

from jampetsc.errors import InputError, named
from jampetsc.io.atomic import check_writable, open_regular
from jampetsc.io.checksums import SIGNATURE, seal_of
from jampetsc.io.hdf5 import attributes, open_file
from jampetsc.io.parts import PartList

PICTURE, TABLE, EXPORTED = "picture", "table", "exported"
_PICTURES = (b"\x89PNG\r\n", b"%PDF-", b"<?xml", b"<svg")  # how the files begin
_EXPORTS = {  # ending -> how such a file begins
    ".xyz": re.compile(rb"\d+\nLattice="),
    ".dump": re.compile(rb"ITEM: (UNITS|TIMESTEP)"),
    ".data": re.compile(rb"LAMMPS data file"),
    ".vtp": re.compile(rb"<\?xml[^>]*>\s*<VTKFile"),
    ".npz": re.compile(rb"PK\x03\x04"),
    ".gsd": re.compile(rb"\xdf\x65" * 4),
    ".mtx": re.compile(rb"%%MatrixMarket"),
    ".petsc": re.compile(rb"\x00\x12\x7b\x50"),  # MAT_FILE_CLASSID
}
# endings that promise something else
_NOT_HDF5 = (".png", ".pdf", ".svg", ".csv", ".txt", ".opts", *_EXPORTS)


def check_output(out, kind, inputs=(), beside=(), request=None) -> bool:
    """Raise InputError unless a `kind` of file may be put at `out` now. Call it before long work.

    Returns whether the finished result of the request is there already and is to stay.

    kind     "picture", "table", "exported" for a file of other programs, or the format of a result
    inputs   paths of the files that the run reads; a missing one is reported when it is read
    beside   paths of the other files that the run writes
    request  settings of the run: a finished result of other settings is refused, unless it may be overwritten
    """
    for other in beside:
        if is_same(out, other) or os.path.realpath(out) == os.path.realpath(other):
            raise InputError(
                f"{out}: another file that this run writes. Choose another name for one of them."
            )
    for source in inputs:
        if is_same(out, source):
            alias = "" if str(out) == str(source) else f" {source}"
            raise InputError(f"{out}: the input{alias}, which would be lost. Choose another {named('out')}.")
    check_place(out, kind)
    return request is not None and not request.overwrite and is_finished(out, request)


def check_place(out, kind) -> None:
    """Raise InputError unless a `kind` of file may be put at `out`, for any settings."""
    if kind.startswith("jampetsc-") and Path(out).suffix.lower() in _NOT_HDF5:
        raise InputError(
            f"{named('out')} {out}: an HDF5 file with the ending of another format. Give it the ending .h5."
        )
    check_writable(out)
    check_replaced(out, _exported(out) if kind == EXPORTED else kind)


def is_finished(path, request) -> bool:
    """Whether the result of a request is at `path`, every byte as it was written.

    Raises InputError for a result of other settings or inputs, and for one that is damaged or was edited.
    """
    if _kind_at(path) is None:
        return False
    if why := _unlike(path, request):
        raise InputError(
            f"{path}: exists and {why}. Choose another {named('out')}, or give {named('overwrite')} to replace it."
        )
    return True


def _unlike(path, request) -> str:
    """Why the file at `path` is not the finished result of a request; empty if it is."""
    with open_file(path) as h5:
        recorded, parts = attributes(h5).get("request"), PartList(h5, path)
    if recorded is None:
        return "does not record its settings"
    if why := request.differences(recorded):
        return f"has {why}"
    try:
        parts.verify()
    except InputError as error:
        return f"is damaged ({error})"
    with open_regular(path) as file:
        return "" if seal_of(file) else "was edited, as its checksums are gone"


def check_replaced(out, kind) -> None:
    """Raise InputError if there is something at `out` that a `kind` of file may not replace."""
    present = _kind_at(out)
    if present not in (None, kind):
        raise InputError(
            f"{out}: exists and is {_article(present)}, not {_article(kind)}. Choose another {named('out')}, or "
            "remove it first."
        )


def is_same(path, other) -> bool:
    """Whether two paths, both of which lead to a file, lead to the same one."""
    try:
        return os.path.samefile(path, other)
    except OSError:
        return False


def _exported(path):
    return f"an exported {Path(path).suffix.lower()} file"


def _article(kind):
    return f"a {kind} file" if kind.startswith("jampetsc-") else kind if " " in kind else f"a {kind}"


def _kind_at(path):
    """Kind of the file at `path`, as `check_output` has it, or in words; None where nothing would be lost."""
    try:
        with open_regular(path) as file:
            start = file.read(4096)
    except (FileNotFoundError, NotADirectoryError):
        return None
    except OSError as error:
        return f"a file that cannot be read ({error.strerror})"
    if not start:
        return None
    if start.startswith(SIGNATURE):
        return _format(path)
    begins = _EXPORTS.get(Path(path).suffix.lower())
    if begins and begins.match(start):
        return _exported(path)
    if start.lstrip(b"\xef\xbb\xbf").startswith(_PICTURES):
        return PICTURE
    return TABLE if Path(path).suffix.lower() == ".csv" and b"\0" not in start else "a file of another kind"


def _format(path):
    try:
        with open_file(path) as h5:
            name = attributes(h5).get("format")
    except InputError:
        return "a damaged HDF5 file"
    return name if str(name).startswith("jampetsc-") else "an HDF5 file of another program"
