from jampetsc.recompile import forget_outdated

forget_outdated()  # before any module here or above loads what it has compiled
