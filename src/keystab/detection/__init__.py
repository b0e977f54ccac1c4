"""Extrema of the sampled scale-space: the search, its refinement, and the whole detector."""
