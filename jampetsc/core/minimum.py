"""The proof that a packing is a minimum of its energy, bound to the arrays that it was made from.

It stands in the packing's record, which files carry as attributes. Files get edited: it counts only where
`proof_fingerprint` is the fingerprint of the disks as they are now; otherwise the modes are counted anew.
"""

from jampetsc.core.disks import Disks

PROVED_BY = "Cholesky of K with pre-stress, without rattlers, one disk pinned"
ENTRIES = ("negative_modes", "negative_modes_counted_by", "proof_fingerprint")


def with_proof(disks: Disks) -> Disks:
    """The disks with the proof in their record; only where K of just these disks was factorised as `PROVED_BY` says."""
    return disks.with_record(**dict(zip(ENTRIES, (0, PROVED_BY, disks.fingerprint), strict=True)))


def proved_minimum(disks: Disks) -> bool:
    """Whether K with pre-stress of just these disks was proved to have no negative modes."""
    found = [str(disks.record.get(name)) for name in ENTRIES]
    return found == ["0", PROVED_BY, disks.fingerprint]
