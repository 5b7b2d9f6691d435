"""What a comparison shows: traces (data), figures (files), html (one self-contained page)."""
