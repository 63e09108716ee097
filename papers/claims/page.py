"""The rows of the page of claims: which number decides each claim of the works, and which others bear on it.

The decisive numbers are those that the work prints or draws for this claim; verdicts play no part. Where a claim is
printed for several parameters, its row is the worst of their numbers, or, where all are the same number, their weighted
mean. All other numbers are in claims.csv, with the claim on which they bear.

A pattern is the name of a number, … in it standing for any text, such as parameters of a run. Where several numbers
decide, each pattern has a label for the reader, {} in it standing for the text of the pattern's first …, {1} for that
of its second.
"""

from dataclasses import dataclass

WORST, MEAN = "worst", "mean"


@dataclass(frozen=True)
class PageClaim:
    """A claim as printed.

    text         the claim and where it is printed
    decisive     {pattern: label} of the numbers that decide
    supporting   patterns of the other numbers that bear on it
    combine      WORST or MEAN of several decisive numbers
    """

    text: str
    decisive: dict[str, str]
    supporting: tuple[str, ...] = ()
    combine: str = WORST


PAGE = {
    "Moduli at β = 1": (
        PageClaim(
            "G₀ ~ p^x, without pre-stress (BT 16, Fig. 3b)",
            {"β = 1: G₀ ~ p^x, without pre-stress": ""},
            ("β = 1: G₀ ~ p^x, without pre-stress, … alone",),
        ),
        PageClaim(
            "η₀ ~ p^x, without pre-stress (BT 22, Fig. 3b)",
            {"β = 1: η₀ ~ p^x, without pre-stress": ""},
            ("β = 1: η₀ ~ p^x, without pre-stress, … alone",),
        ),
        PageClaim(
            "ω* = G₀/η₀ ~ p^x, without pre-stress (BT 15, Fig. 3b)",
            {"β = 1: ω* = G₀/η₀ ~ p^x, without pre-stress": ""},
            ("β = 1: ω* = G₀/η₀ ~ p^x, without pre-stress, … alone",),
        ),
        PageClaim(
            "G₀ ~ p^x, with pre-stress (Fig. 3b)",
            {"β = 1: G₀ ~ p^x, with pre-stress": ""},
            ("β = 1: G₀ ~ p^x, with pre-stress, … alone",),
        ),
        PageClaim(
            "G′, G″ ~ ω^Δ for p ≪ ω ≪ 1, with pre-stress (BT 17, Figs. 1, 3)",
            {"β = 1, with pre-stress: Δ": ""},
            (
                "β = 1, without pre-stress: Δ",
                "β = 1, with… pre-stress: ½ d ln…",
                "β = 1, with… pre-stress: arg…",
                "β = 1, with… pre-stress: d ln G″…",
                "β = 1, with… pre-stress: G″/G′…",
            ),
        ),
        PageClaim(
            "G″ ~ ω^x at both ends, as a Kelvin–Voigt solid (Fig. 1)",
            {
                "β = 1, p = …: G″ ~ ω^x at the lowest ω": "at the lowest ω",
                "β = 1, p = …: G″ ~ ω^x at the highest ω": "at the highest ω",
            },
            ("ω = …: non-affine motion per strain, in d", "ω = …: ũ at zero over ũ at peak stress"),
        ),
        PageClaim(
            "the critical regime ends at ω ~ 1: where d ln G″/d ln ω passes ¾ (Fig. 3a)",
            {"β = 1, with pre-stress: upper border…": ""},
            ("β = 1, without pre-stress: upper border…",),
        ),
        PageClaim(
            "G*/p^½ is one curve of ω/p: spread (rms of the logarithm) below ω = 0.1, with pre-stress (Fig. 3b)",
            {"β = 1, with pre-stress: G*/p^½ is one curve…": ""},
            ("β = 1, without pre-stress: G*/p^½ is one curve…",),
        ),
        PageClaim(
            "rotations do not change the form: |G*| without over with rotations ~ ω^x (sec. 2)",
            {"β = 1: |G*| without over with rotations ~ ω^x…": ""},
            ("β = 1: |G*| without over with rotations, …", "β = 1, no rotations…"),
        ),
    ),
    "Moduli at β ≠ 1": (
        PageClaim(
            "β = 0, without pre-stress: G* = G₀(1 + iωτ₁), largest relative difference (BT 18)",
            {"β = 0, without pre-stress: G*/…": ""},
        ),
        PageClaim(
            "β = 0: η₀ ~ p^x, without pre-stress (BT 22)",
            {"contact damping: η₀ at β = 0 ~ p^x, without pre-stress": ""},
            ("contact damping: η₀ at β = 0 ~ p^x, …",),
        ),
        PageClaim(
            "β > 0: η₀ − η₀(β = 0) ~ p^x, without pre-stress (BT 22)",
            {"contact damping: η₀ − η₀(β = 0), per β ~ p^x, without pre-stress": ""},
            ("contact damping: η₀ − η₀(β = 0), per β ~ p^x, …",),
        ),
        PageClaim(
            "β* ~ p^x, below which there is no critical regime, without pre-stress (sec. 3.3)",
            {"contact damping: β* = … ~ p^x, without pre-stress": ""},
            ("contact damping: β* = … ~ p^x, …",),
        ),
        PageClaim(
            "ω* = G₀/η₀ ~ β^x for β ≫ β*, without pre-stress (sec. 3.3)",
            {"without pre-stress: ω* = G₀/η₀ ~ β^x…": ""},
        ),
        PageClaim(
            "no critical regime at β ≪ β*, it opens as β grows: decades of ω with d ln G″/d ln ω = ½ ± 0.1 (Fig. 4b)",
            {"p = 1e-4, with pre-stress: decades of ω with d ln G″/d ln ω = ½ ± …, β = …": "β = {1}"},
            ("p = 1e-4, without pre-stress: decades…",),
        ),
    ),
    "Floppiness": (
        PageClaim(
            "median |Δu∥| ~ p^x, without pre-stress (BT 19, Fig. 5)",
            {"median |Δu∥| ~ p^x, without pre-stress (…": ""},
            ("… |Δu∥| ~ p^x…",),
        ),
        PageClaim(
            "median |Δu⊥| ~ p^x, without pre-stress (BT 20, Fig. 5)",
            {"median |Δu⊥| ~ p^x, without pre-stress (…": ""},
            ("… |Δu⊥| ~ p^x…",),
        ),
        PageClaim(
            "median |u_na| ~ p^x, without pre-stress (BT 21, Fig. 5)",
            {"median |u_na| ~ p^x, without pre-stress (…": ""},
            ("… |u_na| ~ p^x…",),
        ),
        PageClaim(
            "Σ(Δu⊥)²/Σ(Δu∥)² over contacts ~ p^x, without pre-stress (BT 20)",
            {"Σ(Δu⊥)²/Σ(Δu∥)² ~ p^x, without pre-stress…": ""},
        ),
        PageClaim(
            "mean |Δu∥| levels off at low p: ~ p^x between the lowest two p (sec. 3.3)",
            {"mean |Δu∥| ~ p^x, without pre-stress, p = …": ""},
        ),
        PageClaim(
            "low modes are floppy-like: rms Δu⊥ over rms Δu∥ of the lowest ten ~ p^x (sec. 3.3)",
            {"rms Δu⊥ over rms Δu∥ of the lowest … modes ~ p^x": ""},
            ("share of … modes carry, …", "median … by the lowest … modes alone…"),
        ),
    ),
    "Stokes drag": (
        PageClaim(
            "η₀ − η_F ~ p^x at η_F = 1, without pre-stress (Fig. 6a)",
            {"Stokes, η_F = 1: η₀ − η_F ~ p^x, without pre-stress": ""},
            ("Stokes, η_F = 1: η₀ − η_F ~ p^x, …",),
        ),
        PageClaim(
            "G′, G″ − η_Fω ~ ω^Δ at η_F = 1, with pre-stress (Fig. 6a)",
            {"Stokes, η_F = 1, with pre-stress: Δ": ""},
            (
                "Stokes, η_F = 1, without pre-stress: Δ",
                "Stokes, η_F = 1, with… pre-stress: ½ d ln…",
                "Stokes, η_F = 1, with… pre-stress: arg…",
                "Stokes, η_F = 1, with… pre-stress: d ln G″…",
                "Stokes, η_F = 1, with… pre-stress: G″/G′…",
            ),
        ),
        PageClaim(
            "G″ → η_Fω for ω ≫ 1 (Fig. 6a), G″ ~ ω at all ω for η_F ≫ p^(−½) (Fig. 6b)",
            {
                "Stokes, p = 1e-4, η_F = 1: G″/(η_Fω) at the highest ω": "G″/(η_Fω) at the highest ω",
                "Stokes, p = 1e-4, η_F = … ≫ p^(−½): least d ln G″/d ln ω": "least d ln G″/d ln ω at η_F = {}",
            },
        ),
        PageClaim(
            "G′ stays critical for any η_F: largest relative difference between them (Fig. 6b)",
            {"Stokes, p = 1e-4: G′ of … η_F, largest relative difference": ""},
        ),
    ),
    "Correlations": (
        PageClaim(
            "Im u_y gives the same C as Re u_y: ratio of their lengths l (sec. 5)",
            {
                "contact: l of Im u_y over l of Re u_y, …": "contact damping",
                "Stokes: l of Im u_y over l of Re u_y as ω → 0": "Stokes, ω → 0",
            },
        ),
        PageClaim(
            "contact damping: C does not depend on p: ratio of l at the lowest and the highest p (sec. 5)",
            {"contact: l at p = … over l at …, Re u_y": ""},
        ),
        PageClaim(
            "contact damping: C is one curve of δ/L: ratio of C at two N (Fig. 7a)",
            {"contact: C(δ/L = …) at N = … over that at N = …": ""},
            ("contact: l/L at N = … over that at N = …, Re u_y",),
        ),
        PageClaim(
            "Stokes: plateau of l/L as ω → 0 (Fig. 7c)",
            {"Stokes: l/L as ω → 0, Re u_y, phase of the stress": ""},
        ),
        PageClaim(
            "C does not depend on the width of lanes: ratio of l at the narrowest two (sec. 5)",
            {"Stokes: l of lanes of 0.12 d over that of …": ""},
            ("Stokes: l of lanes of …",),
        ),
        PageClaim(
            "Stokes: l (−ln p)^0.65 is one curve of ω/p^½: spread (rms of the logarithm) (Fig. 7d)",
            {"Stokes: spread (rms) of l (−ln p)^0.65 at equal ω/p^½, Re u_y, phase of the stress": ""},
            ("Stokes: spread (rms) of…",),
        ),
        PageClaim(
            "Stokes: the minimum of C is lost at ω = 10^-5.5 and 10^-6.5: C at L/2 less least C (Fig. 7b)",
            {
                "Stokes, p = 1e-4, ω = 10^-6.5: C at L/2 less C at its minimum": "ω = 10^-6.5",
                "Stokes, p = 1e-4, ω = 10^-5.5: C at L/2 less C at its minimum": "ω = 10^-5.5",
            },
            ("Stokes, p = 1e-4, ω = …: C at L/2 less C at its minimum",),
        ),
    ),
    "Finite size": (
        PageClaim(
            "contact damping: a of η₀ = N^a f(pN²), without pre-stress (Fig. 8a)",
            {"β = 1, without pre-stress: a of η₀ = N^a f(pN²)": ""},
            (
                "β = 1, with pre-stress: a of η₀ = N^a f(pN²)",
                "β = 1, without pre-stress: η₀/N^1 ~ (pN²)^x, …",
            ),
        ),
        PageClaim(
            "contact damping: pN² at which η₀ ~ N and η₀ ~ p^(−½) meet, without pre-stress (Fig. 8a)",
            {"β = 1, without pre-stress: pN² at which η₀ ~ N and η₀ ~ p^(−½) meet": ""},
            ("Stokes, … pre-stress: pN² at which…",),
        ),
        PageClaim(
            "pre-stress makes powers of p too shallow even for pN² > 1000: η₀ with over without it ~ (pN²)^x (Fig. 8)",
            {
                "β = 1: η₀ with over without pre-stress ~ (pN²)^x, …": "contact damping",
                "Stokes, η_F = 1: η₀ − η_F with over without pre-stress ~ (pN²)^x, …": "Stokes, η₀ − η_F",
            },
            (
                "β = 1: ω* = G₀/η₀ with over without pre-stress ~ (pN²)^x, …",
                "β = 1: η₀ ~ p^x, with pre-stress, … alone",
                "β = 1: ω* = G₀/η₀ ~ p^x, with pre-stress, … alone",
                "β = 1, with pre-stress: η₀/N^1 ~ (pN²)^x, …",
                "β = 1: R = η₀ with/without pre-stress ~ (pN²)^x, …",
                "with pre-stress: share of packings with G₀ < 0",
            ),
        ),
        PageClaim(
            "Stokes, η_F = 1: a of η₀ = N^a f(pN²), without pre-stress (Fig. 8b)",
            {"Stokes, η_F = 1, without pre-stress: a of η₀ = N^a f(pN²)": ""},
            ("Stokes, … pre-stress: a of η₀ = N^a f(pN²)",),
        ),
        PageClaim(
            "Stokes, η_F = 1: η₀/N^a ~ (pN²)^x for pN² > 1000, without pre-stress (Fig. 8b)",
            {"Stokes, η_F = 1, without pre-stress: η₀/N^1.09 ~ (pN²)^x, …": ""},
            ("Stokes, η_F = 1, with pre-stress: η₀/N^1.09 ~ (pN²)^x, …",),
        ),
    ),
    "Power-law damping": (
        PageClaim(
            "slow shear: G″ ~ X p^(−½), X = ω^α σ^(α−1), exponents of X and p, α = ½ and ⅔ (BT 27)",
            {
                "α = …, quasistatic, p = …: G″ ~ X^x…": "exponent of X at α = {}",
                "α = …, quasistatic: G″/X ~ p^x (BT 27)": "exponent of p at α = {}",
            },
        ),
        PageClaim(
            "critical regime: G′ ~ X^x, α = ½ and ⅔ (BT 28)",
            {"α = …, critical, p = …: G′ ~ X^x…": "α = {}"},
            ("α = …, critical, p = …: G′ ~ …",),
        ),
        PageClaim(
            "critical regime: G″ ~ X^x, α = ½ and ⅔ (BT 29)",
            {"α = …, critical, p = …: G″ ~ X^x…": "α = {}"},
            ("α = …, critical, p = …: G″ ~ …", "α = …, critical, …: effective Ω ~ …"),
        ),
    ),
    "Statics": (
        PageClaim(
            "isostatic at jamming, rattlers left out: Z + 4/N extrapolated to p = 0 (V 2.5)",
            {"Z + 4/N extrapolated to p = 0…": ""},
            ("Z − 4 + 4/N ~ p^x, rattlers left out",),
        ),
        PageClaim(
            "φ_c of random starts: φ(p) extrapolated to p = 0 (BT 2, V 2.3)", {"random starts: φ(p)…": ""}
        ),
        PageClaim(
            "φ_J of cooled liquids depends on rate and start, that of sheared ones has no memory of the start (V 6.1)",
            {
                "cooled, sizes mixed in the liquid: rise of φ_J per decade of slower cooling": "rise per decade",
                "cooled: |difference| of φ_J…": "cooled, separated less mixed sizes",
                "φ_J of sheared liquids: |from separated…": "sheared over cooled, separated less mixed sizes",
                "φ_J of sheared liquids, from separated…": "sheared, separated less mixed sizes",
            },
            (
                "cooled, sizes separated in the liquid: rise…",
                "cooled at …: width of φ_J",
                "segregation of a liquid…",
                "RAND, N = …: …",
                "QS, N = …: …",
            ),
        ),
        PageClaim(
            "quasistatic shear: a small Δγ does not matter: ratio of ⟨p⟩ at Δγ/3 and Δγ (V 4.7)",
            {"QS: ⟨p⟩ with Δγ = …": ""},
        ),
        PageClaim(
            "U/N = 1e-16 separates jammed states: share of states within a factor of 100 of it (V 6.1)",
            {"RAND, QS: share of states…": ""},
        ),
        PageClaim(
            "minimiser and dynamics: single states differ, mean energies agree (V 4.7)",
            {
                "RD0 at rest over conjugate gradients, …": "ratio of ⟨U⟩",
                "RD0 at rest and conjugate gradients: share…": "share of different states",
            },
            ("RD0 at rest … minimise…",),
        ),
        PageClaim(
            "force residues grow away from the origin, not with coordinates in two parts: ~ r^x (V 4.7)",
            {
                "coordinates in one double, …": "in one double",
                "coordinates in two parts, …": "in two parts",
            },
        ),
    ),
    "Steady flow": (
        PageClaim(
            "disks of one size order, of two sizes stay disordered: |⟨ψ₆⟩| over strain 50 to 100 (V Figs. 4.6, 4.7)",
            {"RD0, φ = 0.80, γ̇ = 1e-3, …: |⟨ψ₆⟩|…": "{}"},
        ),
        PageClaim(
            "g_y: RD0 has a minimum, which moves out as γ̇ falls (at φ_J without end), CD0 none (V Fig. 4.8, 4.5.3)",
            {
                "RD0, φ = 0.8: ℓ at γ̇ = … over ℓ at …": "growth of ℓ at φ = 0.80",
                "RD0, φ = 0.8433: place ℓ of the minimum of g_y ~ γ̇^(−x), γ̇ = …": "x of ℓ ~ γ̇^(−x) at φ_J",
                "CD0, φ = 0.8: minima of g_y…": "minima of CD0",
            },
            ("RD0, φ = …: place …", "CD0, φ = …: …"),
        ),
        PageClaim(
            "walls: a shear band at the start that is gone in the steady state: shear rates (V 4.2.2)",
            {
                "walls, CD, γ̇ = …: shear rate … up to 0.1": "in the middle over γ̇, at the start",
                "walls, …: shear rate … at last": "in the middle over a wider part, at last",
            },
            ("walls, …",),
        ),
        PageClaim(
            "Lees–Edwards: u_x(y) = 0 and φ(y) flat: spread over γ̇H and over φ (V 4.2.3)",
            {
                "Lees–Edwards, CD, …: spread of u_x(y)…": "u_x",
                "Lees–Edwards, CD, …: spread of φ(y)…": "φ",
            },
            ("Lees–Edwards, …",),
        ),
        PageClaim(
            "CD and CDt below φ_J, light disks: Newtonian, σ ~ γ̇^x at the lowest γ̇ (V 6.4)",
            {"CD, CDt, φ < φ_J: σ ~ γ̇^x…": ""},
            ("CD, φ = …: σ ~ γ̇^x…", "CDt, …: σ ~ γ̇^x…", "RD, …: σ ~ γ̇^x…", "RD0 at φ = 0.80: …"),
        ),
        PageClaim(
            "CDn below φ_J: Bagnoldian, σ ~ γ̇^x at the lowest γ̇ (V 3.2, 6.4)",
            {"CDn, φ < φ_J: σ ~ γ̇^x…": ""},
            ("CDn, …: σ ~ γ̇^x…", "CDn, …: p ~ γ̇^x…", "largest change of x between neighbouring Q"),
        ),
        PageClaim(
            "Newtonian flow has large clusters, in Bagnoldian flow particles part after contact (V 6.4)",
            {
                "largest cluster/N, …": "Newtonian less Bagnoldian largest cluster/N",
                "CD, …: half-life of contacts…": "half-life of contacts over a collision, CD",
                "CDn, …: half-life of contacts…": "half-life of contacts over a collision, CDn",
            },
            ("largest cluster/N where…", "RD, …: half-life of contacts…"),
        ),
        PageClaim(
            "which models have an overdamped limit: RD and CD, not CDn: σ as Q → 0 (V 6.4)",
            {
                "RD, …: σ at Q = …": "σ of RD over σ of RD0",
                "CD, …: σ at Q = …": "σ of CD over σ of CD0",
                "CDn, …: σ ~ Q^x…": "x of σ ~ Q^x, CDn",
            },
            ("CDn, …: σ at Q = …", "CDt, …: σ at Q = …", "CDt, …: σ ~ Q^x…"),
        ),
        PageClaim(
            "CD of small mass stands in for CD0: ratio of σ (V 4.5.1, 6.5)",
            {"σ of CD at Q = … over σ of CD0…": ""},
            ("CD over CD0: σ, …",),
        ),
    ),
    "Criticality": (
        PageClaim(
            "ν with corrections to scaling is well above the earlier 0.71(8): ν less 0.71, RAND and QS (V 6.2)",
            {"…: ν, with corrections, less the earlier…": "{}"},
            ("f(φ, N), …: ν",),
        ),
        PageClaim("y > 1 under shear: y of QS, with corrections (V 6.3)", {"QS: y, with corrections": ""}),
        PageClaim(
            "exponents of sheared and of compressed states differ: y of QS less y of RAND (V 2.4)",
            {"y of QS less y of RAND": ""},
            (
                "y/ν of QS less that of RAND…",
                "⟨p⟩(φ, N), …: y",
                "…: y/ν of ⟨p⟩…",
                "y of QS, … less that of RAND…",
            ),
        ),
        PageClaim(
            "exponents depend on the potential: y of Hertzian less that of harmonic disks, RAND (V 4.3.2)",
            {"y of RAND, hertzian less that of RAND, harmonic, N = …, limit of small cuts": "N = {}"},
            ("…: y of P(p) ~ p^(1/y − 1), limit of small cuts",),
            combine=MEAN,
        ),
        PageClaim(
            "φ_J of sheared states is one number: QS less RD0, CD0 less RD0 (V 6.1)",
            {
                "φ_J of quasistatic shear less φ_J of RD0, γ̇ → 0": "QS less RD0",
                "φ_J of CD0 less φ_J of RD0": "CD0 less RD0",
            },
            ("φ_J of …", "…, … corrections to scaling: φ_J", "collapse of p, …D0, γ̇ ≤ 0.0009: φ_J"),
        ),
        PageClaim(
            "RD0 and CD0 have the same exponents: differences of y and zν, exponent of the ratio of p at φ_J (V 6.5)",
            {
                "y of CD0 less y of RD0": "y",
                "zν of CD0 less zν of RD0": "zν",
                "RD0/CD0 of p at φ_J…": "ratio of p",
            },
            ("collapse of p, …D0, γ̇ ≤ 0.0009: …", "RD0/CD0 of σ at φ_J…"),
        ),
        PageClaim(
            "collapse of p, RD0: φ_J (V Fig. 5.1)",
            {"collapse of p, RD0, γ̇ ≤ 0.0003: φ_J": ""},
            ("collapse of …, RD0, …: φ_J",),
        ),
        PageClaim(
            "collapse of p, RD0: y (V Fig. 5.1)",
            {"collapse of p, RD0, γ̇ ≤ 0.0003: y": ""},
            ("collapse of …, RD0, …: y",),
        ),
        PageClaim(
            "collapse of p, RD0: zν (V Fig. 5.1)",
            {"collapse of p, RD0, γ̇ ≤ 0.0003: zν": ""},
            ("collapse of …, RD0, …: zν",),
        ),
        PageClaim(
            "φ < φ_J: p/γ̇ ~ (φ_J − φ)^(−β), γ̇ → 0: β (V 5.4)",
            {"φ < φ_J: p/γ̇ ~ …": ""},
            ("β = zν − y from the collapse of p, RD0", "φ > φ_J: p ~ (φ − φ_J)^y…"),
        ),
        PageClaim(
            "RD0 at φ_J: p ~ γ̇^x (V 5.3)",
            {"RD0 at φ_J = …: p ~ γ̇^x, …": ""},
            ("RD0 at φ_J = …: σ ~ γ̇^x, …",),
        ),
        PageClaim(
            "corrections to scaling are larger for σ than for p: distances of their exponents at φ_J from y/zν (V 5.4)",
            {"RD0 at φ_J = …: |x − y/zν| of σ less that of p…": ""},
        ),
    ),
    "Three dimensions": (
        PageClaim(
            "the same exponents in 3D: G₀ ~ p^x, without pre-stress (BT 2)",
            {"3D, β = 1: G₀ ~ p^x, without pre-stress": ""},
            ("3D, β = 1: G₀ ~ p^x, …",),
        ),
        PageClaim(
            "the same in 3D: η₀ ~ p^x, without pre-stress (BT 2)",
            {"3D, β = 1: η₀ ~ p^x, without pre-stress": ""},
            ("3D, β = 1: η₀…",),
        ),
        PageClaim(
            "the same in 3D: ω* = G₀/η₀ ~ p^x, without pre-stress (BT 2)",
            {"3D, β = 1: ω* = G₀/η₀ ~ p^x, without pre-stress": ""},
            ("3D, β = 1: ω* = G₀/η₀…",),
        ),
        PageClaim(
            "the same in 3D: G′, G″ ~ ω^Δ for p ≪ ω ≪ 1, with pre-stress (BT 2)",
            {"3D, β = 1, with pre-stress: Δ": ""},
            ("3D, β = 1, …",),
        ),
        PageClaim(
            "the same in 3D: floppy-like motion, rms of Δu∥, Δu⊥, u_na ~ p^x, without pre-stress (BT 2)",
            {
                "3D, rms |Δu∥|…(BT 19–21)": "Δu∥",
                "3D, rms |Δu⊥|…(BT 19–21)": "Δu⊥",
                "3D, rms |u_na|…(BT 19–21)": "u_na",
            },
            ("3D, rms …", "3D, median …", "3D, mean …", "3D, Σ…"),
        ),
        PageClaim(
            "isostatic in 3D: Z + 6/N extrapolated to p = 0 (BT 2, V 2.5)",
            {"3D, Z + 6/N extrapolated to p = 0…": ""},
            ("3D, Z − 6 + 6/N ~ p^x, rattlers left out",),
        ),
        PageClaim(
            "φ_c of random starts in 3D, equal spheres: φ(p) extrapolated to p = 0 (BT 2, V 2.3)",
            {"3D, equal spheres, random starts: φ(p)…": ""},
            ("3D, spheres of two sizes, random starts: φ(p)…",),
        ),
        PageClaim(
            "φ_J of random starts in 3D, spheres of two sizes: f(φ, N) of O'Hern et al. (2003)",
            {"3D, RAND: φ_J of f(φ, N)": ""},
            ("3D, f(φ, N), …: φ_J", "3D, ⟨p⟩(φ, N), …: φ_J"),
        ),
        PageClaim(
            "random starts in 3D, quenched at fixed φ and at fixed p → 0, have one φ_J: difference",
            {"3D, RAND: φ_J of f(φ, N) less φ_c…": ""},
        ),
        PageClaim(
            "ν of random starts in 3D: f(φ, N) is one function of (φ − φ_J) L^(1/ν) (V 5.6)",
            {"3D, RAND: ν of f(φ, N)": ""},
            ("3D, f(φ, N), …", "3D, ⟨p⟩(φ, N), …", "3D, RAND: ν, …"),
        ),
        PageClaim(
            "y/zν of disks in 3D: p ~ γ̇^(y/zν) of RD0 at φ_c of random starts (BT 2, V Fig. 5.1)",
            {"3D, RD0 at φ_c…": ""},
        ),
        PageClaim(
            "y and zν of disks in 3D: collapse of p, RD0 (BT 2, V Fig. 5.1)",
            {"3D, RD0, collapse of p: y": "y", "3D, RD0, collapse of p: zν": "zν"},
            ("3D, RD0, collapse of …",),
        ),
    ),
}
