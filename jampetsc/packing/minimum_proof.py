"""The proof that a packing is a minimum of its energy, valid only for the arrays that it was made from.

It is kept in the packing's record, which files hold as attributes. Files may be edited, so the proof counts only if
`proof_fingerprint` is the fingerprint of the packing as it is now; otherwise negative modes are counted again.
"""

from jampetsc.packing.packing import Packing

PROVED_BY = "Cholesky of K with pre-stress, without rattlers, one disk pinned"
ENTRIES = ("negative_modes", "negative_modes_counted_by", "proof_fingerprint")


def with_proof(disks: Packing) -> Packing:
    """The packing with the proof in its record, for one of which K was factorised as `PROVED_BY` says."""
    return disks.with_record(**dict(zip(ENTRIES, (0, PROVED_BY, disks.fingerprint), strict=True)))


def proved_minimum(disks: Packing) -> bool:
    """Whether K with pre-stress of this very packing was proved to have no negative modes."""
    entries = [str(disks.record.get(name)) for name in ENTRIES]
    return entries == ["0", PROVED_BY, disks.fingerprint]
