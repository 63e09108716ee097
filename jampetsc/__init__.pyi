"""Written by run/generate.py from the declarations of the jobs. Editors and type checkers read it."""

from collections.abc import Sequence
from os import PathLike
from pathlib import Path
from typing import Any, Literal

from numpy.typing import NDArray

from jampetsc.io.ensemble import Ensemble
from jampetsc.io.reader import FlowResult, ShearedResult, SpectrumResult, SweepResult
from jampetsc.io.results import Result
from jampetsc.laws.flow_models import Model
from jampetsc.commands.matrices import assemble as assemble
from jampetsc.commands.minimising import minimise as minimise
from jampetsc.io.importers import import_packing as import_packing
from jampetsc.io.network_importers import import_network as import_network
from jampetsc.io.reader import load as load
from jampetsc.laws import loads as loads
from jampetsc.laws.damping import ContactDamping as ContactDamping
from jampetsc.laws.damping import Law as Law
from jampetsc.laws.damping import StokesDrag as StokesDrag
from jampetsc.packing.packing import Packing as Packing
from jampetsc.packing.spring_network import Network as Network
from jampetsc.plots.draw import plot as plot

_Path = str | PathLike[str]
_Array = NDArray[Any]
_Numbers = str | float | Sequence[float] | _Array
_Integers = str | int | Sequence[int] | _Array

__version__: str

class models:
    """Models of steady shear: a damping law, a mass or none, and the time step that fits them.

    MODELS is the table of those that have a name; the functions RD0(), CD0(), RD(mass=…) … of this module, the command's
    choices and its messages follow from it: a new model is one more row.
    """

    @staticmethod
    def RD0(
        *,
        tau1: float = 1.0,
    ) -> Model:
        """Drag, overdamped (Vågberg, thesis sec. 4.3), see `Model` and `model_of`.
        """

    @staticmethod
    def CD0(
        *,
        background_drag: float = 0.0,
        tau1: float = 1.0,
    ) -> Model:
        """Contact damping, overdamped (Vågberg, thesis sec. 4.3), see `Model` and `model_of`.
        """

    @staticmethod
    def RD(
        *,
        mass: float | None = None,
        quality: float | None = None,
        tau1: float = 1.0,
    ) -> Model:
        """Drag (Vågberg, thesis sec. 4.3), see `Model` and `model_of`.
        """

    @staticmethod
    def CD(
        *,
        mass: float | None = None,
        quality: float | None = None,
        background_drag: float = 0.0,
        tau1: float = 1.0,
    ) -> Model:
        """Contact damping (Vågberg, thesis sec. 4.3), see `Model` and `model_of`.
        """

    @staticmethod
    def CDn(
        *,
        mass: float | None = None,
        quality: float | None = None,
        background_drag: float = 0.0,
        tau1: float = 1.0,
    ) -> Model:
        """Normal contact damping (Vågberg, thesis sec. 4.3), see `Model` and `model_of`.
        """

    @staticmethod
    def CDt(
        *,
        mass: float | None = None,
        quality: float | None = None,
        background_drag: float = 0.0,
        tau1: float = 1.0,
    ) -> Model:
        """Tangential contact damping (Vågberg, thesis sec. 4.3), see `Model` and `model_of`.
        """

def pack(
    *,
    n: int | None = None,
    dimension: int | None = None,
    pressure: float | None = None,
    phi: float | None = None,
    potential: Literal["harmonic", "hertzian", "power"] | None = None,
    exponent: float | None = None,
    stiffness: Literal["constant", "inverse-square-diameter"] | None = None,
    sizes: str | None = None,
    radii: _Array | Sequence[float] | _Path | None = None,
    stabilise: Literal["volume", "shear", "all"] = 'volume',
    tolerance: float = 1e-10,
    seed: int | None = None,
    from_: Packing | _Path | None = None,
    threads: int | None = None,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Packing:
    """Make a packing.

    A packing of soft disks or spheres at rest: a minimum of the enthalpy at a given pressure, or of the energy at a
    given packing fraction, from random particles or from another packing. `study` makes ensembles of them.

    Collective.

    Parameters
    ----------
    n : integer, default None
        number of particles
    dimension : integer, default None
        2: disks (default), 3: spheres
    pressure : number, default None
        pressure p = Σ f r / (D V), in the unit of k, in three dimensions that of k/length
    phi : number, default None
        packing fraction, instead of a pressure, of disks from 0.8 to 1.5, of spheres from 0.6 to 1.2 (they jam near 0.84 and 0.64)
    potential : "harmonic", "hertzian" or "power", default None
        energy of an overlap (default harmonic)
    exponent : number, default None
        exponent α of the potential power, whose force is ∝ overlap^(α−1); 2 is harmonic, 5/2 hertzian
    stiffness : "constant" or "inverse-square-diameter", default None
        convention of the contact stiffness (default constant)
    sizes : str, default None
        particle sizes: bidisperse[:RATIO[:SHARE]], monodisperse, lognormal:SIGMA, uniform:LOW:HIGH, powerlaw:EXPONENT:RATIO; bidisperse has RATIO 1.4 and a SHARE of 0.5 of large ones (default bidisperse)
    radii : array (N,) or the name of a text file, default None
        text file of radii, line i that of particle i, or an array, instead of n and sizes
    stabilise : "volume", "shear" or "all", default volume
        relaxed shape of the cell: volume alone, for a positive bulk modulus; shear as well, so that σ_xy = 0 (and σ_xz = σ_yz = 0), G₀ > 0; or all, so that σ_xx = σ_yy (= σ_zz) too and the moduli of all loads are positive
    tolerance : number, default 1e-10
        largest max|F|/(p d), in three dimensions max|F|/(p d²), and |Δp|/p of a packing
    seed : integer, default None
        seed of the random start (default 1)
    from_ : Packing or the name of its file, default None
        packing to start from, with its cell
    threads : integer, default None
        threads of a rank (default: its share of the cores of the node)
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-packing file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def springs(
    source: Packing | Network | _Path | None = None,
    *,
    lattice: Literal["triangular", "square", "kagome", "cubic", "fcc"] | None = None,
    size: int | Sequence[int] | None = None,
    keep: float = 1.0,
    seed: int = 1,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Network:
    """Make a network of springs: a lattice, or the contacts of a packing, with a share of its bonds.

    Springs of a lattice have k = 1, length 1 and no force. Bonds of a packing have the stiffness and force of its
    contacts. Bonds that are left out are chosen at random; of one seed, a lower share keeps bonds of a higher one.

    Collective.

    Parameters
    ----------
    source : Packing, Network or the name of its file, default None
        packing or network, instead of a lattice
    lattice : "triangular", "square", "kagome", "cubic" or "fcc", default None
        kind of lattice
    size : integer or (NX, NY), default None
        unit cells along all axes, or along each (default 32, in three dimensions 10); triangular, square and cubic have one node each, kagome three, fcc four
    keep : number, default 1
        share of the bonds that stay, chosen at random
    seed : integer, default 1
        seed of the choice of bonds
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-network file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def export(
    file: Packing | Network | Result | _Path,
    *,
    mode: int | None = None,
    field: float | None = None,
    packing: Packing | _Path | None = None,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Path:
    """Write packings, modes, fields and flows for OVITO, ASE, LAMMPS, ParaView, HOOMD and numpy.

    Of a packing: radius, coordination, rattlers and stress of every disk and, in data, vtp, npz and gsd, its contacts
    with force and overlap. Of modes, a sweep's fields or slow shear: the motion as vectors on the packing. Of a flow:
    the snapshots with their velocities, as frames of one file (xyz, dump, gsd). Of a network: nodes and bonds (data,
    vtp, npz). The ending of the name chooses the format.

    Collective.

    Parameters
    ----------
    file : Packing, Network, result or the name of its file
        packing, network, modes, sweep with fields, quasistatic or flow file
    mode : integer, default None
        modes file: number of the mode, from 1 (default 1)
    field : number, default None
        sweep: frequency of the field
    packing : Packing or the name of its file, default None
        file of the packing of a result (default: as the result records it)
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    the name of the file, a Path

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def matrices(
    packing: Packing | Network | _Path,
    law: Law | str = ...,
    *,
    prestress: bool = True,
    tangential_stiffness: float = 0.0,
    load: Any = 'xy',
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> list[Path]:
    """Write K, B and the load column of a packing or a network for scipy, Matrix Market or PETSc.

    The matrices of docs/theory/linear_response.md, not scaled and without constraints. With them come their load column
    k_gamma, b_gamma, k_gg, b_gg, the area, the disk and the component of every unknown, and the unknowns to leave out
    where K + i omega B is to be regular (pins). docs/reference/python.md computes G* of them in five lines; in python
    `assemble` gives them without a file.

    Collective.

    Parameters
    ----------
    packing : Packing, Network or the name of its file
        packing or network
    law : jampetsc.ContactDamping(…), jampetsc.StokesDrag(…), jampetsc.Law("custom", …) or "contact", "stokes", "custom", default ContactDamping()
        damping law
    prestress : bool, default True
        K keeps the f/r term of its contacts (BT: 'with pre-stress')
    tangential_stiffness : number, default 0
        elastic springs between the rims of touching particles, k_t over the stiffness k of each contact; above 0 particles roll, and no contact slips
    load : str, array (D, D) or one of `jampetsc.loads`, default xy
        load, a displacement gradient E: xy or yx (simple shear), pure-xy, compression, xx, yy (in 3D also xz, zz, …), or D² numbers row by row (with commas; on a command line with = where the first is negative); tensor: columns (u, L) and their products (L, L) of all symmetric loads. Moduli are second derivatives of the energy per volume along F = 1 + εE
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    the names of the files, a list of Path

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def merge(
    file: _Path,
    *,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Result:
    """Make one plain file of a result written by many ranks.

    The new file replaces the result and its parts, unless out names another file.

    Collective.

    Parameters
    ----------
    file : name of a file
        result of sweep, quasistatic, modes, …
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    the result, loaded

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def info(
    file: Packing | Network | Result | _Path,
    law: Law | str = ...,
    *,
    matrices: bool = False,
    prestress: bool = True,
    tangential_stiffness: float = 0.0,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> str:
    """Print the content of a file; with `matrices`, whether a packing is a minimum of its energy.

    For `matrices`, the Hessian K and the damping matrix B of a packing are assembled, in parallel under mpirun, and
    their negative, zero and positive eigenvalues counted.

    Collective.

    Parameters
    ----------
    file : Packing, Network, result or the name of its file
        packing, network or result file, or folder of a study
    matrices : bool, default False
        assemble K and B and count their eigenvalues
    law : jampetsc.ContactDamping(…), jampetsc.StokesDrag(…), jampetsc.Law("custom", …) or "contact", "stokes", "custom", default ContactDamping()
        damping law
    prestress : bool, default True
        K keeps the f/r term of its contacts (BT: 'with pre-stress')
    tangential_stiffness : number, default 0
        elastic springs between the rims of touching particles, k_t over the stiffness k of each contact; above 0 particles roll, and no contact slips
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    str, lines of text

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def collapse(
    *results: Result | Ensemble | _Path,
    observable: Literal["pressure", "shear_stress", "jammed"],
    fit: str,
    finite_size: bool = False,
    corrections: bool = False,
    degree: int = 5,
    spline: bool = False,
    where: str | None = None,
    cut: float | None = None,
    range: tuple[float, float] | None = None,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Result:
    """Critical exponents from rates or sizes.

    Fit the scaling of an observable O near jamming (Vågberg, thesis ch. 5). Of flows at several rates and phi of one N:

      O = rate^(y/znu) [f0(x) + rate^(omega/z) f1(x)],   x = (phi - phi_J) / rate^(1/znu)

    and with finite_size, of jam and shear results at several N and phi, L = N^(1/D):

      O = L^(-y/nu) [f0(x) + L^(-omega) f1(x)],          x = (phi - phi_J) L^(1/nu)

    f0 and |f1| are exponentials of polynomials or splines; f1 is fitted with corrections. The fit is weighted least
    squares; errors come from the profile of chi^2 and from fits of higher degrees. The fit is repeated with the largest
    rates, or smallest N, left out one by one.

    Collective.

    Parameters
    ----------
    results : result or the name of its file
        flows, or jam and shear results, or the folder of a study
    observable : "pressure", "shear_stress" or "jammed"
        observable to scale
    fit : str
        names of the parameters to fit: phi_J,y,znu[,omega] (nu for znu with finite_size); y=1 fixes y
    finite_size : bool, default False
        scale with L = N^(1/D) instead of the rate
    corrections : bool, default False
        also fit f1, which needs omega in fit
    degree : integer, default 5
        degree of the polynomial ln f0
    spline : bool, default False
        cubic spline over degree intervals instead of a polynomial
    where : str, default None
        study: use only the files whose rows in its table have these values
    cut : number, default None
        largest rate, or smallest N, in the fit (default: all)
    range : (low, high), default None
        range of packing fractions in the fit (default: all)
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-collapse file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def scaling(
    *results: Result | Ensemble | _Path,
    form: Literal["herschel-bulkley", "bingham", "power-law"] = 'herschel-bulkley',
    by: str | None = None,
    where: str | None = None,
    cut: float | None = None,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Result:
    """Yield stress by a Herschel–Bulkley, Bingham or power-law fit of flow curves.

    Fit the mean shear stress of flows at several rates of one model, phi and N by

      sigma = sigma_y + A rate^n     (Herschel & Bulkley, Kolloid-Z. 39, 291 (1926))

    bingham has n = 1, power-law has sigma_y = 0. The fit is weighted least squares. 95 % intervals are from the
    scatter of seeds (jackknife, Student's t) where three or more have all rates, else from the profile of chi^2. The
    fit is repeated with the largest rates left out one by one: the law holds for slow flow alone. Quasistatic shear
    of the same particles, if given, is compared with the yield stress.

    Collective.

    Parameters
    ----------
    results : result or the name of its file
        flows at several rates, quasistatic shear to compare with, or the folder of a study
    form : "herschel-bulkley", "bingham" or "power-law", default herschel-bulkley
        law to fit
    by : str, default None
        settings in which groups of flows differ, each with its own fit: model, mass, phi, n, sizes, potential
    where : str, default None
        study: use only the files whose rows in its table have these values
    cut : number, default None
        largest rate in the fit (default: all)
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-scaling file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def sweep(
    packing: Packing | Network | _Path,
    law: Law | str = ...,
    *,
    prestress: bool = True,
    tangential_stiffness: float = 0.0,
    omega: _Numbers = '1e-10:1e4:141',
    method: Literal["rational", "direct"] = 'rational',
    load: Any = 'xy',
    accuracy: float = 1e-06,
    parallel: Literal["auto", "shifts", "matrix"] | None = None,
    fields: _Numbers | None = None,
    alpha: float | None = None,
    stress: float | None = None,
    mass: float | None = None,
    mass_by: Literal["number", "volume"] | None = None,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> SweepResult:
    """Complex modulus G*(ω) of a packing or a network under shear or another load.

    A modulus is the second derivative of the energy per volume along F = 1 + εE, E the displacement gradient of the
    load. With load tensor all elastic constants C*(ω) of the symmetric loads xx, yy, (zz, yz, xz,) xy, whose shears are
    E = ½(x̂ŷ + ŷx̂), from the same factorisations, and the bulk modulus −V dp/dV and the shear modulus averaged over all
    directions.

    Each value comes with a bound on its error (BT eqs. 10–15; docs/theory/linear_response.md). Method `rational` gets
    the whole spectrum from a few real factorisations, `direct` solves K + iωB at every frequency.

    Collective.

    Parameters
    ----------
    packing : Packing, Network or the name of its file
        packing or network
    law : jampetsc.ContactDamping(…), jampetsc.StokesDrag(…), jampetsc.Law("custom", …) or "contact", "stokes", "custom", default ContactDamping()
        damping law
    prestress : bool, default True
        K keeps the f/r term of its contacts (BT: 'with pre-stress')
    tangential_stiffness : number, default 0
        elastic springs between the rims of touching particles, k_t over the stiffness k of each contact; above 0 particles roll, and no contact slips
    omega : numbers or "low:high:count", default 1e-10:1e4:141
        frequencies ω, in 1/time, the time that tau1 is in
    method : "rational" or "direct", default rational
        rational: the whole spectrum from a few real factorisations; direct: one complex solve per frequency
    load : str, array (D, D), one of `jampetsc.loads` or forces (N, D), default xy
        load, a displacement gradient E: xy or yx (simple shear), pure-xy, compression, xx, yy (in 3D also xz, zz, …), or D² numbers row by row (with commas; on a command line with = where the first is negative); tensor: all elastic constants C*(ω); or forces: wave:1,0:transverse or longitudinal (numbers of cell vectors; several with + between them), point:7 (particles), points:100 or points:100:5 (a sample, its seed). Moduli are second derivatives of the energy per volume along F = 1 + εE
    accuracy : number, default 1e-06
        relative error allowed in G' and in G'' each, of forces in χ' and in χ''
    parallel : "auto", "shifts" or "matrix", default None
        rational method on several ranks: each factorises a shift of its own, or all share each factorisation (default auto: by the number of ranks and unknowns)
    fields : numbers or "low:high:count", default None
        also displacement fields at these frequencies
    alpha : number, default None
        exponent of the damping force (1 is linear)
    stress : number, default None
        amplitude of the shear stress, with alpha, in the unit of k, in three dimensions that of k/length
    mass : number, default None
        mass of every particle, in the unit of k τ₁²; with it inertia adds −ω²M to K + iωB (default: none)
    mass_by : "number" or "volume", default None
        masses: equal (number), or by the volume of a particle, mass then being that of one of the mean diameter (default number)
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-sweep file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def quasistatic(
    packing: Packing | Network | _Path,
    law: Law | str = ...,
    *,
    prestress: bool = True,
    tangential_stiffness: float = 0.0,
    load: Any = 'xy',
    betas: _Numbers | None = None,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Result:
    """Fields, moduli and viscosities of the limit of slow shear, or of another slow load.

    The motion of touching disks relative to each other, Δu∥ and Δu⊥, and the non-affine displacement of every disk, per
    unit strain, with medians, means, rms and histograms; G₀, bulk modulus, η₀ = lim G''/ω and η_∞ (BT eqs. 18–24).
    Moduli are second derivatives of the energy per volume along F = 1 + εE, E the displacement gradient of the load;
    the bulk modulus is −V dp/dV. With load tensor the fields are of simple shear xy, and the constants C₀, η₀ and η_∞
    between the symmetric loads xx, yy, (zz, yz, xz,) xy, whose shears are E = ½(x̂ŷ + ŷx̂), are added, with the shear
    modulus averaged over all directions and Poisson's ratio of both moduli.
    Forces have a susceptibility χ₀, with a bound, and its slope χ₁, χ → χ₀ − iωχ₁; waves also G₀ and η₀ at their k.
    Numbers whose names have no_prestress are without the pre-stress of K.

    Collective.

    Parameters
    ----------
    packing : Packing, Network or the name of its file
        packing or network
    law : jampetsc.ContactDamping(…), jampetsc.StokesDrag(…), jampetsc.Law("custom", …) or "contact", "stokes", "custom", default ContactDamping()
        damping law
    prestress : bool, default True
        K keeps the f/r term of its contacts (BT: 'with pre-stress')
    tangential_stiffness : number, default 0
        elastic springs between the rims of touching particles, k_t over the stiffness k of each contact; above 0 particles roll, and no contact slips
    load : str, array (D, D), one of `jampetsc.loads` or forces (N, D), default xy
        load, a displacement gradient E: xy or yx (simple shear), pure-xy, compression, xx, yy (in 3D also xz, zz, …), or D² numbers row by row (with commas; on a command line with = where the first is negative); tensor: also the elastic constants and viscosities between all symmetric loads; or forces: wave:1,0:transverse or longitudinal (numbers of cell vectors; several with + between them), point:7 (particles), points:100 or points:100:5 (a sample, its seed). Moduli are second derivatives of the energy per volume along F = 1 + εE
    betas : numbers or "low:high:count", default None
        also η₀ and η_∞ at these β, from the same fields (contact law)
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-quasistatic file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def modes(
    packing: Packing | Network | _Path,
    *,
    count: int | None = None,
    below: float | None = None,
    all: bool = False,
    states: _Numbers | None = None,
    eigenvectors: bool = True,
    mass_by: Literal["number", "volume"] | None = None,
    prestress: bool = True,
    load: Any = 'xy',
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Result:
    """Lowest vibrational modes of a packing, how floppy they are, and their share of the response to a load.

    Eigenvectors of the Hessian K without its translations. Disks have mass one, or masses by their volume: frequencies
    are the square roots of the eigenvalues. Each mode has its floppiness, participation ratio and share of the response
    to a load. That none was missed is proved by the inertia of K. The density of states follows from the inertia alone,
    without modes.

    Collective.

    Parameters
    ----------
    packing : Packing, Network or the name of its file
        packing or network
    count : integer, default None
        number of modes (default 50); more where the last eigenvalues are equal
    below : number, default None
        all modes with eigenvalues below this, in the unit of k
    all : bool, default False
        all modes, by LAPACK on one rank: up to 4096 disks or 2730 spheres
    states : numbers or "low:high:count", default None
        no modes but their exact numbers between these frequencies, by one factorisation for each, in √k, the mass, or that of the mean diameter, being one
    eigenvectors : bool, default True
        eigenvectors in the file, 8 DN bytes for each mode
    mass_by : "number" or "volume", default None
        masses: all one (number), or by the volume of a particle, one being that of the mean diameter (default number)
    prestress : bool, default True
        K keeps the f/r term of its contacts (BT: 'with pre-stress')
    load : str, array (D, D) or one of `jampetsc.loads`, default xy
        load, a displacement gradient E: xy or yx (simple shear), pure-xy, compression, xx, yy (in 3D also xz, zz, …), or D² numbers row by row (with commas; on a command line with = where the first is negative); tensor: simple shear xy, and the shares of the moduli of all symmetric loads. Moduli are second derivatives of the energy per volume along F = 1 + εE
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-modes file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def oscillate(
    packing: Packing | _Path,
    law: Law | str = ...,
    *,
    prestress: bool = True,
    tangential_stiffness: float = 0.0,
    omega: _Numbers,
    stress: _Numbers | None = None,
    strain: _Numbers | None = None,
    alpha: float = 1.0,
    contacts: Literal["fixed", "moving"] = 'fixed',
    cycles: int | Literal["auto"] | None = None,
    load: Any = 'xy',
    steps: int = 64,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Result:
    """G*(ω), harmonics and work of a packing with power-law damping.

    Steady oscillation of a packing whose contacts are damped by a force ∝ |Δv|^alpha (BT eq. 9): G*(ω) of the first
    harmonic, third and fifth harmonic, work per cycle, with an estimate of the error. With fixed contacts the
    equations are solved for a whole cycle at once, for alpha of at least 0.45; with moving contacts, which open and
    close, cycles are integrated in time until G* repeats or, above yielding, its mean over cycles is known; each
    amplitude begins where the next smaller one ended. Moving contacts are sheared, fixed ones take any single load.

    Collective.

    Parameters
    ----------
    packing : Packing or the name of its file
        packing
    law : jampetsc.ContactDamping(…), jampetsc.StokesDrag(…), jampetsc.Law("custom", …) or "contact", "stokes", "custom", default ContactDamping()
        damping law
    prestress : bool, default True
        K keeps the f/r term of its contacts (BT: 'with pre-stress')
    tangential_stiffness : number, default 0
        elastic springs between the rims of touching particles, k_t over the stiffness k of each contact; above 0 particles roll, and no contact slips
    omega : numbers or "low:high:count"
        frequencies ω, in 1/time, the time that tau1 is in
    stress : numbers or "low:high:count", default None
        amplitudes of an imposed stress, the force per volume on the amplitude of the load, in the unit of k, in three dimensions that of k/length
    strain : numbers or "low:high:count", default None
        amplitudes of an imposed strain
    alpha : number, default 1
        exponent of the damping force, from 0 (dry friction) to 2; 1 is linear
    contacts : "fixed" or "moving", default fixed
        contacts: fixed, as in the packing, or moving, which open and close
    cycles : integer or "auto", default None
        number of cycles with moving contacts, computed with half the steps and then with all; auto (default): until G* repeats from cycle to cycle or, where cycles fluctuate, its mean is known to 5 %
    load : str, array (D, D) or one of `jampetsc.loads`, default xy
        load, a displacement gradient E: xy or yx (simple shear), pure-xy, compression, xx, yy (in 3D also xz, zz, …), or D² numbers row by row (with commas; on a command line with = where the first is negative). Moduli are second derivatives of the energy per volume along F = 1 + εE
    steps : integer, default 64
        time steps per cycle, a multiple of 8
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-oscillate file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def relax(
    packing: Packing | _Path,
    law: Law | str = ...,
    *,
    prestress: bool = True,
    tangential_stiffness: float = 0.0,
    strain: _Numbers,
    times: _Numbers | None = None,
    accuracy: float = 0.001,
    load: Any = 'xy',
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Result:
    """G(t) after step strains of any size.

    The cell of a packing at rest is strained at t = 0 and held. The disks relax without inertia, contacts open and
    close, until forces balance again: G(t) = (σ(t) − σ(0⁻))/γ with an estimate of its error, the energy stored and
    dissipated, and the contacts that changed. For γ → 0 it is the G(t) of spectrum. The step is the limit of a fast
    one: dashpots and fluid alone decide where it leaves the disks, along with the strain where only a fluid damps
    them. Masses are not supported.

    Collective.

    Parameters
    ----------
    packing : Packing or the name of its file
        packing
    law : jampetsc.ContactDamping(…), jampetsc.StokesDrag(…), jampetsc.Law("custom", …) or "contact", "stokes", "custom", default ContactDamping()
        damping law
    prestress : bool, default True
        K keeps the f/r term of its contacts (BT: 'with pre-stress')
    tangential_stiffness : number, default 0
        elastic springs between the rims of touching particles, k_t over the stiffness k of each contact; above 0 particles roll, and no contact slips
    strain : numbers or "low:high:count"
        step strains γ, the cell becomes 1 + γE with the load E
    times : numbers or "low:high:count", default None
        times t at which G is stored; the step takes a hundredth of the first. Default: 10 per decade from 0.001 τ₁ until forces balance, in the time that tau1 is in
    accuracy : number, default 0.001
        relative error of the energy balance of a time step, about that of G(t)
    load : str, array (D, D) or one of `jampetsc.loads`, default xy
        load, a displacement gradient E: xy or yx (simple shear), pure-xy, compression, xx, yy (in 3D also xz, zz, …), or D² numbers row by row (with commas; on a command line with = where the first is negative). Moduli are second derivatives of the energy per volume along F = 1 + εE
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-relax file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def flow(
    start: Packing | Result | _Path | None = None,
    model: Model | Law | str | None = None,
    *,
    n: int | None = None,
    dimension: int | None = None,
    phi: float | None = None,
    seed: int | None = None,
    sizes: str | None = None,
    radii: _Array | Sequence[float] | _Path | None = None,
    potential: Literal["harmonic", "hertzian", "power"] | None = None,
    exponent: float | None = None,
    discard: float | None = None,
    last: _Path | None = None,
    threads: int | None = None,
    rate: float | None = None,
    strain: float,
    walls: bool = False,
    snapshots: int | None = None,
    snapshot_every: float | None = None,
    snapshot_spacing: Literal["even", "log"] | None = None,
    series: float | None = None,
    step: float | None = None,
    tolerance: float | None = None,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> FlowResult:
    """Steady shear at a rate: stress, pressure, energy balance.

    Shears disks or spheres steadily under Lees–Edwards conditions, by one of Vågberg's six models (thesis sec. 4.3)
    or a damping law, overdamped or with a mass. Starts from a packing, or from random particles of a given number and
    packing fraction; or continues an earlier flow with its settings.

    Collective.

    Parameters
    ----------
    start : Packing, result or the name of its file, default None
        packing to start from, or flow to continue
    n : integer, default None
        number of particles
    dimension : integer, default None
        2: disks (default), 3: spheres
    phi : number, default None
        packing fraction (disks jam near 0.84, spheres near 0.64)
    seed : integer, default None
        seed of the random start (default 1)
    sizes : str, default None
        particle sizes: bidisperse[:RATIO[:SHARE]], monodisperse, lognormal:SIGMA, uniform:LOW:HIGH, powerlaw:EXPONENT:RATIO; bidisperse has RATIO 1.4 and a SHARE of 0.5 of large ones (default bidisperse)
    radii : array (N,) or the name of a text file, default None
        text file of radii, line i that of particle i, or an array, instead of n and sizes
    potential : "harmonic", "hertzian" or "power", default None
        energy of an overlap (default harmonic)
    exponent : number, default None
        exponent α of the potential power, whose force is ∝ overlap^(α−1); 2 is harmonic, 5/2 hertzian
    discard : number, default None
        strain left out of the means (default 1, or half of the strain if less)
    last : name of a file, default None
        packing file of the last state to write
    threads : integer, default None
        maximal number of threads (default: one per core)
    model : jampetsc.models.CDn(mass=…), a damping law, a Model of it or "RD0", "CD0", "RD", "CD", "CDn", "CDt", optional
        model of the flow
    rate : number, default None
        shear rate γ̇, in 1/time, the time that tau1 is in
    strain : number
        how far to shear
    walls : bool, default False
        between sliding rough walls, rows of disks (not of spheres)
    snapshots : integer, default None
        number of states to keep, at equal strains after what is discarded
    snapshot_every : number, default None
        strain between snapshots, instead of their number
    snapshot_spacing : "even" or "log", default None
        log: states at strains that grow by a factor, for mean square displacements (default even)
    series : number, default None
        strain of a row of the series, finer than by default; the state at γ = 0 is kept as well, for the start of the flow
    step : number, default None
        time step, a time as tau1 (default: by the model)
    tolerance : number, default None
        of the velocities of contact damping (default 0.0001)
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-flow file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def shear(
    start: Packing | _Path | None = None,
    *,
    n: int | None = None,
    dimension: int | None = None,
    phi: float | None = None,
    seed: int | None = None,
    sizes: str | None = None,
    radii: _Array | Sequence[float] | _Path | None = None,
    potential: Literal["harmonic", "hertzian", "power"] | None = None,
    exponent: float | None = None,
    discard: float | None = None,
    last: _Path | None = None,
    threads: int | None = None,
    step: float,
    strain: float,
    events: bool = False,
    d2min: bool = False,
    descent: Literal["steepest", "lbfgs"] | None = None,
    load: Any = None,
    tolerance: float = 1e-06,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> ShearedResult:
    """Quasistatic shear: affine step, minimise, repeat.

    Shears disks or spheres in small affine steps, each followed to the minimum of the energy (Vågberg, thesis
    sec. 4.7).

    Collective.

    Parameters
    ----------
    start : Packing or the name of its file, default None
        packing to start from
    n : integer, default None
        number of particles
    dimension : integer, default None
        2: disks (default), 3: spheres
    phi : number, default None
        packing fraction (disks jam near 0.84, spheres near 0.64)
    seed : integer, default None
        seed of the random start (default 1)
    sizes : str, default None
        particle sizes: bidisperse[:RATIO[:SHARE]], monodisperse, lognormal:SIGMA, uniform:LOW:HIGH, powerlaw:EXPONENT:RATIO; bidisperse has RATIO 1.4 and a SHARE of 0.5 of large ones (default bidisperse)
    radii : array (N,) or the name of a text file, default None
        text file of radii, line i that of particle i, or an array, instead of n and sizes
    potential : "harmonic", "hertzian" or "power", default None
        energy of an overlap (default harmonic)
    exponent : number, default None
        exponent α of the potential power, whose force is ∝ overlap^(α−1); 2 is harmonic, 5/2 hertzian
    discard : number, default None
        strain left out of the means (default 1, or half of the strain if less)
    last : name of a file, default None
        packing file of the last state to write
    threads : integer, default None
        maximal number of threads (default: one per core)
    step : number
        strain of one step
    strain : number
        how far to shear, γ; negative (the other way) with events alone
    events : bool, default False
        follow each minimum exactly from event to event: contacts that open or close, instabilities
    d2min : bool, default False
        with events, displacement and D²min of each particle in the largest drop of the energy
    descent : "steepest" or "lbfgs", default None
        with events, way down from an instability: steepest descent, which overdamped particles take, or L-BFGS (default steepest)
    load : str, array (D, D) or one of `jampetsc.loads`, default None
        with events, load, a displacement gradient E: xy or yx (simple shear), pure-xy, compression, xx, yy (in 3D also xz, zz, …), or D² numbers row by row (with commas; on a command line with = where the first is negative); with zeros below its diagonal. The cell becomes 1 + γE (default xy)
    tolerance : number, default 1e-06
        largest max|F|/(p d), in three dimensions max|F|/(p d²), of a minimum
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-shear file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def jam(
    *,
    n: int,
    dimension: int = 2,
    phi: _Numbers,
    seeds: _Integers,
    sizes: str = 'bidisperse',
    potential: Literal["harmonic", "hertzian", "power"] = 'harmonic',
    exponent: float | None = None,
    tolerance: float = 1e-06,
    protocol: Literal["random", "shear", "compress"] = 'random',
    separated: bool = False,
    step: float | None = None,
    strain: float | None = None,
    discard: float | None = None,
    every: float | None = None,
    temperature: float | None = None,
    cooling_rate: float | None = None,
    sweeps: int | None = None,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Result:
    """The fraction of packings that jam, and their pressures.

    Makes many samples at each packing fraction, jammed or not, with their energies and pressures (Vågberg et al., PRE
    83, 030303 (2011); thesis sec. 4.7), by one of three protocols. random: random particles, quenched. shear: minima
    at several strains of a quasistatic shear of such particles. compress: a liquid is cooled and quenched, sheared if
    a strain is given, then compressed or decompressed to its phi_J; also how far large and small particles have
    separated.

    Collective.

    Parameters
    ----------
    n : integer
        number of particles
    dimension : integer, default 2
        2: disks, 3: spheres
    phi : numbers or "low:high:count"
        packing fractions: M from A to B evenly, or a list with commas
    seeds : integers or "first:last"
        a sample at each packing fraction for each seed, both ends included
    sizes : str, default bidisperse
        particle sizes: bidisperse[:RATIO[:SHARE]], monodisperse, lognormal:SIGMA, uniform:LOW:HIGH, powerlaw:EXPONENT:RATIO; bidisperse has RATIO 1.4 and a SHARE of 0.5 of large ones
    potential : "harmonic", "hertzian" or "power", default harmonic
        energy of an overlap
    exponent : number, default None
        exponent α of the potential power, whose force is ∝ overlap^(α−1); 2 is harmonic, 5/2 hertzian
    tolerance : number, default 1e-06
        largest max|F|/(p d), in three dimensions max|F|/(p d²), of a minimum
    protocol : "random", "shear" or "compress", default random
        how samples are made
    separated : bool, default False
        large particles start on one side of the cell, small on the other
    step : number, default None
        strain of one step (default 1e-3)
    strain : number, default None
        how far each seed is sheared (default 2; compress: not)
    discard : number, default None
        strain before the first sample (default 1)
    every : number, default None
        strain between samples (default 0.02)
    temperature : number, default None
        of the liquid, in k_e (default 1e-3)
    cooling_rate : number, default None
        by how much ln T falls per sweep (default 1e-2)
    sweeps : integer, default None
        sweeps before that (default 200)
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-jam file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def spectrum(
    *sweeps: Result | Ensemble | _Path,
    window: float | None = None,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> SpectrumResult:
    """Relaxation spectrum, G(t) and J(t) of a sweep.

    The response in time from a sweep by the rational method: relaxation times and weights, the spectrum
    H(τ), stress relaxation G(t), creep compliance J(t) and its retardation spectrum. One sweep gives a result; any
    number of sweeps give a picture, where the name of the file ends in .png, .pdf or .svg.

    A packing has thousands of modes, the spectrum of a sweep a few tens: nodes of a quadrature that gives G* to the
    accuracy of the sweep. H(τ) is therefore its mean between neighbouring nodes, averaged over a window. With masses
    G(t) and J(t) oscillate, and the result has these two alone, without a spectrum.

    Collective.

    Parameters
    ----------
    sweeps : result or the name of its file
        sweeps by the rational method
    window : number, default None
        width of the average of H(τ) (default: twice the widest gap between nodes), in decades
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-spectrum file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def correlate(
    *results: Result | Ensemble | _Path,
    lane: _Numbers | None = None,
    bin: float | None = None,
    phase: Literal["stress", "strain"] | None = None,
    along: Literal["x", "y", "both"] | None = None,
    omega: _Numbers | None = None,
    packing: Packing | _Path | None = None,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Result:
    """Correlation of displacements along the flow, and its length.

    C(δ) of the displacements u_y along x in narrow lanes (BT Fig. 7), real and imaginary part, of the fields that
    sweeps hold, and the length l at its first root: by default in the phase of the stress, as BT impose it. In a square
    cell u_x along y has the same C on average, and the mean of both a smaller error.
    Several sweeps of one kind (law, pressure, number of disks) are averaged. Of flows with snapshots: the correlation
    g_y(x) of transverse velocities along the flow (Vågberg, eq. 4.23) of pairs of disks in one lane, and its minimum.

    The packing of a sweep is read from the path that the sweep records, or beside it. Errors come from resampling the
    packings; for fewer than five packings from strips of lanes, which gives lower bounds.

    Collective.

    Parameters
    ----------
    results : result or the name of its file
        sweeps with fields, or flows with snapshots, of one kind
    lane : numbers, default None
        widths of a lane, the first for the summary (default 0.5,0.25,1); for a flow one width (default 1), in mean diameters
    bin : number, default None
        flow: width of the bins of x (default 1), in mean diameters
    phase : "stress" or "strain", default None
        sweep: phase of the real parts, that of the stress (default, BT) or of the strain
    along : "x", "y" or "both", default None
        sweep: axis of the lanes, x (default) for u_y along x, y for u_x along y, or both, their mean
    omega : numbers or "low:high:count", default None
        sweep: frequencies of the fields to correlate (default: all)
    packing : Packing or the name of its file, default None
        sweep: file of its packing (default: as the result records it)
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a jampetsc-correlation file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def study(
    study: dict[str, Any] | _Path,
    *,
    dry_run: bool = False,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> Ensemble:
    """An ensemble: packings, responses and their table.

    Runs every task of STUDY.toml that is not done yet. A table is a command and its keys are options; lists give a
    task for every combination of their values, and every response runs on every packing. Under mpirun each rank takes
    the next task as soon as it is free. The same command resumes a study that was stopped, on any number of ranks; a
    changed STUDY.toml adds tasks. FOLDER/table.csv has one row per task; jampetsc.load(FOLDER) reads it.

    Collective.

    Parameters
    ----------
    study : dict or the name of a TOML file
        description of the study: a TOML file, in python also its tables by name
    dry_run : bool, default False
        print the tasks without running them
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    what `load` gives for a table file

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def trade(
    packing: Packing | _Path,
    law: Law | str = ...,
    *,
    prestress: bool = True,
    tangential_stiffness: float = 0.0,
    choices: str | Sequence[str] = 'accuracy,method,physics,frequencies',
    ensemble: bool = False,
    omega: _Numbers = '1e-10:1e4:141',
    ranks: int | None = None,
    options_files: Sequence[_Path] | None = None,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> str:
    """Measure what speed costs in accuracy.

    Runs a sweep of one packing with each of many settings, and compares time, memory, factorisations, errors of G' and
    G'' and critical slopes with the most accurate sweep. Writes a table (CSV) and, beside it, a picture of
    time against error (.png), and recommends settings by rules that it states.

      accuracy     accuracies 1e-2 ... 1e-10 of the rational sweep
      method       method direct with MUMPS and with the options files
      physics      rotations, pre-stress, Stokes drag instead of contact damping: deviation from the law given
      frequencies  few frequencies solved one by one, and interpolation between them

    Collective.

    Parameters
    ----------
    packing : Packing or the name of its file
        packing
    law : jampetsc.ContactDamping(…), jampetsc.StokesDrag(…), jampetsc.Law("custom", …) or "contact", "stokes", "custom", default ContactDamping()
        damping law
    prestress : bool, default True
        K keeps the f/r term of its contacts (BT: 'with pre-stress')
    tangential_stiffness : number, default 0
        elastic springs between the rims of touching particles, k_t over the stiffness k of each contact; above 0 particles roll, and no contact slips
    choices : texts, default accuracy,method,physics,frequencies
        groups of settings to vary
    ensemble : bool, default False
        also compare the packing with 4 new ones of N/4 and 16 of N/16 disks
    omega : numbers or "low:high:count", default 1e-10:1e4:141
        frequencies ω, in 1/time, the time that tau1 is in
    ranks : integer, default None
        ranks of each run under mpirun (default: without mpirun)
    options_files : names of files, default None
        options files for method direct (default: iterative, superlu_dist, low_memory of jampetsc)
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    str, the table and the advice

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """

def examples(
    *,
    copy: _Path,
    out: _Path | None = None,
    checkpoint: _Path | None = None,
    overwrite: bool = False,
    progress: bool = False,
) -> str:
    """Copy the example programs, options files of PETSc and Slurm scripts that come with jampetsc.

    Into a new folder: examples/ (programs in Python), options/ (files of PETSc options, also known as
    -options_file jampetsc:NAME) and slurm/ (scripts for a cluster).

    Collective.

    Parameters
    ----------
    copy : name of a file
        new folder to copy into
    out : name of a file, default None
        file of the result (default: in memory; see `Result.save`)
    checkpoint : name of a file, default None
        file beside which a long run saves its finished steps, to resume from them (default: out)
    overwrite : bool, default False
        compute again and replace a finished result at out; otherwise a finished result of the same settings and inputs is returned, and one of other settings raises InputError
    progress : bool, default False
        whether to report progress on stderr

    Returns
    -------
    str, the files

    Raises
    ------
    InputError
        for values that cannot be used, naming them
    ConvergenceError
        where a solver does not converge
    """
