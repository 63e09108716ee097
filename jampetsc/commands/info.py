"""What a packing or a result is, in words and numbers."""

import os
from dataclasses import dataclass
from typing import ClassVar

from jampetsc.commands import describe
from jampetsc.errors import InputError, about, named
from jampetsc.io.ensemble import Ensemble
from jampetsc.io.packing_file import read_identified, read_source
from jampetsc.laws.damping import Law, Physics, damping_law, elastic_parameters
from jampetsc.options.job import Job
from jampetsc.options.parameters import FILE, composite_parameter, parameter
from jampetsc.options.physics_options import DAMPING, PRESTRESS, TANGENTIAL_STIFFNESS
from jampetsc.options.values import PACKING_NETWORK_OR_RESULT, input_name, load_source
from jampetsc.packing.packing import Packing
from jampetsc.packing.spring_network import Network
from jampetsc.petsc import session

DESCRIBE = {
    Packing: describe.describe_packing,
    Network: describe.describe_network,
    Ensemble: describe.describe_study,
}


@dataclass(frozen=True, eq=False)
class Info(Job):
    """Print the content of a file; with `matrices`, whether a packing is a minimum of its energy.

    For `matrices`, the Hessian K and the damping matrix B of a packing are assembled, in parallel under mpirun, and
    their negative, zero and positive eigenvalues counted.
    """

    FORMAT: ClassVar = "no file"
    OUT: ClassVar = ""
    GIVES: ClassVar = "str, lines of text"
    EPILOG: ClassVar = """examples:
  jampetsc info p.h5
  jampetsc info p.h5 --matrices --beta 0.1

PETSc options: -inertia_… for the factorisations of --matrices."""
    SOLVERS: ClassVar = ("inertia_",)

    file: Packing = parameter(
        help="packing, network or result file, or folder of a study",
        place=FILE,
        value_type=PACKING_NETWORK_OR_RESULT,
    )
    matrices: bool = parameter(False, "assemble K and B and count their eigenvalues")
    law: Law = composite_parameter(DAMPING)
    prestress: bool = PRESTRESS
    tangential_stiffness: float = TANGENTIAL_STIFFNESS

    @property
    def physics(self) -> Physics:
        """What the matrices model."""
        return Physics(self.law, self.prestress, self.tangential_stiffness)

    def check(self):
        """Refuse a law where there are no matrices, and matrices of a result."""
        if not self.matrices and self.physics != Physics(damping_law()):
            raise InputError(
                f"{self.physics}: a damping law without {named('matrices')}. Leave it out, or add {named('matrices')}."
            )
        if self.matrices and not isinstance(self.file, str | Packing | Network):
            raise InputError(
                f"{named('matrices')}: {input_name(self.file)} is not a packing. Give a packing."
            )

    @property
    def scalar(self):
        """PETSc is needed for the matrices only."""
        return "real" if self.matrices else None

    def check_outputs(self, to):
        """Nothing is written; the folder of a study is refused before PETSc starts."""
        if self.matrices and isinstance(self.file, str) and os.path.isdir(self.file):
            raise InputError(f"{named('matrices')}: {self.file} is the folder of a study. Give a packing.")

    def work(self, to):
        """The description. Collective with matrices."""
        name = input_name(self.file)
        if self.matrices:
            return self._with_matrices(name)
        loaded = load_source(self.file)
        return DESCRIBE.get(type(loaded), describe.describe_result)(name, loaded)

    def _with_matrices(self, name):
        from jampetsc.response.contact_network import build_network
        from jampetsc.response.minimum_check import examine

        running = session.current()
        source, _ = read_identified(self.file, running.comm, read_source)
        elastic = elastic_parameters(self.prestress, self.tangential_stiffness)
        with about(name):
            network = build_network(source, running.comm, **elastic)
            facts = examine(network, self.law)
        counts = describe.describe_matrices(
            network, isinstance(source, Packing), self.physics, facts, running.size
        )
        return f"{DESCRIBE[type(source)](name, source)}\n\n{counts}"
