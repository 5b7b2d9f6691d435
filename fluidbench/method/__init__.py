"""What a comparison needs of any method, and how methods are found."""
