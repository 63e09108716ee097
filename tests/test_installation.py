"""What pip makes of the tree: the package is found from every folder."""

import os
import subprocess
import sys

import launch


def python(code, folder, program=sys.executable):
    """What `program` prints for `code` in a folder, with nothing but its own installation to find modules in."""
    clean = {name: value for name, value in os.environ.items() if name != "PYTHONPATH"}
    done = subprocess.run([program, "-c", code], cwd=folder, env=clean, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout.strip()


def test_a_clone_named_like_the_package_does_not_stand_for_it_in_the_folder_above(tmp_path):
    (tmp_path / "jampetsc").symlink_to(launch.ROOT)
    found = python("import jampetsc; print(jampetsc.__version__, jampetsc.__file__)", tmp_path)
    assert found.endswith(f" {launch.ROOT / 'jampetsc' / '__init__.py'}")
