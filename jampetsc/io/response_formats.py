"""Formats of results on one packing: sweep, quasistatic response, modes, spectrum, correlation, oscillation."""

from jampetsc.io.declaration import Format
from jampetsc.io.provenance import PROVENANCE

SWEEP = Format(
    datasets=r"""
omega | (M,) | float | 1/time | frequencies ω, increasing
G | (M,) | complex | k | G* = G′ + iG″
error_bound | (M,) | float | k | bound on \|ΔG*\|; its assumption is in `positive_semidefinite`
error_bound_storage, error_bound_loss | (M,) | float? | k | bounds on \|ΔG′\| and \|ΔG″\|
equivalent_omega | (M,) | float? | 1/time | with `--alpha`: frequencies at which the linear law has these moduli
fields/omega | (F,) | float? | 1/time | with `--fields`: their frequencies
fields/displacement | (F, n, 2) | complex? | length | non-affine displacements per unit strain
fields/rotation | (F, n) | complex? | | angles per unit strain; only of laws with rotations
fields/error_bound | (F,) | float? | | bound on the relative error of a field in the energy norm
particles | (n,) | int? | | with `--fields`: numbers in the packing of the rows above
reduced/G0 | scalar | float? | k | of the rational method: G₀, so that
  G* = G₀ + iωη_∞ + Σ_m g_m iω/(λ_m + iω) at any ω
reduced/eta_inf | scalar | float? | kτ₁ | η_∞
reduced/rates | (m,) | float? | 1/time | λ_m
reduced/weights | (m,) | float? | k | g_m
""",
    attributes=r"""
method | text | | rational or direct
accuracy | float | | relative error asked for
positive_semidefinite | text | | whether K has no negative modes, and how that is known
factorisations, unknowns | int | | work: sparse factorisations (each once, also those that a continued run
  makes again), size of K
vectors | int? | | of the rational method: size of the reduced space
failed_omega | (f,) float? | 1/time | of the direct method: frequencies that were not solved, and are not in `omega`
""",
    common=PROVENANCE,
)

QUASISTATIC = Format(
    datasets=r"""
particles | (n,) | int | | numbers in the packing of the rows below
nonaffine | (n, 2) | float | length | non-affine displacement u_na
rotation | (n,) | float? | | angles of the disks in the limit ω → 0; only of laws with rotations
contacts/pairs | (c, 2) | int | | rows i, j of *particles*
contacts/bonds | (c, 2) | float | length | r_j − r_i, the nearest image
contacts/normal, contacts/transverse | (c,) | float | length | Δu∥, Δu⊥
contacts/sliding | (c,) | float? | length | Δu⊥ᶜ, of laws with rotations
histogram/*/edges | (B + 1,) | float | length | of \|Δu∥\|, \|Δu⊥\| and \|u_na\| (normal, transverse, nonaffine): edges
  of 101 logarithmic bins
histogram/*/counts | (B,) | int | | numbers in them
beta_scan/beta | (b,) | float? | | with `--betas`: β
beta_scan/eta0, beta_scan/eta_inf | (b,) | float? | kτ₁ | η₀ and η_∞ there
beta_scan/no_prestress_eta0 | (b,) | float? | kτ₁ | η₀ of K without pre-stress
no_prestress/nonaffine | (n, 2) | float? | length | as the same datasets above, of K without pre-stress
no_prestress/rotation | (n,) | float? | | likewise
no_prestress/contacts/* | (c,) | float? | length | likewise
no_prestress/histogram/*/edges | (B + 1,) | float? | length | likewise
no_prestress/histogram/*/counts | (B,) | int? | | likewise
""",
    attributes=r"""
G0, G_affine, bulk_modulus | float | k | moduli
eta0, eta_inf | float | kτ₁ | viscosities η₀ and η_∞
eta0_* | float? | kτ₁ | the part of each term of the dissipation in η₀
omega_star | float | 1/time | G₀/η₀
normal_*, transverse_*, nonaffine_* | float | length | median, mean and rms of \|Δu∥\|, \|Δu⊥\|, \|u_na\|
identity_difference, field_error | float | | relative difference of the energies by contacts and by K; relative error
  of the field
no_prestress_* | float? | | these numbers of K without pre-stress
""",
    common=PROVENANCE,
)

MODES = Format(
    datasets=r"""
eigenvalues | (M,) | float | k | λ of K, increasing, translations left out; frequencies are √(λ/mass)
modes | (M, n, 2) | float | | displacements, Σ\|φ_i\|² = 1
particles | (n,) | int | | numbers in the packing of the disks in `modes`
residuals | (M,) | float | k | \|Kφ − λφ\|
normal, transverse | (M,) | float | | mean over contacts of (Δu∥)², (Δu⊥)²
floppiness | (M,) | float | | rms Δu⊥/rms Δu∥
participation_ratio | (M,) | float | | (Σ\|φ_i\|²)²/(n Σ\|φ_i\|⁴), 1 if all disks move alike
shear_force | (M,) | float | | force of an affine shear on the mode, per unit strain
share/nonaffine, share/normal, share/transverse, share/modulus | (M,) | float? | | of \|u_na\|², of (Δu∥)² and (Δu⊥)²
  without their affine parts (projections), of G_affine − G₀; missing, like all below, where the response is affine or
  not unique
cumulative/nonaffine, cumulative/normal, cumulative/transverse, cumulative/modulus | (M,) | float? | | their sums up to
  each mode
lowest/count | (q,) | int? | | those of 10, 50, 200 that do not exceed M
lowest/normal_median, lowest/transverse_median, lowest/nonaffine_median | (q,) | float? | length | medians of \|Δu∥\|,
  \|Δu⊥\|, \|u_na\| per unit strain of the response of only that many lowest modes, without affine part
""",
    attributes=r"""
inertia_count, inertia_shift | int, float? | | number of eigenvalues below the shift (in k), counted by inertia: none
  was missed
complete, contacts, method | bool, int, text | | whether the file has all modes; number of contacts; solver
restarts | int? | | of the solver
normal_median, transverse_median, nonaffine_median | float? | length | medians of \|Δu∥\|, \|Δu⊥\|, \|u_na\| of the
  whole response, affine part included, per unit strain
""",
    common=PROVENANCE,
)

SPECTRUM = Format(
    datasets=r"""
relaxation/times | (m,) | float | time | nodes of a quadrature of the relaxation spectrum: 1/λ_m, increasing
relaxation/rates | (m,) | float | 1/time | λ_m
relaxation/weights | (m,) | float | k | g_m
H/between | (m − 1,) | float | k | mean of H(τ) over ln τ between neighbouring times
H/tau | (t,) | float | time | times of the next
H/smoothed | (t,) | float | k | H averaged over a window of `window_decades`
stress/time | (g,) | float | time | times of the next
stress/G | (g,) | float | k | stress relaxation G(t) without η_∞ δ(t)
creep/time | (j,) | float | time | times of the next
creep/J | (j,) | float | 1/k | creep compliance J(t); ends early where it diverges
retardation/rates | (r,) | float | 1/time | μ_k: J(t) = J_∞ + t·fluidity + Σ_k J_k (1 − exp(−μ_k t))
retardation/compliances | (r,) | float | 1/k | J_k
""",
    attributes=r"""
G0, G_inf | float | k | limits of G′ at both ends
eta0, eta_inf | float | kτ₁ | limits of G″/ω at both ends
J_inf, fluidity, growth_rate | float | | of creep: instantaneous compliance, 1/k; final strain rate per stress; rate of
  divergence if G₀ < 0
window_decades, resolution_decades | float | | window of H; widest gap between times that matter
slowest_omega, fastest_omega | float | 1/time | range of frequencies of the sweep it was computed from
""",
    common=PROVENANCE,
)

CORRELATION = Format(
    datasets=r"""
omega | (F,) | float | 1/time | frequencies
G | (F,) | complex | k | G* there, the mean over the packings
lane_width | (W,) | float | length | of lanes along x
delta | (W, D + 1) | float | length | mean δ of the pairs in a bin; the first is 0
C, C_error | (W, F, 2, D + 1) | float | | C(δ) = ⟨u_y(x) u_y(x + δ)⟩/⟨u_y²⟩ and its standard error; nan in empty bins
length, length_error | (W, F, 2) | float | length | first root of C; nan where there is none
minimum, minimum_error | (W, F, 2) | float | length | δ of the smallest C
""",
    attributes=r"""
packings | int | | number of packings averaged
pairs | (W,) int | | number of pairs of disks for each lane width
phase | text | | what Re u_y is in phase with, `stress` or `strain`; `strain` where it is missing
L, mean_diameter | float > 0 | length | side of the cell along x, mean diameter
""",
    common=PROVENANCE,
)

OSCILLATE = Format(
    datasets=r"""
omega | (M,) | float | 1/time | ω, increasing
amplitude | (A,) | float | | of what is imposed: stress in units of k, or strain
G | (A, M) | complex | k | G* = first harmonic of the stress over that of the strain
error | (A, M) | float | k | estimate of \|ΔG*\|: the difference from the result with half of the steps, plus the
  errors of the solver and of ending after finitely many cycles
harmonics | (A, M, 2) | complex | | third and fifth harmonic over the first, of the strain where stress is imposed and
  the other way round
work | (A, M) | float | k | ∮σdγ of a cycle, per area
energy_balance | (A, M) | float | | energy dissipated in a cycle and, with moving contacts, stored, over the work,
  minus 1
regularisation_effect | (A, M) | float? | k | fixed contacts: estimate of \|ΔG*\| when `regularisation` is halved
cycle_change | (A, M) | float? | k | moving contacts: \|ΔG*\| between the last two cycles
drift | (A, M) | float? | | moving contacts: change of the strain in the last cycle under an imposed stress
newton_steps | (A, M) | int | | work
linear_iterations | (A, M) | int? | | work where `solver` is `cycle`
factorisations | (A, M) | int? | | work where `solver` is `steps`
steps_taken | (A, M) | int? | | moving contacts: time steps of all cycles; of a step that was halved, its parts
cycles | (A, M) | int? | | moving contacts: number of cycles in both runs, with half of the steps and with all
""",
    attributes=r"""
control, contacts, steps | text, text, int | | stress or strain; fixed or moving; steps of a cycle
solver | text | | `cycle`: a whole cycle at once, for fixed contacts; `steps`: time steps, for moving contacts
regularisation | float | | force below which a contact counts as linear, over the force at the rms velocity; 0 for
  linear damping
""",
    common=PROVENANCE,
)
