"""`load`: any jampetsc file as an object with numpy arrays. Needs neither PETSc nor MPI."""

from jampetsc.errors import InputError
from jampetsc.storage.hdf5 import attributes, check_format, open_file, reading
from jampetsc.storage.packing_file import packing_from

LOADERS = {"jampetsc-packing": packing_from}  # format -> loader(h5, path)


def load(path):
    """Open a jampetsc file: Disks for a packing.

    Raises InputError naming the file, what is wrong with it and the remedy.
    """
    with open_file(path) as h5:
        with reading(path):
            attrs = attributes(h5)
        name = check_format(path, attrs)
        if name not in LOADERS:
            raise InputError(
                f"{path}: format {name}: this jampetsc knows {', '.join(LOADERS)}; use a newer one"
            )
        return LOADERS[name](h5, path)
