"""One compiled kernel over graph tables: states of a mechanism, one at a time, certified from step to step."""
