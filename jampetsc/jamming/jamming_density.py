"""φ_J of a sample, where the energy of its minimum vanishes as the cell grows, and how its sizes have separated."""

from jampetsc.analysis.jammed_samples import assortativity
from jampetsc.errors import ConvergenceError
from jampetsc.jamming.quasistatic_shear import quench
from jampetsc.minimise.protocols import rescaled
from jampetsc.packing.neighbours import neighbour_pairs
from jampetsc.packing.packing import Packing

PHI_STEP = 2e-3  # of the search for φ_J before it is bracketed
PHI_TOLERANCE = 1e-5  # largest final width of the bracket of φ_J
MAX_SEARCH_PHI = 1.0  # largest φ of the search for φ_J
MAX_NEIGHBOUR_GAP = 0.2  # largest gap between neighbours, in mean diameters


def find_jamming_density(disks: Packing, jammed: bool, solver, tolerance: float) -> tuple[float, Packing]:
    """(φ_J, disks of the loosest jammed state): φ_J is where the energy of a minimum vanishes as the cell grows.

    disks: the minimum; if not jammed, it is compressed first. φ_J is bracketed to PHI_TOLERANCE; every looser state is
    made from the loosest jammed one. Raises ConvergenceError where a minimum is not found, or none jams up to
    MAX_SEARCH_PHI.
    """
    while not jammed:
        if disks.phi + PHI_STEP > MAX_SEARCH_PHI:
            raise ConvergenceError(f"no jammed state up to phi = {disks.phi:.6g}")
        disks, state = quench(rescaled(disks, disks.phi + PHI_STEP), solver, tolerance)
        jammed = state.jammed
    loose = disks.phi
    while jammed:
        loose -= PHI_STEP
        minimum, state = quench(rescaled(disks, loose), solver, tolerance)
        jammed, disks = state.jammed, minimum if state.jammed else disks
    while disks.phi - loose > PHI_TOLERANCE:
        middle = 0.5 * (disks.phi + loose)
        minimum, state = quench(rescaled(disks, middle), solver, tolerance)
        disks, loose = (minimum, loose) if state.jammed else (disks, middle)
    return 0.5 * (disks.phi + loose), disks


def segregation(disks: Packing) -> float:
    """Separation of sizes: assortativity of neighbours as large or small, 0 if mixed at random; nan for one size.

    Neighbours are disks with a gap of less than MAX_NEIGHBOUR_GAP mean diameters.
    """
    large = disks.radii > disks.radii.mean()
    i, j, _ = neighbour_pairs(
        disks.positions, disks.radii, disks.cell, skin=2 * MAX_NEIGHBOUR_GAP * float(disks.radii.mean())
    )
    return assortativity(large, i, j)
