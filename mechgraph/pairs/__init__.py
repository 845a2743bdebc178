"""Pair types as rows of data, their factors and kinematics, and the curves and surfaces on which pairs travel. A new pair is a row here."""
