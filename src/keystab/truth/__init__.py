"""The true extrema of the continuous scale-space, found by Newton's method."""
