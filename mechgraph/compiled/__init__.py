"""A mechanism that stays hot in the compiled kernel, and the same as C and as an FMU to take away."""
