"""Pictures of forces: moduli of waves over those of strains, compliances of particles, and files that are no moduli."""

import numpy as np
import pytest
from picture_contents import figure_of
from samples import stored

from jampetsc.analysis.susceptibility import resonance
from jampetsc.commands.sources import rows_named
from jampetsc.errors import InputError
from jampetsc.plots.draw import draw
from jampetsc.plots.moduli_plots import plot_moduli
from jampetsc.plots.probe_plots import plot_compliances, plot_sound, plot_waves

K_UNIT, TAU = 2.0, 3.0  # units of the files


def slow(load, pressure=1e-2, prestress=True, dimension=2, **attributes):
    """A quasistatic file in units of K_UNIT; attributes over k."""
    values = {"susceptibility": np.array(1.0)}
    if load.startswith("point"):
        values["susceptibility"] = attributes.pop("J") / K_UNIT
    moduli = {name: K_UNIT * value for name, value in attributes.items() if name != "wave_vector"}
    more = {"wave_vector": attributes["wave_vector"]} if "wave_vector" in attributes else {}
    return stored(
        None, "quasistatic", values, law="contact", beta=1.0, k=K_UNIT, tau1=TAU, pressure=K_UNIT * pressure,
        load=load, prestress=prestress, dimension=dimension, particle_count=64, **moduli, **more,
    )  # fmt: skip


def drawn(figure):
    """{label: (x, y)} of all lines with labels."""
    lines = {}
    for ax in figure.axes:
        for container in ax.containers:
            lines[container.get_label()] = container.lines[0].get_data()
    return lines


@pytest.mark.parametrize("dimension", [2, 3])
def test_moduli_of_waves_over_those_of_strains(dimension):
    """G − p/2 and K + 2(D − 1)G/D − p(D − 1)/D, without p where there is no pre-stress."""
    p, G, K = 0.1, 0.3, 0.7
    numbers = {2: "1,0", 3: "1,0,0"}[dimension]
    vectors = np.eye(dimension)[:2] * [[0.2], [0.4]]
    for prestress in (True, False):
        how = {"pressure": p, "prestress": prestress, "dimension": dimension}
        results = [
            slow(f"wave:{numbers}:transverse", G0=0.2, wave_vector=vectors[0].tolist(), **how),
            slow(f"wave:{numbers}:transverse", G0=0.3, wave_vector=vectors[1].tolist(), **how),
            slow(f"wave:{numbers}:longitudinal", G0=0.9, wave_vector=vectors[0].tolist(), **how),
            slow("tensor", shear_modulus=G, bulk_modulus=K, **how),
            slow("points:3", J=np.ones(3), **how),
        ]
        lines = drawn(figure_of(plot_waves, results))
        ((x, y),) = (line for label, line in lines.items() if "transverse" in label)
        stress = p * prestress
        assert (x, y) == (pytest.approx([0.3]), pytest.approx([0.25 / (G - stress / 2)]))
        ((_, y),) = (line for label, line in lines.items() if "longitudinal" in label)
        share = (dimension - 1) / dimension
        assert y == pytest.approx([0.9 / (K + 2 * share * G - share * stress)])
        ((_, y),) = (
            line for label, line in drawn(figure_of(plot_waves, results[:2])).items() if "transverse" in label
        )
        assert y == pytest.approx([0.25])  # over k alone without a file of the tensor


def test_several_waves_of_one_file():
    """Each is a curve of its own under its load, and a point of G₀(k)."""
    omega, chi = np.geomspace(1e-3, 1e3, 5), np.ones((5, 2), complex)
    G = np.outer(1.0 + 1j * omega, [0.1, 0.2])
    arrays = {
        "G": G,
        "error_bound": 0 * G.real,
        "error_bound_storage": 0 * G.real,
        "error_bound_loss": 0 * G.real,
    }
    loads = ["wave:1,0:transverse", "wave:2,0:transverse"]
    result = swept("+".join(loads), susceptibility=chi, susceptibility_error_bound=0 * chi.real, **arrays)
    figure = figure_of(plot_moduli, [result])
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert labels[:2] == [f"load {load}" for load in loads]
    storage = [line.get_ydata() for line in figure.axes[0].get_lines() if "\u2032," in line.get_label()]
    np.testing.assert_allclose(storage, G.real.T)
    with pytest.raises(InputError, match=r"several waves\. Give files of one wave each\."):
        draw([result], "exponents")
    values = {
        "susceptibility": np.ones(2),
        "waves/vectors": np.diag([0.2, 0.4]),
        "waves/G0": K_UNIT * np.array([0.3, 0.5]),
    }
    slow_waves = stored(
        None, "quasistatic", values, law="contact", beta=1.0, k=K_UNIT, pressure=1e-2, load="+".join(loads),
        prestress=True, particle_count=64,
    )  # fmt: skip
    ((x, y),) = drawn(figure_of(plot_waves, [slow_waves])).values()
    assert x == pytest.approx([0.2, 0.4]) and y == pytest.approx([0.3, 0.5])


def test_a_damped_oscillator_has_its_frequency_and_width():
    omega = np.geomspace(1e-2, 1e2, 401)
    for at, width in ((1.0, 0.3), (0.3, 0.05), (2.0, 5.0)):
        chi = 3.0 / (at**2 - omega**2 + 1j * width * omega)
        assert resonance(omega, chi) == pytest.approx((at, width), rel=5e-3)
    for chi in (
        1.0 / (1.0 + 1j * omega),
        1.0 / (1.0 - omega**2 + 1e-4j * omega),
        1.0 / (1e6 - omega**2 + 1j * omega),
    ):
        assert np.isnan(resonance(omega, chi)).all()  # overdamped, too narrow, out of range


N_V, MASS, SOFT, WIDTH, WAVE_NUMBERS = 1.3, 4.0, 0.3, 0.02, np.array([0.2, 0.4])


def sounding():
    """A sweep of two waves that are oscillators, of stiffness G k² V/n and mass m."""
    omega, k = np.geomspace(1e-3, 1e1, 201), WAVE_NUMBERS
    stiffness, s = K_UNIT * SOFT * k**2 / N_V, 1j * omega[:, None]
    chi = 1.0 / (stiffness + MASS * s * (s + WIDTH))
    arrays = {
        "omega": omega, "susceptibility": chi, "G": N_V / (k**2 * chi), "waves/vectors": np.diag(k),
        **{name: np.zeros(chi.shape) for name in ("error_bound", "susceptibility_error_bound")},
    }  # fmt: skip
    how = {
        "law": "contact",
        "beta": 1.0,
        "k": K_UNIT,
        "tau1": TAU,
        "pressure": K_UNIT * 1e-2,
        "mass_by": "number",
    }
    return stored(None, "sweep", arrays, load="wave:1,0:transverse+wave:2,0:transverse", mass=MASS, **how)


def test_sound_in_units_of_the_damping_time():
    """ω, Γ and the speed of the slow modulus."""
    result = sounding()
    frequency, attenuation = (
        [
            line
            for line in ax.get_lines()
            if "transverse" in line.get_label() and "elastic" not in line.get_label()
        ]
        for ax in figure_of(plot_sound, result).axes
    )
    expected = WAVE_NUMBERS * np.sqrt(K_UNIT * SOFT / (N_V * MASS))
    np.testing.assert_allclose(frequency[0].get_xdata(), WAVE_NUMBERS)
    np.testing.assert_allclose(frequency[0].get_ydata(), expected * TAU, rtol=5e-3)
    np.testing.assert_allclose(attenuation[0].get_ydata(), WIDTH / expected, rtol=0.02)
    (elastic,) = (
        line for line in figure_of(plot_sound, result).axes[0].get_lines() if "elastic" in line.get_label()
    )
    np.testing.assert_allclose(elastic.get_ydata(), expected * TAU, rtol=1e-3)
    with pytest.raises(InputError, match=r"no sound\. Give sweeps with mass of load wave:…"):
        draw([swept("wave:1,0:transverse", G=np.ones(5), error_bound=np.zeros(5))], "sound")


def test_compliances_of_particles():
    J = np.exp(np.random.default_rng(1).normal(size=400))
    lines = drawn(figure_of(plot_compliances, [slow("points:400", J=J), slow("tensor")]))
    ((x, y),) = lines.values()
    area = np.sum(0.5 * (y[1:] + y[:-1]) * np.diff(np.log(x)))
    assert area == pytest.approx(1.0, abs=0.05) and 0.5 < x[np.argmax(y)] < 2.0
    with pytest.raises(InputError, match="fewer than 8 particles"):
        draw([slow("points:3", J=np.ones(3))], "compliances")


def test_the_picture_follows_from_the_load():
    wave, points = (
        slow("wave:1,0:transverse", G0=1.0, wave_vector=[0.2, 0.0]),
        slow("points:9", J=np.arange(1.0, 10)),
    )
    assert "waves" in draw([wave]).text and "compliances" in draw([points]).text
    with pytest.raises(InputError, match=r"no such forces\. Give files of load wave:…"):
        draw([points], "waves")
    with pytest.raises(InputError, match=r"no such forces\. Give files of load points:…"):
        draw([wave], "compliances")
    for kind in ("medians", "viscosities", "finite-size", "omega-star", "exponents"):
        with pytest.raises(
            InputError, match=r"load wave:1,0:transverse, which is forces\. Give files of strains\."
        ):
            draw([wave], kind)


def test_loads_with_commas_choose_rows_of_a_study(tmp_path):
    """--where load=wave:1,0:transverse,n=64."""
    (tmp_path / "table.csv").write_text(
        'command,state,file,n,load,seconds\nquasistatic,done,a.h5,64,"wave:1,0:transverse",1\n'
        "quasistatic,done,b.h5,64,xy,1\n"
    )
    (study,) = rows_named([str(tmp_path)], "load=wave:1,0:transverse,n=64")
    assert study["file"].tolist() == ["a.h5"]


def swept(load, **arrays):
    """A sweep of forces."""
    omega = np.geomspace(1e-3, 1e3, 5)
    chi = 1.0 / (1.0 + 1j * omega)
    values = {"omega": omega, "susceptibility": chi, "susceptibility_error_bound": np.zeros(5), **arrays}
    return stored(None, "sweep", values, law="contact", beta=1.0, pressure=1e-2, k=1.0, load=load)


def test_sweeps_of_forces_are_never_taken_for_strains():
    G = 0.1 * (1.0 + 1j * np.geomspace(1e-3, 1e3, 5))
    wave = swept("wave:1,0:transverse", G=G, error_bound=np.zeros(5))
    strain = stored(
        None, "sweep", {"omega": wave.omega, "G": 2 * G, "error_bound": np.zeros(5)}, law="contact", beta=1.0,
        pressure=1e-2, k=1.0,
    )  # fmt: skip
    figure = figure_of(plot_moduli, [wave, strain, strain], statistic="mean")
    labels = [text.get_text() for text in figure.axes[0].get_legend().get_texts()]
    assert "shear xy" in labels and "load wave:1,0:transverse" in labels
    with pytest.raises(InputError, match="load wave:1,0:transverse, not a shear"):
        wave.shear_modulus  # noqa: B018
    with pytest.raises(InputError, match="of which no spectrum is stored"):
        wave.spectrum  # noqa: B018
    with pytest.raises(
        InputError, match=r"is not one of its 5 frequencies, 0\.001 to 1000\. Choose one of them\."
    ):
        wave.modulus(0.5)
    assert wave.modulus(wave.omega[1]) == G[1]
    point = swept("point:3")
    for name in ("G", "error_bound", "G_storage"):
        with pytest.raises(
            InputError, match=r"load point:3, forces without a modulus\. See its susceptibility\."
        ):
            getattr(point, name)
    for kind in ("moduli", "collapse", "exponents", "bulk", "spectrum"):
        with pytest.raises(InputError, match="load point:3, "):
            draw([point], kind)
