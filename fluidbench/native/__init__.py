"""How a method written on our particle pool runs."""
