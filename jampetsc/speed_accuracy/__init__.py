"""The command `jampetsc trade`: time and errors of solver settings, simpler physics and smaller packings.

Each setting for one packing is run as a `jampetsc` command in processes of its own, to measure its time and
memory, and compared with the most accurate certified sweep.

choices    the settings, their sweeps, and the reference sweep
ensembles  one big packing against many small ones
processes  one run of jampetsc in processes of its own: time, memory, why it failed
compare    errors against the reference, critical exponents, interpolation between frequencies
table      the rows, as CSV and as text
measure    runs everything and writes table and picture
advice     recommends settings from the rows by stated rules
"""
