"""The settings of the study, whether they can work, and its verdicts on claims."""
