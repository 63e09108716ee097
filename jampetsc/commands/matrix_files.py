"""Files of K, B and their load columns, as numpy, Matrix Market or PETSc read them."""

import io
import tempfile
from pathlib import Path

import numpy as np
from scipy.io import mmwrite

from jampetsc.collective import on_root
from jampetsc.errors import InputError, named
from jampetsc.io.atomic import write_whole
from jampetsc.petsc.session import current
from jampetsc.response.assembled_matrices import NAMES, NUMBERS, SPARSE, VECTORS, PackingMatrices

ENDINGS = (".npz", ".mtx", ".petsc")


def files_of(out) -> dict:
    """{name of its matrix, "" for all: path} of the files that `write_matrices` puts at `out`.

    Raises InputError for an ending without a format.
    """
    path = Path(out)
    if path.suffix not in ENDINGS:
        raise InputError(f"{named('out')} {out}: unknown ending. Give it one of {', '.join(ENDINGS)}.")
    if path.suffix == ".mtx":  # Matrix Market: a matrix a file
        return {name: path.with_name(f"{path.stem}-{name}.mtx") for name in NAMES}
    return {"": path}


def write_matrices(out, matrices: PackingMatrices) -> None:
    """Write the files of `files_of`. Collective. Raises InputError or JampetscError where that fails."""
    comm, files = matrices.K.getComm().tompi4py(), files_of(out)
    if Path(out).suffix == ".petsc":
        _write_petsc(comm, files[""], matrices)
        return
    whole = matrices.to_scipy()
    on_root(comm, lambda: _write_npz(files[""], whole) if "" in files else _write_mtx(files, whole))


def _write_npz(path, whole):
    """K and B have one pattern: scipy.sparse.csr_array((K, indices, indptr))."""
    arrays = {name: getattr(whole, name) for name in NAMES if name not in SPARSE}
    content = io.BytesIO()
    np.savez(
        content, indptr=whole.K.indptr, indices=whole.K.indices, K=whole.K.data, B=whole.B.data, **arrays
    )
    write_whole(path, content.getvalue())


def _write_mtx(files, whole):
    for name, path in files.items():
        value, content = getattr(whole, name), io.BytesIO()
        array = value if name in SPARSE else np.reshape(value, (len(np.atleast_1d(value)), -1))
        mmwrite(content, array, precision=17, symmetry="general")
        write_whole(path, content.getvalue())


def _write_petsc(comm, path, matrices):
    """PETSc binary, one after another: Mat K, B, Vec k_γ, b_γ, Vec (k_γγ, b_γγ, V), IS of disk numbers, IS of pins.

    Of a tensor of L loads L Vec k and L Vec b, and the rows of k and b of the loads in the last Vec.
    """
    PETSc, first = current().PETSc, comm.rank == 0
    values = np.concatenate([np.ravel(getattr(matrices, name)) for name in NUMBERS])
    numbers = PETSc.Vec().createMPI((len(values) if first else 0, len(values)), comm=comm)
    if first:
        numbers.getArray()[:] = values
    columns = [getattr(matrices, name) for name in VECTORS]
    vectors = [
        vector for column in columns for vector in (column if isinstance(column, tuple) else (column,))
    ]
    sets = [
        PETSc.IS().createGeneral((rows if first else rows[:0]).astype(PETSc.IntType), comm=comm)
        for rows in (matrices.particles, matrices.pins)
    ]
    with tempfile.TemporaryDirectory() as folder:
        file = Path(comm.bcast(folder)) / "matrices"
        viewer = PETSc.Viewer().createBinary(str(file), "w", comm=comm)  # rank 0 writes
        for item in (*(getattr(matrices, name) for name in SPARSE), *vectors, numbers, *sets):
            item.view(viewer)
        viewer.destroy()  # it writes the last of it
        on_root(comm, lambda: write_whole(path, file.read_bytes()))
