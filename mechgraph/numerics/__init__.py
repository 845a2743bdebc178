"""Linear algebra and iteration strategies; knows no mechanism."""
