"""Graph and geometry together: mobility, passive freedoms, self-stress and uniqueness, the determinacy report."""
