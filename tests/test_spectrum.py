"""`jampetsc spectrum`: what its files and pictures hold."""

import numpy as np
import pytest
from drawn import figure_of, lines
from matplotlib.image import imread

from jampetsc import cli
from jampetsc.analysis.relaxation import RelaxationSpectrum
from jampetsc.errors import InputError
from jampetsc.plots.spectrum import plot_relaxation, spectrum_curve
from jampetsc.storage.reader import load
from jampetsc.storage.result_file import ResultWriter

pytestmark = pytest.mark.filterwarnings("error::RuntimeWarning", "error::UserWarning")  # numpy, matplotlib

OMEGA = np.geomspace(1e-8, 1e2, 41)


def spectrum(G0=0.02):
    rates = np.geomspace(1e-4, 1.0, 16)
    return RelaxationSpectrum(G0, 0.4, rates, 0.1 * np.sqrt(rates))


def write_sweep(path, held=None, omega=OMEGA, **attributes):
    """A sweep by the rational method."""
    held = held or spectrum()
    with ResultWriter(path, "jampetsc-sweep") as writer:
        for name, values in {
            "omega": omega,
            "G": held.modulus(omega),
            "error_bound": np.full(len(omega), 1e-9),
            "reduced/G0": held.G0,
            "reduced/eta_inf": held.eta_inf,
            "reduced/rates": held.rates,
            "reduced/weights": held.weights,
        }.items():
            writer.dataset(name, values)
        writer.attributes(
            **{"law": "contact", "beta": 1.0, "pressure": 1e-3, "k": 1.0, "tau1": 1.0} | attributes
        )
    return path


def run(*words):
    return cli.dispatch(["spectrum", *map(str, words)])


def test_a_file_holds_the_response_in_time(tmp_path, capsys):
    sweep = write_sweep(tmp_path / "sweep.h5")
    assert run(sweep, "--out", tmp_path / "spectrum.h5", "--window", 0.5) == 0
    held, found = spectrum(), load(tmp_path / "spectrum.h5")
    assert found.format == "jampetsc-spectrum" and found.law == {"law": "contact", "beta": 1.0, "tau1": 1.0}
    assert found.attributes["sources"] == "sweep.h5" and found.attributes["pressure"] == 1e-3
    np.testing.assert_allclose(found["relaxation/times"], np.sort(1 / held.rates))
    np.testing.assert_allclose(found.spectrum.modulus(OMEGA), held.modulus(OMEGA), rtol=1e-13)
    assert found.frequency_range == (OMEGA[0], OMEGA[-1])
    np.testing.assert_allclose(found["stress/G"], held.stress_relaxation(found["stress/time"]))
    np.testing.assert_allclose(found["H/smoothed"], held.smoothed(found["H/tau"], 0.5))
    assert found["creep/J"][-1] == pytest.approx(1 / held.G0, rel=1e-6)
    assert found["retardation/compliances"].sum() == pytest.approx(1 / held.G0)
    said = capsys.readouterr().out
    assert "16 relaxation times from 1 to 1e+04" in said and "1/G0 = 50" in said


def test_moduli_beside_a_stored_frequency_are_those_of_the_spectrum(tmp_path):
    held, sweep = spectrum(), load(write_sweep(tmp_path / "sweep.h5"))
    omega = OMEGA[[9, 20]] * (1 + 1e-5)
    np.testing.assert_allclose(sweep.modulus(omega), held.modulus(omega), rtol=1e-13)
    assert sweep.modulus(OMEGA[9]) == sweep.G[9]


def test_a_sweep_that_ends_early_says_so(tmp_path, capsys):
    run(write_sweep(tmp_path / "short.h5", omega=np.geomspace(1e-3, 1e2, 9)), "--out", tmp_path / "s.h5")
    assert "the sweep covers times 0.01 to 1e+03: what is faster or slower" in capsys.readouterr().out


def test_instability_and_power_law_damping_are_said(tmp_path, capsys):
    sweep = write_sweep(tmp_path / "unstable.h5", spectrum(-0.01))
    run(sweep, "--out", tmp_path / "s.h5")
    assert "G0 < 0: the packing is unstable to shear, creep diverges as exp(" in capsys.readouterr().out
    assert load(tmp_path / "s.h5").attributes["growth_rate"] > 0
    run(write_sweep(tmp_path / "alpha.h5", alpha=0.5, stress=1e-5), "--out", tmp_path / "s.h5")
    assert "the spectrum of linear damping" in capsys.readouterr().out


@pytest.mark.parametrize("command", ["spectrum", "plot"])
def test_pictures(tmp_path, command):
    sweeps = [
        write_sweep(tmp_path / "a.h5"),
        write_sweep(tmp_path / "b.h5", spectrum(-0.01), tau1=2.0, beta=0.1),
    ]
    kind = ["--kind", "spectrum"] if command == "plot" else []
    cli.dispatch([command, *map(str, sweeps), *kind, "--out", str(tmp_path / "picture.png")])
    image = imread(tmp_path / "picture.png")
    assert image.shape[:2] == (1500, 2100) and image.std() > 0.05


def test_weights_add_up_with_time(tmp_path):
    one = spectrum_curve(load(write_sweep(tmp_path / "sweep.h5")))
    _, cumulative, relaxation, _ = figure_of(plot_relaxation, [one]).axes
    held = spectrum()
    x, y, *_ = lines(cumulative)[0]
    assert np.allclose(x, np.sort(1 / held.rates)) and np.allclose(y, np.cumsum(held.weights[::-1]))
    time, G, *_ = lines(relaxation)[0]
    assert np.allclose(G, held.stress_relaxation(time))


def test_a_spectrum_file_draws_as_its_sweep_does(tmp_path):
    sweep = write_sweep(tmp_path / "sweep.h5")
    run(sweep, "--out", tmp_path / "spectrum.h5")
    run(sweep, "--out", tmp_path / "a.png")
    cli.dispatch(["plot", str(tmp_path / "spectrum.h5"), "--out", str(tmp_path / "b.png")])
    assert (tmp_path / "a.png").read_bytes() == (tmp_path / "b.png").read_bytes()


def test_units_of_the_sweep_drop_out_of_the_picture(tmp_path):
    held = spectrum()
    scaled = RelaxationSpectrum(3 * held.G0, 6 * held.eta_inf, held.rates / 2, 3 * held.weights)
    plain = write_sweep(tmp_path / "plain.h5", held)
    other = write_sweep(tmp_path / "other.h5", scaled, OMEGA / 2, k=3.0, tau1=2.0, pressure=3e-3)
    for sweep in (plain, other):
        run(sweep, "--out", sweep.with_suffix(".png"))
    np.testing.assert_allclose(
        imread(plain.with_suffix(".png")), imread(other.with_suffix(".png")), atol=0.02, rtol=0
    )


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "sweep.h5 --out s.gif",
            r"--out s\.gif: give it the ending \.h5 for a file, \.png, \.pdf, \.svg for",
        ),
        ("sweep.h5 sweep.h5 --out s.png", r"sweep\.h5: this file is given already"),
        ("direct.h5 --out s.h5", r"direct\.h5: holds no spectrum: run the sweep with --method rational"),
        ("sweep.h5 sweep.h5 --out s.h5", r"s\.h5: a file holds one spectrum, not 2"),
        ("sweep.h5 --out s.h5 --window 2", r"--window 2: choose between 0\.01 and 1\.5"),
        ("sweep.h5 --out s.h5 --window nan", "--window nan: choose"),
        ("spectrum.h5 --out s.h5", r"spectrum\.h5: is not a sweep"),
        ("stiff.h5 --out s.png", r"stiff\.h5: no relaxation modes"),
        ("missing.h5 --out s.h5", r"missing\.h5: no such file"),
    ],
)
def test_bad_input(tmp_path, monkeypatch, line, message):
    monkeypatch.chdir(tmp_path)
    sweep = write_sweep(tmp_path / "sweep.h5")
    run(sweep, "--out", tmp_path / "spectrum.h5")
    write_sweep(tmp_path / "stiff.h5", RelaxationSpectrum(0.1, 0.2, np.empty(0), np.empty(0)))
    with ResultWriter(tmp_path / "direct.h5", "jampetsc-sweep") as writer:
        for name in ("omega", "G", "error_bound"):
            writer.dataset(name, np.ones(3))
    with pytest.raises(InputError, match=message):
        run(*line.split())
    assert not (tmp_path / "s.h5").exists() and not list(tmp_path.glob("s.[pg]*"))
