"""The command `jampetsc trade`: what speed costs in accuracy, and simpler physics or fewer disks in truth.

Each choice there is for one packing is run as a `jampetsc` command in processes of its own, which have a time and a
memory of their own, and compared with the tightest certified sweep.

choices    what can be chosen, and the sweeps that measure it against the tightest certified one
ensembles  one big packing against many small ones
processes  one run of jampetsc in processes of its own: time, memory, why it failed
compare    errors against the reference, critical exponents, interpolation between frequencies
table      the rows, as CSV and as text
measure    the whole of it
advice     which setting to take, from the rows by stated rules
"""
