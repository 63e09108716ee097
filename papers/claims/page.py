"""The claims of the two works in the order of the page: {group: {key: text}}, a row each.

A number names the claim on which it bears by its key (`shared.Row.bears`), and whether it decides it (`part`). The
decisive numbers are those that the work prints or draws for this claim; verdicts play no part. Where a claim is printed
for several parameters, its row is the worst of their numbers, or, for those in MEANS, their weighted mean.
"""

PAGE = {
    "Moduli at β = 1": {
        "G0": "G₀ ~ p^x, without pre-stress (BT 16, Fig. 3b)",
        "eta0": "η₀ ~ p^x, without pre-stress (BT 22, Fig. 3b)",
        "omega*": "ω* = G₀/η₀ ~ p^x, without pre-stress (BT 15, Fig. 3b)",
        "G0-prestress": "G₀ ~ p^x, with pre-stress (Fig. 3b)",
        "Delta": "G′, G″ ~ ω^Δ for p ≪ ω ≪ 1, with pre-stress (BT 17, Figs. 1, 3)",
        "ends": "G″ ~ ω^x at both ends, as a Kelvin–Voigt solid (Fig. 1)",
        "border": "the critical regime ends at ω ~ 1: where d ln G″/d ln ω passes ¾ (Fig. 3a)",
        "collapse": "G*/p^½ is one curve of ω/p: spread (rms of the logarithm) below ω = 0.1, with pre-stress (Fig. "
        "3b)",
        "rotations": "rotations do not change the form: Δ without less Δ with rotations (sec. 2)",
    },
    "Moduli at β ≠ 1": {
        "beta0": "β = 0, without pre-stress: G* = G₀(1 + iωτ₁), largest relative difference (BT 18)",
        "eta0-beta0": "β = 0: η₀ ~ p^x, without pre-stress (BT 22)",
        "eta0-beta": "β > 0: η₀ − η₀(β = 0) ~ p^x, without pre-stress (BT 22)",
        "beta*": "β* ~ p^x, below which there is no critical regime, without pre-stress (sec. 3.3)",
        "omega*-beta": "ω* = G₀/η₀ ~ β^x for β ≫ β*, without pre-stress (sec. 3.3)",
        "window": "no critical regime at β ≪ β*, it opens as β grows: decades of ω with d ln G″/d ln ω = ½ ± 0.1 "
        "(Fig. 4b)",
    },
    "Floppiness": {
        "median-normal": "median |Δu∥| ~ p^x, without pre-stress (BT 19, Fig. 5)",
        "median-transverse": "median |Δu⊥| ~ p^x, without pre-stress (BT 20, Fig. 5)",
        "median-nonaffine": "median |u_na| ~ p^x, without pre-stress (BT 21, Fig. 5)",
        "squares": "Σ(Δu⊥)²/Σ(Δu∥)² over contacts ~ p^x, without pre-stress (BT 20)",
        "mean-normal": "mean |Δu∥| levels off at low p: ~ p^x between the lowest two p (sec. 3.3)",
        "low-modes": "low modes are floppy-like: rms Δu⊥ over rms Δu∥ at equal λ/p ~ p^x (sec. 3.3)",
    },
    "Stokes drag": {
        "stokes-eta0": "η₀ − η_F ~ p^x at η_F = 1, without pre-stress (Fig. 6a)",
        "stokes-Delta": "G′, G″ − η_Fω ~ ω^Δ at η_F = 1, with pre-stress (Fig. 6a)",
        "stokes-linear": "G″ → η_Fω for ω ≫ 1 (Fig. 6a), G″ ~ ω at all ω for η_F ≫ p^(−½) (Fig. 6b)",
        "stokes-storage": "G′ stays critical for any η_F: largest relative difference between them (Fig. 6b)",
    },
    "Correlations": {
        "swirls": "contact damping: swirls of L/4: first root of C over L (sec. 5)",
        "monotonic": "contact damping: C falls monotonically: C at L/2 less least C (sec. 5)",
        "contact-omega": "contact damping: C does not depend on ω: C at the lowest over C at the highest (Fig. 7a)",
        "re-im": "Im u_y gives the same C as Re u_y: ratio of their lengths l (sec. 5)",
        "contact-p": "contact damping: C does not depend on p: ratio of l at the lowest and the highest p (sec. 5)",
        "contact-size": "contact damping: C is one curve of δ/L: ratio of C at two N (Fig. 7a)",
        "growth": "Stokes: l grows as ω falls: l at ω = 1e-4 over l at 1e-2 (Fig. 7c)",
        "plateau": "Stokes: plateau of l/L as ω → 0 (Fig. 7c)",
        "lanes": "C does not depend on the width of lanes: ratio of l at the narrowest two (sec. 5)",
        "spread-7d": "Stokes: l (−ln p)^0.65 is one curve of ω/p^½: spread (rms of the logarithm) (Fig. 7d)",
        "minimum": "Stokes: the minimum of C is lost at ω = 10^-5.5 and 10^-6.5: C at L/2 less least C (Fig. 7b)",
    },
    "Finite size": {
        "size-a": "contact damping: a of η₀ = N^a f(pN²), without pre-stress (Fig. 8a)",
        "size-crossing": "contact damping: pN² at which η₀ ~ N and η₀ ~ p^(−½) meet, without pre-stress (Fig. 8a)",
        "shallow": "pre-stress makes powers of p too shallow even for pN² > 1000: η₀ with over without it ~ "
        "(pN²)^x (Fig. 8)",
        "stokes-a": "Stokes, η_F = 1: a of η₀ = N^a f(pN²), without pre-stress (Fig. 8b)",
        "stokes-slope": "Stokes, η_F = 1: η₀/N^a ~ (pN²)^x for pN² > 1000, without pre-stress (Fig. 8b)",
    },
    "Power-law damping": {
        "BT27": "slow shear: G″ ~ X p^(−½), X = ω^α σ^(α−1), exponents of X and p, α = ½ and ⅔ (BT 27)",
        "slow-storage": "slow shear: G′ over G₀, α = ½ and ⅔ (BT 27)",
        "BT28": "critical regime: G′ ~ Ω^½ with Ω ~ X^x, α = ½ and ⅔ (BT 28)",
        "BT29": "critical regime: G″ ~ Ω^½ with Ω ~ X^x, α = ½ and ⅔ (BT 29)",
    },
    "Statics": {
        "isostatic": "isostatic at jamming, rattlers left out: Z + 4/N extrapolated to p = 0 (V 2.5)",
        "residual": "residual stress of packings is zero on average: ⟨σ₀⟩/p (BT 4)",
        "phi_c": "φ_c of random starts: φ(p) extrapolated to p = 0 (BT 2, V 2.3)",
        "cooled": "φ_J of cooled liquids depends on rate and start, that of sheared ones has no memory of the "
        "start (V 6.1)",
        "narrower": "φ_J of sheared liquids is narrower than that of cooled ones: difference of widths (V 6.1)",
        "strain-step": "quasistatic shear: a small Δγ does not matter: ratio of ⟨p⟩ at Δγ/3 and Δγ (V 4.7)",
        "energy-cut": "U/N = 1e-16 separates jammed states: share of states within a factor of 100 of it (V 6.1)",
        "minimiser": "minimiser and dynamics: single states differ, mean energies agree (V 4.7)",
        "coordinates": "force residues grow away from the origin, not with coordinates in two parts: ~ r^x (V 4.7)",
    },
    "Steady flow": {
        "order": "disks of one size order, of two sizes stay disordered: |⟨ψ₆⟩| over strain 50 to 100 (V Figs. "
        "4.6, 4.7)",
        "fitting": "disks of one size crystallise more easily where L fits the lattice: mean |⟨ψ₆⟩|, fitting less "
        "halfway (V 4.3.1)",
        "g_y": "g_y: RD0 has a minimum, which moves out as γ̇ falls (at φ_J without end), CD0 none (V Fig. "
        "4.8, 4.5.3)",
        "walls": "walls: a shear band at the start that is gone in the steady state: shear rates (V 4.2.2)",
        "bands": "Lees–Edwards: u_x(y) = 0 and φ(y) flat: spread over γ̇H and over φ (V 4.2.3)",
        "overdamped-newtonian": "RD0 and CD0 below φ_J: Newtonian, σ ~ γ̇^x at the lowest γ̇ (V 3.2)",
        "newtonian": "CD and CDt below φ_J, light disks: Newtonian, σ ~ γ̇^x at the lowest γ̇ (V 6.4)",
        "bagnoldian": "CDn below φ_J: Bagnoldian, σ ~ γ̇^x at the lowest γ̇ (V 3.2, 6.4)",
        "sharp": "some transitions between the two are sharp: ratio of σ at Q two apart (V 6.4; 2 in neither "
        "work)",
        "clusters": "Newtonian flow has large clusters, in Bagnoldian flow particles part after contact (V 6.4)",
        "overdamped": "which models have an overdamped limit: RD and CD, not CDn: σ as Q → 0 (V 6.4)",
        "stand-in": "CD of small mass stands in for CD0: ratio of σ (V 4.5.1, 6.5)",
    },
    "Criticality": {
        "nu": "ν is well above the earlier 0.71(8): ν less 0.71, RAND and QS (V 6.2; 0.71 in neither work)",
        "y": "y > 1 under shear, by P(p → 0): y of QS less y of RAND (V 6.3)",
        "ensembles": "exponents of sheared and of compressed states differ: y of QS less y of RAND (V 2.4)",
        "potential": "exponents depend on the potential: y of Hertzian less that of harmonic disks, RAND (V 4.3.2; "
        "½ in neither work)",
        "phi_J": "φ_J of sheared states is one number: QS less RD0, CD0 less RD0 (V 6.1)",
        "universality": "RD0 and CD0 have the same exponents: differences of y and zν, exponent of the ratio of p at "
        "φ_J (V 6.5)",
        "fit-phi_J": "collapse of p, RD0: φ_J (V Fig. 5.1)",
        "fit-y": "collapse of p, RD0: y (V Fig. 5.1)",
        "fit-znu": "collapse of p, RD0: zν (V Fig. 5.1)",
        "beta": "φ < φ_J: p/γ̇ ~ (φ_J − φ)^(−β), γ̇ → 0: β (V 5.4)",
        "above": "φ > φ_J: p ~ (φ − φ_J)^y, γ̇ → 0: y, QS (V 5.5)",
        "cells": "finite size separates z from zν: ν = zν/z less 0.71, z of RD0 at φ_J by p N^(y/2ν) against "
        "γ̇ N^(z/2) (V 5.3; 0.71 in neither work)",
        "at-phi_J": "RD0 at φ_J: p ~ γ̇^x (V 5.3)",
        "corrections": "corrections to scaling are larger for σ than for p: distances of their exponents at φ_J from "
        "y/zν (V 5.4)",
    },
    "Three dimensions": {
        "3D-G0": "the same exponents in 3D: G₀ ~ p^x, without pre-stress (BT 2)",
        "3D-eta0": "the same in 3D: η₀ ~ p^x, without pre-stress (BT 2)",
        "3D-omega*": "the same in 3D: ω* = G₀/η₀ ~ p^x, without pre-stress (BT 2)",
        "3D-Delta": "the same in 3D: G′, G″ ~ ω^Δ for p ≪ ω ≪ 1, with pre-stress (BT 2)",
        "3D-floppy": "the same in 3D: floppy-like motion, rms of Δu∥, Δu⊥, u_na ~ p^x, without pre-stress (BT 2)",
        "3D-isostatic": "isostatic in 3D: Z + 6/N extrapolated to p = 0 (BT 2, V 2.5)",
        "3D-phi_c": "φ_c of random starts in 3D, equal spheres: φ(p) extrapolated to p = 0 (BT 2, V 2.3)",
        "3D-phi_J": "φ_J of random starts in 3D, two sizes: f(φ, N) of O'Hern et al. (2003) (in neither work)",
        "3D-one-phi_J": "random starts in 3D, quenched at fixed φ and at p → 0: one φ_J (in neither work)",
        "3D-nu": "ν of random starts in 3D: f(φ, N) is one function of (φ − φ_J) L^(1/ν) (in neither work)",
        "3D-flow": "y/zν of disks in 3D: p ~ γ̇^(y/zν) of RD0 at φ_c of random starts (in neither work)",
        "3D-fit": "y and zν of disks in 3D: collapse of p, RD0 (in neither work)",
    },
}
MEANS = {"potential", "y"}  # keys of claims whose numbers all estimate one number
TEXTS = {key: text for claims in PAGE.values() for key, text in claims.items()}
