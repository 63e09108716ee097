"""Damping laws as data: weights with which motions of contacts, and of disks in the fluid, dissipate.

All laws are values of the weights of one dissipation function (BT eqs. 5–9; Vågberg, thesis eqs. 4.16–4.28),

    2R/kτ₁ = Σ_c [ normal (ȧ∥)² + transverse (ȧ⊥)² + sliding (ȧ⊥ᶜ)² ]
             + Σ_i [ drag |u̇_i|² + spin_drag d² |θ̇_i − γ̇Ω|² ] + η_F V γ̇² ,

a sum over the rows of `forms.FORMS`: a∥, a⊥ are the relative motions of two disks along and across their
bond, a⊥ᶜ = a⊥ − (ρ_i θ_i + ρ_j θ_j) × n the sliding of their rims, u_i a disk's motion relative to the affine flow, Ω
the rotation of that flow and d the mean diameter. FAMILIES is the table of the laws
that can be chosen by name; a new law is one more row there. No other code depends on the name of a law: matrices,
forces, dissipation, null modes and command-line options all follow from weights and rows.
"""

import inspect
import math
from collections.abc import Callable
from dataclasses import KW_ONLY, dataclass, field, make_dataclass

from jampetsc.errors import InputError, as_float, named, python_value
from jampetsc.laws.forms import CENTRAL, FORMS, SPIN, LinearForm, spins_of

MAX_WEIGHT = 1e12  # largest weight
MIN_OMEGA, MAX_OMEGA = 1e-16, 1e12  # of ωτ₁: beyond, K and ωB no longer share a double


def refuse_beyond(what: str, value) -> None:
    """Raise InputError, which begins with `what`, unless `value` is a number between 0 and MAX_WEIGHT."""
    number = _number(what, value)
    if not 0 <= number <= MAX_WEIGHT:  # nan does not
        raise InputError(f"{what} {number:g}: must lie between 0 and {MAX_WEIGHT:g}")


def _number(what, value) -> float:
    try:
        return as_float(value)
    except (TypeError, ValueError):
        raise InputError(f"{what} {python_value(value)!r}: must be a number") from None


@dataclass(frozen=True)
class Option:
    """A parameter of a family: a number ≥ 0, or a switch where the default is True."""

    default: float | bool
    meaning: str  # for a switch: what turning it off means


@dataclass(frozen=True)
class Family:
    """A row of the table: laws that differ in the values of some parameters."""

    label: str
    options: dict[str, Option]
    weights: Callable  # of the options' values → those weights of `Law` that are not zero
    python: str  # call that makes a Law in python; {} stands for its options
    leading: str = ""  # the option that a law's label always has
    simplest: dict | None = None  # values of options for a first comparison with laws of other families


FAMILIES = {
    "contact": Family(  # BT eqs. 5, 6; Vågberg's CD, CDn, CDt: --no-rotations with (1, 1), (1, 0), (0, 1)
        "contact damping",
        {
            "normal": Option(1.0, "weight of normal contact damping, ≥ 0"),
            "beta": Option(1.0, "weight of transverse contact damping, ≥ 0"),
            "rotations": Option(True, "particles do not roll"),
        },
        lambda normal, beta, rotations: {"normal": normal, "sliding" if rotations else "transverse": beta},
        python="ContactDamping({})",
        leading="beta",
        simplest={"beta": 1.0},
    ),
    "stokes": Family(  # BT eqs. 7, 8; Vågberg's RD with η_F = 0
        "Stokes drag",
        {"eta_f": Option(1.0, "fluid viscosity in units of k τ₁, ≥ 0")},
        lambda eta_f: {"drag": 1.0, "eta_f": eta_f},
        python="StokesDrag({})",
        leading="eta_f",
        simplest={"eta_f": 0.0},
    ),
    "custom": Family(  # any weights of the dissipation function above
        "custom law",
        {form.weight: Option(0.0, form.help) for form in FORMS},
        dict,
        python='Law("custom", {})',
    ),
}
DEFAULT, CUSTOM = "contact", "custom"
WEIGHTS = tuple(form.weight for form in FORMS)  # of a `Law`
OPTIONS = tuple(dict.fromkeys(name for family in FAMILIES.values() for name in family.options))


_Weights = make_dataclass(
    "_Weights", [(weight, float, field(default=0.0, kw_only=True)) for weight in WEIGHTS], frozen=True
)


@dataclass(frozen=True)
class Law(_Weights):
    """A damping law: weights of the dissipation 2R in units of kτ₁ (docs/theory/linear_response.md).

    `damping_law` makes the laws of BT.

    label      name in messages and files
    exponent   α of a viscous force ∝ |ȧ|^α (BT eq. 9); 1 is linear
    tau1       damping time τ₁

    WEIGHTS
    """

    label: str
    _: KW_ONLY
    exponent: float = 1.0  # α of a viscous force ∝ |ȧ|^α (BT eq. 9); 1 is linear
    tau1: float = 1.0  # damping time τ₁
    family: str | None = None  # row of FAMILIES it was made from, with its options
    options: tuple = field(default=(), compare=False)  # ((name, value), …)

    def __post_init__(self):
        for name in (*WEIGHTS, "exponent", "tau1"):
            object.__setattr__(self, name, python_value(getattr(self, name)))
        for name in WEIGHTS:
            refuse_beyond(f"{name} =", getattr(self, name))
        tau1 = _number(named("tau1"), self.tau1)
        if not 0 < tau1 < math.inf:
            raise InputError(f"{named('tau1')} {tau1:g}: must be positive")

    def weight(self, form: LinearForm) -> float:
        """The weight in B of the square of a form."""
        return getattr(self, form.weight)

    @property
    def dissipating(self) -> tuple[LinearForm, ...]:
        """Rows of the table that the law weighs."""
        return tuple(form for form in FORMS if self.weight(form))

    def contact_forms(self, elastic=CENTRAL) -> tuple[LinearForm, ...]:
        """Forms of contacts that the law weighs, and those whose weights in K are among `elastic`."""
        return tuple(
            form for form in FORMS if form.is_of_contacts and (self.weight(form) or form.elastic in elastic)
        )

    @property
    def on_contacts(self) -> tuple[float, float, float]:
        """Weights of (ȧ∥)², (ȧ⊥)², (ȧ⊥ᶜ)², of contacts, which flows support."""
        return self.normal, self.transverse, self.sliding

    def on_axes(self, forms, dimension: int) -> tuple[float, ...]:
        """Weights of the squares of `forms` of contacts, one for each axis: as `relative_motion.linear_forms`."""
        return tuple(self.weight(form) for form in forms for _ in range(form.count(dimension)))

    def on_disks(self, dimension: int, diameter: float):
        """Weights of the squares of the D displacements of a disk and of its spins, (D(D + 1)/2,)."""
        of_spin = 0.0 if not self.spin_drag else self.spin_drag * diameter**2
        return (self.drag,) * dimension + (of_spin,) * spins_of(dimension)

    @property
    def damps_contacts(self) -> bool:
        """Whether contacts dissipate; otherwise only the fluid does, if anything."""
        return any(form.is_of_contacts for form in self.dissipating)

    @property
    def is_of_contacts(self) -> bool:
        """Whether contacts dissipate and no fluid."""
        return self.damps_contacts and all(form.is_of_contacts for form in self.dissipating)

    def require_dissipation(self) -> None:
        """Raise InputError if motions of disks dissipate nothing."""
        if not (self.damps_contacts or any(form.is_of_disks for form in self.dissipating)):
            raise InputError(f"{self.label}: nothing dissipates. Raise one of the weights.")

    @property
    def couples_rotations(self) -> bool:
        """Whether the law needs the angles θ: a form that it weighs has them."""
        return any(form.has_spins for form in self.dissipating)

    def dofs(self, dimension: int) -> int:
        """Unknowns per disk: D displacements and, where disks roll, D(D − 1)/2 spins θ."""
        return dimension + (spins_of(dimension) if self.couples_rotations else 0)

    @property
    def holds_translations(self) -> bool:
        """Whether the fluid damps translations of a whole piece of the packing; contacts do not."""
        return self.drag > 0

    @property
    def holds_spins(self) -> bool:
        """Whether the fluid damps disks that turn like gears; the sliding of rims does not."""
        return any(form.axes == SPIN for form in self.dissipating)

    def require_only(self, forms, of: str) -> None:
        """Raise InputError where the law weighs forms with other weights than these; of: what has no others."""
        for form in self.dissipating:
            if form.weight not in forms:
                raise InputError(
                    f"{named(form.weight)} {self.weight(form):g}: not supported by {of}. Leave it out, or use sweep, "
                    "which takes any linear law."
                )

    @property
    def parameters(self) -> dict:
        """Name and parameters, for files: {"law": "contact", "tau1": 1.0, "beta": 1.0, …}; weights without a family."""
        if self.family is None:
            weights = {name: getattr(self, name) for name in WEIGHTS if getattr(self, name)}
            return {"law": self.label, "tau1": self.tau1, **weights}
        return {"law": self.family, "tau1": self.tau1, **dict(self.options)}

    def altered(self, **options) -> "Law":
        """The law of the same family with some options changed."""
        unchanged = {"tau1": self.tau1, "exponent": self.exponent}
        return damping_law(self.family, **{**dict(self.options), **unchanged, **options})

    def __str__(self):
        return self.label

    def __repr__(self):
        if self.family is None:
            values = {name: getattr(self, name) for name in (*WEIGHTS, "exponent", "tau1")}
            changed = {name: value for name, value in values.items() if value != getattr(Law, name)}
            options_text = "".join(f", {name}={value!r}" for name, value in changed.items())
            return f'Law("{self.label}"{options_text})'
        options = {"tau1": self.tau1} if self.tau1 != 1.0 else {}
        options |= {
            name: value
            for name, value in self.options
            if value != FAMILIES[self.family].options[name].default
        }
        return python_text(self.family, options)


Law.__doc__ = inspect.cleandoc(Law.__doc__).replace(
    "WEIGHTS", "\n".join(f"{form.weight:10s} {form.help}" for form in FORMS)
)


@dataclass(frozen=True)
class Physics:
    """What a linear response models: a damping law, and what K has beside the stiffness of contacts.

    prestress              K includes the −f/r of contacts (BT eq. 4)
    tangential_stiffness   weight of (a⊥ᶜ)² in K over the stiffness k of each contact; above 0 disks roll
    """

    law: Law
    prestress: bool = True
    tangential_stiffness: float = 0.0

    @property
    def parameters(self) -> dict:
        """Parameters of the law and of K, for files."""
        return {**self.law.parameters, **elastic_parameters(self.prestress, self.tangential_stiffness)}

    def __str__(self):
        springs = f", k_t/k = {self.tangential_stiffness:g}" if self.tangential_stiffness else ""
        return f"{self.law}{'' if self.prestress else ', no pre-stress'}{springs}"


def elastic_parameters(prestress: bool, tangential_stiffness: float = 0.0) -> dict:
    """What K has beside the stiffness of contacts, for files: tangential springs where there are any."""
    springs = {"tangential_stiffness": tangential_stiffness} if tangential_stiffness else {}
    return {"prestress": prestress, **springs}


UNDAMPED = Law("no damping")  # K alone


def damping_law(law: str = DEFAULT, *, tau1: float = 1.0, exponent: float = 1.0, **options) -> Law:
    """The law of a family with these options, the others at their defaults.

    Raises InputError for a name that is not in FAMILIES, an option of another family, values out of range, and
    if motions of disks dissipate nothing.
    """
    if law not in FAMILIES:
        raise InputError(f"{named('law')} {law}: not supported. Choose one of {', '.join(FAMILIES)}.")
    family = FAMILIES[law]
    for option in options:
        if option not in family.options:
            owners = " or ".join(having(option))
            raise InputError(
                f"{named(option)}: an option of {named('law')} {owners}, not of {law}. Leave it out."
            )
    values = {
        option: python_value(options.get(option, family.options[option].default)) for option in family.options
    }
    for option, value in values.items():
        if not isinstance(value, bool):
            refuse_beyond(named(option), value)
    label = family.label + "".join(
        f", no {option}" if value is False else f", {option} = {value:g}"
        for option, value in values.items()
        if value != family.options[option].default or option == family.leading
    )
    family_law = Law(
        label,
        **family.weights(**values),
        exponent=exponent,
        tau1=tau1,
        family=law,
        options=(*values.items(),),
    )
    family_law.require_dissipation()
    return family_law


def python_text(family: str, options: dict) -> str:
    """The call that makes a law of a family in python, with options {name: value}."""
    return FAMILIES[family].python.format(", ".join(f"{name}={value!r}" for name, value in options.items()))


def ContactDamping(beta=1.0, *, normal=1.0, rotations=True, tau1=1.0) -> Law:
    """The Law of damping by the relative motions of disks in contact (BT eqs. 5, 6).

    beta        weight of transverse motion, ≥ 0
    normal      weight of normal motion, ≥ 0
    rotations   whether disks roll; transverse motion is then of the rims
    tau1        damping time τ₁

    Raises InputError for values out of range and if nothing dissipates.
    """
    return damping_law("contact", normal=normal, beta=beta, rotations=rotations, tau1=tau1)


def StokesDrag(eta_f=1.0, *, tau1=1.0) -> Law:
    """The Law of drag by the fluid that the disks are in (BT eqs. 7, 8).

    eta_f   viscosity η_F of the fluid in kτ₁, ≥ 0
    tau1    damping time τ₁

    Raises InputError for values out of range.
    """
    return damping_law("stokes", eta_f=eta_f, tau1=tau1)


def having(option: str) -> list[str]:
    """Names of the families that have an option."""
    return [name for name, family in FAMILIES.items() if option in family.options]
