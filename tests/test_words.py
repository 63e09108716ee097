"""What the words of the command line mean: those that contradict each other, or mean nothing, are refused."""

import pytest

from jampetsc import cli
from jampetsc.errors import InputError
from jampetsc.words.files import refuse_repeated
from jampetsc.words.packtasks import plan


@pytest.mark.parametrize(
    ("line", "message"),
    [
        (
            "sweep p.h5 --out s.h5 --method direct --parallel shifts",
            "--parallel shifts: belongs to --method rational",
        ),
        (
            "sweep p.h5 --out s.h5 --method direct --parallel auto",
            "--parallel auto: belongs to --method rational",
        ),
        ("sweep p.h5 --out s.h5 --fields=", "--fields : write low:high:count"),
        ("sweep p.h5 --out s.h5 --fields ,", "--fields ,: write low:high:count"),
        ("pack --n 64 --pressure 1e-3 --out k{foo}.h5", r"--out k\{foo\}\.h5: \{foo\} stands for nothing"),
        ("pack --n 64 --pressure 1e-3 --out k{seed.h5", r"\{seed\.h5 stands for nothing: only \{seed\} and"),
        ("pack --n 64 --phi 0.86 --out k{pressure}.h5", r"\{pressure\} has no meaning with --phi"),
        (
            "pack --n 64 --pressure 1e-3 --seed 9223372036854775808 --out k.h5",
            "--seed 9223372036854775808: must lie in",
        ),
        (
            "pack --n 64 --pressure 1e-3 --seeds 1:9999999999 --out {seed}.h5",
            "9999999999 packings: at most 1000000",
        ),
        ("pack --n 64 --pressure -1e-4 --out k.h5", r"--pressure -1e-4: must lie in \[1e-08, 1\]"),
        ("pack --n 64 --pressure 1e-3, --out k.h5", "--pressure 1e-3,: must be a number, or several"),
        ("pack --n 64 --presure 1e-3 --out k.h5", "--presure: no such option; did you mean --pressure"),
        ("sweep p.h5 --ouput s.h5", "--ouput: no such option; did you mean --out"),
        (
            "sweep p.h5 --out s.png",
            r"--out s\.png: would be an HDF5 file by that name: give it the ending \.h5",
        ),
        (
            "modes p.h5 --out m.h5 --below 1e-30",
            "--below 1e-30: must be above 1e-12; softer modes cannot be told",
        ),
        ("correlate f.h5 --out c.h5 --lane 1,0.5,1", "--lane 1,0.5,1: gives a width twice"),
        ("plot c.h5 --log-exponent -1e2 --out c.png", "c.h5: no such file"),
    ],
)
def test_words_that_mean_nothing(line, message, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with pytest.raises(InputError, match=message):
        cli.dispatch(line.split())
    assert not list(tmp_path.iterdir())


def test_pressure_is_in_units_of_the_k_of_the_packing():
    line = ["pack", "--from", "soft.h5", "--pressure", "1e-3,1e-2", "--out", "p{pressure}.h5"]
    tasks = plan(cli.command_parser(line)[0].parse_args(line), 1e-6)
    assert [(task.path.name, task.target.pressure) for task in tasks] == [
        ("p1e-3.h5", pytest.approx(1e-9)),
        ("p1e-2.h5", pytest.approx(1e-8)),
    ]


def test_one_file_under_two_names(tmp_path):
    (tmp_path / "a.h5").touch()
    (tmp_path / "b.h5").symlink_to("a.h5")
    refuse_repeated([tmp_path / "a.h5", tmp_path / "c.h5"])
    with pytest.raises(InputError, match=r"b\.h5: is .*a\.h5, which is given already: name each file once"):
        refuse_repeated([str(tmp_path / "a.h5"), str(tmp_path / "b.h5")])
    with pytest.raises(InputError, match=r"a\.h5: this file is given already"):
        refuse_repeated([str(tmp_path / "a.h5")] * 2)
