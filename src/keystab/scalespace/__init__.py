"""The Gaussian scale-space of a picture: its cosine series, its samplings, and closed forms."""
