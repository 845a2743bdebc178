"""Motion in time: efforts are given, accelerations are sought (Lee 1977, section 3.5)."""
