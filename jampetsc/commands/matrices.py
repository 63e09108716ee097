"""K, B and their load columns as files of scipy, Matrix Market or PETSc."""

from dataclasses import dataclass
from typing import ClassVar

from jampetsc.errors import about
from jampetsc.io.packing_file import read_identified, read_source, source_name
from jampetsc.laws import loads
from jampetsc.laws.damping import DEFAULT
from jampetsc.laws.loads import LoadChoice
from jampetsc.options.physics_options import NetworkJob, load_parameter
from jampetsc.petsc import session


@dataclass(frozen=True, eq=False)
class Matrices(NetworkJob):
    """Write K, B and the load column of a packing or a network for scipy, Matrix Market or PETSc.

    The matrices of docs/theory/linear_response.md, not scaled and without constraints. With them come their load column
    k_gamma, b_gamma, k_gg, b_gg, the area, the disk and the component of every unknown, and the unknowns to leave out
    where K + i omega B is to be regular (pins). docs/reference/python.md computes G* of them in five lines; in python
    `assemble` gives them without a file.
    """

    FORMAT: ClassVar = "exported"
    OUT_HELP: ClassVar = (
        "file to write: .npz (numpy), .petsc (PETSc binary) or .mtx (Matrix Market, NAME-K.mtx and so on)"
    )
    GIVES: ClassVar = "the names of the files, a list of Path"
    EPILOG: ClassVar = "examples:\n  jampetsc matrices p.h5 --beta 0.1 --out K.npz"

    load: LoadChoice = load_parameter("columns (u, L) and their products (L, L) of all symmetric loads")

    def check_outputs(self, to):
        """Refuse an unknown ending, and outputs that may not be replaced."""
        from jampetsc.commands.matrix_files import files_of

        to.require_file()
        for path in files_of(to.path).values():
            to.check(self.FORMAT, self.paths, path)

    def work(self, to):
        from jampetsc.commands.matrix_files import files_of, write_matrices

        matrices = self.build(session.current().comm)
        write_matrices(to.path, matrices)
        names = ", ".join(map(str, files_of(to.path).values()))
        unknowns, disks, pins = len(matrices.dofs), len(matrices.particles), len(matrices.pins)
        matrices.destroy()
        return f"{names}: {self.physics}, {unknowns} unknowns of {disks} particles, {pins} pins"

    def build(self, comm):
        """The `assembled_matrices.PackingMatrices`. Collective."""
        from jampetsc.response.assembled_matrices import build_matrices
        from jampetsc.response.contact_network import build_network

        source, _ = read_identified(self.packing, comm, read_source)
        with about(source_name(self.packing)):
            network = build_network(source, comm, **self.elastic)
        return build_matrices(network, self.law, self.load.of(source.dimension))

    def python_result(self, to):
        from jampetsc.commands.matrix_files import files_of

        return list(files_of(to.path).values())


def assemble(packing, law=DEFAULT, *, prestress=True, tangential_stiffness=0.0, load=loads.DEFAULT):
    """The Hessian K in k, the damping matrix B in kτ₁ and their columns of the load γ (BT eqs. 10, 11). Collective.

    packing                a Packing or a Network, or the name of a file
    law                    a damping law, or the name of a family of them
    prestress              whether K keeps the f/r term of its contacts (BT eq. 4)
    tangential_stiffness   of springs between the rims of touching particles, over the stiffness of each contact
    load                   "xy" (simple shear) or another name, a displacement gradient (2, 2) or of `jampetsc.loads`,
                           or "tensor": the columns of all symmetric loads side by side

    Returns an `assembled_matrices.PackingMatrices`, distributed; `.to_scipy()` gathers it. Raises InputError for a
    packing that is not rigid, and for an unknown law.
    """
    job = Matrices(packing, law, prestress=prestress, tangential_stiffness=tangential_stiffness, load=load)
    return job.build(session.start("real").comm)
