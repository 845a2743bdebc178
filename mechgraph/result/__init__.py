"""What a solution hands back: labeled values, checks, export."""
