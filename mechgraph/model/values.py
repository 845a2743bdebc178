"""Another name of ``mechgraph.model.numeric``."""

from mechgraph.model.numeric import PerCase, is_numeric, number_fault, plain, same, same_fields, vector_fault

__all__ = ["PerCase", "is_numeric", "number_fault", "plain", "same", "same_fields", "vector_fault"]
