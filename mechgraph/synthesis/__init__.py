"""All mechanisms of a declared topology that do what is asked."""
