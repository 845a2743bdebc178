"""Kinematic chains up to isomorphism: generated, named, their inversions and drivers; system groups."""
