"""The questions of the study: one module for the tables of each."""
