"""What commands print at the end of tiny runs: the numbers of their files, and what a user has to know of them."""

import contextlib
import io

import numpy as np
import pytest
from samples import SAMPLES, crystal, lattice, published

import jampetsc
from jampetsc import main as cli
from jampetsc.analysis.error_bounds import relative_part_bounds
from jampetsc.analysis.jammed_samples import correlated_share, independent_share
from jampetsc.analysis.statistics import mean_with_error
from jampetsc.errors import ConvergenceError
from jampetsc.io.packing_file import write_packing
from jampetsc.jamming import samples

pytestmark = [pytest.mark.scalar("real"), pytest.mark.most_ranks(1)]
PACKINGS = {"p": published, "stiff": SAMPLES["k = 2.5"], "lattice": lattice, "crystal": crystal}


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    """A function that runs a command line in a folder with PACKINGS; (the printed lines, the result)."""
    folder = tmp_path_factory.mktemp("summaries")
    for name, packing in PACKINGS.items():
        write_packing(folder / f"{name}.h5", packing())

    def lines_and_result(line):
        with contextlib.chdir(folder), contextlib.redirect_stdout(io.StringIO()) as printed:
            out = f"{line.split()[0]}.h5"
            assert cli.dispatch([*line.split(), "--out", out, "--overwrite"]) == 0
            return printed.getvalue().splitlines(), jampetsc.load(out)

    return lines_and_result


@pytest.mark.parametrize(("method", "proof"), [("rational", "certified"), ("direct", "estimated")])
def test_a_sweep_tells_its_ends_and_its_worst_errors(run, method, proof):
    lines, sweep = run(f"sweep p.h5 --omega 0.1,1,10 --accuracy 0.1 --method {method}")
    bounds = np.column_stack([sweep[f"error_bound_{part}"] for part in ("storage", "loss")])
    storage, loss = relative_part_bounds(sweep.G, bounds).max(axis=0)
    assert lines[:3] == [
        f"sweep.h5: contact damping, beta = 1, 3 frequencies, {proof} to {storage:.1e} in G' and {loss:.1e} in G''",
        *(
            f"  omega {sweep.omega[m]:g}: G' = {sweep.G[m].real:.6g}, G'' = {sweep.G[m].imag:.6g}"
            for m in (0, 2)
        ),
    ]


@pytest.mark.parametrize(("stress", "told"), [(1.07e-4, False), (1.11e-4, True)])
def test_a_strain_that_would_change_contacts(run, stress, told):
    """σ₀/|G*| at the softest frequency, where |G*| = 0.10882 k, against p/k = 1e-3."""
    lines, sweep = run(f"sweep stiff.h5 --omega 1e-3,1 --alpha 1 --stress {2.5 * stress}")
    strain = 2.5 * stress / abs(sweep.G).min()
    assert (
        f"alpha 1, stress {2.5 * stress:g}: equivalent linear frequencies 0.001 to 1; the stored" in lines[3]
    )
    note = f"  note: contacts would change, which is left out: strain amplitude up to {strain:.1e}, more than p/k = "
    assert [line.startswith(f"{note}1.0e-03.") for line in lines[5:]] == [True] * told


def test_one_frequency_is_told_once(run):
    lines, _ = run("sweep p.h5 --omega 10")
    assert (
        "1 frequencies" in lines[0] and lines[1].startswith("  omega 10: G' = 0.309564,") and len(lines) == 3
    )


def test_moduli_below_zero_are_noted(run):
    lines, sweep = run("sweep lattice.h5 --omega 1e-3,1 --alpha 0.5 --stress 1e-4")
    low, high = sweep["equivalent_omega"]
    assert f"equivalent linear frequencies {low:.3g} to {high:.3g};" in lines[3] and low > 1.0
    _, unstable, formal = lines[5:]
    assert unstable.startswith("  note: unstable to shear: G' at omega 0.001 = -0.0309. ")
    assert "--stabilise shear" in unstable and formal.startswith("  note: G* is formal: G' < 0")


def test_modes_tell_how_they_were_counted(run):
    lines, modes = run("modes p.h5 --count 3 --no-prestress")
    names = {"nonaffine": "|u_na|²", "transverse": "Δu⊥²", "normal": "Δu∥²", "modulus": "G_affine − G0"}
    shares = ", ".join(f"{100 * modes[f'share/{key}'].sum():.3g} % of {name}" for key, name in names.items())
    lowest, _, highest = modes["eigenvalues"]
    first, _, last = modes["floppiness"]
    assert lines[:4] == [
        f"modes.h5: 3 modes, no pre-stress; inertia counts 3 below {modes.attributes['inertia_shift']:.4g}",
        f"  eigenvalues {lowest:.6g} to {highest:.6g}, residuals ≤ {modes['residuals'].max():.1e}",
        f"  floppiness (rms Δu⊥ / Δu∥) {first:.3g} to {last:.3g}",
        f"  together {shares}",
    ]
    lines, _ = run("modes crystal.h5 --all")
    assert lines[0] == "modes.h5: 70 modes, pre-stress; all of them" and "together" not in "".join(lines)
    assert lines[-1] == "  note: no shares of the response: it is affine, or not unique because of zero modes"


def test_an_oscillation_tells_both_ends_of_its_frequencies(run):
    lines, result = run("oscillate p.h5 --omega 0.1,1,10 --strain 1e-4 --alpha 0.5 --steps 16")
    ((low, _, high),), ((first, _, last),) = result["G"], np.abs(result["harmonics"])[..., 0]
    worst, balance = (result["error"] / abs(result["G"])).max(), abs(result["energy_balance"]).max()
    assert lines[0].endswith(
        f"alpha = 0.5, 3 oscillations, estimated to {worst:.1e} of |G*|, energy balanced to {balance:.0e}"
    )
    assert lines[1:3] == [
        f"  strain 0.0001, omega {omega}: G' = {G.real:.6g}, G'' = {G.imag:.6g}, third harmonic {100 * third:.2g} %"
        for omega, G, third in ((0.1, low, first), (10, high, last))
    ]
    assert 0.01 < first < 0.5


def test_a_quasistatic_response_tells_its_parts(run):
    lines, result = run("quasistatic p.h5 --law stokes --eta-f 0.5 --tau1 3")
    a = result.attributes
    assert lines[0].endswith(f": Stokes drag, eta_f = 0.5, eta_inf = {a['eta_inf']:.6g}") and len(lines) == 6
    for line, medians, name in zip(lines[1:5:2], lines[2:5:2], ("", "no_prestress_"), strict=True):
        eta, drag, fluid = (a[f"{name}eta0{part}"] for part in ("", "_drag", "_fluid"))
        stress = "no pre-stress" if name else "pre-stress"
        assert line == (
            f"  {stress}: G0 = {a[f'{name}G0']:.6g}, bulk modulus {a[f'{name}bulk_modulus']:.6g}, eta0 = {eta:.6g} "
            f"(drag {drag:.4g}, fluid {fluid:.4g}), omega* = {a[f'{name}omega_star']:.4g}"
        )
        group = "no_prestress/" if name else ""
        assert all(
            f"{group}histogram/{part}/edges" in result for part in ("normal", "transverse", "nonaffine")
        )
        quantities = zip(("|Δu∥|", "|Δu⊥|", "|u_na|"), ("normal", "transverse", "nonaffine"), strict=True)
        values = ", ".join(f"{symbol} {a[f'{key}_median']:.4g}" for symbol, key in quantities)
        assert name or medians == (
            f"    medians per unit strain: {values}; identity kept to {a['identity_difference']:.0e}"
        )


def test_lanes_of_other_widths_are_compared_with_errors_of_both(run):
    """And lengths without a root are said."""
    run("sweep p.h5 --omega 0.01,1 --fields 0.01,1")
    lines, result = run("correlate sweep.h5 --phase strain --lane 0.1,0.3,1")
    size, diameter = result.attributes["L"], result.attributes["mean_diameter"]
    (real, imaginary), (_, error) = (result[name][0, 0] / diameter for name in ("length", "length_error"))
    assert np.isnan(real) and lines[:2] == [
        f"correlate.h5: 1 packing, L = {size / diameter:.4g} d, lanes of 0.1 d, "
        f"{result.attributes['pairs'][0]} pairs, in phase with the strain",
        f"  omega 0.01: l/d Re no root,  Im {imaginary:.3g} ± {error:.1g}",
    ]
    C, errors = result["C"][..., 1:], result["C_error"][..., 1:]  # beyond δ = 0, where C is 1
    for row, width in ((1, 0.3), (2, 1)):
        change, *of_both = (np.sqrt(np.nanmean(part**2)) for part in (C[row] - C[0], errors[0], errors[row]))
        difference = f"differs by {change:.2g} (rms), with errors of {np.hypot(*of_both):.2g}"
        assert lines[2 + row] == f"  lanes of {width} d: C {difference}"


@pytest.mark.parametrize(
    ("phi", "how", "told"),
    [
        (0.84, "--step 1e-3 --strain 3e-3", "jammed at every step"),
        (0.7, "--step 1e-3 --strain 3e-3", "jammed at no step"),
        (0.81, "--step 3e-3 --strain 0.03 --seed 2", "jammed at {0.value:.3g} of the steps (68 % interval {0.low:.2g} "
         "to {0.high:.2g})"),
        (0.82, "--step 3e-3 --strain 0.03 --seed 3", "jammed at {0.value:.3g} of the steps (too few independent ones "
         "for an error)"),
    ],
)  # fmt: skip
def test_slow_shear_tells_how_much_of_it_is_jammed(run, phi, how, told):
    lines, shear = run(f"shear --n 16 --phi {phi} {how} --discard 0")
    assert f", {told.format(correlated_share([shear['jammed']]))}, 2N_c/N = " in lines[1]


def test_samples_tell_how_many_jam_and_the_pressure_of_those(run):
    lines, jam = run("jam --n 16 --phi 0.75,0.83,0.9 --seeds 1:6")
    share = independent_share(jam["jammed"][6:12])
    pressure, all_jammed = (
        jam["pressure"][rows][jam["jammed"][rows] == 1].mean() for rows in (slice(6, 12), slice(12, 18))
    )
    assert lines[0] == "jam.h5: 18 samples of 16 disks" and 0.0 < share.value < 1.0
    assert lines[2:5] == [
        "  phi = 0.75: none of 6 samples jammed (effective sample size 6)",
        f"  phi = 0.83: jammed {share.value:.3f} ± {share.error:.2g} (effective sample size 6), p of the jammed "
        f"{pressure:.4g}",
        f"  phi = 0.9: all of 6 samples jammed (effective sample size 6), p of the jammed {all_jammed:.4g}",
    ]


def test_samples_without_a_minimum_are_noted_and_left_out(run, monkeypatch):
    """Lost are here the first of four, the jamming density of the second, and all at the second packing fraction."""
    quench, densities = samples.quench, []

    def quench_or_lose(disks, *how):
        densities.append(disks.phi)
        if disks.phi > 0.87 or len(densities) in (1, 3):
            raise ConvergenceError("lost")
        return quench(disks, *how)

    monkeypatch.setattr(samples, "quench", quench_or_lose)
    words = "--protocol compress --cooling-rate 1 --sweeps 0 --temperature 1e-6"
    lines, jam = run(f"jam --n 16 --phi 0.84,0.88 --seeds 1:4 {words}")
    value, error = mean_with_error(jam["phi_J"][2:4])
    pressure = jam["pressure"][1:4].mean()
    assert lines[2].startswith(
        "  phi = 0.84: all of 3 samples jammed (effective sample size 3), p of the jammed "
        f"{pressure:.4g}, phi_J {value:.5g} ± {error:.2g}, segregation "
    )
    assert lines[3] == "  phi = 0.88: no minimum found"
    assert lines[-1] == "  note: no minimum found: 5 samples, nan in the result"
