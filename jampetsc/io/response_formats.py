"""Formats of linear responses: moduli, slow response, modes, relaxation spectra."""

from jampetsc.io.declaration import Format
from jampetsc.io.provenance import PROVENANCE

SWEEP = Format(
    datasets=r"""
omega | (M,) | float | 1/time | frequencies ω, increasing
G | (M,) or (M, P) | complex? | k | G* = G′ + iG″; of waves of forces G(k, ω) = (n/V)/(k²χ), n
  particles that bear load; other forces have none
error_bound | (M,) or (M, P) | float? | k | bound on \|ΔG*\|; its assumption is in `positive_semidefinite`
error_bound_storage, error_bound_loss | (M,) or (M, P) | float? | k | bounds on \|ΔG′\| and \|ΔG″\|
susceptibility | (M,) or (M, P) | complex? | length/force | of forces f: χ = fᵀ(K + iωB)⁻¹f, of a wave over n
  and the mean of its polarisations, of points the mean over the axes; a column for each of several waves or points
susceptibility_error_bound | (M,) or (M, P) | float? | length/force | bound on \|Δχ\|, under the same assumption
susceptibility_error_bound_storage, susceptibility_error_bound_loss | (M,) or (M, P) | float? | length/force | bounds
  on \|Δχ′\| and \|Δχ″\|
probe/particles | (P,) | int? | | of points: numbers of the particles in the packing
waves/vectors | (P, D) | float? | 1/length | of several waves: k of each
probe/forces | (N, D) | float? | force | of an array of forces: that array
equivalent_omega | (M,) | float? | 1/time | with `--alpha`: frequencies at which the linear law has these moduli
fields/omega | (F,) | float? | 1/time | with `--fields`: their frequencies
fields/displacement | (F, n, D) | complex? | length | non-affine displacements per unit strain
fields/rotation | (F, n) or (F, n, 3) | complex? | | angles per unit strain, of spheres about x, y and z; only of laws
  with rotations
fields/error_bound | (F,) | float? | | bound on the relative error of a field in the energy norm
particles | (n,) | int? | | with `--fields`: numbers in the packing of the rows above
spectrum/G0 | scalar | float? | k | of the rational method: G₀, so that
  G* = G₀ + iωη_∞ + Σ_m g_m iω/(λ_m + iω) at any ω
spectrum/eta_inf | scalar | float? | kτ₁ | η_∞
spectrum/rates | (m,) | float? | 1/time | λ_m
spectrum/weights | (m,) | float? | k | g_m
C | (M, L, L) | complex? | k | with `--load tensor`: elastic constants; `G` is then the shear modulus averaged over all
  directions
C_error_bound | (M, L, L) | float? | k | bound on \|ΔC\|
C_error_bound_storage, C_error_bound_loss | (M, L, L) | float? | k | bounds on \|ΔC′\| and \|ΔC″\|
bulk_modulus | (M,) | complex? | k | −V dp/dV = mean of C among xx, yy, (zz,) plus p (D − 1)/D (only with pre-stress)
anisotropy | (M,) | float? | | \|C − C_iso\|/\|C\|, C_iso the isotropic part of C
reduced_tensor/K | (c, c) | float? | k | of the rational method: K between the columns of all loads, over V, so that
  C = w(ω)ᵀ(K + iωB)w(ω) at any ω, w = 1 for a quasistatic field and −iωh/(λ + iω) for a mode, 0 for other loads
reduced_tensor/B | (c, c) | float? | kτ₁ | B between them
reduced_tensor/rates | (c,) | float? | 1/time | λ; inf for quasistatic fields
reduced_tensor/forces | (c,) | float? | | h
reduced_tensor/loads | (c,) | int? | | number of the load of each column
reduced_inertia/stiffness | (m,) | float? | 1/time² | with `--mass`, of the rational method where it solved all
  frequencies: Ω² of a reduced space, so that G* = k_γγ + iω b_γγ − cᵀ(Ω² + iωB − ω²)⁻¹c, c = k + iωb, at any ω
reduced_inertia/damping | (m, m) | float? | 1/time | B
reduced_inertia/k, reduced_inertia/b | (L, m) | float? | | k and b of each load
reduced_inertia/k_gg, reduced_inertia/b_gg | (L, L) | float? | k, kτ₁ | k_γγ and b_γγ between the loads
""",
    attributes=r"""
method | text in rational direct | | how frequencies were solved
accuracy | float | | relative error asked for
positive_semidefinite | text | | whether K has no negative modes, and how that is known
factorisations, unknowns | int | | work: sparse factorisations (each once, also those that a continued run
  makes again), size of K
vectors | int? | | of the rational method: size of the reduced space
direct_frequencies | int? | | with `--mass`, of the rational method: frequencies that were solved one by one
wave_vector | (D,) float? | 1/length | of a wave of forces: k
failed_omega | (f,) float? | 1/time | of the direct method: frequencies that were not solved, and are not in `omega`
""",
    common=PROVENANCE,
)

QUASISTATIC = Format(
    datasets=r"""
particles | (n,) | int? | | numbers in the packing of the rows below; missing, like all down to the histograms, where
  the load is forces
nonaffine | (n, D) | float? | length | non-affine displacement u_na
rotation | (n,) or (n, 3) | float? | | angles of the disks in the limit ω → 0, of spheres about x, y and z; only of laws
  with rotations
contacts/pairs | (c, 2) | int? | | numbers i, j of the two particles in the packing, as in *particles*
contacts/bonds | (c, D) | float? | length | r_j − r_i, the nearest image
contacts/normal, contacts/transverse | (c,) | float? | length | Δu∥, Δu⊥; of spheres \|Δu⊥\|
contacts/sliding | (c,) | float? | length | Δu⊥ᶜ, of spheres its length; of laws with rotations
histogram/*/edges | (B + 1,) | float? | length | of \|Δu∥\|, \|Δu⊥\| and \|u_na\| (normal, transverse, nonaffine): edges
  of 101 logarithmic bins
histogram/*/counts | (B,) | int? | | numbers in them
beta_scan/beta | (b,) | float? | | with `--betas`: β
beta_scan/eta0, beta_scan/eta_inf | (b,) | float? | kτ₁ | η₀ and η_∞ there
beta_scan/no_prestress_eta0 | (b,) | float? | kτ₁ | η₀ of K without pre-stress
susceptibility | scalar or (P,) | float? | length/force | of forces: χ₀, for each of several waves or points
susceptibility_error_bound | scalar or (P,) | float? | length/force | bound on \|Δχ₀\|
susceptibility_slope | scalar or (P,) | float? | time·length/force | χ₁, χ → χ₀ − iωχ₁ for ω → 0
no_prestress/susceptibility, no_prestress/susceptibility_error_bound, no_prestress/susceptibility_slope | scalar or (P,)
  | float? | | as the same datasets above, of K without pre-stress
probe/particles | (P,) | int? | | of points: numbers of the particles in the packing
waves/vectors | (P, D) | float? | 1/length | of several waves: k of each
waves/G0, waves/G0_error_bound | (P,) | float? | k | G₀(k) of each, bound on \|ΔG₀(k)\|
waves/eta0 | (P,) | float? | kτ₁ | η₀(k) of each
waves/omega_star | (P,) | float? | 1/time | G₀/η₀ of each
no_prestress/waves/* | (P,) | float? | | likewise
probe/forces | (N, D) | float? | force | of an array of forces: that array
C0 | (L, L) | float? | k | with `--load tensor`: elastic constants
eta0, eta_inf | (L, L) | float? | kτ₁ | likewise η₀ and η_∞ between the loads
no_prestress/C0 | (L, L) | float? | k | likewise
no_prestress/eta0 | (L, L) | float? | kτ₁ | likewise
no_prestress/nonaffine | (n, D) | float? | length | as the same datasets above, of K without pre-stress
no_prestress/rotation | (n,) or (n, 3) | float? | | likewise
no_prestress/contacts/* | (c,) | float? | length | likewise
no_prestress/histogram/*/edges | (B + 1,) | float? | length | likewise
no_prestress/histogram/*/counts | (B,) | int? | | likewise
""",
    attributes=r"""
G0, G_affine, bulk_modulus | float? | k | moduli: of the load and of its affine motion, of the energy along F = 1 + εE;
  −V dp/dV. Of a wave of forces G₀(k) alone, of other forces none
G0_error_bound | float? | k | of a wave: bound on \|ΔG₀(k)\|
susceptibility_mean | float? | length/force | of forces: mean of `susceptibility`
wave_vector | (D,) float? | 1/length | of a wave of forces: k
shear_modulus, poisson_ratio, anisotropy, least_modulus | float? | | of `tensor`: averaged over all directions, k;
  Poisson's ratio of it and of the bulk modulus; \|C − C_iso\|/\|C\|; least E:C:E for Σ E² = 1, k: positive where every
  load has a positive modulus
eta0, eta_inf | float? | kτ₁ | viscosities η₀ and η_∞; of a wave η₀(k), G(k) → G₀ + iωη₀
eta0_* | float? | kτ₁ | the part of each term of the dissipation in η₀
omega_star | float? | 1/time | G₀/η₀
normal_*, transverse_*, nonaffine_* | float? | length | median, mean and rms of \|Δu∥\|, \|Δu⊥\|, \|u_na\|
identity_difference, field_error | float? | | relative difference of the energies by contacts and by K; relative error
  of the field
no_prestress_* | float? | | these numbers of K without pre-stress
""",
    common=PROVENANCE,
)

MODES = Format(
    datasets=r"""
eigenvalues | (M,) | float? | k | λ of K, increasing, translations left out; frequencies are √(λ/mass); missing,
  like all of single modes below, with `--states`
modes | (M, n, D) | float? | | displacements, Σ m_i\|φ_i\|² = 1; missing with `--no-eigenvectors`
particles | (n,) | int | | numbers in the packing of the disks that are no rattlers, in the order of `modes`
residuals | (M,) | float? | k | \|Kφ − λφ\|, with masses by volume \|M^(−½)(Kφ − λMφ)\|
normal, transverse | (M,) | float? | | mean over contacts of (Δu∥)², (Δu⊥)²
floppiness | (M,) | float? | | rms Δu⊥/rms Δu∥
participation_ratio | (M,) | float? | | (Σ m_i\|φ_i\|²)²/(n Σ m_i²\|φ_i\|⁴), 1 if all disks have as much energy
shear_force | (M,) | float? | | force of the affine motion of the load on the mode, per unit amplitude
share/nonaffine, share/normal, share/transverse, share/modulus | (M,) | float? | | of m\|u_na\|², of (Δu∥)² and (Δu⊥)²
  without their affine parts (projections), of G_affine − G₀; missing, like all below, where the response is affine or
  not unique
cumulative/nonaffine, cumulative/normal, cumulative/transverse, cumulative/modulus | (M,) | float? | | their sums up to
  each mode
tensor/force | (M, L) | float? | | with `--load tensor`: such forces of its loads; the datasets above are then of
  simple shear
tensor/modulus | (M, L) | float? | | shares of the non-affine part of the modulus of each; nan where that is zero or
  not unique
lowest/count | (q,) | int? | | 10, 50 and 200, if they do not exceed M
lowest/normal_median, lowest/transverse_median, lowest/nonaffine_median | (q,) | float? | length | medians of \|Δu∥\|,
  \|Δu⊥\|, \|u_na\| per unit strain of the response of only that many lowest modes, without affine part
states/edges | (B + 1,) | float? | √k | with `--states`: frequencies √λ, increasing
states/counts | (B,) | int? | | exact numbers of modes between them; D(ω) is a number over D n Δω
""",
    attributes=r"""
contacts | int | | number of contacts
inertia_count, inertia_shift | int, float? | , k | number of eigenvalues below the shift, counted by inertia: none was
  missed
complete, method, restarts | bool, text, int? | | whether the file has all modes; solver, its restarts
states_below, states_above | int? | | with `--states`: modes below the first edge, translations left out, and above the
  last
normal_median, transverse_median, nonaffine_median | float? | length | medians of \|Δu∥\|, \|Δu⊥\|, \|u_na\| of the
  whole response, affine part included, per unit strain
""",
    common=PROVENANCE,
)

SPECTRUM = Format(
    datasets=r"""
relaxation/times | (m,) | float? | time | nodes of a quadrature of the relaxation spectrum: 1/λ_m, increasing; missing
  with masses, as all below but stress and creep
relaxation/rates | (m,) | float? | 1/time | λ_m
relaxation/weights | (m,) | float? | k | g_m
H/between | (m − 1,) | float? | k | mean of H(τ) over ln τ between neighbouring times
H/tau | (t,) | float? | time | times of the next
H/smoothed | (t,) | float? | k | H averaged over a window of `window_decades`
stress/time | (g,) | float | time | times of the next
stress/G | (g,) | float | k | stress relaxation G(t) without η_∞ δ(t)
creep/time | (j,) | float | time | times of the next
creep/J | (j,) | float | 1/k | creep compliance J(t); ends early where it diverges
retardation/rates | (r,) | float? | 1/time | μ_k: J(t) = J_∞ + t·fluidity + Σ_k J_k (1 − exp(−μ_k t))
retardation/compliances | (r,) | float? | 1/k | J_k
""",
    attributes=r"""
G0, G_inf | float? | k | limits of G′ at both ends; missing with masses, like all below but growth_rate
eta0, eta_inf | float? | kτ₁ | limits of G″/ω at both ends
J_inf, fluidity | float? | | of creep: instantaneous compliance, 1/k; final strain rate per stress
growth_rate | float | 1/time | rate at which creep diverges if G₀ < 0
window_decades, resolution_decades | float? | | window of H; widest gap between times that matter
slowest_omega, fastest_omega | float | 1/time | range of frequencies of the sweep it was computed from
""",
    common=PROVENANCE,
)
