"""What to simulate: shipped scenarios (extrusion/*.toml) and published answers (reference/*.csv)."""
