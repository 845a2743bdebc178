"""Graph and geometry together: mobility, passive freedoms, self-stress and uniqueness, pair changes, and the report of them."""
