"""What a single detection shows about its stability."""
