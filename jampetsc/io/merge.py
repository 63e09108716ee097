"""A joint file and its parts as one plain file."""

import os
from pathlib import Path

import h5py

from jampetsc.io.formats import check_file
from jampetsc.io.hdf5 import OutputFile, open_file, retry_if_replaced, store
from jampetsc.io.outputs import check_output, check_place
from jampetsc.io.parts import PartList


@retry_if_replaced
def merge(path, out=None, request=None) -> int:
    """Write the result at `path` as one plain file at `out`, or in place and remove its parts.

    request: what was asked for, which the file at `out` records.

    Returns the number of parts that were joined (0: it was a plain file already). Raises InputError for a
    file or part that is missing or damaged, JampetscError if writing fails; then everything is as it was.
    """
    target = Path(path if out is None else out)
    in_place = os.path.realpath(target) == os.path.realpath(path)
    with open_file(path) as h5:
        kind, _, found = check_file(h5, path)
        parts = PartList(h5, path)
        parts.check()
        if in_place and not parts:
            return 0
        if in_place:
            check_place(target, kind)
        else:
            check_output(target, kind, [path])
        with OutputFile(target) as merged:
            _copy(h5, found, parts, merged)
            if request and not in_place:
                merged.attrs["request"] = request.text
            parts.check()  # gone where a run has replaced the result meanwhile
    if in_place:
        parts.remove()
    return len(parts.sizes)


def _copy(source, found, parts, target):
    target.attrs.update(source.attrs)
    for name, item in found.items():
        if isinstance(item, h5py.Dataset):
            _copy_dataset(item, parts, target, name)
        else:
            target.require_group(name)
        target[name].attrs.update(item.attrs)


def _copy_dataset(item, parts, target, name):
    if not item.is_virtual or item.shape[1:] in ((), (2,)):  # a row for each disk or contact
        store(target, name, parts.read(item))
        return
    chunks = (1, *item.shape[1:])
    copied = target.create_dataset(name, item.shape, item.dtype, chunks=chunks, fletcher32=True)
    for entry in range(len(item)):  # fields, which may be many
        copied[entry] = parts.read(item, entry)
