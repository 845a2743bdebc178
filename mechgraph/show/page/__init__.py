"""The page that people pass on: one file with the report, the mechanism in space, curves, equations and where it comes from."""
