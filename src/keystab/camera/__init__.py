"""The simulated camera: views of a scene, sets of them, and the blur of real cameras."""
