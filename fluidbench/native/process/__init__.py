"""What happens to material whatever the method."""
