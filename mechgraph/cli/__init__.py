"""The command line, for a mechanism of the library or a file: its options, what it prints, its commands."""
