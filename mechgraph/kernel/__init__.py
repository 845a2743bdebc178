"""The compiled kernel: one file of C99, generic over tables, and how it is built and loaded."""
