"""What a printer cares about, from particles' positions and volumes alone: no method, no device."""
