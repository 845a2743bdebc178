"""Unknowns, equations and the ledger: a registry without numbers, printed and assembled from the same terms."""
