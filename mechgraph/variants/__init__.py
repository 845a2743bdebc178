"""Many variants of one mechanism: declared numbers that vary, samples of them, and the results."""
