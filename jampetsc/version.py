"""The version of the program, which the package has as `jampetsc.__version__`, and that of the layout of its files."""

VERSION = "0.1.0"
FORMAT_VERSION = "2.0"  # of the layout of all files
