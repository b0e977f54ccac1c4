"""Detectors of others behind one signature, and what is asked of them."""
