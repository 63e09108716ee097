"""The one version number; packaging reads it, and the package has it as `jampetsc.__version__`."""

VERSION = "0.1.0"
