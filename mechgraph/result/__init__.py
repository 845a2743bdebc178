"""What a solution hands back: labelled values, checks, export."""
