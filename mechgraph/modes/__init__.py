"""All assemblies of a mechanism, and its branches as a map."""
