"""Mathematics that knows no mechanism: rigid-body algebra, linear systems, Newton's method, tracks of solutions."""
