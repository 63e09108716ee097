"""What K and B are sums of: weighted squares of linear forms, the relative motions of bonds and motions of disks.

FORMS is the table of them: a weight is a row. With r = x_j − x_i, n = r/|r| and axes t across n, displacements ũ and
spins θ of the two disks, and the load E r of unit amplitude (`laws.loads`), a form of a bond along an axis e is

    a = moves e·(ũ_j − ũ_i + ε E r) + e·[(turns_i ρ_i θ_i + turns_j ρ_j θ_j) × n] ,

so that a∥ has e = n, a⊥ has e = t, and the sliding of the rims a⊥ᶜ = a⊥ − t·[(ρ_i θ_i + ρ_j θ_j) × n] turns = (−1, −1).
In two dimensions there is one axis t = ẑ × n and θ = θ ẑ; in three there are two axes t, and three spins. Forms of
single disks are the displacement ũ_i relative to the affine flow, and d (θ_i − εΩ), the spin relative to its rotation
Ω times the mean diameter d.

In K a row weighs k, −f/r (BT eqs. 4, 11) or what the model of K adds; in B the weight of the law, in units of kτ₁.
"""

from dataclasses import dataclass

ALONG, ACROSS = "along a bond", "across a bond"
DISPLACEMENT, SPIN, STRAIN = "displacement of a disk", "spin of a disk", "strain of the fluid"


@dataclass(frozen=True)
class LinearForm:
    """A row of the table: a motion whose square K and B weigh."""

    weight: str  # in B: attribute of a `Law` and option of `--law custom`, in units of kτ₁
    help: str  # of that option
    symbol: str  # of that weight, in legends (LaTeX)
    axes: str  # ALONG or ACROSS for a form of contacts; DISPLACEMENT, SPIN, STRAIN
    moves: float = 0.0  # coefficient of ũ_j − ũ_i
    turns: tuple[float, float] = (0.0, 0.0)  # of ρ_i θ_i × n and of ρ_j θ_j × n
    elastic: str = ""  # its weight in K, see `DistributedNetwork.elastic_weights`

    @property
    def is_of_contacts(self) -> bool:
        """Whether it is a relative motion of two disks."""
        return self.axes in (ALONG, ACROSS)

    @property
    def is_of_disks(self) -> bool:
        """Whether it is a motion of a single disk relative to the fluid."""
        return self.axes in (DISPLACEMENT, SPIN)

    @property
    def has_spins(self) -> bool:
        """Whether the spins of disks are in it."""
        return self.axes == SPIN or any(self.turns)

    def count(self, dimension: int) -> int:
        """Forms of one contact: one for each axis."""
        return 1 if self.axes == ALONG else dimension - 1


FORMS = (
    LinearForm(
        "normal",
        "weight of normal contact damping, ≥ 0",
        r"w_\parallel",
        ALONG,
        moves=1.0,
        elastic="stiffness",
    ),
    LinearForm(
        "transverse",
        "weight of transverse contact damping without rotations, ≥ 0",
        r"w_\perp",
        ACROSS,
        moves=1.0,
        elastic="prestress",
    ),
    LinearForm(
        "sliding",
        "weight of the sliding of rims, ≥ 0; above 0 particles roll",
        r"w_{\perp c}",
        ACROSS,
        moves=1.0,
        turns=(-1.0, -1.0),
        elastic="tangential_stiffness",
    ),
    LinearForm("drag", "weight of the drag of the fluid on every particle, ≥ 0", r"w_d", DISPLACEMENT),
    LinearForm(
        "spin_drag",
        "weight of the drag of the fluid on the spin of every particle relative to the rotation of the flow, in units "
        "of k τ₁ d² with the mean diameter d, ≥ 0; above 0 particles roll",
        r"w_\theta",
        SPIN,
    ),
    LinearForm("eta_f", "fluid viscosity in units of k τ₁, ≥ 0", r"\eta_F", STRAIN),
)
# weights in K that every packing has, so that their motions are always known
CENTRAL = "stiffness", "prestress"
CENTRAL_FORMS = tuple(form for form in FORMS if form.elastic in CENTRAL)


def spins_of(dimension: int) -> int:
    """Spins of a disk that rolls, D(D − 1)/2."""
    return dimension * (dimension - 1) // 2
