"""`jampetsc spectrum`: what its files and pictures hold."""

import numpy as np
import pytest
from picture_contents import figure_of, lines, told
from samples import stored

from jampetsc import main as cli
from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.analysis.transient import retardation
from jampetsc.errors import InputError
from jampetsc.io.reader import load
from jampetsc.plots.spectrum_plots import plot_relaxation, spectrum_curve

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib

OMEGA = np.geomspace(1e-8, 1e2, 41)


def spectrum(G0=0.02):
    rates = np.geomspace(1e-4, 1.0, 16)
    return RelaxationSpectrum(G0, 0.4, rates, 0.1 * np.sqrt(rates))


def write_sweep(path, held=None, omega=OMEGA, **attributes):
    """A sweep by the rational method."""
    held = held or spectrum()
    arrays = {"omega": omega, "G": held.modulus(omega), "error_bound": np.full(len(omega), 1e-9)}
    arrays |= {f"spectrum/{name}": getattr(held, name) for name in ("G0", "eta_inf", "rates", "weights")}
    facts = {"law": "contact", "beta": 1.0, "pressure": 1e-3, "k": 1.0, "tau1": 1.0}
    return stored(path, "sweep", arrays, **facts | attributes)


def run(*words):
    return cli.dispatch(["spectrum", *map(str, words)])


def test_moduli_beside_a_stored_frequency_are_those_of_the_spectrum(tmp_path):
    held, sweep = spectrum(), load(write_sweep(tmp_path / "sweep.h5"))
    omega = OMEGA[[9, 20]] * (1 + 1e-5)
    np.testing.assert_allclose(sweep.modulus(omega), held.modulus(omega), rtol=1e-13)
    assert sweep.modulus(OMEGA[9]) == sweep.G[9]


def test_moduli_of_power_law_damping_at_no_frequency_and_at_those_beyond_a_double(tmp_path):
    held, sweep = spectrum(), load(write_sweep(tmp_path / "alpha.h5", alpha=0.5, stress=1e-5))
    assert sweep.modulus(0.0) == held.modulus(0.0) and sweep.modulus(-0.07) == np.conj(sweep.modulus(0.07))
    with pytest.raises(InputError, match=r"^omega = 1e\+308: its equivalent frequency overflows"):
        sweep.modulus(1e308)


def test_instability_and_power_law_damping_are_said(tmp_path, capsys):
    sweep = write_sweep(tmp_path / "unstable.h5", spectrum(-0.01))
    run(sweep, "--out", tmp_path / "s.h5")
    said, result = capsys.readouterr().out, load(tmp_path / "s.h5")
    assert "G0 < 0: creep diverges as exp(" in said and "  note: unstable to shear: G0 = -0.01" in said
    assert result.attributes["growth_rate"] > 0
    assert result.attributes["notes"].startswith("unstable to shear: G0 = -0.01. ")
    run(write_sweep(tmp_path / "alpha.h5", alpha=0.5, stress=1e-5), "--out", tmp_path / "s.h5", "--overwrite")
    assert "  note: linear damping: alpha is not in this spectrum" in capsys.readouterr().out
    assert "linear damping: alpha is not" in load(tmp_path / "s.h5").attributes["notes"]
    held = spectrum(0.0)
    run(write_sweep(tmp_path / "fluid.h5", held), "--out", tmp_path / "t.h5")
    assert f"G0 = 0: it flows in the end, J(t) -> {1 / held.eta0:.6g} t" in capsys.readouterr().out
    assert load(tmp_path / "t.h5").attributes["fluidity"] == pytest.approx(1 / held.eta0)


def test_weights_add_up_with_time(tmp_path):
    one = spectrum_curve(load(write_sweep(tmp_path / "sweep.h5")))
    _, cumulative, relaxation, _ = figure_of(plot_relaxation, [one]).axes
    held = spectrum()
    x, y, *_ = lines(cumulative)[0]
    assert np.allclose(x, np.sort(1 / held.rates)) and np.allclose(y, np.cumsum(held.weights[::-1]))
    time, G, *_ = lines(relaxation)[0]
    assert np.allclose(G, held.stress_relaxation(time))


def test_a_spectrum_file_draws_as_its_sweep_does(tmp_path, capsys):
    sweep = write_sweep(tmp_path / "sweep.h5")
    run(sweep, "--out", tmp_path / "spectrum.h5")
    run(sweep, "--out", tmp_path / "a.png")
    said = f"{tmp_path / 'a.png'}: relaxation spectrum, G(t) and J(t) of 1 spectrum"
    assert capsys.readouterr().out.splitlines()[-1] == said
    cli.dispatch(["plot", str(tmp_path / "spectrum.h5"), "--out", str(tmp_path / "b.png")])
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_a_spectrum_without_modes_is_not_drawn(tmp_path):
    write_sweep(tmp_path / "stiff.h5", RelaxationSpectrum(0.1, 0.2, np.empty(0), np.empty(0)))
    with pytest.raises(InputError, match=r"stiff\.h5: no relaxation modes"):
        run(tmp_path / "stiff.h5", "--out", tmp_path / "s.png")
    assert not (tmp_path / "s.png").exists()


@pytest.mark.parametrize(
    ("slowest", "fastest", "whole"),
    [(0.99e-5, 10.1, True), (1.01e-5, 10.1, False), (0.99e-5, 9.9, False), (1e-3, 1e-2, False)],
)
def test_a_sweep_reaches_a_decade_beyond_all_modes_or_says_so(tmp_path, capsys, slowest, fastest, whole):
    """Rates are 1e-4 to 1."""
    run(write_sweep(tmp_path / "s.h5", omega=np.geomspace(slowest, fastest, 5)), "--out", tmp_path / "t.h5")
    said = capsys.readouterr().out
    notes = load(tmp_path / "t.h5").attributes.get("notes", "")
    assert (
        ("note: not certified at all times: " in said)
        == ("not certified at all times" in notes)
        == (not whole)
    )
    assert whole or f"the sweep covers times {1 / fastest:.3g} to {1 / slowest:.3g}, and what is" in said


def test_a_spectrum_has_the_notes_of_its_sweep(tmp_path, capsys):
    notes = "forces are not balanced: max|F|/(p d) = 1e-3. Quench it; rough: 3"
    run(write_sweep(tmp_path / "s.h5", notes=notes), "--out", tmp_path / "t.h5")
    assert "\n  note: forces are not balanced: max|F|/(p d) = 1e-3. Quench it\n" in capsys.readouterr().out
    assert load(tmp_path / "t.h5").attributes["notes"].startswith(notes)


@pytest.mark.parametrize("window", [None, 0.75])
def test_attributes_of_a_spectrum_are_those_of_its_sweep(tmp_path, window, capsys):
    rates = np.array([1e-4, 1e-3, 10**-2.4, 1.0])
    held = RelaxationSpectrum(0.02, 0.4, rates, np.full(4, 0.25))
    path = write_sweep(tmp_path / "s.h5", held)
    run(path, "--out", tmp_path / "t.h5", *([] if window is None else ["--window", window]))
    found, late = load(tmp_path / "t.h5"), retardation(held)
    assert found.format == "jampetsc-spectrum" and found.law == {"law": "contact", "beta": 1.0, "tau1": 1.0}
    assert found.attributes["sources"] == "s.h5" and found.attributes["pressure"] == 1e-3
    assert found.frequency_range == (OMEGA[0], OMEGA[-1])
    np.testing.assert_allclose(found.spectrum.modulus(OMEGA), held.modulus(OMEGA), rtol=1e-13)
    np.testing.assert_allclose(found["relaxation/times"], np.sort(1 / rates))
    np.testing.assert_allclose(found["stress/G"], held.stress_relaxation(found["stress/time"]))
    np.testing.assert_allclose(found["H/smoothed"], held.smoothed(found["H/tau"], window or 1.5))
    expected = {
        "G0": held.G0, "G_inf": held.G_inf, "eta0": held.eta0, "eta_inf": 0.4, "J_inf": 0.0, "fluidity": 0.0,
        "growth_rate": 0.0, "window_decades": window or 1.5, "resolution_decades": 2.4,
        "slowest_omega": OMEGA[0], "fastest_omega": OMEGA[-1],
    }  # fmt: skip
    assert {name: found.attributes[name] for name in expected} == pytest.approx(expected)
    np.testing.assert_allclose(found["relaxation/rates"], rates[::-1])
    np.testing.assert_allclose(found["relaxation/weights"], 0.25)
    np.testing.assert_allclose(found["retardation/rates"], late.rates)
    np.testing.assert_allclose(found["retardation/compliances"], late.compliances)
    np.testing.assert_allclose(found["H/between"], held.between()[1])
    np.testing.assert_allclose(found["creep/J"], late.creep(found["creep/time"]))
    said = capsys.readouterr().out
    assert "4 relaxation times from 1 to 1e+04" in said
    assert f"H averaged over {window or 1.5:.2g} decades" in said
    assert f"G(0+) = {held.G_inf:.6g} and 0.4 delta(t), G(t -> inf) = 0.02, eta0 = {held.eta0:.6g}" in said
    assert f"J(t -> inf) = 1/G0 = 50, slowest retardation {1 / late.rates[0]:.3g}" in said


def curve(tmp_path, name, held, omega=OMEGA, **attributes):
    return spectrum_curve(load(write_sweep(tmp_path / f"{name}.h5", held, omega, **attributes)))


def test_few_spectra_show_their_modes_many_do_not(tmp_path):
    some = [curve(tmp_path, f"s{n}", spectrum(), beta=0.1 * (n + 1)) for n in range(3)]
    for count, single in ((2, True), (3, False)):
        axes = figure_of(plot_relaxation, some[:count]).axes
        assert len(axes[0].patches) == count * single  # steps between nodes
        assert [line.get_marker() for line in axes[1].get_lines()] == ["." if single else "None"] * count
        assert told(axes[0]) == ["averaged over 0.53 decades", *["mean between nodes"] * single]
        assert told(axes[1]) == [rf"$\beta={0.1 * (n + 1):.1f}$" for n in range(count)]


def test_notes_tell_what_is_not_drawn(tmp_path):
    stiff, soft = spectrum(), spectrum(-0.01)
    other = RelaxationSpectrum(0.02, 0.5, stiff.rates, stiff.weights)
    dashpot, one = r"without $\eta_\infty\,\delta(t)$", r", $\eta_\infty=0.4\,k\tau_1$"
    pairs = (
        ([stiff, soft], dashpot + one, r"$G_0<0$ in 1 of 2: creep diverges (dashed)"),
        ([stiff, other], dashpot, None),
        ([RelaxationSpectrum(0.02, 0.0, stiff.rates, stiff.weights)], None, None),
    )
    for held, dashpot, unstable in pairs:
        curves = [curve(tmp_path, f"{n}", one, beta=1.0 + n) for n, one in enumerate(held)]
        axes = figure_of(plot_relaxation, curves).axes
        assert [text.get_text() for text in axes[2].texts] == [dashpot] * (dashpot is not None)
        assert [text.get_text() for text in axes[3].texts] == [unstable] * (unstable is not None)
        dashes = ["-" if one.G0 >= 0 else "--" for one in held]
        assert [line.get_linestyle() for line in axes[3].get_lines()] == dashes


def test_a_spectrum_is_in_units_of_its_k_and_tau1(tmp_path):
    held = spectrum()
    scaled = RelaxationSpectrum(3 * held.G0, 6 * held.eta_inf, held.rates / 2, 3 * held.weights)
    one = curve(tmp_path, "plain", held)
    other = curve(tmp_path, "other", scaled, OMEGA / 2, k=3.0, tau1=2.0, pressure=3e-3)
    for name in ("rates", "weights", "eta_inf", "G0"):
        np.testing.assert_allclose(getattr(one.spectrum, name), getattr(other.spectrum, name), rtol=1e-12)
    for name in ("time", "tau", "creep_time", "J", "G", "H"):
        np.testing.assert_allclose(getattr(one.transient, name), getattr(other.transient, name), rtol=1e-9)


def test_the_window_of_a_spectrum_file_is_kept(tmp_path):
    run(write_sweep(tmp_path / "s.h5"), "--out", tmp_path / "t.h5", "--window", 0.9)
    assert spectrum_curve(load(tmp_path / "t.h5")).transient.window == 0.9
    assert spectrum_curve(load(tmp_path / "t.h5"), 0.6).transient.window == 0.6
    assert spectrum_curve(load(tmp_path / "s.h5")).transient.window == pytest.approx(2 * 4 / 15)
