"""Graph and geometry together: mobility, finite motion, passive freedoms, self-stress and uniqueness, pair changes."""
